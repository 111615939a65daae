"""The score of a run, made after it from the true poses that only the referee sampled.

Definitions, and where they come from (Sui et al. 2017, section VI):

- Only tracks that were associated with a detection of the observation count: those are its hypotheses.
- A track is *true* when an object of its label is where its box is: intersection over union with the object's box at
  least .5, the paper's true positive; or, for an object whose visible part is smaller than the box projected from its
  mesh, when the estimate lies within 5 cm of it. Every other track is a false positive, and rejected when the belief
  does not accept it. The paper's "ratio of rejected detection false positives" is then
  false_positives_rejected / false_positives.
- A *trial* is an attempt in which something was moved. A *manipulation error* is a trial that ends neither sorted nor
  missorted for a wrong label, or that knocks another object off the table.
- The *completion ratio* is the share of the objects with a place to go that rest there at the end.
- Translation error is the distance between the origins; rotation error the smallest angle over the symmetry group.
"""

import dataclasses
import hashlib
import math
import types
import typing
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake.assets import InputError
from sum_drake.geometry import box_iou, pose_error
from sum_drake.jsonio import canonical
from sum_drake.rendering import predicted_box
from sum_drake.types import LEAVE, Array, Attempt, Box, Frame, Immutable, Perception, Region, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

SCHEMA = "sum-drake/run/1"
TRUE_IOU = 0.5
"""Least overlap of a true positive, as in the paper."""
TRUE_DISTANCE = 0.05
"""An estimate nearer than this to an object of its label stems from that object, metres."""
MOVED = 0.01
"""An object that moved less than this was not touched to any effect, metres."""
HEAP = 0.10
"""Objects lie up to this much above the rim of a full bin, metres."""

OUTCOMES = {
    "sorted": "the object taken rests in the region it belongs in",
    "missorted": "the object taken rests in another region",
    "dropped": "it left the hand on the way: it lies on the table or the floor although the hand was opened over the "
    "region, or it fell off the table",
    "slipped": "it was moved but the hand was empty after the lift",
    "missed": "it was not moved and the hand was empty after the lift",
    "aborted": "the robot broke the motion off for another reason",
    "infeasible": "nothing was moved: no grasp or path was found, or the robot did not try",
}
"""How an attempt ended, by the truth."""


@dataclasses.dataclass(frozen=True, eq=False)
class Truth(Immutable):
    """Where everything was when an observation was made, or at the end of the run."""

    observation: int
    X_WOs: tuple[tuple[str, Array], ...]
    """Label and pose (4, 4) of each object."""
    visible_shares: tuple[tuple[str, float | None], ...] = ()
    """Label and visible part of the object's picture in [0, 1]; None where unknown."""
    boxes: tuple[tuple[str, Box], ...] = ()
    """Label and box of the visible part; boxes are projected from the meshes for labels not named here."""


def where_is(X_WO: Array, regions: Mapping[str, Region]) -> str:
    """Name of the region that holds the object's origin, "table" above the table's height, else "floor".

    A region holds what lies within its footprint, from its floor to `HEAP` above its rim. The region named "table"
    gives the table's height.
    """
    p_W = X_WO[:3, 3]
    for name, region in regions.items():
        inside = np.all(np.abs(p_W[:2] - region.p_W[:2]) <= region.half_extents[:2])
        if inside and region.floor_height - MOVED <= p_W[2] <= region.rim_height + HEAP:
            return name
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
            is_true = X_WO is not None and _is_true(track, X_WO, perception.frame, truth, catalogue)
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
        "poses": poses,
    }


def _nearest(track: Track, truth: Truth) -> Array | None:
    """Pose of the object of the track's label, the nearest where there are several."""
    candidates = [X_WO for label, X_WO in truth.X_WOs if label == track.label]
    return min(candidates, key=lambda X: float(np.linalg.norm(X[:3, 3] - track.X_WO[:3, 3])), default=None)


def _is_true(track: Track, X_WO: Array, frame: Frame, truth: Truth, catalogue: "Catalogue") -> bool:
    if np.linalg.norm(X_WO[:3, 3] - track.X_WO[:3, 3]) <= TRUE_DISTANCE:
        return True
    box = dict(truth.boxes).get(track.label)
    if box is None:
        box = predicted_box(np.asarray(catalogue[track.label].load_mesh().vertices), X_WO, frame)
    return box_iou(track.box, box) >= TRUE_IOU


