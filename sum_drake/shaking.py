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
from sum_drake.retreat import rising
from sum_drake.robot import HAND, VIEW
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
OVER = 0.1
"""How far to the side of the place the hand may be for what it shakes off to fall there, metres."""
RISE = 0.35
"""How far the hand rises at most where something was met as it turned, metres: what hangs on it is as long."""
NO_WAY = "no free way to shake off what hangs on the hand"
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
    Where it was stopped as it turned the hand over the place, what hangs there has met something, a wall of the bin
    mostly: it rises straight, and turns the hand where it comes to.
    times: how often that was tried before, less than SHAKES. Raises RuntimeError where there is no such way.
    """
    others = [solid_of(other, X) for other, X in obstacles]
    points = unexplained(np.empty((0, 3)) if points_W is None else points_W, others, config.explained)
    bare = scene.with_solids((*others, *solids_of_points(points, size=config.point_size)))
    came = plan.place.segments[-1]
    around = padded(bare, config).with_gap(came.gap)
    wide = around.with_gap(HAND.gap_max)
    p_WG, gaps = plan.X_WG_place[:3, 3], GAPS[times : times + 1]
    heights: Sequence[float] = HEIGHTS
    ways = _ways(came.trajectory, q_now, config.speed)
    if ways is None:
        p_WG_now = arm.forward(q_now)[:3, 3]
        if np.linalg.norm((p_WG_now - p_WG)[:2]) > OVER:
            raise RuntimeError(f"{NO_WAY}: the arm is neither where it came by nor over the place")
        rise = rising(arm, around, q_now, RISE)
        # Which of them it got to before is not known here.
        heights, gaps = [arm.forward(rise[-1])[2, 3] - p_WG[2]], GAPS
        ways = _up_and_home(around, rise, seed, config)
    there, back = ways
    q_there = there.positions[-1]
    reason = "no way to hold the hand there"
    for height in heights:
        at = p_WG + np.array([0.0, 0.0, height])
        X_WGs = np.array([transform(rotation_from_vector(np.array([0.0, 0.0, yaw])) @ DOWN, at) for yaw in YAWS])
        qs = np.concatenate(arm.solutions_many(X_WGs, near=q_there, count=4, thorough=False))
        qs = np.array([q for q in qs if around.is_free(q) and wide.path_free(_rolled(q), FINE)])
        if not len(qs):
            continue
        way = plan_path(around, q_there, qs, seed=seed, budget=config.budget)
        if isinstance(way, NoPath):
            reason = f"{way.reason} {way.pairs}"
            continue
        turning, q = timed(around, way.qs, config.speed), way.qs[-1]
        rolling = timing.time_path(_rolled(q), speed=config.speed)
        segments = (
            Segment("shake", there, came.gap),
            Segment("weigh", timing.rest(q_there, WEIGHING), came.gap),
            Segment("shake", turning, came.gap),
            *(Segment("shake", rolling, gap) for gap in gaps),
            opening(q, came.gap, config),
            Segment("shake", timing.reverse(turning), came.gap),
            Segment("return", back, came.gap),
        )
        return Motion(motion_id, segments)
    raise RuntimeError(f"{NO_WAY}: {reason}")


def _up_and_home(around: PlanningScene, rise: Array, seed: int, config: PickConfig) -> tuple[Trajectory, Trajectory]:
    """Along rise (k, 8), and from where that ends to the viewing pose."""
    up = timing.time_curve(rise, speed=config.straight_speed) if len(rise) > 1 else timing.rest(rise[0], 0.0)
    home = plan_path(around, rise[-1], nearest_turns(VIEW, rise[-1])[None], seed=seed, budget=config.budget)
    if isinstance(home, NoPath):
        raise RuntimeError(f"{NO_WAY}, and to come back: {home.reason} {home.pairs}")
    return up, timed(around, home.qs, config.speed)


def _ways(came: Trajectory, q_now: Array, speed: float) -> tuple[Trajectory, Trajectory] | None:
    """Back along the way that the arm came by, from q_now (8,) on it; and that way again, whole; None: it is not on it.

    Give or take full turns of joints that turn without end.
    """
    on_way = timing.sample(came, 0.02)
    turned = nearest_turns(on_way, q_now)
    nearest = int(np.abs(turned - q_now).max(axis=1).argmin())
    if np.abs(turned[nearest] - q_now).max() > ON_WAY:
        return None
    turns = turned[nearest] - on_way[nearest]
    back = dataclasses.replace(came, positions=readonly(came.positions + turns))
    if nearest == len(on_way) - 1:
        return timing.reverse(back), back
    return timing.time_curve(np.vstack([q_now, (on_way + turns)[nearest::-1]]), speed=speed), back


def _rolled(q: Array) -> Array:
    """(5, 8): the wrist to either side of q (8,), and back to it."""
    return np.asarray(q + np.outer([0.0, ROLL, -ROLL, ROLL, 0.0], np.eye(len(q))[-1]))
