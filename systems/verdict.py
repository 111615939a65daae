"""The score of an episode: the referee's samples against what the robot believed and did."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sum_drake.evaluation import Truth, digest, score_attempts, score_observation, summary
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.systems.episode import Episode
from sum_drake.systems.referee import TruthSample, transport_slip
from sum_drake.systems.scenario import Scenario
from sum_drake.task import region_of
from sum_drake.types import Array, Attempt, Frame


def score(
    episode: Episode, scenario: Scenario, catalogue: Catalogue, *, versions: Mapping[str, str], device: str
) -> dict[str, Any]:
    """summary.json of an episode, as plain data. versions, device: what it ran on, see `doctor`."""
    renderer = DepthRenderer(catalogue)
    truths = [
        _truth_at(episode.truth, perception.step, perception.frame, renderer) for perception in episode.perceptions
    ]
    final = Truth(len(truths), episode.truth[-1].X_WOs)
    regions = {name: scenario.region(name) for name in scenario.regions}
    goal = {label: region_of(label, scenario.goal, catalogue) for label in catalogue.labels}
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
        attempts=score_attempts(
            episode.attempts,
            [*truths, final],
            regions=regions,
            goal=goal,
            slips=_slips(episode.attempts, episode.truth),
        ),
        timing={
            **{f"{purpose}_cpu_s": seconds for purpose, seconds in episode.costs.items()},
            "wall_s": episode.wall_s,
            "sim_time_s": episode.sim_time_s,
        },
        digest=digest(episode.perceptions, episode.attempts, final),
        versions=versions,
        device=device,
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
    """Slip of each attempt: the k-th executed one played motions 2k (pick) and 2k + 1 (place or retreat)."""
    slips, executed = [], 0
    for attempt in attempts:
        slip = None
        if attempt.action is not None:
            known = attempt.label in dict(samples[0].X_WOs)
            slip = transport_slip(samples, 2 * executed + 1, attempt.label) if known else None
            executed += 1
        slips.append(slip)
    return slips
