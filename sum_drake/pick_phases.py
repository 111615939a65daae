"""What picks, places and retreats share: the scene as each phase of the motion sees it, and two kinds of segment."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from sum_drake import timing
from sum_drake.checked_scene import FINE
from sum_drake.geometry import apply, inverse
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import PlanningScene, Solid, solids_of_points
from sum_drake.playback import GAP_SPEED
from sum_drake.types import Array, Segment, Trajectory


@dataclasses.dataclass(frozen=True, eq=False)
class PhaseScenes:
    """One scene, as it is seen in the phases of the motion."""

    around: PlanningScene
    """Everything, at the distances of a motion around things."""
    close: PlanningScene
    """Near the grasp: without the object, without points, close to table and neighbours."""
    cleared: PlanningScene
    """`around` without the object: once it has been let go, or is in the hand."""
    config: PickConfig

    def moved(self, target: Solid) -> PlanningScene:
        """`around` with the object where it has been set down."""
        return padded(self.around.with_solids((target, *self.around.solids[1:])), self.config)

    @staticmethod
    def make(
        scene: PlanningScene, target: Solid, others: Sequence[Solid], points: Array, config: PickConfig
    ) -> "PhaseScenes":
        loose = solids_of_points(unexplained(points, others, config.explained), size=config.point_size)
        # The object and the points come first, so that no other solid of the same name is meant by theirs.
        full = scene.with_solids((target, *loose, *others))
        around = padded(full, config)
        near = full.padded(furniture=config.reach_padding, solids=0.0, self_distance=config.self_padding)
        close = near.ignoring(*full.names[: 1 + len(loose)])
        return PhaseScenes(around, close, around.ignoring(full.names[0]), config)


def padded(scene: PlanningScene, config: PickConfig) -> PlanningScene:
    return scene.padded(
        furniture=config.furniture_padding, solids=config.solid_padding, self_distance=config.self_padding
    )


def opening(q: Array, gap: float, config: PickConfig) -> Segment:
    """Opens a closed hand to `gap` with the arm at rest at q (8,)."""
    return Segment("open", timing.rest(q, gap / GAP_SPEED + config.open_time), gap)


def timed(scene: PlanningScene, qs: Array, speed: float) -> Trajectory:
    """A free polyline as a trajectory, whose corners are rounded where that is free as well."""
    return timing.time_path(qs, is_free=lambda corner: scene.path_free(corner, FINE), speed=speed)


def unexplained(points_W: Array, solids: Sequence[Solid], distance: float) -> Array:
    """The points (n, 3) that lie further than `distance` from every hull."""
    loose = np.ones(len(points_W), dtype=bool)
    for solid in solids:
        p_SQ = apply(inverse(solid.X_WS), points_W)
        for hull in solid.hulls:
            faces = ConvexHull(hull).equations  # (f, 4): outward normal and offset
            loose &= (p_SQ @ faces[:, :3].T + faces[:, 3]).max(1) > distance
    return points_W[loose]
