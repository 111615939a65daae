"""Planning problems for the Fetch with torso and arm among furniture: shelves, cages, and what stands under tables.

In the manner of MotionBenchMaker's sets (Chamzas et al. 2022): the kind of scene is given, the sizes of its furniture,
what stands on it and where the robot stands before it are drawn; the arm starts folded (or over the table) and must
end with its hand among it. A problem is kept if both ends are free, the straight line between them is not, and the
hand can be drawn out of the furniture again in a line, so that few have no solution at all.
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.planning import SceneGraphCollisionChecker

from sum_drake import robot as fetch
from sum_drake.assets import asset
from sum_drake.bench.plan_scenes import MAKERS, rounded
from sum_drake.files import write_whole
from sum_drake.geometry import transform
from sum_drake.kinematics import Arm
from sum_drake.planning_problems import problem_checker, read_problem, refusal
from sum_drake.seeds import derive
from sum_drake.types import Array
from sum_drake.user_robot import UserRobot, load_robot, plant_positions

JOINTS = tuple(joint.name for joint in fetch.ARM_JOINTS)
KINDS = tuple(MAKERS)
_SCENES, _SOLUTIONS = 200, 12
"""How many scenes are drawn for a problem, and ways of the arm looked at for a pose of the hand."""
_CLEAR = 0.25
"""Metres that the hand can be drawn back from the goal along a line."""
_STEP = 0.02
"""Radians between the configurations of the straight line that must not be free."""


def fetch_robot() -> UserRobot:
    """The robot of the sets: this project's own Fetch."""
    return load_robot(asset(fetch.FETCH_URDF))


def make_problem(kind: str, seed: int, index: int, robot: UserRobot) -> dict[str, Any]:
    """Problem number `index` of a kind, in the format of `planning_problems`, rounded; a function of its arguments.

    Raises RuntimeError where no scene of many yields one.
    """
    rng = np.random.default_rng([derive(seed, f"problems {kind}"), index])
    for _ in range(_SCENES):
        scene, hands, X_WG_start = MAKERS[kind](rng)
        entry: dict[str, Any] = {
            "request": f"{kind}_{index:04d}",
            "joints": list(JOINTS),
            "start": [0.0] * len(JOINTS),
            "goal": [0.0] * len(JOINTS),
            "obstacles": scene.obstacles,
        }
        checker = problem_checker(robot, read_problem(entry, entry["request"], robot))
        start = _start(rng, checker, X_WG_start)
        if start is None:
            continue
        away = -scene.X_WF[:3, 0] if kind == "under_table" else None
        goal = _goal(rng, checker, start, [scene.X_WF @ X_FG for X_FG in hands], away)
        if goal is None:
            continue
        entry |= {"start": start.tolist(), "goal": goal.tolist()}
        problem = read_problem(entry, entry["request"], robot)
        if refusal(checker, robot, problem, "start") is None and refusal(checker, robot, problem, "goal") is None:
            return entry
    raise RuntimeError(f"no problem of kind {kind} in {_SCENES} scenes")


def write_sets(
    folder: Path,
    *,
    count: int,
    seed: int,
    kinds: Sequence[str] = KINDS,
    progress: Callable[[str], None] = lambda _: None,
) -> None:
    """Writes KIND.json, one problem a line, for every kind."""
    folder.mkdir(parents=True, exist_ok=True)
    robot = fetch_robot()
    for kind in kinds:
        lines = []
        for index in range(count):
            entry = make_problem(kind, seed, index, robot)
            lines.append(json.dumps(entry, separators=(",", ":"), allow_nan=False))
            progress(entry["request"])
        write_whole(folder / f"{kind}.json", "[" + ",\n".join(lines) + "]\n")


def _start(rng: np.random.Generator, checker: SceneGraphCollisionChecker, X_WG: Array | None) -> Array | None:
    """A free configuration (8,), rounded: with the hand at X_WG, or about folded where that is None."""
    if X_WG is not None:
        candidates = list(rng.permutation(Arm().solutions(X_WG, count=_SOLUTIONS, thorough=False)))
    else:
        shaken = fetch.VIEW + rng.uniform(-0.12, 0.12, (_SOLUTIONS, len(JOINTS)))
        shaken[:, 0] = rng.uniform(0.02, 0.37, _SOLUTIONS)
        candidates = list(shaken)
    for q in candidates:
        start = np.array(rounded(q))
        if _free(checker, start[None]):
            return start
    return None


def _goal(
    rng: np.random.Generator,
    checker: SceneGraphCollisionChecker,
    start: Array,
    X_WGs: list[Array],
    away: Array | None,
) -> Array | None:
    """A free configuration (8,), rounded, with the hand at one of X_WGs (4, 4) that is no straight line from start.

    away: direction (3,) in W in which the hand can be drawn out; None: against its own x axis.
    """
    arm = Arm()
    for X_WG in X_WGs:
        line = np.linspace(0, _CLEAR, 26)[:, None] * (-X_WG[:3, 0] if away is None else away)
        for q in rng.permutation(arm.solutions(X_WG, near=start, count=_SOLUTIONS, thorough=False)):
            goal = np.array(rounded(q))
            if not _free(checker, goal[None]):
                continue
            count = int(np.ceil(np.abs(goal - start).max() / _STEP)) + 1
            if _free(checker, np.linspace(start, goal, count)):
                continue
            out = transform(X_WG[:3, :3], X_WG[:3, 3] + line)
            if any(_free(checker, path) for path in arm.follow(out, q)):
                return goal
    return None


def _free(checker: SceneGraphCollisionChecker, qs: Array) -> bool:
    """Whether all of qs (n, 8) are free."""
    positions = plant_positions(checker, JOINTS, qs)
    return all(checker.CheckConfigCollisionFree(each) for each in positions)
