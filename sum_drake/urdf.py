"""What a URDF says of links and joints, element by element, as planning needs it. Raises InputError in one line."""

import dataclasses
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from sum_drake.assets import InputError, one_line
from sum_drake.collision_mesh import convex_pieces, find_mesh
from sum_drake.types import Array, Immutable, readonly

LARGEST = 1e6
"""No number of a robot is larger, but of limits, where more than that is as good as none."""
SPEED = 1.0
"""Radians or metres a second of a joint that says nothing of its speed."""
MOVING = ("revolute", "continuous", "prismatic")
_KINDS = (*MOVING, "fixed", "floating", "planar")


@dataclasses.dataclass(frozen=True, eq=False)
class UserJoint(Immutable):
    """One joint of the URDF."""

    name: str
    kind: str
    """revolute, continuous, prismatic, fixed, floating or planar."""
    parent: str
    child: str
    X_PJ: Array
    """(4, 4): the child's frame on the parent where the joint is at 0."""
    axis: Array
    """(3,), unit."""
    lower: float
    upper: float
    """-inf and inf where the joint has no limits."""
    velocity: float
    follows: tuple[str, float, float] | None = None
    """Leader, multiplier and offset of a joint that mimics another."""


@dataclasses.dataclass(frozen=True, eq=False)
class UserLink(Immutable):
    """One link and its collision shapes, each with its pose on the link."""

    name: str
    shapes: tuple[tuple[Shape, RigidTransform], ...]


