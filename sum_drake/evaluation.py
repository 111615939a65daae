"""The score of a run, made after it from the true poses that only the referee sampled.

Definitions, and where they come from (Sui et al. 2017, section VI):

- Only tracks that were associated with a detection of the observation count: those are its hypotheses.
- A track is *true* when an object of its label is where its box is: intersection over union with the object's box at
  least .5, the paper's true positive; or, for an object whose visible part is smaller than the box projected from its
  mesh, when the estimate lies within 5 cm of it. Every other track is a false positive, and rejected when the belief
  does not accept it. The paper's "ratio of rejected detection false positives" is then
  false_positives_rejected / false_positives.
- A *detection* is false when its likeliest label is not that of what is in its box, by the same rule.
- A *trial* is an attempt for which the arm set out. A *manipulation error* is a trial that ends neither sorted, nor
  moved as it was meant to, nor missorted for a wrong label, or that knocks another object off the table.
- The *completion ratio* is the share of the objects with a place to go that rest there at the end.
- Translation error is the distance between the origins; rotation error the smallest angle over the symmetry group.
"""

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake.geometry import iou, pose_error
from sum_drake.jsonio import canonical
from sum_drake.making_way import MOVE
from sum_drake.rendering import predicted_box
from sum_drake.summary_schema import SCHEMA, TIMING, is_manipulation_error
from sum_drake.types import LEAVE, Array, Attempt, Believed, Box, Frame, Immutable, Perception, Region, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

TRUE_IOU = 0.5
"""Least overlap of a true positive, as in the paper."""
TRUE_DISTANCE = 0.05
"""An estimate nearer than this to an object of its label stems from that object, metres."""
MOVED = 0.01
"""An object that moved less than this was not touched to any effect, metres."""
PUT = 0.10
"""An object that was moved to a place on the table lies at most this far from it, metres: it may have rolled over."""
HEAP = 0.10
"""Objects lie up to this much above the rim of a full bin, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Truth(Immutable):
    """Where everything was when an observation was made, or at the end of the run."""

    observation: int
    X_WOs: tuple[tuple[str, Array], ...]
    """Label and pose (4, 4) of each object."""
    visible_shares: tuple[tuple[str, float | None], ...] = ()
    """Label and visible part of the object's picture in [0, 1]; None where unknown."""


def where_is(X_WO: Array, regions: Mapping[str, Region]) -> str:
    """Name of the region that holds the object's origin, "table" above the table's height, else "floor".

    A region holds what lies within its footprint, from its floor to `HEAP` above its rim. Where several do, it is the
    smallest: part of the table may be a region of its own. The region named "table" gives the table's height.
    """
    p_W = X_WO[:3, 3]

    def holds(region: Region) -> bool:
        inside = np.all(np.abs(p_W[:2] - region.p_W[:2]) <= region.half_extents[:2])
        return bool(inside and region.floor_height - MOVED <= p_W[2] <= region.rim_height + HEAP)

    holding = [name for name, region in regions.items() if holds(region)]
    if holding:
        return min(holding, key=lambda name: float(np.prod(regions[name].half_extents)))
    table = regions.get("table")
    return "table" if table is not None and p_W[2] > table.floor_height else "floor"


