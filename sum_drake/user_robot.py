"""A user's own robot for planning: what a URDF and an SRDF say of links, joints, collision shapes and pairs.

Only what planning asks for is kept. Visuals, transmissions and simulator tags are passed over and inertias are looked
at and dropped, so a robot loads though its pictures are elsewhere. What is odd but does not change a plan is a note;
what cannot be used raises InputError.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia, WeldJoint
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from sum_drake.assets import InputError
from sum_drake.collision_pairs import filter_groups, srdf_pairs
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.parsing import parser_allowed
from sum_drake.types import Array, Immutable
from sum_drake.urdf import MOVING, UserJoint, UserLink, base_link, check_follows, once, parse_xml, read_joint, read_link
from sum_drake.urdf_inertia import check_inertias

STEP = 0.005
"""Radians (and metres) between the configurations at which an edge of the checker is looked at."""
ROBOT = "robot"
"""The robot's model instance in a checker's plant."""
OBSTACLES = "obstacles"
"""The one body (and model instance) that all obstacles belong to, each a geometry named OBSTACLES::NAME."""


@dataclasses.dataclass(frozen=True, eq=False)
class UserRobot(Immutable):
    """A robot as planning sees it. Its base link is the root of the tree and stands on the world's origin."""

    path: Path
    base: str
    links: tuple[UserLink, ...]
    joints: tuple[UserJoint, ...]
    """All of the URDF's, in its order."""
    disabled: frozenset[tuple[str, str]]
    """Pairs of links, each sorted, that may touch."""
    notes: tuple[str, ...] = ()
    """What was passed over or replaced, one line each, for the user to read."""

    @property
    def movable(self) -> tuple[UserJoint, ...]:
        """Joints that a problem may move: revolute, continuous or prismatic, and neither following nor followed."""
        leaders = {joint.follows[0] for joint in self.joints if joint.follows}
        return tuple(j for j in self.joints if j.kind in MOVING and j.follows is None and j.name not in leaders)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the movable joints."""
        return tuple(joint.name for joint in self.movable)

    @property
    def lower(self) -> Array:
        """Lower limits of `names`, (n,); -inf where there is none."""
        return np.array([joint.lower for joint in self.movable])

    @property
    def upper(self) -> Array:
        """Upper limits of `names`, (n,); inf where there is none."""
        return np.array([joint.upper for joint in self.movable])

    @property
    def velocity(self) -> Array:
        """Speed limits of `names`, (n,)."""
        return np.array([joint.velocity for joint in self.movable])

    def limits(self, names: Sequence[str]) -> tuple[Array, Array, Array]:
        """Lower, upper and speed limits (n,) of some movable joints."""
        chosen = [{joint.name: joint for joint in self.movable}[name] for name in names]
        return (
            np.array([joint.lower for joint in chosen]),
            np.array([joint.upper for joint in chosen]),
            np.array([joint.velocity for joint in chosen]),
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Obstacle(Immutable):
    """Something that stands still."""

    name: str
    shape: Shape
    X_WO: Array
    """(4, 4)."""


def load_robot(urdf: Path, srdf: Path | None = None) -> UserRobot:
    """Reads a robot. Raises InputError, one line, for what planning cannot use.

    Collision meshes are found beside the URDF, in folders above it and on ROS_PACKAGE_PATH (`find_mesh`), and taken as
    convex pieces (`convex_pieces`). Pairs that the SRDF disables are taken from it, and Drake's collision filter
    groups from the URDF. Links that the SRDF names and the URDF lacks are a note: published SRDFs are shared by
    variants of a robot.
    """
    root = parse_xml(urdf, "a URDF")
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError(f"{urdf}: has xacro tags; expected a plain URDF (run xacro on it first)")
    notes: list[str] = []
    links = tuple(read_link(element, urdf) for element in root.findall("link"))
    names = [link.name for link in links]
    once(names, "link", urdf)
    if not links:
        raise InputError(f"{urdf}: has no link; expected a robot")
    joints = tuple(read_joint(element, urdf, notes) for element in root.findall("joint"))
    base = base_link(joints, names, urdf)
    for joint in joints:
        check_follows(joint, joints, urdf)
        if joint.kind in ("floating", "planar"):
            notes.append(f"{urdf}: joint '{joint.name}' is {joint.kind}: held where it is at 0")
    if not any(link.shapes for link in links):
        notes.append(f"{urdf}: no link has a collision shape: everything is free")
    check_inertias(root, joints, urdf, notes)
    disabled = filter_groups(root, set(names), urdf)
    if srdf is not None:
        disabled = srdf_pairs(srdf, set(names), disabled, urdf, notes)
    return UserRobot(urdf, base, links, joints, frozenset(disabled), tuple(notes))


def make_checker(
    robot: UserRobot, names: Sequence[str], obstacles: Sequence[Obstacle] = ()
) -> SceneGraphCollisionChecker:
    """The robot, its base fixed to the world, among obstacles of different names. Only the joints `names` can move.

    All other joints are fixed at 0 (a mimic joint at its offset), so links that cannot move against each other are one
    body to Drake and never collide; nor do neighbours across a joint, nor the pairs in `robot.disabled`. Links fixed to
    the base never collide with obstacles, for the same reason. All obstacles are one body's geometries, of their names.
    """
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    instance = plant.AddModelInstance(ROBOT)
    # Nothing moves by force here: any inertia will do.
    inertia = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    friction = CoulombFriction(1.0, 1.0)
    bodies = {link.name: plant.AddRigidBody(link.name, instance, inertia) for link in robot.links}
    plant.WeldFrames(plant.world_frame(), bodies[robot.base].body_frame())
    for joint in robot.joints:
        parent, child = bodies[joint.parent], bodies[joint.child].body_frame()
        X_PJ = RigidTransform(joint.X_PJ)
        if joint.name not in names:
            plant.AddJoint(WeldJoint(joint.name, parent.body_frame(), child, X_PJ @ _at_rest(joint)))
            continue
        frame = plant.AddFrame(FixedOffsetFrame(f"{joint.name}_parent", parent.body_frame(), X_PJ))
        kind = PrismaticJoint if joint.kind == "prismatic" else RevoluteJoint
        plant.AddJoint(kind(joint.name, frame, child, joint.axis, joint.lower, joint.upper))
    for link in robot.links:
        for i, (shape, X_LG) in enumerate(link.shapes):
            plant.RegisterCollisionGeometry(bodies[link.name], X_LG, shape, f"{link.name}_{i}", friction)
    # One body for all of them: a hundred would make every check several times as slow.
    body = plant.AddRigidBody(OBSTACLES, plant.AddModelInstance(OBSTACLES), inertia)
    plant.WeldFrames(plant.world_frame(), body.body_frame())
    for obstacle in obstacles:
        plant.RegisterCollisionGeometry(body, RigidTransform(obstacle.X_WO), obstacle.shape, obstacle.name, friction)
    checker = SceneGraphCollisionChecker(
        model=builder.Build(), robot_model_instances=[instance], edge_step_size=STEP, implicit_context_parallelism=False
    )
    matrix = np.array(checker.GetFilteredCollisionMatrix())
    for pair in robot.disabled:
        a, b = (int(bodies[name].index()) for name in pair)
        matrix[a, b] = matrix[b, a] = 1
    checker.SetCollisionFilterMatrix(matrix)
    return checker


def plant_positions(checker: SceneGraphCollisionChecker, names: Sequence[str], qs: Array) -> Array:
    """Positions (..., n) in the order of the checker's plant for qs (..., n) in the order of `names`."""
    instance = checker.plant().GetModelInstanceByName(ROBOT)
    order = [checker.plant().GetJointByName(name, instance).position_start() for name in names]
    positions = np.empty(np.shape(qs))
    positions[..., order] = qs
    return positions


def _at_rest(joint: UserJoint) -> RigidTransform:
    """How far a joint that nothing moves is from 0: what it mimics stays at 0, and so it is at its offset."""
    if joint.follows is None or joint.kind not in MOVING:
        return RigidTransform()
    motion = joint.follows[2] * joint.axis
    if joint.kind == "prismatic":
        return RigidTransform(motion)
    return RigidTransform(transform(rotation_from_vector(motion), np.zeros(3)))
