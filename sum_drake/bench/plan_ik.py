"""How many poses of the hand that can be reached the inverse kinematics solves, and how long that takes."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from sum_drake import robot
from sum_drake.geometry import rotation_angle
from sum_drake.kinematics import CONTINUOUS, Arm
from sum_drake.types import Array, Immutable

POSITION, ANGLE = 1e-6, 1e-6
"""How far the hand may be from where it was to be, metres and radians."""
Row = dict[str, Any]
Progress = Callable[[str, int, int], None]


@dataclasses.dataclass(frozen=True)
class IkMeasured(Immutable):
    """What came of `measure_ik`."""

    poses: int
    success: float
    """Share of the poses with a solution, all of whose solutions are within limits and tolerances."""
    median_s: float
    """CPU seconds a pose, for all its solutions that differ (`Arm.solutions` as it is called by default)."""
    p95_s: float
    worst_position: float
    """Metres by which the worst of all solutions is off."""
    worst_angle: float
    """Radians."""
    median_solutions: float
    """Solutions that differ, a pose."""
    median_room: float
    """Radians between the first solution and the nearest joint limit (the torso's left out)."""
    median_room_drawn: float
    """The same of the positions that the poses were made from."""
    rows: tuple[Row, ...]
    """Poses without success, each with the positions that it was made from."""


def random_positions(count: int, rng: np.random.Generator) -> Array:
    """(count, 8), evenly from all that the joint limits allow, continuous joints from one turn."""
    lower, upper = robot.limits()
    return rng.uniform(np.where(CONTINUOUS, -np.pi, lower), np.where(CONTINUOUS, np.pi, upper), (count, 8))


def errors(arm: Arm, qs: Array, X_WG: Array) -> tuple[float, float]:
    """The worst of qs (n, 8) at putting the hand at X_WG (4, 4): metres and radians, 0 if n = 0."""
    X_WGs = arm.forward_many(qs)
    position = np.linalg.norm(X_WGs[:, :3, 3] - X_WG[:3, 3], axis=1)
    angle = rotation_angle(np.swapaxes(X_WGs[:, :3, :3], 1, 2) @ X_WG[:3, :3])
    return float(position.max(initial=0.0)), float(angle.max(initial=0.0))


def measure_ik(
    count: int, seed: int, progress: Progress = lambda what, done, total: None, *, arm: Arm | None = None
) -> IkMeasured:
    """Solves `count` poses that are reachable by construction: the hand's at random positions, as hard as they come.

    A function of count and seed, but for the seconds.
    """
    arm = arm or Arm()
    lower, upper = robot.limits()
    drawn = random_positions(count, np.random.default_rng(seed))
    arm.solutions(np.eye(4))  # compiles, or loads what was compiled
    seconds, worst, numbers, rooms, rows = np.empty(count), np.zeros(2), [], [], []
    for i, (q, X_WG) in enumerate(zip(drawn, arm.forward_many(drawn), strict=True)):
        if i % 1000 == 0:
            progress("ik", i, count)
        begun = time.process_time()
        qs = arm.solutions(X_WG)
        seconds[i] = time.process_time() - begun
        error = np.array(errors(arm, qs, X_WG))
        worst = np.maximum(worst, error)
        numbers.append(len(qs))
        rooms += [_room(qs[0])] if len(qs) else []
        if not len(qs) or (error > (POSITION, ANGLE)).any() or (qs < lower).any() or (qs > upper).any():
            rows.append({"table": "ik", "pose": i, "drawn": q.tolist(), "room": _room(q), "solutions": len(qs)})
    progress("ik", count, count)
    return IkMeasured(
        poses=count,
        success=1 - len(rows) / count,
        median_s=float(np.median(seconds)),
        p95_s=float(np.quantile(seconds, 0.95)),
        worst_position=float(worst[0]),
        worst_angle=float(worst[1]),
        median_solutions=float(np.median(numbers)),
        median_room=float(np.median(rooms)) if rooms else 0.0,
        median_room_drawn=float(np.median([_room(q) for q in drawn])),
        rows=tuple(rows),
    )


def _room(q: Array) -> float:
    """Radians between q (8,) and the nearest joint limit but for the torso's."""
    lower, upper = robot.limits()
    return float(np.minimum(q - lower, upper - q)[1:].min())