def score_observation(perception: Perception, truth: Truth, catalogue: "Catalogue") -> dict[str, Any]:
    """The row of `observations` in summary.json for one observation. Raises ValueError for another one's truth."""
    if perception.posterior.observation != truth.observation:
        raise ValueError(
            f"truth of observation {truth.observation} for the belief of {perception.posterior.observation}"
        )
    shares = dict(truth.visible_shares)
    poses, verdicts = [], []
    for track in perception.posterior.tracks:
        X_WO = _nearest(track, truth)
        translation = rotation = None
        if X_WO is not None:
            errors = pose_error(track.X_WO, X_WO, catalogue[track.label].symmetry)
            translation, rotation = float(errors[0]), float(errors[1])
        seen = track.seen == truth.observation
        if seen:
            is_true = X_WO is not None and _is_true(track, X_WO, perception.frame, catalogue)
            verdicts.append((is_true, track.accepted))
        poses.append(
            {
                "track": track.id,
                "label": track.label,
                "seen": seen,
                "accepted": track.accepted,
                "probability": float(track.probability),
                "translation_error_m": translation,
                "rotation_error_rad": rotation,
                "visible_share": shares.get(track.label),
            }
        )
    return {
        "step": perception.step,
        "detections": len(perception.detections),
        "tracks": len(poses),
        "false_positives": sum(not is_true for is_true, _ in verdicts),
        "false_positives_rejected": sum(not is_true and not accepted for is_true, accepted in verdicts),
        "true_tracks": sum(is_true for is_true, _ in verdicts),
        "true_tracks_accepted": sum(is_true and accepted for is_true, accepted in verdicts),
        "false_detections": _false_detections(perception, truth, catalogue),
        "poses": poses,
        "gone": [
            {"track": gone.track, "label": gone.label, "reason": gone.reason} for gone in perception.posterior.gone
        ],
    }


def _false_detections(perception: Perception, truth: Truth, catalogue: "Catalogue") -> list[dict[str, Any]]:
    """The rows of `false_detections`: detections whose likeliest label is wrong, and what became of them."""
    tracks = {track.id: track for track in perception.posterior.tracks}
    fed = _tracks_fed(perception)
    rows = []
    for index, detection in enumerate(perception.detections):
        label, p_label = detection.p_labels[0]
        own = [tracks[id] for id in fed.get(index, ()) if id in tracks]
        right = [track for track in own if _stands_for_an_object(track, perception.frame, truth, catalogue)]
        if any(track.label == label for track in right) or _holds(
            detection.box, label, perception.frame, truth, catalogue
        ):
            continue
        accepted = next((track for track in own if track.accepted), None)
        if accepted is None:
            fate = "rejected" if own else "unused"
        else:
            fate = "corrected" if accepted in right else "accepted"
        rows.append(
            {
                "box": list(detection.box),
                "label": label,
                "probability": float(detection.p_box * p_label),
                "fate": fate,
                "accepted_as": None if accepted is None else accepted.label,
            }
        )
    return rows


def _tracks_fed(perception: Perception) -> dict[int, list[int]]:
    """Index of a detection -> ids of the tracks that it fed.

    Not of those it was associated with: a track may turn out to be elsewhere than in its box, which then feeds another.
    """
    seen = [track for track in perception.posterior.tracks if track.seen == perception.posterior.observation]
    return {
        index: [t.id for t in seen if t.box == detection.box and t.label in dict(detection.p_labels)]
        for index, detection in enumerate(perception.detections)
    }


def _stands_for_an_object(track: Track, frame: Frame, truth: Truth, catalogue: "Catalogue") -> bool:
    X_WO = _nearest(track, truth)
    return X_WO is not None and _is_true(track, X_WO, frame, catalogue)


def _holds(box: Box, label: str, frame: Frame, truth: Truth, catalogue: "Catalogue") -> bool:
    """Whether an object of the label is where the box is, by the overlap alone."""
    return any(
        iou(box, predicted_box(np.asarray(catalogue[label].load_mesh().vertices), X_WO, frame))[0, 0] >= TRUE_IOU
        for other, X_WO in truth.X_WOs
        if other == label
    )


def _nearest(track: Track, truth: Truth) -> Array | None:
    """Pose of the object of the track's label, the nearest where there are several."""
    candidates = [X_WO for label, X_WO in truth.X_WOs if label == track.label]
    return min(candidates, key=lambda X: float(np.linalg.norm(X[:3, 3] - track.X_WO[:3, 3])), default=None)


def _is_true(track: Track, X_WO: Array, frame: Frame, catalogue: "Catalogue") -> bool:
    if np.linalg.norm(X_WO[:3, 3] - track.X_WO[:3, 3]) <= TRUE_DISTANCE:
        return True
    box = predicted_box(np.asarray(catalogue[track.label].load_mesh().vertices), X_WO, frame)
    return bool(iou(track.box, box)[0, 0] >= TRUE_IOU)


