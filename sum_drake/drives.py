"""The robot's joint drives: how stiff they are, and how far a command may lead so that none gives all it has."""

import numpy as np

from sum_drake.robot import ARM_JOINTS, FINGERS, JOINTS, STATE_JOINTS
from sum_drake.types import Array, readonly

STIFFNESS = readonly([240e3, 8000, 8000, 4000, 4000, 2000, 2000, 800, 20, 20, 30e3, 30e3])
"""Of JOINTS: proportional gains, N/m and N m/rad. The drives saturate at the joints' limits; a finger's at 60 N."""
FINGER_DAMPING = 3000.0
"""N s/m: the fingers meet the object without a blow."""
DAMPING = readonly([*(2 * np.sqrt(STIFFNESS[: -len(FINGERS)])), *[FINGER_DAMPING] * len(FINGERS)])
"""Of JOINTS: gains of the velocity, N s/m and N m s/rad."""
SHARE = 0.75
"""Of its largest effort that a drive of the arm is to give, whatever it runs into; motions ask for half of that."""

_N = len(ARM_JOINTS)
_EFFORT = np.array([joint.effort for joint in ARM_JOINTS])
_V = slice(len(STATE_JOINTS), len(STATE_JOINTS) + _N)
"""Velocities of ARM_JOINTS in the measured state."""


def within_effort(desired: Array, state: Array, step: float) -> Array:
    """The desired state (24,), with the arm's positions so near the measured ones that no drive gives more than SHARE.

    An arm that cannot follow its motion would else push with all it has until it has braked. desired: positions, then
    velocities, of JOINTS; state: the station's, measured, (24,). step: seconds until the drives compare the two, in
    which the arm moves on.
    """
    v = state[_V]
    q = state[:_N] + step * v
    damping = DAMPING[:_N] * (desired[len(JOINTS) :][:_N] - v)
    effort = STIFFNESS[:_N] * (desired[:_N] - q) + damping
    limited = np.clip(effort, -SHARE * _EFFORT, SHARE * _EFFORT)
    limited = np.where(limited == effort, desired[:_N], q + (limited - damping) / STIFFNESS[:_N])
    return np.concatenate([limited, desired[_N:]])
