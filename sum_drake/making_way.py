"""What to move so that something else can be taken: the blocker, and where to."""

from collections.abc import Sequence

import numpy as np

from sum_drake.explaining import in_the_way
from sum_drake.geometry import inverse
from sum_drake.types import Array, Attempt, Track

MOVE = "move"
"""The kind of an action that sets an object down elsewhere on the table, to make way or to be grasped anew."""
TO_PLACE = (
    "place_out_of_reach", "place_ik", "place_collision", "no_path_to_place", "no_path_home",
)  # fmt: skip
"""Reasons for which an object that can be grasped as it lies cannot be brought to where it belongs."""
LEAST = 0.05
"""Share of the rejected grasps of an object that something must be in the way of to be moved for it."""


def blockers(
    wanted: Track, believed: Sequence[Track], rejected_by: Sequence[tuple[str, int]]
) -> list[tuple[Track, int]]:
    """The believed objects that are in the way of an object's grasps, and of how many; the worst first."""
    others = [track for track in believed if track.id != wanted.id]
    labels = {track.label for track in others}
    least = LEAST * sum(count for _, count in rejected_by)
    return [
        (nearest(body.split("#")[0], wanted, others), count)
        for body, count in in_the_way(rejected_by).most_common()
        if body.split("#")[0] in labels and count >= least
    ]


def nearest(label: str, wanted: Track, believed: Sequence[Track]) -> Track:
    """The object of that label that is nearest to another one."""
    others = (track for track in believed if track.label == label and track.id != wanted.id)
    return min(others, key=lambda track: float(np.linalg.norm(track.X_WO[:3, 3] - wanted.X_WO[:3, 3])))


def moves(label: str, attempts: Sequence[Attempt]) -> list[Attempt]:
    """The moves of objects of a label that the arm set out for."""
    return [a for a in attempts if a.label == label and a.kind == MOVE and a.action is not None]


def been(label: str, attempts: Sequence[Attempt]) -> list[Array]:
    """(3,) each: where objects of a label were taken from when they were moved."""
    found = []
    for a in moves(label, attempts):
        if a.action is not None and a.X_OG is not None:
            found.append((a.action.X_WG_pick @ inverse(a.X_OG))[:3, 3])
    return found


def failed(label: str, attempts: Sequence[Attempt]) -> list[Attempt]:
    """The tries at objects of a label that count as such: all for which the arm set out, but for moves that worked."""
    set_out = [a for a in attempts if a.label == label and a.action is not None]
    return [a for a in set_out if a.kind != MOVE or a.reason != "executed"]


def worn_out(label: str, attempts: Sequence[Attempt], limit: int) -> bool:
    """Whether objects of a label were tried `limit` times since another was brought away, or twice as often in all.

    What went wrong beside a neighbour may work once that is gone.
    """
    gone = [i for i, a in enumerate(attempts) if a.label != label and a.action is not None and a.reason == "executed"]
    since = attempts[gone[-1] + 1 :] if gone else attempts
    return len(failed(label, since)) >= limit or len(failed(label, attempts)) >= 2 * limit
