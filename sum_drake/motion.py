"""Collision-free paths of the arm: Drake answers what is free, OMPL searches, every path is checked densely at the end.

A `PlanningScene` is a value: believed objects, a held object and paddings are added by making another scene.
"""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from pydrake.geometry import Convex
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import ModelDirective, ModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from sum_drake import robot
from sum_drake.assets import InputError, asset, one_line
from sum_drake.kinematics import Arm
from sum_drake.objects import ObjectModel
from sum_drake.parsing import add_packages, parser_allowed
from sum_drake.types import Array, Immutable, readonly

SORTING = "package://sum_drake/scenes/sorting.dmd.yaml"
FINE = 0.005
"""Radians (and metres) between the configurations that a finished path is checked at."""
_ROBOT = "fetch"
_HAND = "gripper_link"
_SCALE = 1.0 / robot.velocity_limits()
"""OMPL searches in seconds: each joint divided by its speed limit."""


@dataclasses.dataclass(frozen=True, eq=False)
class Solid(Immutable):
    """Something rigid, as the union of convex hulls in its own frame, and where it stands."""

    name: str
    hulls: tuple[Array, ...]
    """(n, 3) points each, n >= 4 and not flat."""
    X_WS: Array
    """(4, 4)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "hulls", tuple(readonly(hull) for hull in self.hulls))
        object.__setattr__(self, "X_WS", readonly(self.X_WS))


def solid_of(model: ObjectModel, X_WO: Array, name: str | None = None) -> Solid:
    """The collision pieces of an object at X_WO (4, 4); the convex hull of its mesh where it has none."""
    return Solid(name or model.label, _hulls(model), X_WO)


@functools.lru_cache(maxsize=256)
def _hulls(model: ObjectModel) -> tuple[Array, ...]:
    return tuple(np.asarray(mesh.convex_hull.vertices, dtype=float) for mesh in model.load_collision())


def solids_of_points(points_W: Array, *, size: float = 0.02, name: str = "unexplained") -> tuple[Solid, ...]:
    """Boxes that cover points (m, 3) nothing explains, on a grid of `size` metres; neighbours are merged into one.

    One solid, or none where there are no points.
    """
    boxes = {
        tuple(cell): np.array([cell, cell + 1]) for cell in np.unique(np.floor(points_W / size).astype(int), axis=0)
    }
    for axis in (2, 0, 1):  # runs along z, then runs of equal runs along x, then y
        merged: dict[tuple[int, ...], Array] = {}
        others = [a for a in range(3) if a != axis]
        last: dict[tuple[int, ...], Array] = {}
        for _, box in sorted(boxes.items(), key=lambda item: (item[0][axis], item[0])):
            key = tuple(int(v) for v in box[:, others].ravel())
            before = last.get(key)
            if before is not None and before[1, axis] == box[0, axis]:
                before[1, axis] = box[1, axis]
            else:
                last[key] = merged[tuple(int(v) for v in box[0])] = box
        boxes = merged
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    hulls = tuple(size * np.where(corners, box[1], box[0]) for box in boxes.values())
    return (Solid(name, hulls, np.eye(4)),) if hulls else ()


@dataclasses.dataclass(frozen=True, eq=False)
class PlanningScene:
    """The robot among what stands still: the scene's furniture, believed objects, and what the hand holds.

    Every q is (8,), ARM_JOINTS. Head at VIEW_HEAD, fingers `gap` apart.
    """

    directives: str | Sequence[ModelDirective] = SORTING
    """The furniture and a model named "fetch": a path, a package://sum_drake URI, or directives as Drake reads them."""
    solids: tuple[Solid, ...] = ()
    gap: float = robot.HAND.gap_max
    checker: SceneGraphCollisionChecker = None
    """Made from the rest, in about .3 CPU seconds; scenes derived from this one share or clone it."""

    def __post_init__(self) -> None:
        """Raises InputError where the directives cannot be loaded."""
        if self.checker is None:
            object.__setattr__(self, "checker", _make_checker(self.directives, self.solids, self.names))

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Of the solids, in order; those of equal name are numbered: tide, tide#2."""
        given = [solid.name for solid in self.solids]
        counts = [given[: i + 1].count(name) for i, name in enumerate(given)]
        return tuple(f"{name}#{count}" if count > 1 else name for name, count in zip(given, counts, strict=True))

    def with_solids(self, solids: Sequence[Solid]) -> "PlanningScene":
        """The same furniture with these solids, nothing held, no padding."""
        return PlanningScene(self.directives, tuple(solids), self.gap)

    def with_gap(self, gap: float) -> "PlanningScene":
        """The same scene with the fingers `gap` metres apart."""
        return dataclasses.replace(self, gap=gap)

    def padded(self, *, furniture: float, solids: float, self_distance: float = 0.0) -> "PlanningScene":
        """The same scene where the robot must keep these distances (metres) from furniture, solids and itself."""
        checker = self.checker.Clone()
        checker.SetPaddingAllRobotEnvironmentPairs(furniture)
        checker.SetPaddingAllRobotRobotPairs(self_distance)
        for name in self.names:
            for link in self._links(checker):
                checker.SetPaddingBetween(self._body(name), link, solids)
        return dataclasses.replace(self, checker=checker)

    def ignoring(self, *names: str) -> "PlanningScene":
        """The same scene without some of its solids."""
        checker = self.checker.Clone()
        for name, link in itertools.product(names, self._links(checker)):
            checker.SetCollisionFilteredBetween(self._body(name), link, True)
        return dataclasses.replace(self, checker=checker)

    def holding(self, hulls: Sequence[Array], X_GO: Array) -> "PlanningScene":
        """The same scene with convex hulls (n, 3), given in O, fixed to the hand at X_GO; they may touch the hand."""
        checker = self.checker.Clone()
        frame = checker.plant().GetFrameByName(_HAND)
        for hull in hulls:
            shape = Convex(points=hull.T, label="held")
            checker.AddCollisionShapeToFrame("held", frame, shape, RigidTransform(X_GO))
        return dataclasses.replace(self, checker=checker)

    def is_free(self, q: Array) -> bool:
        """Whether nothing touches, or comes closer than the padding, at q."""
        return bool(self.checker.CheckConfigCollisionFree(self._full(q)))

    def free_many(self, qs: Array) -> Array:
        """`is_free` of qs (n, 8), (n,)."""
        return np.array(self.checker.CheckConfigsCollisionFree(list(self._full(qs)), parallelize=False), dtype=bool)

    def edge_free(self, q0: Array, q1: Array, step: float = FINE) -> bool:
        """Whether the straight line from q0 to q1 is free, checked where no joint has moved by more than `step`."""
        count = int(np.ceil(np.abs(q1 - q0).max() / step)) + 1
        return bool(self.free_many(np.linspace(q0, q1, max(count, 2))).all())

    def path_free(self, qs: Array, step: float = FINE) -> bool:
        """Whether the polyline qs (k, 8) is free, checked as `edge_free` does."""
        return all(self.edge_free(q0, q1, step) for q0, q1 in itertools.pairwise(qs))

    def colliding_pairs(self, q: Array) -> tuple[tuple[str, str], ...]:
        """Names of the bodies that touch, or come closer than the padding, at q: the robot's link first."""
        checker, plant = self.checker, self.checker.plant()
        clearance = checker.CalcRobotClearance(self._full(q), max(checker.GetLargestPadding(), 0.0) + 1e-6)
        pairs = {
            (plant.get_body(a).name(), plant.get_body(b).name()): None
            for a, b, distance in zip(
                clearance.robot_indices(), clearance.other_indices(), clearance.distances(), strict=True
            )
            # Drake has taken the padding off the distances.
            if distance <= 0
        }
        return tuple(sorted(pairs))

    @staticmethod
    def _links(checker: SceneGraphCollisionChecker) -> list[BodyIndex]:
        indices = map(BodyIndex, range(checker.plant().num_bodies()))
        return [index for index in indices if checker.IsPartOfRobot(index)]

    def _body(self, name: str) -> BodyIndex:
        plant = self.checker.plant()
        return plant.GetBodyByName(name, plant.GetModelInstanceByName(f"solid::{name}")).index()

    @functools.cached_property
    def _order(self) -> Array:
        plant = self.checker.plant()
        return np.array([plant.GetJointByName(joint.name).position_start() for joint in robot.JOINTS])

    def _full(self, qs: Array) -> Array:
        """Positions of the whole plant (..., 12) for qs (..., 8)."""
        full = np.empty((*np.shape(qs)[:-1], len(robot.JOINTS)))
        full[..., self._order[:8]] = qs
        full[..., self._order[8:10]] = robot.VIEW_HEAD
        full[..., self._order[10:]] = self.gap / 2
        return full


