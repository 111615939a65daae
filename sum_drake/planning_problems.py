"""A user's own planning problems: read from a file, checked field by field, and why a start or a goal is refused."""

import dataclasses
import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydrake.geometry import Box, Cylinder, Shape, Sphere
from pydrake.planning import SceneGraphCollisionChecker

from sum_drake import geometry
from sum_drake.assets import InputError, one_line
from sum_drake.types import Array, Immutable, readonly
from sum_drake.user_robot import OBSTACLES, Obstacle, UserRobot, make_checker, plant_positions

LARGEST = 1e4
"""No number of a problem is larger: metres or radians."""
SLACK = 1e-5
"""Radians (and metres) by which a start or goal may be out of the limits: numbers are written with few digits."""
STANDING = 0.02
"""Metres that a link fixed to the base may stand in an obstacle."""
_DIMENSIONS = {"box": ("x", "y", "z"), "cylinder": ("height", "radius"), "sphere": ("radius",)}
_NAMED = 3
"""Pairs of bodies that a refusal names."""


@dataclasses.dataclass(frozen=True, eq=False)
class PlanningProblem(Immutable):
    """From one configuration to another among things that stand still."""

    request: str
    joints: tuple[str, ...]
    """Those that move; all others stay at 0."""
    start: Array
    """(n,), in the order of `joints`."""
    goal: Array
    """(n,)."""
    obstacles: tuple[Obstacle, ...]
    """In the robot's base frame."""


def load_problems(path: Path, robot: UserRobot) -> tuple[PlanningProblem, ...]:
    """Reads a list of {request, joints, start, goal, obstacles: [{id, type, dimensions, position, quat_xyzw}]}.

    Other keys are passed over. Raises InputError, one line that names the problem, the field and what was expected.
    """
    try:
        data = json.loads(path.read_text())
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; expected a file of planning problems") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected JSON") from error
    if not isinstance(data, list) or not data:
        raise InputError(f"{path}: is no list of problems; expected [{{request, joints, start, goal, obstacles}}, ...]")
    return tuple(read_problem(entry, f"{path}: problem {i}", robot) for i, entry in enumerate(data))


def read_problem(entry: Any, where: str, robot: UserRobot) -> PlanningProblem:
    """One problem of a file; `where` begins what is said of it. Raises InputError."""
    if not isinstance(entry, dict):
        raise InputError(f"{where}: is no object; expected {{request, joints, start, goal, obstacles}}")
    request = entry.get("request")
    if isinstance(request, int) and not isinstance(request, bool):
        request = str(request)
    if not isinstance(request, str) or not _plain(request):
        raise InputError(f"{where}: request is {_said(entry, 'request')}; expected a name")
    where = f"{where} ('{_plain(request)}')"
    joints = entry.get("joints")
    if not isinstance(joints, list) or not joints or not all(isinstance(name, str) for name in joints):
        raise InputError(f"{where}: joints is {_said(entry, 'joints')}; expected a list of names of joints")
    movable = f"some of {', '.join(robot.names)}" if robot.names else "a robot with movable joints, this one has none"
    for i, name in enumerate(joints):
        if name not in robot.names:
            raise InputError(f"{where}: joints: {_why_not(name, robot)}; expected {movable}")
        if name in joints[:i]:
            raise InputError(f"{where}: joints: '{name}' is there twice; expected every joint once")
    start, goal = (_numbers(entry, key, len(joints), where) for key in ("start", "goal"))
    given = entry.get("obstacles")
    if not isinstance(given, list):
        raise InputError(f"{where}: obstacles is {_said(entry, 'obstacles')}; expected a list")
    obstacles = [_obstacle(each, f"{where}: obstacle {i}") for i, each in enumerate(given)]
    return PlanningProblem(request, tuple(joints), start, goal, _told_apart(obstacles))


def problem_checker(robot: UserRobot, problem: PlanningProblem) -> SceneGraphCollisionChecker:
    """Drake's checker of the problem's robot among its obstacles; its positions are those of the problem's joints."""
    return make_checker(robot, problem.joints, problem.obstacles)


