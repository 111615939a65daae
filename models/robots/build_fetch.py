"""Writes `fetch.urdf` and its visual meshes from the joint table of `sum_drake.robot`; run it after a change there.

The robot is drawn as filleted boxes and cylinders, one table a link; what collides is the same primitives without the
fillets, so that no collision shape is smaller than what is seen. Masses and inertias are those that Fetch Robotics
publishes in `fetch_ros/fetch_description` (the fingers' there are no rigid body's: theirs are a steel-like box's).
"""

import dataclasses
import itertools
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from sum_drake import robot
from sum_drake.robot import HAND

HERE = Path(__file__).resolve().parent
Vector = tuple[float, float, float]
Array = NDArray[np.float64]

COLORS = {
    "white": (0.92, 0.92, 0.93),
    "blue": (0.086, 0.506, 0.767),
    "grey": (0.356, 0.361, 0.376),
    "dark": (0.11, 0.115, 0.125),
    "steel": (0.62, 0.63, 0.65),
    "orange": (0.95, 0.42, 0.08),
    "red": (0.8, 0.05, 0.05),
    "glass": (0.05, 0.07, 0.16),
}


@dataclasses.dataclass(frozen=True)
class Box:
    """An axis-aligned box in the link's frame."""

    color: str
    center: Vector
    size: Vector
    fillet: float = 0.012
    collides: bool = True


@dataclasses.dataclass(frozen=True)
class Cylinder:
    """A cylinder along `axis` (0, 1, 2 for x, y, z) in the link's frame."""

    color: str
    axis: int
    center: Vector
    radius: float
    length: float
    fillet: float = 0.008
    collides: bool = True


Shape = Box | Cylinder


@dataclasses.dataclass(frozen=True)
class Body:
    """Mass in kg, centre of mass, moments and products of inertia about it (xx, yy, zz, xy, xz, yz), shapes."""

    mass: float
    com: Vector
    inertia: tuple[float, float, float, float, float, float]
    shapes: tuple[Shape, ...]


def caps(center: Vector, radius: float, length: float, color: str) -> tuple[Shape, ...]:
    """The round covers on both ends of a hinge along y; they are drawn only."""
    x, y, z = center
    return tuple(
        Cylinder(color, 1, (x, y + side * (length / 2 + 0.001), z), radius, 0.010, 0.004, collides=False)
        for side in (-1, 1)
    )


def finger(side: int) -> Body:
    """The right (-1) or left (+1) finger: a rubber pad on its inner face, which lies at y = 0 when closed."""
    thickness, rubber = HAND.pad_thickness, 0.006
    length, width = HAND.pad_x[1] - HAND.pad_x[0], 2 * HAND.pad_half_width
    x = (HAND.pad_x[0] + HAND.pad_x[1]) / 2
    mass = 0.0798
    squares = np.square([length, thickness, width])
    inertia = mass / 12 * (squares.sum() - squares)
    back = thickness - rubber
    return Body(
        mass,
        (x, side * thickness / 2, 0.0),
        (inertia[0], inertia[1], inertia[2], 0.0, 0.0, 0.0),
        (
            Box("dark", (x, side * rubber / 2, 0.0), (length, rubber, width), 0.0),
            Box("steel", (x, side * (rubber + back / 2), 0.0), (length, back, width), 0.003),
        ),
    )


PALM_X = (HAND.palm_x[0] + HAND.palm_x[1]) / 2
PALM_LENGTH = HAND.palm_x[1] - HAND.palm_x[0]

