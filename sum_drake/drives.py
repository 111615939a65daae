"""The robot's joint drives: how stiff they are, and how far a command may lead, so that none gives or does too much."""

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

FINGER_LEAD = FINGER_DAMPING * min(joint.velocity for joint in FINGERS) / min(STIFFNESS[-len(FINGERS) :])
"""How far a command may lead a finger, metres: one that nothing stops any longer then gets no faster than it may. It is
more than the 2 mm in which a drive gives its 60 N."""

_N = len(ARM_JOINTS)
_EFFORT = np.array([joint.effort for joint in ARM_JOINTS])
_V = slice(len(STATE_JOINTS), len(STATE_JOINTS) + _N)
"""Velocities of ARM_JOINTS in the measured state."""
_Q_FINGERS = slice(_N, _N + len(FINGERS))
"""Positions of FINGERS in the measured state."""
_FINGERS = slice(len(JOINTS) - len(FINGERS), len(JOINTS))
"""And in the desired one."""


def within_limits(desired: Array, state: Array, step: float) -> Array:
    """The desired state (24,), with positions so near the measured ones that no drive gives or does more than it may.

    An arm that cannot follow its motion would else push with all it has until it has braked: none of its drives gives
    more than SHARE. Fingers would close on nothing faster than they can, once what they held with all their force has
    slipped out: they are led by FINGER_LEAD at most. desired: positions, then velocities, of JOINTS; state: the
    station's, measured, (24,). step: seconds until the drives compare the two, in which the arm moves on.
    """
    v = state[_V]
    q = state[:_N] + step * v
    damping = DAMPING[:_N] * (desired[len(JOINTS) :][:_N] - v)
    effort = STIFFNESS[:_N] * (desired[:_N] - q) + damping
    limited = np.clip(effort, -SHARE * _EFFORT, SHARE * _EFFORT)
    limited = np.where(limited == effort, desired[:_N], q + (limited - damping) / STIFFNESS[:_N])
    fingers = np.clip(desired[_FINGERS], state[_Q_FINGERS] - FINGER_LEAD, state[_Q_FINGERS] + FINGER_LEAD)
    return np.concatenate([limited, desired[_N : _FINGERS.start], fingers, desired[len(JOINTS) :]])