def parse_xml(path: Path, what: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; expected {what}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected {what}, which is XML") from error
    if root.tag != "robot":
        raise InputError(f"{path}: its root is <{root.tag}>; expected {what}, whose root is <robot>")
    return root


def once(names: Iterable[str], what: str, path: Path) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{path}: {what} '{name}' is there twice; expected every name once")
        seen.add(name)


def numbers(element: ElementTree.Element | None, key: str, default: str | None, count: int, where: str) -> Array:
    """The numbers of an attribute (count,); those of `default` where it is missing, if there is a default."""
    text = default if element is None else element.get(key, default)
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.full(count, np.nan)
    if len(values) != count or not (np.abs(values) <= LARGEST).all():
        said = "is missing" if text is None else f"is '{text}'"
        many = "a finite number" if count == 1 else f"{count} finite numbers"
        raise InputError(f"{where}: {key} {said}; expected {many}")
    return values


def limit_of(element: ElementTree.Element | None, key: str, where: str) -> float:
    """A number of a limit, 0 where it is missing; -inf or inf where it is beyond LARGEST, as what has none is written.

    Raises InputError for what is no number.
    """
    text = "0" if element is None else element.get(key, "0")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if np.isnan(value):
        raise InputError(f"{where}: {key} is '{text}'; expected a number")
    return value if abs(value) <= LARGEST else float(np.copysign(np.inf, value))


def number(element: ElementTree.Element | None, key: str, default: str | None, where: str) -> float:
    return float(numbers(element, key, default, 1, where)[0])


def name_of(element: ElementTree.Element, path: Path) -> str:
    name = element.get("name")
    if not name:
        raise InputError(f"{path}: a {element.tag} has no name; expected every {element.tag} to have one")
    return name


def origin_of(element: ElementTree.Element, where: str) -> RigidTransform:
    origin = element.find("origin")
    xyz, rpy = (numbers(origin, key, "0 0 0", 3, f"{where}: origin") for key in ("xyz", "rpy"))
    return RigidTransform(RollPitchYaw(rpy), xyz)


def read_link(element: ElementTree.Element, path: Path) -> UserLink:
    name = name_of(element, path)
    shapes: list[tuple[Shape, RigidTransform]] = []
    for collision in element.findall("collision"):
        where = f"{path}: link '{name}': collision"
        X_LG = origin_of(collision, where)
        shapes += [(shape, X_LG) for shape in _shapes(collision.find("geometry"), path, where)]
    return UserLink(name, tuple(shapes))


def _shapes(geometry: ElementTree.Element | None, path: Path, where: str) -> list[Shape]:
    kinds = [] if geometry is None else [child for child in geometry if isinstance(child.tag, str)]
    if len(kinds) != 1:
        raise InputError(f"{where}: has {len(kinds)} shapes; expected a geometry with one shape")
    element, kind = kinds[0], str(kinds[0].tag).rpartition("}")[2]
    if kind == "mesh":
        name = element.get("filename")
        if not name:
            raise InputError(f"{where}: a mesh has no filename; expected one")
        scale = numbers(element, "scale", "1 1 1", 3, f"{where}: mesh '{name}'")
        if not scale.all():
            raise InputError(f"{where}: mesh '{name}' is scaled by 0; expected other numbers")
        pieces = convex_pieces(find_mesh(name, path, where), scale, where)
        hulls = [Convex(points=points.T, label=Path(name).name) for points in pieces]
        for hull in hulls:
            hull.GetConvexHull()  # computed here, it is shared by all checkers of the robot
        return hulls
    if kind not in ("box", "sphere", "cylinder", "capsule"):
        raise InputError(f"{where}: is a <{kind}>; expected a box, sphere, cylinder, capsule or mesh")
    keys = {"box": ("size",), "sphere": ("radius",)}.get(kind, ("radius", "length"))
    count = 3 if kind == "box" else 1
    sizes = np.concatenate([numbers(element, key, None, count, f"{where}: {kind}") for key in keys])
    if not (sizes > 0).all():
        raise InputError(f"{where}: {kind} has the size {' '.join(f'{size:g}' for size in sizes)}; expected over 0")
    made = {"box": Box, "sphere": Sphere, "cylinder": Cylinder, "capsule": Capsule}[kind]
    return [made(*sizes)]


def collision_meshes(path: Path) -> list[Path]:
    """The files of all meshes of a URDF's collision shapes, in its order, where `find_mesh` finds them."""
    names = (str(mesh.get("filename")) for mesh in parse_xml(path, "a URDF").findall("link/collision/geometry/{*}mesh"))
    return [find_mesh(name, path, str(path)) for name in names]


def read_joint(element: ElementTree.Element, path: Path, notes: list[str]) -> UserJoint:
    name, kind = name_of(element, path), element.get("type", "")
    where = f"{path}: joint '{name}'"
    if kind not in _KINDS:
        raise InputError(f"{where}: its type is '{kind}'; expected one of {', '.join(_KINDS)}")
    ends = []
    for end in ("parent", "child"):
        found = element.find(end)
        if found is None or not found.get("link"):
            raise InputError(f"{where}: has no {end} link; expected one")
        ends.append(str(found.get("link")))
    axis, lower, upper, velocity = np.array([1.0, 0.0, 0.0]), -np.inf, np.inf, SPEED
    if kind in MOVING:
        axis = numbers(element.find("axis"), "xyz", "1 0 0", 3, f"{where}: axis")
        if np.linalg.norm(axis) < 1e-6:
            raise InputError(f"{where}: its axis is 0; expected a direction")
        axis = axis / np.linalg.norm(axis)
        limit = element.find("limit")
        velocity = limit_of(limit, "velocity", f"{where}: limit")
        if velocity < 0:
            raise InputError(f"{where}: limit: velocity is {velocity:g}; expected over 0")
        if np.isinf(velocity):
            notes.append(f"{where} has no limit of speed: taken to move at {SPEED:g} a second")
        velocity = SPEED if velocity == 0 or np.isinf(velocity) else velocity
        if limit is None and kind != "continuous":
            notes.append(f"{where} has no limit: taken to have none")
        elif kind != "continuous":
            lower, upper = (limit_of(limit, key, f"{where}: limit") for key in ("lower", "upper"))
            if lower > upper or lower == np.inf or upper == -np.inf:
                raise InputError(f"{where}: its lower limit is {lower:g}, its upper {upper:g}; expected a range")
    follows, mimic = None, element.find("mimic")
    if mimic is not None and kind in MOVING:
        leader = mimic.get("joint")
        if not leader:
            raise InputError(f"{where}: mimic names no joint; expected one")
        factor, offset = (
            number(mimic, key, default, f"{where}: mimic") for key, default in (("multiplier", "1"), ("offset", "0"))
        )
        follows = (leader, factor, offset)
    X_PJ = readonly(origin_of(element, where).GetAsMatrix4())
    return UserJoint(name, kind, ends[0], ends[1], X_PJ, readonly(axis), lower, upper, velocity, follows)


def base_link(joints: Sequence[UserJoint], links: Sequence[str], path: Path) -> str:
    """The one link that is no joint's child, from which all others hang."""
    once([joint.name for joint in joints], "joint", path)
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise InputError(f"{path}: joint '{joint.name}': there is no link '{link}'; expected one of the links")
    children = [joint.child for joint in joints]
    for child in children:
        if children.count(child) > 1:
            raise InputError(f"{path}: link '{child}' is the child of two joints; expected a tree")
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        said = f"has {len(roots)} links without a parent joint ({', '.join(roots[:4])})" if roots else "has a loop"
        raise InputError(f"{path}: {said}; expected a tree with one base link")
    reached = {roots[0]}
    for _ in joints:
        reached |= {joint.child for joint in joints if joint.parent in reached}
    if len(reached) < len(links):
        lost = next(link for link in links if link not in reached)
        raise InputError(f"{path}: link '{lost}' is part of a loop; expected a tree")
    return roots[0]


def check_follows(joint: UserJoint, joints: Sequence[UserJoint], path: Path) -> None:
    if joint.follows is None:
        return
    leader = next((other for other in joints if other.name == joint.follows[0]), None)
    if leader is None or leader is joint or leader.kind not in MOVING or leader.follows is not None:
        raise InputError(
            f"{path}: joint '{joint.name}' mimics '{joint.follows[0]}'; expected a movable joint that mimics none"
        )


def some_of(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
