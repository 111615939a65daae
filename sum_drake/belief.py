"""The recursion over observations: predict, estimate, spawn, terminate, accept (Sui et al. 2017, eq. 4)."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from sum_drake.action_model import NEAR_M, OUTCOMES, felt, judged, predict
from sum_drake.association import AssociationConfig, probability
from sum_drake.consistency import PENETRATION, SAME_M, agree, conflicts, contended, penetration
from sum_drake.existence import LEAST, SURVIVES, agreed_probability, missed_probability, track_probability
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimate, PoseRequest
from sum_drake.presence import UNKNOWN, Presence, PresenceCheck
from sum_drake.support import sunk
from sum_drake.types import (
    Array,
    Association,
    Associations,
    Believed,
    Detection,
    Detections,
    Frame,
    Gone,
    PickPlace,
    PoseBelief,
    Region,
    SceneBelief,
    Track,
)

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

SHOWN = 0.3
"""Of what could be seen of an object that was not detected, the share that must be explained for it to be accepted."""
ENDS = {
    "placed": "it was put where it was to go, which the camera does not see",
    "lost": "it left the table on the way",
    "empty": "depth shows nothing where it was",
    "unseen": "it was unlikely, and not detected too often",
    "unlikely": "it was hardly probable any more, and not detected, or likelier ones needed the room",
}
"""Why a track ends, `types.Gone.reason`."""
HIDDEN = 0.5
"""Where more than this share of what would be seen of an object is hidden, it is no miss that it is not detected."""
SUNK = 0.02
"""How far an accepted track may reach into the table, metres: as far as its position may be off."""


class Estimator(Protocol):
    """Anything that estimates poses in boxes: `filtering.PoseEstimator`, or many in `pose_workers.PoseWorkers`."""

    def estimate_all(self, frame: Frame, requests: Sequence[PoseRequest]) -> list[PoseEstimate]:
        """The pose belief of each request given the frame's depth in its box, in the order of the requests."""


@dataclasses.dataclass
class AcceptanceConfig:
    """When a track counts as an object."""

    threshold: float = 0.5
    """Least probability of an accepted track."""
    by: str = "existence"
    """What a track's probability is by one look, one of ACCEPT_BY: `existence`, as learned (`existence.py`), or
    `score`, p(b) p(o | b) times the likelihood, by which the paper ranks hypotheses."""


ACCEPT_BY = ("existence", "score")


@dataclasses.dataclass(frozen=True)
class BeliefConfig:
    """What the recursion goes by."""

    filter: FilterConfig
    association: AssociationConfig
    acceptance: AcceptanceConfig
    unique_labels: bool
    """At most one accepted object of a label."""
    seed: int
    table: Region | None = None
    """What objects stand on, if it is known; its floor is the top."""


def update(
    held: SceneBelief,
    frame: Frame,
    detections: Detections,
    associations: Associations,
    action: PickPlace | None,
    estimator: Estimator,
    presence: PresenceCheck,
    catalogue: "Catalogue",
    config: BeliefConfig,
) -> SceneBelief:
    """The belief after an observation; as it was, if the observation is not newer than those it knows.

    Raises ValueError if the three inputs speak of different observations.

    A track with a box is estimated anew from its prior; one without is looked for where it is believed to be, as is one
    whose box turns out to show it elsewhere: it is where it is likelier. Tracks that cannot all be true contend. What
    became of the action's target is believed by what the hand felt and what is seen now.
    """
    if not frame.observation == detections.observation == associations.observation:
        raise ValueError(
            f"frame {frame.observation}, detections {detections.observation} and associations "
            f"{associations.observation} are of different observations; expected one"
        )
    if frame.observation <= held.observation:
        return held
    if not config.association.carry:
        held, action = SceneBelief(held.observation, next_id=held.next_id), None
    acted = action if action is not None and action.kind != "none" else None
    matched = {pair.track: pair for pair in associations.pairs if pair.track is not None}
    looked_for: list[tuple[Track | int, Association]] = []
    requests = []
    beliefs: dict[int, PoseBelief] = {}
    for track in held.tracks:
        rng = np.random.default_rng([config.seed, track.id, frame.observation])
        is_target = acted is not None and acted.track == track.id
        beliefs[track.id] = predict(track.belief, acted, is_target=is_target, rng=rng, config=config.filter)
        if track.id in matched:
            pair = matched[track.id]
            box = detections.boxes[pair.detection].box
            looked_for.append((track, pair))
            requests.append(PoseRequest(pair.label, box, rng, beliefs[track.id], track.likelihood, config.table))
    next_id = held.next_id
    for pair in associations.pairs:
        if pair.track is None:
            rng = np.random.default_rng([config.seed, next_id, frame.observation])
            looked_for.append((next_id, pair))
            box = detections.boxes[pair.detection].box
            requests.append(PoseRequest(pair.label, box, rng, table=config.table))
            next_id += 1
    estimates = estimator.estimate_all(frame, requests)
    tracks = [
        _estimated(track, detections.boxes[pair.detection], pair.label, estimate, frame, acted, catalogue, config)
        for (track, pair), estimate in zip(looked_for, estimates, strict=True)
    ]
    believed = _believed(held, tracks, frame, acted, presence, config)
    gone: list[Gone] = []
    found = {track.id: track for track in tracks}
    for track in held.tracks:
        estimated = found.get(track.id)
        if estimated is not None and "p_before" in dict(estimated.features):
            continue
        left = _unseen(track, beliefs[track.id], frame, acted, believed, presence, catalogue, config)
        if isinstance(left, Gone):
            gone += [left] if estimated is None else []
            continue
        if estimated is None:
            found[track.id] = left
            continue
        # The box shows it elsewhere than it was. It is where it is likelier; the other place may be another one's.
        found[track.id], other = (left, estimated) if left.probability > estimated.probability else (estimated, left)
        if other.probability >= LEAST:
            found[next_id] = dataclasses.replace(other, id=next_id, born=frame.observation)
            next_id += 1
    kept = sorted(found.values(), key=lambda track: (-track.probability, track.id))[: config.association.max_tracks]
    left_out = [track for track in found.values() if all(track is not one for one in kept)]
    gone += [Gone(track.id, track.label, frame.observation, "unlikely") for track in left_out]
    tracks, rivals = _contended(sorted(kept, key=lambda track: track.id), frame, presence, catalogue)
    return SceneBelief(
        frame.observation, _accept(tracks, rivals, frame.observation, catalogue, config), next_id, tuple(gone), believed
    )


