"""Collision-free paths: OMPL searches, shortcuts are taken, Drake confirms every path at the end.

Edges are checked by the compiled model of the scene, one call an edge, as finely as a finished path must be: most of an
edge is proven free by a few distances, so that a coarser look would save nothing.
"""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from sum_drake.checked_scene import FINE, CheckedScene, JointSpace
from sum_drake.kinematics import Arm
from sum_drake.types import Array, Immutable, readonly, shaped


@dataclasses.dataclass(frozen=True, eq=False)
class Path(Immutable):
    """A free polyline in joint space."""

    qs: Array
    """(k, n)."""
    goal: int
    """Index of the goal it ends at."""
    checks: int
    """Edges checked on the way: the cost, without a clock."""


@dataclasses.dataclass(frozen=True)
class NoPath(Immutable):
    """Why there is no path."""

    reason: str
    """start_in_collision, goal_in_collision, start_beyond_limits, goal_beyond_limits, budget (used up), unconfirmed
    (Drake found what was found not free)."""
    pairs: tuple[tuple[str, str], ...] = ()
    """What touches what, where something does; or each joint that is beyond a limit, and how."""
    checks: int = 0


def plan_path(
    scene: CheckedScene,
    q_start: Array,
    q_goals: Array,
    *,
    seed: int,
    budget: int = 4000,
    planner: str = "rrt_connect",
    stop: Callable[[], bool] = lambda: False,
) -> Path | NoPath:
    """A short free path from q_start (n,) to one of q_goals (m, n), or why there is none.

    Goals that collide, or are beyond joint limits by more than `SLACK`, are passed over while others are not.

    One of PLANNERS searches rooms of growing size, and gives up in one after its share of `budget` calls of its
    termination condition; shortcuts are taken. Edges are checked every `FINE` radians or proven free, and the whole
    path once more, every `CONFIRM`, by Drake. No clock is asked, so the answer depends on the arguments alone; a bench
    may `stop` searches earlier by one of its own.

    Raises ValueError, one line, for an unknown planner, no goal, and for arrays of another shape or not finite.
    """
    n = len(scene.space.names)
    q_start, q_goals = shaped("q_start", q_start, n), shaped("q_goals", np.atleast_2d(q_goals), -1, n)
    if not len(q_goals):
        raise ValueError("q_goals: holds no goal; expected one or more")
    if planner not in PLANNERS:
        raise ValueError(f"planner {planner!r}: unknown; expected one of {', '.join(PLANNERS)}")
    beyond = [_beyond(q, scene.space) for q in (q_start, *q_goals)]
    if beyond[0]:
        return NoPath("start_beyond_limits", beyond[0])
    if not scene.is_free(q_start):
        return NoPath("start_in_collision", scene.colliding_pairs(q_start))
    within = np.flatnonzero([not each for each in beyond[1:]])
    if not len(within):
        return NoPath("goal_beyond_limits", beyond[1])
    free = within[scene.free_many(q_goals[within])]
    if not len(free):
        return NoPath("goal_in_collision", scene.colliding_pairs(q_goals[within[0]]))
    edges, reason = _Edges(scene, planner, stop), "budget"
    for attempt in range(_CONFIRMATIONS):
        qs = _search(edges, q_start, q_goals[free], seed + attempt, budget)
        if qs is None:
            break
        if scene.confirmed(qs, CONFIRM):
            goal = int(free[np.abs(q_goals[free] - qs[-1]).max(1).argmin()])
            return Path(readonly(qs), goal, edges.count)
        reason = "unconfirmed"
    return NoPath(reason, (), edges.count)


PLANNERS: dict[str, Callable[[Any], Any]] = {
    "rrt_connect": lambda information: _ranged(og.RRTConnect(information)),
    "rrt": lambda information: _ranged(og.RRT(information)),
    "bkpiece": og.BKPIECE1,
    "lbkpiece": og.LBKPIECE1,
    "kpiece": og.KPIECE1,
    "bit_star": og.BITstar,
}
"""OMPL's planners that were tried, by name (`benchmarks/planners.py`). RRT-Connect (Kuffner and LaValle 2000) is used:
the quickest where paths are easy, and among the surest where they are hard. PRM looks for its solution in a thread of
its own, so that no seed would repeat it."""
RANGE = 1.2
"""Length of a tree's edges, seconds at full speed."""


