"""Collision-free paths of the arm: OMPL searches, shortcuts are taken, every path is checked densely at the end."""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from sum_drake import robot
from sum_drake.kinematics import Arm
from sum_drake.planning_scene import FINE, PlanningScene
from sum_drake.types import Array, Immutable, readonly

_SCALE = 1.0 / robot.velocity_limits()
"""OMPL searches in seconds: each joint divided by its speed limit."""


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
        self._full, self._checker, self.count = scene.full, scene.checker.Clone(), 0
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