BODIES = {
    "base_link": Body(
        70.1294, (-0.0036, 0.0, 0.0014), (1.225, 1.2853, 0.987, 0.0099, 0.0062, -0.0034),
        (
            Cylinder("dark", 2, (0, 0, 0.055), 0.258, 0.07, 0.02, collides=False),
            Cylinder("grey", 2, (0, 0, 0.190), 0.275, 0.340, 0.035),
            Cylinder("dark", 2, (0, 0, 0.262), 0.2765, 0.034, 0.002, collides=False),
            Cylinder("blue", 2, (0, 0, 0.112), 0.2765, 0.010, 0.002, collides=False),
            Cylinder("dark", 2, (0, 0, 0.362), 0.215, 0.012, 0.004, collides=False),
            Box("orange", (0.272, 0, 0.175), (0.010, 0.085, 0.035), 0.004, collides=False),
        ),
    ),
    "torso_fixed_link": Body(
        13.2775, (-0.0722, 0.0057, 0.2656), (0.3861, 0.3388, 0.1192, 0.0015, -0.0102, -0.0117),
        (
            Box("white", (-0.025, 0, 0.105), (0.165, 0.290, 0.225), 0.040),
            Box("dark", (-0.025, 0, 0.211), (0.135, 0.245, 0.020), 0.006, collides=False),
            Cylinder("red", 0, (-0.108, 0.085, 0.145), 0.018, 0.022, 0.006, collides=False),
        ),
    ),
    "torso_lift_link": Body(
        10.7796, (-0.0013, -0.0009, 0.2935), (0.3354, 0.3354, 0.0954, 0.0, -0.0162, -0.0006),
        (
            # The black bellows reach down into the fixed torso at any height of the lift.
            Box("dark", (-0.025, 0, 0.045), (0.115, 0.215, 0.550), 0.020),
            Box("white", (-0.025, 0, 0.425), (0.140, 0.240, 0.310), 0.040),
            # Slim enough that the upper arm can hang beside it.
            Box("white", (0.065, 0, 0.275), (0.110, 0.090, 0.110), 0.025),
            Cylinder("white", 2, (0.119525, 0, 0.268), 0.054, 0.145, 0.018),
            Cylinder("blue", 2, (0.119525, 0, 0.333), 0.0515, 0.016, 0.003, collides=False),
            Box("white", (0.022, 0, 0.562), (0.115, 0.120, 0.055), 0.024),
            Cylinder("dark", 2, (0.053125, 0, 0.590), 0.046, 0.020, 0.004, collides=False),
            Box("blue", (0.046, 0, 0.470), (0.004, 0.110, 0.020), 0.001, collides=False),
        ),
    ),
    "head_pan_link": Body(
        2.2556, (0.0321, 0.0161, 0.0390), (0.0129, 0.0095, 0.0184, 0.0002, 0.0007, 0.0),
        (
            Cylinder("grey", 2, (0, 0, 0.028), 0.056, 0.052, 0.012),
            Box("grey", (0.066, 0, 0.034), (0.130, 0.098, 0.052), 0.016),
            Box("grey", (0.118, 0.135, 0.054), (0.090, 0.022, 0.076), 0.010),
            Box("grey", (0.118, -0.135, 0.054), (0.090, 0.022, 0.076), 0.010),
            Box("grey", (0.080, 0, 0.024), (0.050, 0.290, 0.034), 0.012),
        ),
    ),
    "head_tilt_link": Body(
        0.9087, (0.0081, 0.0025, 0.0113), (0.0061, 0.0014, 0.0061, 0.0, 0.0002, -0.0001),
        (
            Box("white", (-0.004, 0, 0.0225), (0.094, 0.240, 0.088), 0.030),
            Box("dark", (0.036, 0, 0.0225), (0.030, 0.196, 0.046), 0.012, collides=False),
            Cylinder("glass", 0, (0.050, -0.012, 0.0225), 0.012, 0.006, 0.002, collides=False),
            Cylinder("glass", 0, (0.050, 0.025, 0.0225), 0.009, 0.006, 0.002, collides=False),
            Cylinder("glass", 0, (0.050, -0.062, 0.0225), 0.012, 0.006, 0.002, collides=False),
            Box("blue", (-0.004, 0, 0.0645), (0.060, 0.150, 0.006), 0.002, collides=False),
        ),
    ),
    "shoulder_pan_link": Body(
        2.5587, (0.0927, -0.0056, 0.0564), (0.0043, 0.0087, 0.0087, -0.0001, 0.001, -0.0001),
        (
            Cylinder("white", 2, (0, 0, 0.050), 0.076, 0.110, 0.028),
            Box("white", (0.060, 0, 0.060), (0.120, 0.112, 0.096), 0.030),
            Cylinder("white", 1, (0.117, 0, 0.060), 0.062, 0.124, 0.014),
            *caps((0.117, 0, 0.060), 0.045, 0.124, "blue"),
        ),
    ),
    "shoulder_lift_link": Body(
        2.6615, (0.1432, 0.0072, -0.0001), (0.0028, 0.0111, 0.0112, -0.0021, 0.0, 0.0),
        (
            Cylinder("blue", 0, (0.1195, 0, 0), 0.056, 0.137, 0.012),
            Cylinder("dark", 0, (0.190, 0, 0), 0.051, 0.012, 0.001, collides=False),
        ),
    ),
    "upperarm_roll_link": Body(
        2.3311, (0.1165, 0.0014, 0.0), (0.0019, 0.0045, 0.0047, -0.0001, 0.0, 0.0),
        (
            Cylinder("white", 0, (0.049, 0, 0), 0.056, 0.148, 0.012),
            Cylinder("white", 1, (0.133, 0, 0), 0.060, 0.118, 0.014),
            *caps((0.133, 0, 0), 0.043, 0.118, "blue"),
        ),
    ),
    "elbow_flex_link": Body(
        2.1299, (0.1279, 0.0073, 0.0), (0.0024, 0.0082, 0.0084, -0.0016, 0.0, 0.0),
        (
            Cylinder("blue", 0, (0.109, 0, 0), 0.053, 0.120, 0.012),
            Cylinder("dark", 0, (0.170, 0, 0), 0.048, 0.012, 0.001, collides=False),
        ),
    ),
    "forearm_roll_link": Body(
        1.6563, (0.1097, -0.0266, 0.0), (0.0016, 0.003, 0.0035, -0.0003, 0.0, 0.0),
        (
            Cylinder("white", 0, (0.046, 0, 0), 0.052, 0.140, 0.012),
            Cylinder("white", 1, (0.1245, 0, 0), 0.055, 0.108, 0.014),
            *caps((0.1245, 0, 0), 0.039, 0.108, "blue"),
        ),
    ),
    "wrist_flex_link": Body(
        1.725, (0.0882, 0.0009, -0.0001), (0.0018, 0.0042, 0.0042, -0.0001, 0.0, 0.0),
        (
            Cylinder("blue", 0, (0.0785, 0, 0), 0.049, 0.071, 0.010),
            Cylinder("dark", 0, (0.113, 0, 0), 0.044, 0.012, 0.001, collides=False),
        ),
    ),
    "wrist_roll_link": Body(
        0.1354, (0.0095, 0.0004, -0.0002), (0.0001, 0.0001, 0.0001, 0.0, 0.0, 0.0),
        (Cylinder("white", 0, (0.0105, 0, 0), 0.046, 0.061, 0.008),),
    ),
    "gripper_link": Body(
        1.5175, (-0.0900, -0.0001, -0.0017), (0.0013, 0.0019, 0.0024, 0.0, 0.0, 0.0),
        (
            Box("grey", (PALM_X, 0, 0), (PALM_LENGTH, 2 * HAND.palm_half[0], 2 * HAND.palm_half[1]), 0.014),
            Box("blue", (PALM_X - 0.012, 0, 0), (0.022, 2 * HAND.palm_half[0] - 0.02, 2 * HAND.palm_half[1] + 0.001),
                0.001, collides=False),
            Box("dark", (HAND.palm_x[1] - 0.003, 0, 0), (0.0065, 0.104, 0.030), 0.001, collides=False),
        ),
    ),
    "r_gripper_finger_link": finger(-1),
    "l_gripper_finger_link": finger(1),
}  # fmt: skip

