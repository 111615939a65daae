"""What summary.json holds, and whether a file holds it."""

import math
import types
import typing
from collections.abc import Mapping
from typing import Any

from sum_drake.assets import InputError

SCHEMA = "sum-drake/run/1"
TIMING = ("perception_cpu_s", "planning_cpu_s", "simulation_cpu_s", "wall_s", "sim_time_s")
"""What every summary tells the cost of; others may stand beside them."""

OUTCOMES = {
    "sorted": "the object taken rests in the region it belongs in",
    "missorted": "the object taken rests in another region",
    "moved": "the object taken was to make way, or to be grasped anew, and rests about where it was set down",
    "dropped": "it left the hand on the way: it lies on the table or the floor although the hand was opened over the "
    "region, or was lost on the way, or fell off the table",
    "slipped": "it was moved but the hand was empty after the lift",
    "missed": "it was not moved and the hand was empty after the lift",
    "aborted": "the robot broke the motion off for another reason",
    "infeasible": "the arm did not set out: no grasp or path was found, or the robot did not try",
}
"""How an attempt ended, by the truth."""


def is_manipulation_error(trial: Mapping[str, Any]) -> bool:
    """Whether an attempt that was executed did not bring its object where it was to go, or knocked another off."""
    if trial["knocked_off"]:
        return True
    if trial["outcome"] == "missorted":
        return bool(trial["object"] == trial["label"])
    return trial["outcome"] not in ("sorted", "moved")


FATES = {
    "rejected": "what it gave rise to was not accepted",
    "corrected": "another of its labels was accepted, and is right",
    "accepted": "what it gave rise to was accepted, and is wrong",
    "unused": "it gave rise to nothing",
}
"""What became of a false detection."""

# What the file must hold: a type, a union of types, [rows of a kind], {fields} or {str: type}.
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
_FALSE_DETECTION = {
    "box": [float],
    "label": str,
    "probability": float,
    "fate": str,
    "accepted_as": str | None,
}
"""A row of an observation's `false_detections`, which summaries written before there was a detector do without."""
_GONE = {"track": int, "label": str, "reason": str}
"""A row of an observation's `gone`, which older summaries do without, as they do without `faults`."""
_FAULT = {
    "kind": str,
    "observation": int,
    "object": str | None,
    "happened": bool,
    "dealt_with_after": int | None,
    "belief": str,
}
_LIMITS = {
    "samples": int,
    "position_use": float,
    "speed_use": float,
    "acceleration_use": float,
    "effort_use": float,
    "violations": {str: int},
}
"""`limits`, which older summaries do without."""
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
    for i, row in enumerate(data["observations"]):
        where = f"summary.observations[{i}].false_detections"
        _check(row.get("false_detections", []), [_FALSE_DETECTION], where)
        for j, detection in enumerate(row.get("false_detections", [])):
            if detection["fate"] not in FATES:
                raise InputError(f"{where}[{j}].fate: {detection['fate']!r}; expected one of {', '.join(FATES)}")
        _check(row.get("gone", []), [_GONE], f"summary.observations[{i}].gone")
    _check(data.get("faults", []), [_FAULT], "summary.faults")
    if data.get("limits") is not None:
        _check(data["limits"], _LIMITS, "summary.limits")
        _check(data["limits"].get("violated_by", {}), {str: int}, "summary.limits.violated_by")
    for i, row in enumerate(data["attempts"]):
        believed = row.get("believed")
        _check({} if believed is None else believed, {str: float}, f"summary.attempts[{i}].believed")
        _check(row.get("why", ""), str, f"summary.attempts[{i}].why")
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
