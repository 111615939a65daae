"""The way back of an arm whose pick has failed."""

from collections.abc import Sequence

import numpy as np

from sum_drake import timing
from sum_drake.geometry import shifted
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.motion import NoPath, cartesian_path, plan_path
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import comes_clear, opening, padded, timed, unexplained
from sum_drake.planning_scene import PlanningScene, solid_of, solids_of_points
from sum_drake.robot import HAND, VIEW
from sum_drake.types import Array, Motion, Segment

GAPS = (HAND.gap_max, 0.08, 0.06, 0.045)
"""Distances between the fingers that the hand may open to."""
RISE = 0.4
"""How far the hand rises at most, metres."""


def plan_retreat(
    *,
    arm: Arm,
    scene: PlanningScene,
    q_now: Array,
    motion_id: int = 0,
    seed: int,
    config: PickConfig,
    obstacles: Sequence[tuple[ObjectModel, Array]] = (),
    points_W: Array | None = None,
) -> Motion:
    """From wherever the arm is (8,), after a failed pick: opens the hand, rises straight, returns to the viewing pose.

    Opens as far as there is room between what is believed, all the way where there is none at all; rises as far as it
    can, at most by RISE, away from what the hand touches where it is. Raises RuntimeError where there is no free way
    back.
    """
    others = [solid_of(other, X) for other, X in obstacles]
    points = unexplained(np.empty((0, 3)) if points_W is None else points_W, others, config.explained)
    bare = scene.with_solids((*others, *solids_of_points(points, size=config.point_size)))
    gap = next((gap for gap in GAPS if bare.with_gap(gap).is_free(q_now)), HAND.gap_max)
    bare = bare.with_gap(gap)
    around = padded(bare, config)
    rise = rising(arm, around, q_now)
    home = nearest_turns(VIEW, rise[-1])
    # A hand that has failed may stand closer to things than a plan would bring it: then without padding.
    free = around if around.is_free(rise[-1]) else bare
    path = plan_path(free, rise[-1], home[None], seed=seed, budget=4 * config.budget)
    if isinstance(path, NoPath):
        raise RuntimeError(f"no free way back to the viewing pose: {path.reason} {path.pairs}")
    segments = [opening(q_now, gap, config)]
    if len(rise) > 1:
        segments.append(Segment("retreat", timing.time_curve(rise, speed=config.straight_speed), gap))
    segments.append(Segment("return", timed(free, path.qs, config.speed), gap))
    return Motion(motion_id, tuple(segments))


def rising(arm: Arm, around: PlanningScene, q_now: Array, most: float = RISE) -> Array:
    """(k, 8): straight up from q_now (8,), as far as the hand can, at most metres, away from what it touches there."""
    X_WG = arm.forward(q_now)
    for height in np.arange(most, 0.0, -0.05):
        for path in cartesian_path(arm, X_WG, shifted(X_WG, np.array([0, 0, height])), q_now):
            if comes_clear(around, path):
                return np.asarray(path)
    return np.array([q_now])
