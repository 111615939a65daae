"""What is known of the Fetch-like robot without loading its URDF: joints, limits, hand and standing poses.

Origins, axes, limits, efforts and speeds are Fetch Robotics' published kinematics. `models/robots/build_fetch.py`
writes the URDF from this table, so that the two cannot differ.
"""

import dataclasses
from typing import Literal

import numpy as np

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.types import Array, readonly

FETCH_URDF = "package://sum_drake/robots/fetch.urdf"


@dataclasses.dataclass(frozen=True)
class Joint:
    """One actuated joint: parent-relative origin (no rotation), axis, position limits, effort and speed limits."""

    name: str
    parent: str
    child: str
    kind: Literal["prismatic", "revolute", "continuous"]
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    effort: float
    velocity: float


TORSO = Joint(
    "torso_lift_joint", "base_link", "torso_lift_link", "prismatic",
    (-0.086875, 0, 0.37743), (0, 0, 1), 0.0, 0.38615, 450.0, 0.1,
)  # fmt: skip
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
INF = float("inf")
ARM = (
    Joint("shoulder_pan_joint", "torso_lift_link", "shoulder_pan_link", "revolute",
          (0.119525, 0, 0.34858), Z, -1.6056, 1.6056, 33.82, 1.256),
    Joint("shoulder_lift_joint", "shoulder_pan_link", "shoulder_lift_link", "revolute",
          (0.117, 0, 0.06), Y, -1.221, 1.518, 131.76, 1.454),
    Joint("upperarm_roll_joint", "shoulder_lift_link", "upperarm_roll_link", "continuous",
          (0.219, 0, 0), X, -INF, INF, 76.94, 1.571),
    Joint("elbow_flex_joint", "upperarm_roll_link", "elbow_flex_link", "revolute",
          (0.133, 0, 0), Y, -2.251, 2.251, 66.18, 1.521),
    Joint("forearm_roll_joint", "elbow_flex_link", "forearm_roll_link", "continuous",
          (0.197, 0, 0), X, -INF, INF, 29.35, 1.571),
    Joint("wrist_flex_joint", "forearm_roll_link", "wrist_flex_link", "revolute",
          (0.1245, 0, 0), Y, -2.16, 2.16, 25.7, 2.268),
    Joint("wrist_roll_joint", "wrist_flex_link", "wrist_roll_link", "continuous",
          (0.1385, 0, 0), X, -INF, INF, 7.36, 2.268),
)  # fmt: skip
HEAD = (
    Joint("head_pan_joint", "torso_lift_link", "head_pan_link", "revolute",
          (0.053125, 0, 0.603), Z, -1.57, 1.57, 0.32, 1.57),
    Joint("head_tilt_joint", "head_pan_link", "head_tilt_link", "revolute",
          (0.14253, 0, 0.058), Y, -0.76, 1.45, 0.68, 1.57),
)  # fmt: skip
FINGERS = (
    Joint("r_gripper_finger_joint", "gripper_link", "r_gripper_finger_link", "prismatic",
          (0, 0, 0), (0, -1, 0), 0.0, 0.05, 60.0, 0.05),
    Joint("l_gripper_finger_joint", "gripper_link", "l_gripper_finger_link", "prismatic",
          (0, 0, 0), (0, 1, 0), 0.0, 0.05, 60.0, 0.05),
)  # fmt: skip
GRIPPER_ORIGIN = (0.16645, 0.0, 0.0)
"""gripper_link (frame G) on wrist_roll_link."""
CAMERA_ORIGIN = (0.055, 0.0, 0.0225)
"""head_camera_link on head_tilt_link; the optical frame C has z along its x, x along its -y."""

ARM_JOINTS = (TORSO, *ARM)
"""The 8 joints that planning moves, in the order of every q in this project."""
JOINTS = (*ARM_JOINTS, *HEAD, *FINGERS)
"""All 12 actuated joints, in the order of the station's desired state and effort."""
STATE_JOINTS = (*ARM_JOINTS, *FINGERS, *HEAD)
"""The same in the plant's own order (depth first through the URDF), that of the station's measured state."""