def _estimated(
    track: Track | int,
    detection: Detection,
    label: str,
    estimate: PoseEstimate,
    frame: Frame,
    action: PickPlace | None,
    catalogue: "Catalogue",
    config: BeliefConfig,
) -> Track:
    """The track (or a new one of that id) after its association with a box and the estimate in it."""
    p_box, p_label = probability(detection.p_box), probability(dict(detection.p_labels)[label])
    features = (*estimate.features, ("sunk_m", _sunk(label, estimate.X_WO, catalogue, config)))
    by_score = config.acceptance.by == "score"
    likely = p_box * p_label * estimate.likelihood
    if not by_score:
        likely = track_probability(p_box, p_label, estimate.likelihood, dict(features))
    features = (*features, ("p_look", likely))
    # An estimate of which nothing could be seen is the prior's, and no witness for or against it.
    before = _expected(track, action) if isinstance(track, Track) and estimate.likelihood > 0 else []
    if isinstance(track, Track) and any(agree(estimate.X_WO, X_WO, label, catalogue) for X_WO in before):
        features = (*features, ("p_before", track.own_probability))
        likely = likely if by_score else agreed_probability(likely, track.own_probability)
    return Track(
        id=track if isinstance(track, int) else track.id,
        label=label,
        box=detection.box,
        p_box=p_box,
        p_label=p_label,
        belief=estimate.belief,
        X_WO=estimate.X_WO,
        likelihood=estimate.likelihood,
        probability=likely,
        accepted=False,
        born=frame.observation if isinstance(track, int) else track.born,
        seen=frame.observation,
        features=features,
    )


def _sunk(label: str, X_WO: Array, catalogue: "Catalogue", config: BeliefConfig) -> float:
    """How far an object reaches into the table, metres; 0 where none is known."""
    if config.table is None:
        return 0.0
    return sunk(np.asarray(catalogue[label].load_mesh().vertices), X_WO, config.table)


def _expected(track: Track, action: PickPlace | None) -> list[Array]:
    """Poses at which the track would be no surprise."""
    if action is not None and action.track == track.id and action.released:
        return [track.X_WO, action.X_WO_place]
    return [track.X_WO]


def _believed(
    held: SceneBelief,
    tracks: Sequence[Track],
    frame: Frame,
    action: PickPlace | None,
    presence: PresenceCheck,
    config: BeliefConfig,
) -> Believed | None:
    """What became of the action's target; None where there was no action or no such track."""
    target = next((track for track in held.tracks if action is not None and track.id == action.track), None)
    if action is None or target is None:
        return None
    at_place = UNKNOWN
    if action.released and config.table is not None and config.table.holds(action.X_WO_place[:3, 3]):
        at_place = presence.look(frame, target.label, action.X_WO_place)
    near, far = 0.0, 0.0
    for track in tracks:
        off = float(np.linalg.norm(track.X_WO[:3, 3] - target.X_WO[:3, 3]))
        at_its_place = np.linalg.norm(track.X_WO[:3, 3] - action.X_WO_place[:3, 3]) < 2 * SAME_M
        if track.label != target.label or off < SAME_M or at_its_place:
            continue
        if off < NEAR_M:
            near = max(near, track.probability)
        else:
            far = max(far, track.probability)
    there = presence.look(frame, target.label, target.X_WO)
    outcomes = judged(action, there, at_place, near=near, far=far, blind=not frame.depth.any())
    return Believed(action.step, target.id, target.label, tuple(zip(OUTCOMES, map(float, outcomes), strict=True)))


