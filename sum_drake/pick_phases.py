"""What picks, places and retreats share: the scene as each phase of the motion sees it, and two kinds of segment."""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import ConvexHull

from sum_drake import timing
from sum_drake.checked_scene import FINE
from sum_drake.explaining import UNEXPLAINED
from sum_drake.geometry import apply, inverse, shifted
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import PlanningScene, Solid, solids_of_points
from sum_drake.playback import GAP_SPEED
from sum_drake.types import Array, Segment, Trajectory

REASONS = (
    "no_grasp", "start_in_collision", "out_of_reach", "ik", "grasp_collision", "reach", "lift", "no_place",
    "place_out_of_reach", "place_ik", "place_collision", "no_path_to_pregrasp", "no_path_to_place", "no_path_home",
)  # fmt: skip
"""Why nothing can be done, and, but for the first two, how far a grasp got, in the order of the tests:

no_grasp: no candidate came out of the ranking; start_in_collision: the arm, where it is, touches something;
out_of_reach: the arm is too short; ik: it is not, but cannot put the hand there; grasp_collision: something other than
the object is in the way at the grasp; reach: no straight free way from short of the grasp to it; lift: no straight free
way up; no_place: no spot of the table's region is free; place_out_of_reach, place_ik, place_collision: the arm cannot
hold the object over the region, or something is in the way; no_path_to_pregrasp, no_path_to_place, no_path_home: the
search for a free path was given up. start_in_collision, grasp_collision, reach, lift and place_collision are counted as
CAUSE_BODY, the body that is met, where there is one.
"""


DEEPER = {"": 0.002, UNEXPLAINED: 0.015}
"""How much deeper than before a motion may lead into a solid that it leads out of: by its name, metres.

Points that nothing explains are covered by boxes of that size, and may be of the very object that is lifted.
"""
DENSE = 0.03
"""Radians between the configurations in which that is looked at."""


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
    drags: bool = False
    """Whether lifting the object may take along what lies or leans on it."""

    def lifts(self, held: PlanningScene, path: Array) -> bool:
        """Whether the object in the hand, in the scene `held`, comes clear on its way up, path (k, 8)."""
        return comes_clear(held, path, drags=self.drags)

    def moved(self, target: Solid) -> PlanningScene:
        """`around` with the object where it has been set down."""
        return padded(self.around.with_solids((target, *self.around.solids[1:])), self.config)

    @staticmethod
    def make(
        scene: PlanningScene,
        target: Solid,
        others: Sequence[Solid],
        points: Array,
        config: PickConfig,
        *,
        drags: bool = False,
    ) -> "Iterator[PhaseScenes]":
        """One for each of `config.neighbour_paddings`."""
        loose = solids_of_points(unexplained(points, others, config.explained), size=config.point_size)
        # The object and the points come first, so that no other solid of the same name is meant by theirs.
        full = scene.with_solids((target, *loose, *others))
        around = padded(full, config)
        cleared = around.ignoring(full.names[0])
        for padding in config.neighbour_paddings:
            near = full.padded(furniture=config.reach_padding, solids=padding, self_distance=config.self_padding)
            yield PhaseScenes(around, near.ignoring(*full.names[: 1 + len(loose)]), cleared, config, drags)


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


@dataclasses.dataclass(frozen=True, eq=False)
class PickWay:
    """Joint paths of one way to pick."""

    X_WG: Array
    reach: Array
    """(k, 8) from short of the grasp to it."""
    lift: Array
    """(k, 8) from the grasp upwards."""
    held: PlanningScene
    """With the object in the hand."""


class GivenUp(Exception):
    """A grasp fell through: `stage` is one of REASONS, `cause` what it is counted as."""

    def __init__(self, stage: str, cause: str | None = None) -> None:
        super().__init__(stage)
        self.stage, self.cause = stage, cause or stage


def met(scene: PlanningScene, qs: Array) -> str:
    """_BODY, of what is touched deepest in the first of qs (n, 8) that touches anything; "" where none does."""
    depths = next((depths for depths in map(scene.depths, qs) if depths), ())
    return f"_{depths[0][1]}" if depths else ""


def comes_clear(scene: PlanningScene, path: Array, *, drags: bool = False) -> bool:
    """Whether path (k, 8), at whose start things may touch, leads away from them, and is free from there on.

    It may go no deeper into any solid, by more than DEEPER, than it was before, and from the first configuration in
    which nothing touches it is free. Furniture may be touched until then: what lay on the table leaves it. With
    `drags`, solids may be gone through until then, too.
    """
    steps = np.ceil(np.abs(np.diff(path, axis=0)).max(1) / DENSE).astype(int).clip(1)
    dense = np.concatenate(
        [*(np.linspace(a, b, n, endpoint=False) for a, b, n in zip(path[:-1], path[1:], steps, strict=True)), path[-1:]]
    )
    free = scene.free_many(dense)
    if not free[-1] or not scene.path_free(dense[free.argmax() :], FINE):
        return False
    if free[0] or drags:
        return True
    slack = {name: DEEPER.get(name, DEEPER[""]) for name in scene.names}
    away = -max(scene.checker.GetLargestPadding(), 0.0)  # what is farther off is not told
    least = dict.fromkeys(scene.names, np.inf)
    for q in dense[: free.argmax()]:
        depths = {body: depth for _, body, depth in reversed(scene.depths(q)) if body in slack}
        if any(depth > least[body] + slack[body] for body, depth in depths.items()):
            return False
        least = {body: min(least[body], depths.get(body, away)) for body in least}
    return True


def first_free(along: PlanningScene, paths: Array, at_end: PlanningScene) -> Array | None:
    """The first of paths (n, k, 8) that is free on its way and, in another scene, at its end."""
    return next((path for path in paths if at_end.is_free(path[-1]) and along.path_free(path, 0.01)), None)


def along_x(distance: float) -> Array:
    return shifted(np.eye(4), np.array([distance, 0.0, 0.0]))
