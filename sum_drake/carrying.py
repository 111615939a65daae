"""The way on of an arm that was stopped while it carried something."""

from collections.abc import Sequence

import numpy as np

from sum_drake import timing
from sum_drake.geometry import inverse, shifted
from sum_drake.kinematics import Arm
from sum_drake.motion import NoPath, cartesian_path, plan_path
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import comes_clear, timed, unexplained
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene, solid_of, solids_of_points
from sum_drake.types import Array, Motion, Segment

HEIGHTS = (0.25, 0.2, 0.15, 0.1, 0.05)
"""How far the hand rises first, metres: as far as it can. What it met it did not know of, so that it stays above it."""
MORE_ROOM = 0.02
"""Kept from all that is believed, besides the usual paddings, metres: where the object hangs is not known."""


def plan_carrying_on(
    *,
    arm: Arm,
    scene: PlanningScene,
    plan: PickPlan,
    X_WO: Array,
    model: ObjectModel,
    q_now: Array,
    motion_id: int,
    seed: int,
    config: PickConfig,
    obstacles: Sequence[tuple[ObjectModel, Array]] = (),
    points_W: Array | None = None,
) -> Motion:
    """Up, around everything to where `plan` lets go, and on as planned.

    X_WO: (4, 4), where the object was taken from; q_now: (8,), at rest. Raises RuntimeError where there is no such way.
    """
    others = [solid_of(other, X) for other, X in obstacles]
    points = unexplained(np.empty((0, 3)) if points_W is None else points_W, others, config.explained)
    around = scene.with_solids((*others, *solids_of_points(points, size=config.point_size)))
    held = around.padded(
        furniture=config.furniture_padding, solids=config.solid_padding + MORE_ROOM, self_distance=config.self_padding
    )
    held = held.holding(solid_of(model, X_WO).hulls, inverse(plan.X_WG) @ X_WO).with_gap(plan.grasp.width)
    q_release = plan.place.segments[0].trajectory.positions[-1]
    X_WG = arm.forward(q_now)
    reason = "no straight way up"
    for height in HEIGHTS:
        for rise in cartesian_path(arm, X_WG, shifted(X_WG, np.array([0.0, 0.0, height])), q_now, count=2):
            if not comes_clear(held, rise):
                continue
            way = plan_path(held, rise[-1], q_release[None], seed=seed, budget=config.budget)
            if isinstance(way, NoPath):
                reason = f"{way.reason} {way.pairs}"
                continue
            segments = (
                Segment("lift", timing.time_curve(rise, speed=config.straight_speed), 0.0),
                Segment("transport", timed(held, way.qs, config.speed), 0.0),
                *plan.place.segments[1:],
            )
            return Motion(motion_id, segments, plan.place.load)
    raise RuntimeError(f"no free way on with what is in the hand: {reason}")