def _make_checker(
    directives: str | Sequence[ModelDirective], solids: Sequence[Solid], names: Sequence[str]
) -> SceneGraphCollisionChecker:
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    add_packages(builder.parser())
    try:
        if isinstance(directives, str):
            builder.parser().AddModels(str(asset(directives)))
        else:
            ProcessModelDirectives(ModelDirectives(directives=list(directives)), builder.parser())
        fetch = builder.plant().GetModelInstanceByName(_ROBOT)
    except RuntimeError as error:
        where = directives if isinstance(directives, str) else "directives"
        raise InputError(f"{where}: {one_line(error)}: expected model directives with a model '{_ROBOT}'") from error
    plant = builder.plant()
    for solid, name in zip(solids, names, strict=True):
        instance = plant.AddModelInstance(f"solid::{name}")
        body = plant.AddRigidBody(name, instance, SpatialInertia.NaN())
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(solid.X_WS))
        for i, hull in enumerate(solid.hulls):
            shape = Convex(points=hull.T, label=name)
            plant.RegisterCollisionGeometry(body, RigidTransform(), shape, f"{i}", CoulombFriction(1.0, 1.0))
    return SceneGraphCollisionChecker(
        model=builder.Build(), robot_model_instances=[fetch], edge_step_size=FINE, implicit_context_parallelism=False
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Path(Immutable):
    """A free polyline in joint space."""

    qs: Array
    """(k, 8)."""
    goal: int
    """Index of the goal it ends at."""
    checks: int
    """Edges checked on the way: the cost, without a clock."""


@dataclasses.dataclass(frozen=True)
class NoPath(Immutable):
    """Why there is no path."""

    reason: str
    """start_in_collision, goal_in_collision, budget (used up)."""
    pairs: tuple[tuple[str, str], ...] = ()
    """What touches what, where something does."""
    checks: int = 0


def plan_path(
    scene: PlanningScene, q_start: Array, q_goals: Array, *, seed: int, budget: int = 4000, step: float = 0.04
) -> Path | NoPath:
    """A short free path from q_start (8,) to one of q_goals (n, 8), or why there is none.

    RRT-Connect (Kuffner and LaValle 2000) checks edges every `step` radians, shortcuts are taken, and the result is
    checked every `FINE` radians; a path that fails that is searched for again at half the step. Each such round tries
    rooms of growing size, and gives up in one after its share of `budget` calls of the planner's termination condition.
    No clock is asked, so the answer depends on the arguments alone.
    """
    q_goals = np.atleast_2d(q_goals)
    if not scene.is_free(q_start):
        return NoPath("start_in_collision", scene.colliding_pairs(q_start))
    free = np.flatnonzero(scene.free_many(q_goals))
    if not len(free):
        return NoPath("goal_in_collision", scene.colliding_pairs(q_goals[0]))
    checks = 0
    while step >= FINE:
        edges = _Edges(scene, step)
        qs = _search(edges, q_start, q_goals[free], seed, budget)
        checks += edges.count
        if qs is None:
            return NoPath("budget", (), checks)
        if scene.path_free(qs):
            goal = int(free[np.abs(q_goals[free] - qs[-1]).max(1).argmin()])
            return Path(readonly(qs), goal, checks)
        step /= 2
    return NoPath("budget", (), checks)


class _Edges:
    """Counts the edges that are checked at one step."""

    def __init__(self, scene: PlanningScene, step: float) -> None:
        self._full, self._checker, self.count = scene._full, scene.checker.Clone(), 0
        self._checker.set_edge_step_size(step)

    def free(self, q0: Array, q1: Array) -> bool:
        self.count += 1
        return bool(self._checker.CheckEdgeCollisionFree(self._full(q0), self._full(q1)))


_ROOMS = (0.5, 1.2, 3.0)
"""How far (seconds at full speed) a search may leave the box spanned by start and goals: near first, where paths are
short."""
_SEARCHES = 2
"""Once one search has found a path, this many in all are made: the quickest of them saves more than it costs."""


def _search(edges: _Edges, q_start: Array, q_goals: Array, seed: int, budget: int) -> Array | None:
    """The straight line if it is free, else the quickest of a few searches in the smallest room that has a path."""
    for q_goal in q_goals[:4]:
        if edges.free(q_start, q_goal):
            return np.stack([q_start, q_goal])
    seeds = np.random.SeedSequence(seed).generate_state(_SEARCHES).tolist()
    for room in _ROOMS:
        found: list[Array] = []
        for each in seeds:
            qs = _rrt_connect(edges, q_start, q_goals, room, each, budget // len(_ROOMS))
            if qs is None:
                break
            found.append(_shortcut(edges, qs, np.random.default_rng(each)))
        if found:
            return min(found, key=seconds)
    return None


def _rrt_connect(edges: _Edges, q_start: Array, q_goals: Array, room: float, seed: int, budget: int) -> Array | None:
    """OMPL's RRT-Connect to any of q_goals (n, 8); None when the budget is used up. Only exact solutions count."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed % (2**31 - 1) + 1)  # a seed of 0 would be ignored
    lower, upper = robot.limits()
    ends = np.vstack([q_start, q_goals])
    lower = np.minimum(np.maximum(lower, ends.min(0) - room / _SCALE), ends.min(0))
    upper = np.maximum(np.minimum(upper, ends.max(0) + room / _SCALE), ends.max(0))

    space = ob.RealVectorStateSpace(8)
    bounds = ob.RealVectorBounds(8)
    for j in range(8):
        bounds.setLow(j, float(lower[j] * _SCALE[j]))
        bounds.setHigh(j, float(upper[j] * _SCALE[j]))
    space.setBounds(bounds)
    information = ob.SpaceInformation(space)

    def state(q: Array) -> Any:
        made = space.allocState()
        for j in range(8):
            made[j] = float(q[j] * _SCALE[j])
        return made

    def q_of(given: Any) -> Array:
        return np.array([given[j] for j in range(8)]) / _SCALE

    class Validator(ob.MotionValidator):
        """One call an edge; a callback a state would cost ten times as much."""

        def checkMotion(self, s1: Any, s2: Any, *last: Any) -> bool:
            return edges.free(q_of(s1), q_of(s2))

    validator = Validator(information)
    information.setMotionValidator(validator)
    is_valid: Callable[[Any], bool] = lambda given: True  # noqa: E731  (edges include their ends)
    information.setStateValidityChecker(is_valid)
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.addStartState(state(q_start))
    goals = ob.GoalStates(information)
    for q_goal in q_goals:
        goals.addState(state(q_goal))
    problem.setGoal(goals)
    planner = og.RRTConnect(information)
    planner.setRange(1.2)
    planner.setProblemDefinition(problem)
    planner.setup()
    calls = itertools.count()
    planner.solve(ob.PlannerTerminationCondition(lambda: next(calls) >= budget))
    if not problem.hasExactSolution():
        return None
    return np.array([q_of(given) for given in problem.getSolutionPath().getStates()])


def seconds(qs: Array) -> float:
    """About the time that a polyline (k, 8) takes with a stop at each corner, without the jerk limit."""
    way = np.abs(np.diff(qs, axis=0))
    v, a = robot.velocity_limits(), robot.ACCELERATION
    return float(np.where(way > v**2 / a, way / v + v / a, 2 * np.sqrt(way / a)).max(1).sum())


def _shortcut(edges: _Edges, qs: Array, rng: np.random.Generator, rounds: int = 80) -> Array:
    """Replaces pieces of a polyline by straight lines while that saves time (Geraerts and Overmars 2007)."""
    qs = _without_corners(edges, qs)
    for _ in range(rounds):
        if len(qs) < 3:
            return qs
        marks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(qs, axis=0) * _SCALE, axis=1))])
        a, b = np.sort(rng.uniform(0, marks[-1], 2))
        i, j = np.searchsorted(marks, [a, b], side="right") - 1
        if i == j:
            continue
        cut = np.array([[np.interp(t, marks, qs[:, c]) for c in range(8)] for t in (a, b)])
        if rng.random() < 0.3:  # one joint alone goes straight: what holds up the others may not be in its way
            c = rng.integers(8)
            new = np.vstack([cut[:1], qs[i + 1 : j + 1], cut[1:]])
            along = np.concatenate([[a], marks[i + 1 : j + 1], [b]])
            new[:, c] = np.interp(along, [a, b], cut[:, c])
        else:
            new = cut
        candidate = np.vstack([qs[: i + 1], new, qs[j + 1 :]])
        candidate = candidate[np.concatenate([[True], np.abs(np.diff(candidate, axis=0)).max(1) > 1e-9])]
        if seconds(candidate) + 1e-6 < seconds(qs) and all(edges.free(q0, q1) for q0, q1 in itertools.pairwise(new)):
            qs = _without_corners(edges, candidate)
    return qs


def _without_corners(edges: _Edges, qs: Array) -> Array:
    """Leaves out waypoints, longest leaps first, where the straight line is free and no slower."""
    leaps = ((i, i + length) for length in range(len(qs) - 1, 1, -1) for i in range(len(qs) - length))
    for i, j in leaps:
        candidate = np.vstack([qs[: i + 1], qs[j:]])
        if seconds(candidate) < seconds(qs) and edges.free(qs[i], qs[j]):
            return _without_corners(edges, candidate)
    return qs


def cartesian_path(arm: Arm, X_WG_start: Array, X_WG_goal: Array, q_start: Array, *, count: int = 4) -> Array:
    """Paths (n, k, 8), n <= count, along which the hand moves straight and turns evenly; the quickest first.

    A waypoint each centimetre or 5 degrees. Not checked for collisions. X_WG_start must be the hand's pose at q_start.
    """
    from scipy.spatial.transform import Rotation, Slerp

    p0, p1 = X_WG_start[:3, 3], X_WG_goal[:3, 3]
    rotations = Rotation.from_matrix(np.stack([X_WG_start[:3, :3], X_WG_goal[:3, :3]]))
    angle = float((rotations[0].inv() * rotations[1]).magnitude())
    k = int(np.ceil(max(np.linalg.norm(p1 - p0) / 0.01, angle / np.deg2rad(5), 1.0))) + 1
    s = np.linspace(0, 1, k)
    X_WGs = np.tile(np.eye(4), (k, 1, 1))
    X_WGs[:, :3, :3] = Slerp([0, 1], rotations)(s).as_matrix()
    X_WGs[:, :3, 3] = p0 + s[:, None] * (p1 - p0)
    return arm.follow(X_WGs, q_start, count=count)