def _ranged(planner: Any) -> Any:
    planner.setRange(RANGE)
    return planner


SLACK = 5e-3
"""Radians (and metres) by which start and goals may be beyond joint limits: an arm is measured a hair beyond, too."""


def _beyond(q: Array, space: JointSpace) -> tuple[tuple[str, str], ...]:
    """Joints of q (n,) that are beyond their limits, and how."""
    return tuple(
        (name, f"{value:.5g} {word} its limit {limit:.5g}")
        for name, value, lower, upper in zip(space.names, q, space.lower, space.upper, strict=True)
        for word, limit, by in (("below", lower, lower - value), ("above", upper, value - upper))
        if by > SLACK
    )


CONFIRM = 0.02
"""Radians between the configurations at which Drake looks at a path that the compiled model has found free every
`FINE`: whether the two see the same bodies shows there, too, at a quarter of the cost."""
_CONFIRMATIONS = 3
"""Paths that are searched for, each elsewhere, before Drake's disagreement counts. Both see the same bodies; they can
differ only where a path grazes something by less than a thousandth of its distance."""


class _Edges:
    """What a search is made with: edges, which are counted, the planner, and when to stop."""

    def __init__(self, scene: CheckedScene, planner: str, stop: Callable[[], bool]) -> None:
        self._model, self.count, self.space, self.stop = scene.model, 0, scene.space, stop
        self.planner = PLANNERS[planner]

    def holds(self, q: Array) -> bool:
        """Whether a state is free: edges include their ends, but some planners ask before they try one."""
        return self._model.is_free(q)

    def free(self, q0: Array, q1: Array) -> bool:
        self.count += 1
        return self._model.edge_free(q0, q1, FINE)


_ROOMS = ((0.5, 0.15), (1.2, 0.2), (3.0, 0.25), (np.inf, 0.4))
"""How far (seconds at full speed) a search may leave the box spanned by start and goals, and its share of the budget:
near first, where paths are short."""
_SEARCHES = 2
"""Once one search has found a path, this many in all are made: the quickest of them saves more than it costs."""


def _search(edges: _Edges, q_start: Array, q_goals: Array, seed: int, budget: int) -> Array | None:
    """The straight line if it is free, else the quickest of a few searches in the smallest room that has a path."""
    for q_goal in q_goals[:4]:
        if edges.free(q_start, q_goal):
            return np.stack([q_start, q_goal])
    seeds = np.random.SeedSequence(seed).generate_state(_SEARCHES).tolist()
    for room, share in _ROOMS:
        found: list[Array] = []
        for each in seeds:
            qs = _explore(edges, q_start, q_goals, room, each, round(share * budget))
            if qs is None:
                break
            found.append(_shortcut(edges, qs, np.random.default_rng(each)))
        if found:
            return min(found, key=lambda qs: seconds(qs, edges.space))
    return None


