"""What to do next: the sorting task over the belief, as data about goals and regions."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from sum_drake.carrying import plan_carrying_on
from sum_drake.existence import LIKELY
from sum_drake.geometry import apply, inverse, rotation_angle
from sum_drake.grasp_ranking import rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue, ObjectModel, sample_surface
from sum_drake.pick_config import PickConfig
from sum_drake.picking import PickPlan, plan_pick_place
from sum_drake.planning_scene import PlanningScene
from sum_drake.retreat import plan_retreat
from sum_drake.sensor import back_project
from sum_drake.types import LEAVE, Array, Attempt, Frame, Motion, Perception, Region, Track

POLICIES: dict[str, Callable[[Track], float]] = {
    "most_likely": lambda track: track.p_box * track.p_label * track.likelihood,
}
"""Which accepted object is tried first: the one with the largest value. most_likely: p(x) of eq. 3, as in the paper."""


SHOWN = 0.5
"""Share of the table that must be seen with depth before it counts as clear."""


@dataclasses.dataclass
class TaskConfig:
    """Choices of the task that are not geometry."""

    policy: str = "most_likely"
    """Which accepted object comes first, one of POLICIES."""
    max_attempts: int = 3
    """Tries at one label before it is left."""
    max_looks: int = 3
    """Observations in a row that lead to nothing before the run stops."""
    clear_points: int = 150
    """The table counts as clear with fewer depth pixels than this standing on it."""
    clear_height: float = 0.012
    """What stands less than this above the table is not seen as an object, metres."""
    max_obstacle_points: int = 3000
    """Depth points kept as obstacles."""
    fill_per_object: float = 0.05
    """How much higher the robot takes a region to be filled for each object it has let go there, metres."""
    fill_max: float = 0.16
    """The most it takes a region to be filled, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Pick:
    """Try this now."""

    plan: PickPlan
    track: Track
    region: str
    refused: tuple[Attempt, ...]
    """Likelier objects that could not be attempted, and why."""


