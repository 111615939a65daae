"""The score of an episode: the referee's samples against what the robot believed and did."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sum_drake.attempting import region_of
from sum_drake.evaluation import Truth, digest, score_attempts, score_observation, summary
from sum_drake.faults import score_faults
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.systems.episode import Episode
from sum_drake.systems.referee import TruthSample, transport_slip
from sum_drake.systems.scenario import Scenario
from sum_drake.types import Array, Attempt, Frame


def score(
    episode: Episode, scenario: Scenario, catalogue: Catalogue, *, versions: Mapping[str, str], device: str
) -> dict[str, Any]:
    """summary.json of an episode, as plain data. versions, device: what it ran on, see `doctor`."""
    renderer = DepthRenderer(catalogue)
    truths = [
        _in_play(_truth_at(episode.truth, perception.step, perception.frame, renderer), scenario, episode)
        for perception in episode.perceptions
    ]
    final = _in_play(Truth(len(truths), episode.truth[-1].X_WOs), scenario, episode)
    regions = {name: scenario.region(name) for name in scenario.regions}
    goal = {label: region_of(label, scenario.goal, catalogue) for label in catalogue.labels}
    attempts = score_attempts(
        episode.attempts,
        [*truths, final],
        regions=regions,
        goal=goal,
        slips=_slips(episode.attempts, episode.truth),
        believed=[perception.posterior.believed for perception in episode.perceptions],
    )
    for row in attempts:  # What a hand has swept off the table, the arm has not knocked off.
        swept = {act.label for act in episode.acts if act.kind == "swept" and act.observation == row["step"]}
        row["knocked_off"] = [label for label in row["knocked_off"] if label not in swept]
    return summary(
        seed=scenario.random_seed,
        outcome=episode.outcome,
        final=final,
        regions=regions,
        goal=goal,
        observations=[
            score_observation(perception, truth, catalogue)
            for perception, truth in zip(episode.perceptions, truths, strict=True)
        ],
        attempts=attempts,
        timing={
            **{f"{purpose}_cpu_s": seconds for purpose, seconds in episode.costs.items()},
            "wall_s": episode.wall_s,
            "sim_time_s": episode.sim_time_s,
        },
        digest=digest(episode.perceptions, episode.attempts, final),
        versions=versions,
        device=device,
        faults=score_faults(
            scenario.faults,
            episode.absent,
            episode.acts,
            episode.perceptions,
            episode.attempts,
            truths,
            regions,
            catalogue,
        ),
        limits=None if episode.limit_use is None else episode.limit_use.row(),
    )


def _in_play(truth: Truth, scenario: Scenario, episode: Episode) -> Truth:
    """Without what a hand has not added yet, or has taken away: nobody is to sort that."""
    done = [act for act in episode.acts if act.observation < truth.observation]
    out = {label for fault, label in zip(scenario.faults, episode.absent, strict=True) if fault.kind == "added"}
    out = (out - {act.label for act in done if act.kind == "added"}) | {a.label for a in done if a.kind == "taken"}
    return Truth(
        truth.observation,
        tuple((label, X_WO) for label, X_WO in truth.X_WOs if label not in out),
        tuple((label, share) for label, share in truth.visible_shares if label not in out),
    )


def _truth_at(samples: tuple[TruthSample, ...], observation: int, frame: Frame, renderer: DepthRenderer) -> Truth:
    """The truth when an observation was asked for."""
    sample = next(s for s in samples if s.observations == observation + 1)
    return Truth(observation, sample.X_WOs, visible_shares(sample.X_WOs, frame, renderer))


def visible_shares(
    X_WOs: tuple[tuple[str, Array], ...], frame: Frame, renderer: DepthRenderer
) -> tuple[tuple[str, float | None], ...]:
    """Of each object's pixels, the share that no other object hides; None for one out of the picture."""
    X_CW = np.linalg.inv(frame.X_WC)
    depths = {label: renderer.depth(label, X_CW @ X_WO, frame.camera) for label, X_WO in X_WOs}
    if not depths:
        return ()
    far = {label: np.where(depth > 0, depth, np.inf) for label, depth in depths.items()}
    nearest = np.min(list(far.values()), axis=0)
    shares = []
    for label, depth in far.items():
        shown = np.isfinite(depth)
        shares.append((label, float(np.mean(depth[shown] <= nearest[shown])) if shown.any() else None))
    return tuple(shares)


def _slips(attempts: tuple[Attempt, ...], samples: tuple[TruthSample, ...]) -> list[float | None]:
    """Slip of each attempt: of those after one observation at most one was executed."""
    known = dict(samples[0].X_WOs)
    return [
        transport_slip(tuple(s for s in samples if s.observations == attempt.step + 1), attempt.label)
        if attempt.action is not None and attempt.label in known
        else None
        for attempt in attempts
    ]
