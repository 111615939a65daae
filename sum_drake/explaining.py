"""Why grasps fell through, in words a person understands, and what was in their way."""

from collections import Counter
from collections.abc import Sequence

from sum_drake.types import Attempt

UNEXPLAINED = "unexplained"
"""Stands for depth points that nothing believed explains, where a body is named."""

CAUSES = {
    "approach_from_below": "from below",
    "table": "too near the table",
    "neighbour_finger": "with {} at a finger",
    "neighbour_palm": "with {} in the palm",
    "neighbour_approach": "with {} in the hand's way",
    "belief_too_wide": "hold for too little of the pose belief",
    "outranked": "not tried, as better ones hold or can be reached",
    "start_in_collision": "not tried, the arm touches {} where it stands",
    "out_of_reach": "out of the arm's reach",
    "ik": "within reach, but no way to hold the arm",
    "grasp_collision": "touch {}",
    "reach": "no straight way to it past {}",
    "lift": "no straight way up past {}",
    "place_out_of_reach": "could not be brought as far as the place",
    "place_ik": "no way to hold the arm at the place",
    "place_collision": "touch {} at the place",
    "no_place": "no free spot at the place",
    "no_path_to_pregrasp": "no path to it within the budget",
    "no_path_to_place": "no path to the place within the budget",
    "no_path_home": "no path home within the budget",
}
"""Words for each cause in `rejected_by`; {} stands for the body that is met, where one is named (CAUSE_BODY)."""

REASONS = {
    "executed": "done",
    "too_many_failures": "it was tried as often as allowed",
    "fell_off": "it lies beside the table",
    "not_seen": "it is believed to be there, but cannot be seen",
}
"""Words for some reasons of attempts; the others need none."""

ON_THE_WAY = ("neighbour_finger", "neighbour_palm", "neighbour_approach", "grasp_collision", "reach", "lift")
"""Causes that go away when the body that is met does."""


def parted(cause: str) -> tuple[str, str]:
    """A cause and the body it names, "" where it names none."""
    fits = [name for name in CAUSES if cause == name or ("{}" in CAUSES[name] and cause.startswith(f"{name}_"))]
    name = max(fits, key=len, default=cause)
    return name, cause[len(name) + 1 :]


def in_the_way(rejected_by: Sequence[tuple[str, int]]) -> Counter[str]:
    """Of each body, how many grasps it is in the way of."""
    found: Counter[str] = Counter()
    for cause, count in rejected_by:
        name, body = parted(cause)
        if body and name in ON_THE_WAY:
            found[body] += count
    return found


def explained(candidates: int, rejected_by: Sequence[tuple[str, int]]) -> str:
    """What became of an object's grasps: "812 grasps considered: 430 from below, 96 with tide at a finger, ..."."""
    parts = [
        f"{count} {_words(cause)}" for cause, count in sorted(rejected_by, key=lambda kv: (-kv[1], kv[0])) if count
    ]
    left = candidates - sum(count for _, count in rejected_by)
    if left > 0:
        parts.append(f"{left} hold")
    considered = f"{candidates} {'grasp' if candidates == 1 else 'grasps'} considered"
    return f"{considered}: {', '.join(parts)}" if parts else considered


def given_up(attempt: Attempt) -> str:
    """Why an attempt came to nothing before the arm set out."""
    reason = REASONS.get(attempt.reason, attempt.reason.replace("_", " "))
    if not attempt.grasp_candidates and not attempt.rejected_by:
        return reason
    return f"{reason}; {explained(attempt.grasp_candidates, attempt.rejected_by)}"


def _words(cause: str) -> str:
    name, body = parted(cause)
    words = CAUSES.get(name, name.replace("_", " "))
    return words.format({UNEXPLAINED: "something unexplained", "": "something"}.get(body, body.replace("_", " ")))