def _unseen(
    track: Track,
    predicted: PoseBelief,
    frame: Frame,
    action: PickPlace | None,
    believed: Believed | None,
    presence: PresenceCheck,
    catalogue: "Catalogue",
    config: BeliefConfig,
) -> Track | Gone:
    """The track after an observation without a box that shows it."""
    X_WO, survives, reason = track.X_WO, SURVIVES, ""
    if action is not None and believed is not None and believed.track == track.id:
        reason = believed.outcome
        if reason == "placed" and config.table is not None and config.table.holds(action.X_WO_place[:3, 3]):
            X_WO, reason = action.X_WO_place, ""
        # By what was felt alone: what is seen there counts below, and once.
        by_feel = dict(zip(OUTCOMES, map(float, felt(action)), strict=True))
        survives = min(SURVIVES, by_feel["placed" if X_WO is not track.X_WO else "stayed"])
    seen = presence.look(frame, track.label, X_WO)
    likely = missed_probability(track.own_probability, seen, again=track.missed > 0, survives=survives)
    if likely < LEAST:
        if reason not in ("placed", "lost"):
            reason = "empty" if seen.free > seen.explained else "unlikely"
        return Gone(track.id, track.label, frame.observation, reason)
    missed = track.missed + (seen.pixels > 0 and seen.hidden < HIDDEN)
    if missed > track.missed and missed >= config.association.max_missed and likely < config.acceptance.threshold:
        return Gone(track.id, track.label, frame.observation, "unseen")
    looks = {f"look_{field.name}": float(getattr(seen, field.name)) for field in dataclasses.fields(Presence)}
    looks |= {"p_before": track.own_probability, "sunk_m": _sunk(track.label, X_WO, catalogue, config)}
    return dataclasses.replace(
        track,
        belief=predicted,
        X_WO=X_WO,
        probability=likely,
        accepted=False,
        missed=missed,
        features=tuple((dict(track.features) | looks).items()),
    )


def _contended(
    tracks: list[Track], frame: Frame, presence: PresenceCheck, catalogue: "Catalogue"
) -> tuple[list[Track], set[frozenset[int]]]:
    """Tracks with what each loses to those that cannot be true beside it, and which pairs of ids cannot.

    Several that say the same stand in for one object, and contend as one.
    """
    of = sorted((t for t in tracks if t.probability >= LEAST), key=lambda t: (-t.probability, t.id))
    heads: list[Track] = []
    head_of: dict[int, Track] = {}
    for track in of:
        same = (h for h in heads if h.label == track.label and agree(h.X_WO, track.X_WO, track.label, catalogue))
        head_of[track.id] = next(same, track)
        if head_of[track.id] is track:
            heads.append(track)
    if len(heads) < 2:
        return [dataclasses.replace(t, uncontended=t.probability) for t in tracks], set()
    explained = [presence.explained(frame, track.label, track.X_WO) for track in heads]
    against = conflicts(heads, explained, catalogue)
    left = contended(np.array([track.probability for track in heads]), against)
    share = {head.id: float(p / head.probability) for head, p in zip(heads, left, strict=True)}
    rivals = {frozenset((heads[i].id, heads[j].id)) for i, j in np.argwhere(against)}
    return [
        dataclasses.replace(
            t,
            uncontended=t.probability,
            probability=t.probability * (share[head_of[t.id].id] if t.id in head_of else 1.0),
        )
        for t in tracks
    ], {frozenset((a, b)) for a in head_of for b in head_of if frozenset((head_of[a].id, head_of[b].id)) in rivals}


def _above(track: Track) -> bool:
    """Whether it leaves the table whole, but for errors of its pose."""
    return dict(track.features).get("sunk_m", 0.0) <= SUNK


def _accept(
    tracks: list[Track],
    rivals: set[frozenset[int]],
    observation: int,
    catalogue: "Catalogue",
    config: BeliefConfig,
) -> tuple[Track, ...]:
    """Tracks with `accepted` decided: likeliest first, each taking its box, its place and, if unique, its label.

    rivals: pairs of ids that exclude each other.
    """
    accepted: list[Track] = []

    def excluded(track: Track, other: Track) -> bool:
        if track.box == other.box or frozenset((track.id, other.id)) in rivals:
            return True
        same = track.label == other.label
        if same and (config.unique_labels or agree(track.X_WO, other.X_WO, track.label, catalogue)):
            return True
        # One that says the same as another contends by that one's pose, a little off its own.
        return penetration(track, other, catalogue) > PENETRATION

    for track in sorted(tracks, key=lambda t: (-t.probability, t.id)):
        shown = track.seen == observation or dict(track.features).get("look_explained", 0.0) >= SHOWN
        likely = track.probability >= config.acceptance.threshold and _above(track)
        if shown and likely and not any(excluded(track, other) for other in accepted):
            accepted.append(track)
    taken = {track.id for track in accepted}
    return tuple(dataclasses.replace(track, accepted=track.id in taken) for track in tracks)