def refusal(
    checker: SceneGraphCollisionChecker, robot: UserRobot, problem: PlanningProblem, which: Literal["start", "goal"]
) -> str | None:
    """Why the problem's start or goal cannot be used, in one line; None where it can.

    Either joints beyond their limits or pairs of bodies that touch, the deepest first, with the depth. Links that are
    fixed to the base may stand in obstacles by `STANDING`: a robot touches the floor.
    """
    q = problem.start if which == "start" else problem.goal
    beyond = [
        f"{name} {value:.5g} {word} its limit {limit:.5g}"
        for name, value, lower, upper in zip(problem.joints, q, *robot.limits(problem.joints)[:2], strict=True)
        for word, limit, by in (("below", lower, lower - value), ("above", upper, value - upper))
        if by > SLACK
    ]
    if beyond:
        return f"{which}: {', '.join(beyond)}"
    standing = [pair for pair in fixed_collisions(checker) if pair[2] > STANDING]
    pairs = standing + collisions(checker, plant_positions(checker, problem.joints, q))
    if not pairs:
        return None
    deepest = sorted(pairs, key=lambda pair: -pair[2])
    words = [f"{a} with {b}, {_depth(depth)}" for a, b, depth in deepest[:_NAMED]]
    more = f"; and {len(pairs) - _NAMED} more" if len(pairs) > _NAMED else ""
    return f"{which} in collision: {'; '.join(words)}{more}"


def collisions(checker: SceneGraphCollisionChecker, positions: Array) -> list[tuple[str, str, float]]:
    """Pairs of bodies that touch at positions (n,) of the checker's plant, the robot's link first, and their depth, m.

    Empty exactly where the checker says that the configuration is free.
    """
    if checker.CheckConfigCollisionFree(positions):
        return []
    checker.UpdatePositions(positions)
    plant, query = checker.plant(), checker.model_context().GetQueryObject()
    inspector = query.inspector()
    depths: dict[tuple[str, str], float] = {}
    for pair in query.ComputePointPairPenetration():
        bodies = [plant.GetBodyFromFrameId(inspector.GetFrameId(each)) for each in (pair.id_A, pair.id_B)]
        if checker.IsCollisionFilteredBetween(*(body.index() for body in bodies)):
            continue
        links = [body.name() for body in bodies if not _is_obstacle(plant, body)]
        others = [
            inspector.GetName(each).removeprefix(f"{OBSTACLES}::")
            for each, body in zip((pair.id_A, pair.id_B), bodies, strict=True)
            if _is_obstacle(plant, body)
        ]
        first, second = (*sorted(links), *others)
        depths[first, second] = max(depths.get((first, second), 0.0), float(pair.depth))
    # Two ways to compute the same may differ about what barely touches.
    return [(a, b, depth) for (a, b), depth in depths.items()] or [("the robot", "what it touches", 0.0)]


def _is_obstacle(plant: Any, body: Any) -> bool:
    return bool(plant.GetModelInstanceName(body.model_instance()) == OBSTACLES)


def fixed_collisions(checker: SceneGraphCollisionChecker) -> list[tuple[str, str, float]]:
    """Links fixed to the base that stand in obstacles, and how deep, metres: Drake never compares what cannot move."""
    plant, query = checker.plant(), checker.model_context().GetQueryObject()
    inspector = query.inspector()
    fixed: list[tuple[str, Any]] = []
    obstacles: list[tuple[str, Any]] = []
    for body in plant.GetBodiesWeldedTo(plant.world_body()):
        for each in plant.GetCollisionGeometriesForBody(body):
            if _is_obstacle(plant, body):
                obstacles.append((inspector.GetName(each).removeprefix(f"{OBSTACLES}::"), each))
            else:
                fixed.append((body.name(), each))
    found: dict[tuple[str, str], float] = {}
    for (link, a), (obstacle, b) in itertools.product(fixed, obstacles):
        if not _may_touch(query, a, b):
            continue
        distance = query.ComputeSignedDistancePairClosestPoints(a, b).distance
        if distance < 0:
            found[link, obstacle] = max(found.get((link, obstacle), 0.0), -float(distance))
    return [(link, obstacle, depth) for (link, obstacle), depth in found.items()]