ACCELERATION = readonly([0.3, 1.5, 1.5, 1.5, 1.5, 2.0, 2.5, 2.5])
"""Acceleration limits of ARM_JOINTS, m/s^2 and rad/s^2: ours, Fetch publishes none."""
JERK = readonly([3.0, 15.0, 15.0, 15.0, 15.0, 20.0, 25.0, 25.0])
"""Jerk limits of ARM_JOINTS: ours."""

VIEW = readonly([0.30, 1.32, 1.40, -0.20, 1.72, 0.0, 1.66, 0.0])
"""ARM_JOINTS where the arm is tucked beside the robot, out of the camera's view of the table and the bins' rims."""
VIEW_HEAD = readonly([0.0, 0.85])
"""Head pan and tilt that centre the table in the picture."""


@dataclasses.dataclass(frozen=True)
class Hand:
    """The hand as boxes in G (x out of the palm, y closing), metres."""

    gap_max: float = 0.10
    pad_x: tuple[float, float] = (-0.031, 0.031)
    """Extent of the pads along the approach axis."""
    pad_half_width: float = 0.0125
    """Half the extent of the pads along G's z."""
    pad_thickness: float = 0.014
    """Extent of a finger along y, outward from its inner face at +-gap / 2."""
    palm_x: tuple[float, float] = (-0.125, -0.031)
    palm_half: tuple[float, float] = (0.0625, 0.037)
    """Half the palm's extents along y and z."""


HAND = Hand()


def limits() -> tuple[Array, Array]:
    """Lower and upper position limits of ARM_JOINTS, (8,) each; infinite where continuous."""
    return np.array([j.lower for j in ARM_JOINTS]), np.array([j.upper for j in ARM_JOINTS])


def velocity_limits() -> Array:
    """Speed limits of ARM_JOINTS, (8,)."""
    return np.array([j.velocity for j in ARM_JOINTS])


def arm_positions(state: Array) -> Array:
    """Positions (8,) of ARM_JOINTS from the station's measured state (24,)."""
    return np.array(state[: len(ARM_JOINTS)])


def arm_velocities(state: Array) -> Array:
    """Velocities (8,) of ARM_JOINTS from the station's measured state (24,)."""
    first = len(STATE_JOINTS)
    return np.array(state[first : first + len(ARM_JOINTS)])


def finger_gap(state: Array) -> float:
    """Distance between the fingers, metres, from the station's measured state (24,)."""
    first = len(ARM_JOINTS)
    return float(np.sum(state[first : first + len(FINGERS)]))


def squeeze(effort: Array) -> float:
    """Force with which the drives close the fingers, newtons, from the station's measured effort (12,).

    A hand that has closed on something pushes with all it has; one that has closed on nothing has arrived.
    """
    return float(-np.mean(effort[len(JOINTS) - len(FINGERS) :]))


def camera_pose(state: Array) -> Array:
    """X_BC (4, 4) of the head camera on the robot's base from the station's measured state (24,)."""
    X_BC = np.eye(4)
    for joint in (TORSO, *HEAD):
        value = state[STATE_JOINTS.index(joint)]
        motion = np.asarray(joint.axis) * value
        p = np.asarray(joint.origin)
        if joint.kind == "prismatic":
            X_BC = X_BC @ transform(np.eye(3), p + motion)
        else:
            X_BC = X_BC @ transform(rotation_from_vector(motion), p)
    optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return np.asarray(X_BC @ transform(optical, np.array(CAMERA_ORIGIN)))


def desired_state(q: Array, gap: float, *, v: Array | None = None, head: Array = VIEW_HEAD) -> Array:
    """The station's desired state (24,): positions, then velocities, of JOINTS.

    q, v: positions and velocities (8,) of ARM_JOINTS; gap: distance between the fingers, metres, to which they are
    driven with limited force; head: pan and tilt (2,).
    """
    fingers = np.full(len(FINGERS), gap / 2)
    rates = np.zeros(len(JOINTS))
    if v is not None:
        rates[: len(ARM_JOINTS)] = v
    return np.concatenate([q, head, fingers, rates])