def score_attempts(
    attempts: Sequence[Attempt],
    truths: Sequence[Truth],
    *,
    regions: Mapping[str, Region],
    goal: Mapping[str, str],
    slips: Sequence[float | None],
) -> list[dict[str, Any]]:
    """The rows of `attempts` in summary.json.

    Args:
        attempts: in order; several may follow one observation.
        truths: of observations 0, 1, ..., then of the end of the run.
        regions: by name; "table" among them.
        goal: label -> region name, or "leave".
        slips: for each attempt how far the object moved in the hand, metres; None where it was not carried.
    """
    return [
        _score_attempt(attempt, truths[attempt.step], truths[attempt.step + 1], regions, goal, slip)
        for attempt, slip in zip(attempts, slips, strict=True)
    ]


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
    left = [label for label in was if now[label] != was[label]]
    taken = _taken(attempt, left, now) if attempt.action is not None else None
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
    if taken in left:
        assert taken is not None
        if now[taken] == goal.get(taken):
            return "sorted"
        return "dropped" if now[taken] in ("floor", "table") else "missorted"
    if action.released:
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
) -> dict[str, Any]:
    """summary.json as plain data.

    Args:
        outcome: "cleared" or "stopped: <reason>".
        final: true poses at the end; goal: label -> region name or "leave".
        observations, attempts: rows of `score_observation` and `score_attempts`.
        timing: perception_cpu_s, planning_cpu_s, simulation_cpu_s, wall_s, sim_time_s; missing ones become null.
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
        "objects": [
            {"label": label, "goal": goal.get(label, LEAVE), "place": now[label], "p_W": X_WO[:3, 3].tolist()}
            for label, X_WO in final.X_WOs
        ],
        "manipulation_trials": len(trials),
        "manipulation_errors": sum(map(_is_manipulation_error, trials)),
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


def _is_manipulation_error(trial: Mapping[str, Any]) -> bool:
    if trial["knocked_off"]:
        return True
    if trial["outcome"] == "missorted":
        return bool(trial["object"] == trial["label"])
    return bool(trial["outcome"] != "sorted")


def digest(perceptions: Sequence[Perception], attempts: Sequence[Attempt], final: Truth) -> str:
    """sha256 over beliefs, attempts and final poses as canonical JSON; equal runs have equal digests, to the bit."""
    beliefs = [perception.posterior for perception in perceptions]
    text = canonical({"beliefs": beliefs, "attempts": list(attempts), "final_poses": final.X_WOs})
    return hashlib.sha256(text.encode()).hexdigest()


# What summary.json must hold: a type, a union of types, [rows of a kind], {fields} or {str: type}.
_POSE = {
    "track": int,
    "label": str,
    "seen": bool,
    "accepted": bool,
    "probability": float,
    "translation_error_m": float | None,
    "rotation_error_rad": float | None,
    "visible_share": float | None,
}
_OBSERVATION = {
    "step": int,
    "detections": int,
    "tracks": int,
    "false_positives": int | None,
    "false_positives_rejected": int | None,
    "true_tracks": int | None,
    "true_tracks_accepted": int | None,
    "poses": [_POSE],
}
_ATTEMPT = {
    "step": int,
    "track": int,
    "label": str,
    "object": str | None,
    "region": str,
    "kind": str,
    "outcome": str,
    "reason": str,
    "knocked_off": [str],
    "grasp_candidates": int,
    "rejected_by": {str: int},
    "slip_m": float | None,
}
TIMING = ("perception_cpu_s", "planning_cpu_s", "simulation_cpu_s", "wall_s", "sim_time_s")
_SUMMARY = {
    "schema": str,
    "seed": int,
    "outcome": str,
    "objects_total": int,
    "objects_sorted": int,
    "objects_missorted": int,
    "missorted_by": {"perception": int, "manipulation": int},
    "completion_ratio": float,
    "objects": [{"label": str, "goal": str, "place": str, "p_W": [float]}],
    "manipulation_trials": int,
    "manipulation_errors": int,
    "observations": [_OBSERVATION],
    "attempts": [_ATTEMPT],
    "timing": dict.fromkeys(TIMING, float | None),
    "digest": str,
    "versions": {str: str},
    "device": str,
}


def validate_summary(data: Any) -> None:
    """Raises InputError, naming the field, for data that is not a summary.json of schema "sum-drake/run/1".

    Fields that are not known are let through: a later version may add some.
    """
    _check(data, _SUMMARY, "summary")
    if data["schema"] != SCHEMA:
        raise InputError(f"summary.schema: {data['schema']!r}; expected {SCHEMA!r}")
    if data["outcome"] != "cleared" and not data["outcome"].startswith("stopped: "):
        raise InputError(f"summary.outcome: {data['outcome']!r}; expected 'cleared' or 'stopped: <reason>'")
    for i, row in enumerate(data["attempts"]):
        if row["outcome"] not in OUTCOMES:
            raise InputError(
                f"summary.attempts[{i}].outcome: {row['outcome']!r}; expected one of {', '.join(OUTCOMES)}"
            )
    missorted = sum(data["missorted_by"].values())
    if missorted != data["objects_missorted"]:
        raise InputError(
            f"summary.missorted_by: sums to {missorted}; expected objects_missorted, {data['objects_missorted']}"
        )
    if data["objects_sorted"] > data["objects_total"]:
        raise InputError(
            f"summary.objects_sorted: {data['objects_sorted']}; expected at most {data['objects_total']} in all"
        )


def _check(value: Any, kind: Any, where: str) -> None:
    if isinstance(kind, list):
        if not isinstance(value, list):
            raise InputError(f"{where}: {type(value).__name__}; expected a list")
        for i, item in enumerate(value):
            _check(item, kind[0], f"{where}[{i}]")
    elif isinstance(kind, dict):
        if not isinstance(value, dict):
            raise InputError(f"{where}: {type(value).__name__}; expected an object")
        for name, item in kind.items():
            if name is str:
                for key, entry in value.items():
                    _check(entry, item, f"{where}.{key}")
            elif name not in value:
                raise InputError(f"{where}.{name}: missing; expected {_name(item)}")
            else:
                _check(value[name], item, f"{where}.{name}")
    elif isinstance(kind, types.UnionType):
        if value is not None:
            _check(value, typing.get_args(kind)[0], where)
    elif kind is float:
        if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
            raise InputError(f"{where}: {value!r}; expected a finite number")
    elif not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"{where}: {value!r}; expected {_name(kind)}")


def _name(kind: Any) -> str:
    if isinstance(kind, list | dict):
        return "a list" if isinstance(kind, list) else "an object"
    return str(getattr(kind, "__name__", kind))