def _may_touch(query: Any, a: Any, b: Any) -> bool:
    """Whether the boxes around two shapes overlap along the world's axes."""
    bounds = []
    for geometry_id in (a, b):
        box = query.ComputeObbInWorld(geometry_id)
        if box is None:  # a half space
            return True
        half = np.abs(box.pose().rotation().matrix()) @ box.half_width()
        bounds.append((box.center(), half))
    (p, h), (q, g) = bounds
    return bool((np.abs(p - q) <= h + g).all())


def _depth(depth: float) -> str:
    return f"{depth * 1e3:.2g} mm deep" if depth < 0.01 else f"{depth * 1e3:.0f} mm deep"


def _why_not(name: str, robot: UserRobot) -> str:
    joint = next((joint for joint in robot.joints if joint.name == name), None)
    if joint is None:
        return f"the robot has no '{_plain(name)}'"
    if joint.follows is not None:
        return f"'{name}' mimics '{joint.follows[0]}'"
    follower = next((other.name for other in robot.joints if other.follows and other.follows[0] == name), None)
    return f"'{name}' is mimicked by '{follower}'" if follower else f"'{name}' is {joint.kind}"


def _plain(name: str) -> str:
    """A name in one line, without blanks at its ends."""
    return " ".join(name.split())


def _said(entry: dict[str, Any], key: str) -> str:
    if key not in entry:
        return "missing"
    text = repr(entry[key])
    return text if len(text) <= 60 else text[:57] + "..."


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(-LARGEST <= value <= LARGEST)


def _numbers(entry: dict[str, Any], key: str, count: int, where: str) -> Array:
    values = entry.get(key)
    if not isinstance(values, list) or len(values) != count or not all(map(_is_number, values)):
        many = f" ({len(values)} values)" if isinstance(values, list) and len(values) != count else ""
        raise InputError(
            f"{where}: {key} is {_said(entry, key)}{many}; expected {count} finite number{'s' * (count > 1)}, "
            f"none beyond {LARGEST:g}"
        )
    return readonly(values)


def _obstacle(entry: Any, where: str) -> Obstacle:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: is no object; expected {{id, type, dimensions, position, quat_xyzw}}")
    name = entry.get("id")
    if isinstance(name, int) and not isinstance(name, bool):
        name = str(name)
    # Drake takes blanks off the ends of names.
    if not isinstance(name, str) or not (name := _plain(name)):
        raise InputError(f"{where}: id is {_said(entry, 'id')}; expected a name")
    where = f"{where} ('{name}')"
    kind = entry.get("type")
    if not isinstance(kind, str) or kind not in _DIMENSIONS:
        raise InputError(f"{where}: type is {_said(entry, 'type')}; expected one of {', '.join(_DIMENSIONS)}")
    sizes = _numbers(entry, "dimensions", len(_DIMENSIONS[kind]), where)
    if not (sizes > 0).all():
        said, wanted = _said(entry, "dimensions"), ", ".join(_DIMENSIONS[kind])
        raise InputError(f"{where}: dimensions is {said}; expected {wanted} over 0 metres")
    position, quaternion = _numbers(entry, "position", 3, where), _numbers(entry, "quat_xyzw", 4, where)
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > 0.01:
        raise InputError(f"{where}: quat_xyzw has the length {length:.4g}; expected a unit quaternion x, y, z, w")
    R_WO = geometry.rotation_from_quaternion(quaternion[[3, 0, 1, 2]])
    shape: Shape = {"box": Box, "cylinder": lambda height, radius: Cylinder(radius, height), "sphere": Sphere}[kind](
        *sizes.tolist()
    )
    return Obstacle(name, shape, readonly(geometry.transform(R_WO, position)))


def _told_apart(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """The same with numbers behind names that came before: can, can#2."""
    counts: dict[str, int] = {}
    taken = {obstacle.name for obstacle in obstacles}
    made = []
    for obstacle in obstacles:
        counts[obstacle.name] = counts.get(obstacle.name, 0) + 1
        name = obstacle.name
        if counts[name] > 1:
            while (name := f"{obstacle.name}#{counts[obstacle.name]}") in taken:
                counts[obstacle.name] += 1
            taken.add(name)
        made.append(dataclasses.replace(obstacle, name=name))
    return tuple(made)