def score_attempts(
    attempts: Sequence[Attempt],
    truths: Sequence[Truth],
    *,
    regions: Mapping[str, Region],
    goal: Mapping[str, str],
    slips: Sequence[float | None],
    believed: Sequence[Believed | None] = (),
) -> list[dict[str, Any]]:
    """The rows of `attempts` in summary.json.

    Args:
        attempts: in order; several may follow one observation.
        truths: of observations 0, 1, ..., then of the end of the run.
        regions: by name; "table" among them.
        goal: label -> region name, or "leave".
        slips: for each attempt how far the object moved in the hand, metres; None where it was not carried.
        believed: of what was done before each observation, `SceneBelief.believed`.
    """
    rows = []
    for attempt, slip in zip(attempts, slips, strict=True):
        row = _score_attempt(attempt, truths[attempt.step], truths[attempt.step + 1], regions, goal, slip)
        after = believed[attempt.step + 1] if attempt.step + 1 < len(believed) else None
        known = after is not None and attempt.action is not None and after.track == attempt.track
        rows.append(row | {"believed": dict(after.outcomes) if after is not None and known else None})
    return rows


def _score_attempt(
    attempt: Attempt,
    before: Truth,
    after: Truth,
    regions: Mapping[str, Region],
    goal: Mapping[str, str],
    slip: float | None,
) -> dict[str, Any]:
    was = {label: where_is(X_WO, regions) for label, X_WO in before.X_WOs}
    now = {label: where_is(X_WO, regions) for label, X_WO in after.X_WOs}
    left = [label for label in was if label in now and now[label] != was[label]]
    taken = None
    if attempt.action is not None:
        taken = _moved(attempt, before, after) if attempt.kind == MOVE else _taken(attempt, left, now)
    return {
        "step": attempt.step,
        "track": attempt.track,
        "label": attempt.label,
        "object": taken,
        "region": attempt.region,
        "kind": attempt.kind,
        "outcome": _outcome(attempt, taken, before, after, now, left, goal),
        "reason": attempt.reason,
        "knocked_off": [label for label in left if label != taken] if attempt.action is not None else [],
        "grasp_candidates": attempt.grasp_candidates,
        "rejected_by": dict(attempt.rejected_by),
        "slip_m": slip,
        "why": attempt.why,
    }


def _taken(attempt: Attempt, left: Sequence[str], now: Mapping[str, str]) -> str | None:
    """The true object that was in the hand or that the hand went for; None if there is no object of the label.

    It is the label's own unless that stayed in its place and another came to where the label's was to go, or left
    its place in a carry: then the belief took the one for the other.
    """
    if attempt.label not in left:
        arrived = [label for label in left if now[label] == attempt.region]
        lost = left if attempt.action is not None and attempt.action.released else []
        for other in (*arrived, *lost):
            return other
    return attempt.label if attempt.label in now else None


def _moved(attempt: Attempt, before: Truth, after: Truth) -> str | None:
    """The true object that was in the hand of a move: the label's own, unless that stayed and another came there."""
    assert attempt.action is not None
    was, now = dict(before.X_WOs), dict(after.X_WOs)
    stayed = [label for label in now if label in was and _way(was[label], now[label]) < MOVED]
    if attempt.label in stayed:
        for label in now:
            if label in was and label not in stayed and _way(now[label], attempt.action.X_WO_place) < PUT:
                return label
    return attempt.label if attempt.label in now else None


def _way(X_WA: Array, X_WB: Array) -> float:
    return float(np.linalg.norm(X_WA[:3, 3] - X_WB[:3, 3]))