def _explore(edges: _Edges, q_start: Array, q_goals: Array, room: float, seed: int, budget: int) -> Array | None:
    """A path to any of q_goals (m, n); None when the budget is used up. Only exact solutions count."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed % (2**31 - 1) + 1)  # a seed of 0 would be ignored
    joints, n = edges.space, len(edges.space.names)
    scale = 1.0 / joints.velocity  # OMPL searches in seconds: each joint divided by its speed limit
    ends = np.vstack([q_start, q_goals])
    # A joint that turns without end gets anywhere within half a turn; one may also end on one side alone.
    endless = np.isinf(joints.lower) | np.isinf(joints.upper)
    reach = np.where(endless, np.minimum(room / scale, np.pi), room / scale)
    lower = np.minimum(np.maximum(joints.lower, ends.min(0) - reach), ends.min(0))
    upper = np.maximum(np.minimum(joints.upper, ends.max(0) + reach), ends.max(0))

    space = ob.RealVectorStateSpace(n)
    bounds = ob.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(lower[j] * scale[j]))
        bounds.setHigh(j, float(upper[j] * scale[j]))
    space.setBounds(bounds)
    information = ob.SpaceInformation(space)

    def state(q: Array) -> Any:
        made = space.allocState()
        for j in range(n):
            made[j] = float(q[j] * scale[j])
        return made

    def q_of(given: Any) -> Array:
        return np.array([given[j] for j in range(n)]) / scale

    class Validator(ob.MotionValidator):
        """One call an edge; a callback a state would cost ten times as much."""

        def checkMotion(self, s1: Any, s2: Any, *last: Any) -> bool:
            return edges.free(q_of(s1), q_of(s2))

    validator = Validator(information)
    information.setMotionValidator(validator)

    def is_valid(given: Any) -> bool:
        return edges.holds(q_of(given))

    information.setStateValidityChecker(is_valid)
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.addStartState(state(q_start))
    goals = ob.GoalStates(information)
    for q_goal in q_goals:
        goals.addState(state(q_goal))
    problem.setGoal(goals)
    planner = edges.planner(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    calls = itertools.count()
    planner.solve(ob.PlannerTerminationCondition(lambda: next(calls) >= budget or edges.stop()))
    if not problem.hasExactSolution():
        return None
    return np.array([q_of(given) for given in problem.getSolutionPath().getStates()])


def seconds(qs: Array, space: JointSpace) -> float:
    """About the time that a polyline (k, n) takes with a stop at each corner, without the jerk limit."""
    way = np.abs(np.diff(qs, axis=0))
    v, a = space.velocity, space.acceleration
    return float(np.where(way > v**2 / a, way / v + v / a, 2 * np.sqrt(way / a)).max(1).sum())


def _shortcut(edges: _Edges, qs: Array, rng: np.random.Generator, rounds: int = 80) -> Array:
    """Replaces pieces of a polyline by straight lines while that saves time (Geraerts and Overmars 2007)."""
    qs = _without_corners(edges, qs)
    marks, now = _marks(edges, qs), seconds(qs, edges.space)
    for _ in range(rounds):
        if len(qs) < 3:
            return qs
        a, b = np.sort(rng.uniform(0, marks[-1], 2))
        i, j = np.searchsorted(marks, [a, b], side="right") - 1
        if i == j:
            continue
        shares = (np.array([a, b]) - marks[[i, j]]) / (marks[[i + 1, j + 1]] - marks[[i, j]])
        cut = qs[[i, j]] + shares[:, None] * (qs[[i + 1, j + 1]] - qs[[i, j]])
        if rng.random() < 0.3:  # one joint alone goes straight: what holds up the others may not be in its way
            c = rng.integers(qs.shape[1])
            new = np.vstack([cut[:1], qs[i + 1 : j + 1], cut[1:]])
            along = np.concatenate([[a], marks[i + 1 : j + 1], [b]])
            new[:, c] = np.interp(along, [a, b], cut[:, c])
        else:
            new = cut
        candidate = np.vstack([qs[: i + 1], new, qs[j + 1 :]])
        candidate = candidate[np.concatenate([[True], np.abs(np.diff(candidate, axis=0)).max(1) > 1e-9])]
        quicker = seconds(candidate, edges.space) + 1e-6 < now
        if quicker and all(edges.free(q0, q1) for q0, q1 in itertools.pairwise(new)):
            qs = _without_corners(edges, candidate)
            marks, now = _marks(edges, qs), seconds(qs, edges.space)
    return qs


def _marks(edges: _Edges, qs: Array) -> Array:
    """(k,): how far along a polyline each waypoint lies, seconds at full speed."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(qs, axis=0) / edges.space.velocity, axis=1))])


def _without_corners(edges: _Edges, qs: Array) -> Array:
    """Leaves out waypoints, longest leaps first, where the straight line is free and no slower."""
    leaps = ((i, i + length) for length in range(len(qs) - 1, 1, -1) for i in range(len(qs) - length))
    for i, j in leaps:
        candidate = np.vstack([qs[: i + 1], qs[j:]])
        if seconds(candidate, edges.space) < seconds(qs, edges.space) and edges.free(qs[i], qs[j]):
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
