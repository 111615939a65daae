"""The recursion over observations: predict, estimate, spawn, terminate, accept (Sui et al. 2017, eq. 4)."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from sum_drake.action_model import predict
from sum_drake.association import AssociationConfig
from sum_drake.existence import missed_probability, track_probability
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimate, PoseRequest
from sum_drake.types import (
    Array,
    Association,
    Associations,
    Box,
    Detection,
    Detections,
    Frame,
    PickPlace,
    PoseBelief,
    SceneBelief,
    Track,
)


class Estimator(Protocol):
    """Anything that estimates poses in boxes: `filtering.PoseEstimator`, or many in `pose_workers.PoseWorkers`."""

    def estimate_all(self, frame: Frame, requests: Sequence[PoseRequest]) -> list[PoseEstimate]:
        """The pose belief of each request given the frame's depth in its box, in the order of the requests."""


@dataclasses.dataclass
class AcceptanceConfig:
    """When a track counts as an object."""

    threshold: float = 0.5
    """Least probability of an accepted track."""


def update(
    held: SceneBelief,
    frame: Frame,
    detections: Detections,
    associations: Associations,
    action: PickPlace | None,
    estimator: Estimator,
    *,
    filter_config: FilterConfig,
    association_config: AssociationConfig,
    acceptance: AcceptanceConfig,
    unique_labels: bool,
    seed: int,
    sunk: Callable[[str, Array], float] = lambda label, X_WO: 0.0,
) -> SceneBelief:
    """The belief after an observation. Raises ValueError if the three inputs speak of different observations.

    sunk: how far an object of a label at X_WO (4, 4) would reach into what is known to be solid, metres.
    """
    if not frame.observation == detections.observation == associations.observation:
        raise ValueError(
            f"frame {frame.observation}, detections {detections.observation} and associations "
            f"{associations.observation} are of different observations; expected one"
        )
    matched = {pair.track: pair for pair in associations.pairs if pair.track is not None}
    unseen, looked_for, requests = [], [], []

    def request(track: Track | int, pair: Association, prior: PoseBelief | None, rng: np.random.Generator) -> None:
        looked_for.append((track, pair))
        requests.append(PoseRequest(pair.label, detections.boxes[pair.detection].box, rng, prior))

    for track in held.tracks:
        rng = np.random.default_rng([seed, track.id, frame.observation])
        predicted = _predict(track, action, rng, filter_config)
        if track.id in matched:
            request(track, matched[track.id], predicted, rng)
        elif frame.observation - track.seen < association_config.max_missed:
            unseen.append(_unseen(track, predicted, action))
    next_id = held.next_id
    for pair in associations.pairs:
        if pair.track is None:
            request(next_id, pair, None, np.random.default_rng([seed, next_id, frame.observation]))
            next_id += 1
    seen = [
        _track(track, detections.boxes[pair.detection], pair.label, estimate, frame.observation, sunk)
        for (track, pair), estimate in zip(looked_for, estimator.estimate_all(frame, requests), strict=True)
    ]
    tracks = sorted([*unseen, *seen], key=lambda track: track.id)
    accepted = _accept(tracks, frame.observation, acceptance, unique_labels)
    return SceneBelief(frame.observation, accepted, next_id)


def _predict(track: Track, action: PickPlace | None, rng: np.random.Generator, config: FilterConfig) -> PoseBelief:
    """The action model, eq. 10."""
    is_target = action is not None and action.track == track.id
    return predict(track.belief, action, is_target=is_target, rng=rng, config=config)


def _unseen(track: Track, predicted: PoseBelief, action: PickPlace | None) -> Track:
    """The track after an observation without a box for it: where the action should have put it, if anywhere."""
    moved = action is not None and action.track == track.id and action.released
    return dataclasses.replace(
        track,
        belief=predicted,
        X_WO=action.X_WO_place if moved and action is not None else track.X_WO,
        probability=missed_probability(track.probability),
        accepted=False,
    )


def _track(
    track: Track | int,
    detection: Detection,
    label: str,
    estimate: PoseEstimate,
    observation: int,
    sunk: Callable[[str, Array], float],
) -> Track:
    """The track (or a new one of that id) after its association with a box and the estimate in it."""
    p_label = dict(detection.p_labels)[label]
    features = (*estimate.features, ("sunk_m", sunk(label, estimate.X_WO)))
    return Track(
        id=track if isinstance(track, int) else track.id,
        label=label,
        box=detection.box,
        p_box=detection.p_box,
        p_label=p_label,
        belief=estimate.belief,
        X_WO=estimate.X_WO,
        likelihood=estimate.likelihood,
        probability=track_probability(detection.p_box, p_label, estimate.likelihood, dict(features)),
        accepted=False,
        born=observation if isinstance(track, int) else track.born,
        seen=observation,
        features=features,
    )


def _accept(tracks: list[Track], observation: int, config: AcceptanceConfig, unique_labels: bool) -> tuple[Track, ...]:
    """Tracks with `accepted` decided: likeliest first, each taking its box and, where labels are unique, its label."""
    taken_boxes: set[Box] = set()
    taken_labels: set[str] = set()
    accepted: set[int] = set()
    for track in sorted(tracks, key=lambda t: (-t.probability, t.id)):
        rivals_won = track.box in taken_boxes or (unique_labels and track.label in taken_labels)
        if track.seen == observation and track.probability >= config.threshold and not rivals_won:
            accepted.add(track.id)
            taken_boxes.add(track.box)
            taken_labels.add(track.label)
    return tuple(dataclasses.replace(track, accepted=track.id in accepted) for track in tracks)