@dataclasses.dataclass(frozen=True, eq=False)
class Look:
    """Nothing can be done with this belief; look again."""

    refused: tuple[Attempt, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Stop:
    """The run is over."""

    outcome: str
    """"cleared" or "stopped: <reason>"."""
    refused: tuple[Attempt, ...]


class SortingTask:
    """Decides after every observation; holds the robot's own model of itself, of the table and of the bins.

    regions: where things may go, by name; "table" is the workspace. goal: label or category -> region name or
    "leave"; a label's entry goes before its category's. seed: of every random draw in grasping and planning.
    """

    def __init__(
        self,
        *,
        catalogue: Catalogue,
        arm: Arm,
        scene: PlanningScene,
        regions: Mapping[str, Region],
        goal: Mapping[str, str],
        config: TaskConfig,
        grasp_config: GraspConfig,
        pick_config: PickConfig,
        seed: int,
    ) -> None:
        self._catalogue, self._arm, self._scene = catalogue, arm, scene
        self._regions, self._goal = dict(regions), dict(goal)
        self._config, self._grasp_config, self._pick_config = config, grasp_config, pick_config
        self._seed = seed

    def decide(self, perception: Perception, attempts: Sequence[Attempt], looks: int, q: Array) -> Pick | Look | Stop:
        """The next thing to do after an observation.

        attempts: everything tried before. looks: observations in a row that led to nothing. q: (8,) measured arm.
        """
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        refused: list[Attempt] = []
        believed = [track for track in perception.posterior.tracks if track.accepted]
        wanted = [track for track in believed if not self._is_in_place(track)]
        value = POLICIES[self._config.policy]
        for track in sorted(wanted, key=lambda t: (-value(t), t.id)):
            choice = self._try(track, perception, attempts, points_W, q)
            if isinstance(choice, Pick):
                return dataclasses.replace(choice, refused=tuple(refused))
            refused.append(choice)
        unexplained_W = points_W
        for track in believed:
            unexplained_W = _not_of(unexplained_W, self._catalogue[track.label], track.X_WO)
        shown = table_shown(perception.frame, self._regions["table"])
        unseen = [track for track in perception.posterior.tracks if track.seen < perception.step]
        hidden = [track.label for track in unseen if self._may_be_hidden(track, believed)]
        if not wanted and not hidden and shown >= SHOWN and len(unexplained_W) < self._config.clear_points:
            return Stop("cleared", ())
        if looks + 1 < self._config.max_looks:
            return Look(tuple(refused))
        if refused:
            reasons = ", ".join(f"{a.label} {a.reason}" for a in refused)
            return Stop(f"stopped: no object can be attempted ({reasons})", tuple(refused))
        if shown < SHOWN:
            return Stop(f"stopped: the camera shows depth of {100 * shown:.0f} % of the table", ())
        count = len(unexplained_W)
        if count >= self._config.clear_points:
            return Stop(f"stopped: {count} depth points stand on the table but no object is believed there", ())
        return Stop(f"stopped: {', '.join(hidden)} is believed to be there but cannot be seen", ())

    def _may_be_hidden(self, track: Track, believed: Sequence[Track]) -> bool:
        """Whether an object that was not detected, and is not accepted, may be there all the same."""
        rivals = any(track.label == other.label for other in believed)
        return not track.accepted and track.probability >= LIKELY and not rivals and not self._is_in_place(track)

    def _is_in_place(self, track: Track) -> bool:
        """Whether nothing needs to be done with an object: it is to be left alone, or lies where it belongs."""
        goal = region_of(track.label, self._goal, self._catalogue)
        return goal == LEAVE or self._regions[goal].holds(track.X_WO[:3, 3])

    def _try(
        self, track: Track, perception: Perception, attempts: Sequence[Attempt], points_W: Array, q: Array
    ) -> Pick | Attempt:
        """A plan for one object, or the attempt given up before anything moved."""
        region = region_of(track.label, self._goal, self._catalogue)
        step = perception.step

        def refusal(reason: str, candidates: int = 0, rejected_by: tuple[tuple[str, int], ...] = ()) -> Attempt:
            return Attempt(step, track.id, track.label, region, "none", reason, candidates, rejected_by, None)

        tried = [a for a in attempts if a.label == track.label and a.action is not None]
        if len(tried) >= self._config.max_attempts:
            return refusal("too_many_failures")
        model = self._catalogue[track.label]
        candidates = [
            grasp
            for grasp in grasp_candidates(model, config=self._grasp_config, seed=self._seed)
            if not any(a.X_OG is not None and _same_grasp(grasp.X_OG, a.X_OG) for a in tried)
        ]
        others = [t for t in perception.posterior.tracks if t.accepted and t.id != track.id]
        obstacles_W = thin(_not_of(points_W, model, track.X_WO), self._config.max_obstacle_points)
        ranked = rank_grasps(
            candidates,
            model=model,
            X_WO=track.X_WO,
            belief=track.belief,
            points_W=obstacles_W,
            table_height=self._regions["table"].floor_height,
            config=self._grasp_config,
        )
        plan = plan_pick_place(
            arm=self._arm,
            scene=self._scene,
            ranked=ranked,
            X_WO=track.X_WO,
            model=model,
            region=self._regions[region],
            q_now=q,
            obstacles=[(self._catalogue[t.label], t.X_WO) for t in others],
            points_W=obstacles_W,
            seed=int(np.random.SeedSequence([self._seed, track.id, step]).generate_state(1)[0]),
            config=self._pick_config,
            fill=self._fill(region, attempts),
        )
        if isinstance(plan, PickPlan):
            return Pick(plan, track, region, ())
        return refusal(plan.reason, plan.grasp_candidates, plan.rejected_by)

    def _fill(self, region: str, attempts: Sequence[Attempt]) -> float:
        """How high the region must be taken to be filled: nobody looks into the bins."""
        placed = sum(a.action is not None and a.action.released and a.region == region for a in attempts)
        return min(placed * self._config.fill_per_object, self._config.fill_max)

    def retreat(self, perception: Perception, q: Array, motion: int) -> Motion:
        """From where the arm is, (8,), back to the viewing pose with an open hand, under the given motion id.

        Goes around what was last seen. What was pushed about since then may be anywhere, the hand itself may stand
        where something was: where that leaves no way, only table, bins and robot count. Raises RuntimeError where even
        then there is none.
        """
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        seen = [(self._catalogue[t.label], t.X_WO) for t in perception.posterior.tracks if t.accepted]
        plan = functools.partial(
            plan_retreat,
            arm=self._arm,
            scene=self._scene,
            q_now=q,
            motion_id=motion,
            seed=int(np.random.SeedSequence([self._seed, motion]).generate_state(1)[0]),
            config=self._pick_config,
        )
        try:
            return plan(obstacles=seen, points_W=thin(points_W, self._config.max_obstacle_points))
        except RuntimeError:
            return plan()

    def carry_on(self, perception: Perception, pick: Pick, q: Array, motion: int) -> Motion:
        """From where the arm was stopped, (8,), with the object of `pick` in its hand, to where it is let go.

        Raises RuntimeError where there is no free way.
        """
        model = self._catalogue[pick.track.label]
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        points_W = _not_of(points_W, model, pick.track.X_WO)
        others = [t for t in perception.posterior.tracks if t.accepted and t.id != pick.track.id]
        return plan_carrying_on(
            arm=self._arm,
            scene=self._scene,
            plan=pick.plan,
            X_WO=pick.track.X_WO,
            model=model,
            q_now=q,
            motion_id=motion,
            seed=int(np.random.SeedSequence([self._seed, motion]).generate_state(1)[0]),
            config=self._pick_config,
            obstacles=[(self._catalogue[t.label], t.X_WO) for t in others],
            points_W=thin(points_W, self._config.max_obstacle_points),
        )


def region_of(label: str, goal: Mapping[str, str], catalogue: Catalogue) -> str:
    """Name of the region a label belongs in: by label, else by category, "leave" where the goal has neither."""
    return goal.get(label, goal.get(catalogue[label].category, LEAVE))


def standing_points(frame: Frame, table: Region, height: float) -> Array:
    """Depth points in W (n, 3) that stand more than `height` above the table, over its area."""
    p_CQ = back_project(frame.depth, frame.camera).reshape(-1, 3)
    p_WQ = apply(frame.X_WC, p_CQ[frame.depth.reshape(-1) > 0])
    over = np.all(np.abs(p_WQ[:, :2] - table.p_W[:2]) < table.half_extents[:2], axis=1)
    between = (p_WQ[:, 2] > table.floor_height + height) & (p_WQ[:, 2] < table.rim_height)
    return np.asarray(p_WQ[over & between])


def table_shown(frame: Frame, table: Region) -> float:
    """Share of the table's top, as far as it lies in the picture, at which there is depth; 0 where none of it does."""
    x, y = np.meshgrid(*(np.linspace(-0.95, 0.95, 24),) * 2)
    spots = np.stack([x, y, np.full_like(x, -1.0)], -1).reshape(-1, 3)
    p_CQ = apply(inverse(frame.X_WC), table.p_W + table.half_extents * spots)
    camera = frame.camera
    z = np.maximum(p_CQ[:, 2], 1e-6)
    u = np.round(camera.fx * p_CQ[:, 0] / z + camera.cx).astype(int)
    v = np.round(camera.fy * p_CQ[:, 1] / z + camera.cy).astype(int)
    inside = (p_CQ[:, 2] > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return float(np.mean(frame.depth[v[inside], u[inside]] > 0)) if inside.any() else 0.0


def thin(points: Array, count: int) -> Array:
    """At most `count` of the points, evenly picked."""
    return points[:: max(1, -(-len(points) // count))]


def _not_of(points_W: Array, model: ObjectModel, X_WO: Array) -> Array:
    """The points that are not explained by the object at that pose, by 12 mm: pose error and sensor noise together."""
    surface, _ = sample_surface(model, 3000, np.random.default_rng(0))
    distance, _ = cKDTree(surface).query(apply(inverse(X_WO), points_W))
    return np.asarray(points_W[distance > 0.012])


def _same_grasp(X_OG: Array, X_OF: Array) -> bool:
    """Whether two grasps are so alike that if one slipped the other will."""
    near = np.linalg.norm(X_OG[:3, 3] - X_OF[:3, 3]) < 0.015
    return bool(near and rotation_angle(X_OG[:3, :3].T @ X_OF[:3, :3]) < np.radians(25))