def _outcome(
    attempt: Attempt,
    taken: str | None,
    before: Truth,
    after: Truth,
    now: Mapping[str, str],
    left: Sequence[str],
    goal: Mapping[str, str],
) -> str:
    action = attempt.action
    if action is None:
        return "infeasible"
    if attempt.kind == MOVE and action.released:
        put = taken is not None and _way(dict(after.X_WOs)[taken], action.X_WO_place) < PUT
        return "moved" if put else "dropped"
    if taken in left:
        assert taken is not None
        if now[taken] == goal.get(taken):
            return "sorted"
        return "dropped" if now[taken] in ("floor", "table") else "missorted"
    if action.released or attempt.reason == "lost_in_transport":
        return "dropped"
    if attempt.reason != "empty_hand":
        return "aborted"
    if taken is None:
        return "missed"
    moved = np.linalg.norm(dict(after.X_WOs)[taken][:3, 3] - dict(before.X_WOs)[taken][:3, 3])
    return "slipped" if moved > MOVED else "missed"


def summary(
    *,
    seed: int,
    outcome: str,
    final: Truth,
    regions: Mapping[str, Region],
    goal: Mapping[str, str],
    observations: Sequence[dict[str, Any]],
    attempts: Sequence[dict[str, Any]],
    timing: Mapping[str, float | None],
    digest: str,
    versions: Mapping[str, str],
    device: str,
    faults: Sequence[Mapping[str, Any]] = (),
    limits: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """summary.json as plain data.

    Args:
        outcome: "cleared" or "stopped: <reason>".
        final: true poses at the end; goal: label -> region name or "leave".
        observations, attempts: rows of `score_observation` and `score_attempts`.
        timing: perception_cpu_s, planning_cpu_s, simulation_cpu_s, wall_s, sim_time_s; missing ones become null.
        faults: rows of `faults.score_faults`.
        limits: `executed.LimitUse.row`, where that is known.
    """
    now = {label: where_is(X_WO, regions) for label, X_WO in final.X_WOs}
    wanted = [label for label in now if goal.get(label, LEAVE) != LEAVE]
    in_place = [label for label in wanted if now[label] == goal[label]]
    missorted = [label for label in now if now[label] not in ("table", "floor", goal.get(label, LEAVE))]
    by_perception = [label for label in missorted if _put_by_mistaken_label(label, now[label], attempts)]
    trials = [row for row in attempts if row["outcome"] != "infeasible"]
    return {
        "schema": SCHEMA,
        "seed": seed,
        "outcome": outcome,
        "objects_total": len(wanted),
        "objects_sorted": len(in_place),
        "objects_missorted": len(missorted),
        "missorted_by": {"perception": len(by_perception), "manipulation": len(missorted) - len(by_perception)},
        "completion_ratio": len(in_place) / len(wanted) if wanted else 1.0,
        "faults": list(faults),
        "limits": None if limits is None else dict(limits),
        "objects": [
            {"label": label, "goal": goal.get(label, LEAVE), "place": now[label], "p_W": X_WO[:3, 3].tolist()}
            for label, X_WO in final.X_WOs
        ],
        "manipulation_trials": len(trials),
        "manipulation_errors": sum(map(is_manipulation_error, trials)),
        "observations": list(observations),
        "attempts": list(attempts),
        "timing": {**dict.fromkeys(TIMING), **timing},
        "digest": digest,
        "versions": dict(versions),
        "device": device,
    }


def _put_by_mistaken_label(label: str, place: str, attempts: Sequence[dict[str, Any]]) -> bool:
    """Whether the last trial that brought the object to that place took it for something else."""
    brought = [row for row in attempts if row["object"] == label and row["region"] == place]
    return bool(brought) and brought[-1]["label"] != label


def digest(perceptions: Sequence[Perception], attempts: Sequence[Attempt], final: Truth) -> str:
    """sha256 over beliefs, attempts and final poses as canonical JSON; equal runs have equal digests, to the bit."""
    beliefs = [perception.posterior for perception in perceptions]
    text = canonical({"beliefs": beliefs, "attempts": list(attempts), "final_poses": final.X_WOs})
    return hashlib.sha256(text.encode()).hexdigest()
