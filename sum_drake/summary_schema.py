"""What summary.json holds, and whether a file holds it."""

from collections.abc import Mapping
from typing import Any

from sum_drake.assets import InputError
from sum_drake.json_shape import check_shape

SCHEMA = "sum-drake/run/1"
FAILED = "stopped: failed: "
"""What the outcome of a run that an error ended begins with."""
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

# Shapes, as `json_shape.check_shape` has them.
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
FAULT = {
    "kind": str,
    "observation": int,
    "object": str | None,
    "happened": bool,
    "dealt_with_after": int | None,
    "belief": str,
}
LIMITS = {
    "samples": int,
    "position_use": float,
    "speed_use": float,
    "acceleration_use": float,
    "effort_use": float,
    "violations": {str: int},
}
"""`limits`, which older summaries do without."""
ATTEMPT = {
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
OBJECT = {"label": str, "goal": str, "place": str, "p_W": [float]}
_SUMMARY = {
    "schema": str,
    "seed": int,
    "outcome": str,
    "objects_total": int,
    "objects_sorted": int,
    "objects_missorted": int,
    "missorted_by": {"perception": int, "manipulation": int},
    "completion_ratio": float,
    "objects": [OBJECT],
    "manipulation_trials": int,
    "manipulation_errors": int,
    "observations": [_OBSERVATION],
    "attempts": [ATTEMPT],
    "timing": dict.fromkeys(TIMING, float | None),
    "digest": str,
    "versions": {str: str},
    "device": str,
}


def validate_summary(data: Any) -> None:
    """Raises InputError, naming the field, for data that is not a summary.json of schema "sum-drake/run/1".

    Fields that are not known are let through: a later version may add some.
    """
    check_shape(data, _SUMMARY, "summary")
    if data["schema"] != SCHEMA:
        raise InputError(f"summary.schema: {data['schema']!r}; expected {SCHEMA!r}")
    if data["outcome"] != "cleared" and not data["outcome"].startswith("stopped: "):
        raise InputError(f"summary.outcome: {data['outcome']!r}; expected 'cleared' or 'stopped: <reason>'")
    for i, row in enumerate(data["observations"]):
        where = f"summary.observations[{i}].false_detections"
        check_shape(row.get("false_detections", []), [_FALSE_DETECTION], where)
        for j, detection in enumerate(row.get("false_detections", [])):
            if detection["fate"] not in FATES:
                raise InputError(f"{where}[{j}].fate: {detection['fate']!r}; expected one of {', '.join(FATES)}")
        check_shape(row.get("gone", []), [_GONE], f"summary.observations[{i}].gone")
    check_shape(data.get("faults", []), [FAULT], "summary.faults")
    if data.get("limits") is not None:
        check_shape(data["limits"], LIMITS, "summary.limits")
        check_shape(data["limits"].get("violated_by", {}), {str: int}, "summary.limits.violated_by")
    for i, row in enumerate(data["attempts"]):
        believed = row.get("believed")
        check_shape({} if believed is None else believed, {str: float}, f"summary.attempts[{i}].believed")
        check_shape(row.get("why", ""), str, f"summary.attempts[{i}].why")
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
