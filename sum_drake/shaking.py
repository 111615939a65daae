"""The way of an arm that goes to get rid of what hangs on its opened hand."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from sum_drake import timing
from sum_drake.checked_scene import FINE
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.motion import NoPath, plan_path
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import opening, padded, timed, unexplained
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene, solid_of, solids_of_points
from sum_drake.robot import HAND
from sum_drake.types import Array, Motion, Segment, Trajectory, readonly

GAPS = (HAND.gap_max, HAND.gap_max / 2)
"""Between the fingers while the hand rolls, metres, the first and the second time: what hangs on a finger comes off an
open hand, what the opened fingers press against from within off one that is half closed."""
SHAKES = len(GAPS)
"""Times that it is tried."""
HEIGHTS = (0.1, 0.15, 0.05)
"""Of the hand over where it let go, metres: what hangs on it hangs lower than it was held."""
YAWS = np.arange(8) * np.pi / 4
"""Of the hand that points down, radians: the one that is soonest reached is taken."""
ROLL = 1.0
"""The wrist rolls so far to either side, radians: what slides around a finger slides down it, too."""
WEIGHING = 0.6
"""How long the arm rests over the place before it turns the hand, seconds."""
ON_WAY = 0.05
"""How far it may be from the way that it came by, radians and metres, to go back by it."""
DOWN = readonly([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""R_WG of a hand that points down."""


def plan_shaking(
    *,
    arm: Arm,
    scene: PlanningScene,
    plan: PickPlan,
    q_now: Array,
    motion_id: int,
    times: int,
    seed: int,
    config: PickConfig,
    obstacles: Sequence[tuple[ObjectModel, Array]] = (),
    points_W: Array | None = None,
) -> Motion:
    """From q_now (8,) over to where `plan` let go, the open hand turned down and rolled there, and back to the view.

    q_now is where the arm came to, or where it was stopped on its way. It goes as it came, backwards, since what hangs
    on the hand has hung on it all that way; `weigh` is a rest there, in which it can be felt whether it does still.
    times: how often that was tried before, less than SHAKES. Raises RuntimeError where there is no such way.
    """
    others = [solid_of(other, X) for other, X in obstacles]
    points = unexplained(np.empty((0, 3)) if points_W is None else points_W, others, config.explained)
    bare = scene.with_solids((*others, *solids_of_points(points, size=config.point_size)))
    came = plan.place.segments[-1]
    there, back = _ways(came.trajectory, q_now, config.speed)
    q_there = back.positions[0]
    around = padded(bare, config).with_gap(came.gap)
    wide = around.with_gap(HAND.gap_max)
    reason = "no way to hold the hand there"
    for height in HEIGHTS:
        p_WG = plan.X_WG_place[:3, 3] + np.array([0.0, 0.0, height])
        X_WGs = np.array([transform(rotation_from_vector(np.array([0.0, 0.0, yaw])) @ DOWN, p_WG) for yaw in YAWS])
        qs = np.concatenate(arm.solutions_many(X_WGs, near=q_there, count=4, thorough=False))
        qs = np.array([q for q in qs if around.is_free(q) and wide.path_free(_rolled(q), FINE)])
        if not len(qs):
            continue
        way = plan_path(around, q_there, qs, seed=seed, budget=config.budget)
        if isinstance(way, NoPath):
            reason = f"{way.reason} {way.pairs}"
            continue
        turning, q = timed(around, way.qs, config.speed), way.qs[-1]
        segments = (
            Segment("shake", there, came.gap),
            Segment("weigh", timing.rest(q_there, WEIGHING), came.gap),
            Segment("shake", turning, came.gap),
            Segment("shake", timing.time_path(_rolled(q), speed=config.speed), GAPS[times]),
            opening(q, came.gap, config),
            Segment("shake", timing.reverse(turning), came.gap),
            Segment("return", back, came.gap),
        )
        return Motion(motion_id, segments)
    raise RuntimeError(f"no free way to shake off what hangs on the hand: {reason}")


def _ways(came: Trajectory, q_now: Array, speed: float) -> tuple[Trajectory, Trajectory]:
    """Back along the way that the arm came by, from q_now (8,) on it; and that way again, whole.

    Give or take full turns of joints that turn without end.
    """
    on_way = timing.sample(came, 0.02)
    turned = nearest_turns(on_way, q_now)
    nearest = int(np.abs(turned - q_now).max(axis=1).argmin())
    if np.abs(turned[nearest] - q_now).max() > ON_WAY:
        raise RuntimeError("no free way to shake off what hangs on the hand: the arm is not where it came by")
    turns = turned[nearest] - on_way[nearest]
    back = dataclasses.replace(came, positions=readonly(came.positions + turns))
    if nearest == len(on_way) - 1:
        return timing.reverse(back), back
    return timing.time_curve(np.vstack([q_now, (on_way + turns)[nearest::-1]]), speed=speed), back


def _rolled(q: Array) -> Array:
    """(5, 8): the wrist to either side of q (8,), and back to it."""
    return np.asarray(q + np.outer([0.0, ROLL, -ROLL, ROLL, 0.0], np.eye(len(q))[-1]))