FIXED = (
    # name, parent, child, xyz, rpy
    ("torso_fixed_joint", "base_link", "torso_fixed_link", robot.TORSO.origin, (0.0, 0.0, 0.0)),
    ("gripper_axis", "wrist_roll_link", "gripper_link", robot.GRIPPER_ORIGIN, (0.0, 0.0, 0.0)),
    ("head_camera_joint", "head_tilt_link", "head_camera_link", robot.CAMERA_ORIGIN, (0.0, 0.0, 0.0)),
    ("head_camera_optical_joint", "head_camera_link", "head_camera_optical_frame", (0.0, 0.0, 0.0),
     (-math.pi / 2, 0.0, -math.pi / 2)),
)  # fmt: skip

FILTERED = (
    # These overlap at every height of the lift, or touch when the hand closes on nothing.
    ("torso_fixed_link", "torso_lift_link"),
    ("r_gripper_finger_link", "l_gripper_finger_link"),
)


def swollen_hull(points: Array, directions: Array, radius: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """The hull of balls around `points`: vertices, their exact normals, and triangles wound outwards."""
    vertices = (points[:, None] + radius * directions).reshape(-1, 3)
    normals = np.broadcast_to(directions, (len(points), *directions.shape)).reshape(-1, 3)
    hull = ConvexHull(vertices)
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    vertices, normals = vertices[used], normals[used]
    a, b, c = vertices[triangles].swapaxes(0, 1)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return vertices, normals, triangles


def ball(axis: int, azimuths: int) -> Array:
    """Unit directions on circles of latitude about `axis`, each axis of the frame among them."""
    latitude = np.radians([-90, -60, -30, 0, 30, 60, 90])[:, None]
    azimuth = np.arange(azimuths) * 2 * np.pi / azimuths
    z = np.broadcast_to(np.sin(latitude), (len(latitude), azimuths))
    directions = np.stack([np.cos(latitude) * np.cos(azimuth), np.cos(latitude) * np.sin(azimuth), z], -1)
    return np.unique(np.roll(directions.reshape(-1, 3).round(12), axis + 1, axis=1), axis=0)


def drawn(shape: Shape) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices, normals and triangles of a shape with its fillet."""
    fillet = max(shape.fillet, 1e-4)
    if isinstance(shape, Box):
        half = np.array(shape.size) / 2 - fillet
        corners = np.array(list(itertools.product((-1, 1), repeat=3))) * half
        return swollen_hull(corners + shape.center, ball(2, 12), fillet)
    azimuths = 32
    angle = np.arange(azimuths) * 2 * np.pi / azimuths
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(azimuths)], -1) * (shape.radius - fillet)
    rise = np.array([0, 0, shape.length / 2 - fillet])
    rings = np.roll(np.concatenate([ring - rise, ring + rise]), shape.axis + 1, axis=1)
    return swollen_hull(rings + shape.center, ball(shape.axis, azimuths), fillet)


def write_obj(path: Path, shapes: list[Shape]) -> None:
    """All `shapes` as one OBJ with smooth normals."""
    lines, offset = [f"# Written by {Path(__file__).name}."], 1
    for shape in shapes:
        vertices, normals, triangles = drawn(shape)
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices]
        lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals]
        lines += [f"f {i}//{i} {j}//{j} {k}//{k}" for i, j, k in triangles + offset]
        offset += len(vertices)
    path.write_text("\n".join(lines) + "\n")


def numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def add_origin(parent: ET.Element, xyz: tuple[float, ...], rpy: tuple[float, ...] = (0.0, 0.0, 0.0)) -> None:
    ET.SubElement(parent, "origin", xyz=numbers(xyz), rpy=numbers(rpy))


def add_collision(link: ET.Element, name: str, shape: Shape, *, rubber: bool) -> None:
    collision = ET.SubElement(link, "collision", name=name)
    geometry = ET.SubElement(collision, "geometry")
    if isinstance(shape, Box):
        add_origin(collision, shape.center)
        ET.SubElement(geometry, "box", size=numbers(shape.size))
    else:
        # URDF's cylinders lie along z.
        add_origin(collision, shape.center, ((0, math.pi / 2, 0), (math.pi / 2, 0, 0), (0, 0, 0))[shape.axis])
        ET.SubElement(geometry, "cylinder", radius=numbers((shape.radius,)), length=numbers((shape.length,)))
    proximity = ET.SubElement(collision, "drake:proximity_properties")
    if rubber:
        ET.SubElement(proximity, "drake:compliant_hydroelastic")
        ET.SubElement(proximity, "drake:hydroelastic_modulus", value="1e7")
        ET.SubElement(proximity, "drake:hunt_crossley_dissipation", value="3.0")
        friction = 0.9
    else:
        ET.SubElement(proximity, "drake:rigid_hydroelastic")
        friction = 0.5
    ET.SubElement(proximity, "drake:mesh_resolution_hint", value="0.04")
    ET.SubElement(proximity, "drake:mu_static", value=numbers((friction,)))
    ET.SubElement(proximity, "drake:mu_dynamic", value=numbers((friction,)))


def add_link(urdf: ET.Element, name: str, body: Body, meshes: Path) -> None:
    link = ET.SubElement(urdf, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    add_origin(inertial, body.com)
    ET.SubElement(inertial, "mass", value=numbers((body.mass,)))
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ET.SubElement(inertial, "inertia", {key: numbers((value,)) for key, value in zip(keys, body.inertia, strict=True)})
    for color in dict.fromkeys(shape.color for shape in body.shapes):
        path = meshes / f"{name.removesuffix('_link')}_{color}.obj"
        write_obj(path, [shape for shape in body.shapes if shape.color == color])
        visual = ET.SubElement(link, "visual", name=path.stem)
        ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=f"{meshes.name}/{path.name}")
        ET.SubElement(visual, "material", name=color)
    for index, shape in enumerate(s for s in body.shapes if s.collides):
        rubber = name.endswith("finger_link") and shape.color == "dark"
        add_collision(link, f"{name}_{'pad' if rubber else index}", shape, rubber=rubber)


def add_joint(urdf: ET.Element, joint: robot.Joint) -> None:
    element = ET.SubElement(urdf, "joint", name=joint.name, type=joint.kind)
    add_origin(element, joint.origin)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    ET.SubElement(element, "axis", xyz=numbers(joint.axis))
    limit = {"effort": numbers((joint.effort,)), "velocity": numbers((joint.velocity,))}
    if joint.kind != "continuous":
        limit |= {"lower": numbers((joint.lower,)), "upper": numbers((joint.upper,))}
    ET.SubElement(element, "limit", limit)
    if joint in robot.FINGERS:
        # As a geared drive does: with all its force it goes at its limit of speed, also when what it held slips out.
        ET.SubElement(element, "dynamics", damping=numbers((joint.effort / joint.velocity,)))
    if joint.name == robot.FINGERS[1].name:
        # One drive opens and closes both fingers.
        ET.SubElement(element, "mimic", joint=robot.FINGERS[0].name, multiplier="1", offset="0")


def build(folder: Path) -> Path:
    """Writes `fetch.urdf` and `fetch/*.obj` into `folder`; returns the URDF's path."""
    meshes = folder / "fetch"
    meshes.mkdir(exist_ok=True)
    urdf = ET.Element("robot", {"name": "fetch", "xmlns:drake": "http://drake.mit.edu"})
    urdf.append(ET.Comment(f" Written by {Path(__file__).name}. "))
    for name, rgb in COLORS.items():
        ET.SubElement(ET.SubElement(urdf, "material", name=name), "color", rgba=numbers((*rgb, 1.0)))
    for name, body in BODIES.items():
        add_link(urdf, name, body, meshes)
    for name in ("head_camera_link", "head_camera_optical_frame"):
        ET.SubElement(urdf, "link", name=name)
    for joint in robot.JOINTS:
        add_joint(urdf, joint)
    for name, parent, child, xyz, rpy in FIXED:
        element = ET.SubElement(urdf, "joint", name=name, type="fixed")
        add_origin(element, xyz, rpy)
        ET.SubElement(element, "parent", link=parent)
        ET.SubElement(element, "child", link=child)
    for joint in robot.JOINTS:
        transmission = ET.SubElement(urdf, "transmission", name=f"{joint.name}_transmission")
        ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
        ET.SubElement(transmission, "joint", name=joint.name)
        ET.SubElement(transmission, "actuator", name=joint.name)
    for pair in FILTERED:
        group = ET.SubElement(urdf, "drake:collision_filter_group", name="_and_".join(pair))
        for member in pair:
            ET.SubElement(group, "drake:member", link=member)
        ET.SubElement(group, "drake:ignored_collision_filter_group", name="_and_".join(pair))
    ET.indent(urdf)
    path = folder / "fetch.urdf"
    ET.ElementTree(urdf).write(path, encoding="utf-8", xml_declaration=True)
    return path


if __name__ == "__main__":
    print(build(HERE))
