"""A user's planning problems, solved one by one within a time limit: `plan.json` of `bench plan --problems`."""

import dataclasses
import time

import numpy as np

from sum_drake.checked_scene import FINE
from sum_drake.motion import NoPath, Path, plan_path
from sum_drake.planning_problems import PlanningProblem, refusal
from sum_drake.robot_scene import RobotScene
from sum_drake.seeds import derive
from sum_drake.types import Array, Immutable
from sum_drake.user_robot import UserRobot

BUDGET = 6000
"""Of a first search; each further one gets half as much again: what is hard is not found by starting over."""


@dataclasses.dataclass(frozen=True, eq=False)
class Solved(Immutable):
    """What came of a problem."""

    request: str
    start_valid: bool
    goal_valid: bool
    solved: bool
    time_s: float
    """CPU seconds, loading and refusals aside."""
    path: list[list[float]]
    """Waypoints in the order of the problem's joints, free every .005 rad between; empty where none was found."""
    message: str
    """Why there is no path; empty where there is one."""


def solve(robot: UserRobot, problem: PlanningProblem, *, seed: int, time_limit: float) -> Solved:
    """Searches with ever larger budgets and other seeds until there is a path, or `time_limit` CPU seconds are over.

    What is found later than that, as the clock is not asked while a path is shortened, does not count as solved.
    The one place where a clock is asked: how far a bench gets is what it measures. With time enough the path is the
    seed's.
    """
    scene = RobotScene.of(robot, problem)
    order = [problem.joints.index(name) for name in scene.space.names]
    why = [refusal(scene.checker, robot, problem, "start"), refusal(scene.checker, robot, problem, "goal")]
    said = "; ".join(each for each in why if each)
    if said:
        return Solved(problem.request, why[0] is None, why[1] is None, False, 0.0, [], said)
    begun = time.process_time()

    def over() -> bool:
        return time.process_time() - begun > time_limit

    found: Path | NoPath = NoPath("budget")
    budget, searches = BUDGET, 0
    while not over():
        found = plan_path(
            scene, problem.start[order], problem.goal[order][None],
            seed=derive(seed, f"{problem.request} {searches}"), budget=budget, stop=over,
        )  # fmt: skip
        searches += 1
        budget += budget // 2
        if isinstance(found, Path) or found.reason in ("start_in_collision", "goal_in_collision"):
            break
    spent = time.process_time() - begun
    if isinstance(found, Path):
        if spent > time_limit:
            late = f"a path was found too late, after {spent:.3g} of {time_limit:g} s"
            return Solved(problem.request, True, True, False, spent, [], late)
        back = np.argsort(order)
        return Solved(problem.request, True, True, True, spent, found.qs[:, back].tolist(), "")
    words = {"budget": f"no path in {time_limit:g} s, {searches} searches"}
    return Solved(problem.request, True, True, False, spent, [], words.get(found.reason, found.reason))


def revalidated(robot: UserRobot, problem: PlanningProblem, path: Array) -> bool:
    """Whether a path (k, n) begins and ends as the problem says, within limits, and Drake alone finds it free."""
    scene = RobotScene.of(robot, problem)
    order = [problem.joints.index(name) for name in scene.space.names]
    lower, upper, _ = robot.limits(problem.joints)
    ends = np.allclose(path[0], problem.start, atol=1e-9) and np.allclose(path[-1], problem.goal, atol=1e-9)
    within = np.all(path >= lower - 1e-9) and np.all(path <= upper + 1e-9)
    return bool(ends and within and scene.confirmed(path[:, order], FINE))


def warm_up() -> None:
    """Compiles what is compiled, so that no first problem pays for it."""
    from sum_drake.planning_scene import PlanningScene
    from sum_drake.robot import VIEW

    scene = PlanningScene()
    plan_path(scene, VIEW, VIEW[None] + 0.01, seed=0, budget=100)
