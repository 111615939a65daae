"""No drive of the arm gives all it has, wherever it is told to be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sum_drake.drives import DAMPING, SHARE, STIFFNESS, within_effort
from sum_drake.robot import ARM_JOINTS, JOINTS, STATE_JOINTS

LIMIT = np.array([joint.effort for joint in ARM_JOINTS])
STEP = 0.004


def asked_of_arm(desired, state):
    """What the drives of the arm ask for at the end of a step in which it moves on, (8,)."""
    v = state[len(STATE_JOINTS) :][:8]
    return STIFFNESS[:8] * (desired[:8] - state[:8] - STEP * v) + DAMPING[:8] * (desired[len(JOINTS) :][:8] - v)


@given(arrays(float, 24, elements=st.floats(-2, 2)), arrays(float, 24, elements=st.floats(-2, 2)))
def test_the_arm_is_told_no_more_than_it_can_do_without_giving_all(desired, state):
    told = within_effort(desired, state, STEP)
    assert (told[8:] == desired[8:]).all(), "head and fingers do as told, and velocities are what they were"
    before, after = asked_of_arm(desired, state), asked_of_arm(told, state)
    np.testing.assert_allclose(after, np.clip(before, -SHARE * LIMIT, SHARE * LIMIT), atol=1e-6)
    assert (told[:8][abs(before) <= SHARE * LIMIT] == desired[:8][abs(before) <= SHARE * LIMIT]).all()


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_an_arm_that_follows_its_motion_does_as_told(speed):
    state, desired = np.zeros(24), np.zeros(24)
    state[12:20] = desired[12:20] = speed
    desired[:8] = STEP * speed
    assert (within_effort(desired, state, STEP) == desired).all()
