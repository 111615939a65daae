"""No drive of the arm gives all it has, and no finger is too fast, wherever they are told to be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sum_drake.drives import DAMPING, FINGER_DAMPING, FINGER_LEAD, SHARE, STIFFNESS, within_limits
from sum_drake.robot import ARM_JOINTS, JOINTS, STATE_JOINTS

LIMIT = np.array([joint.effort for joint in ARM_JOINTS])
STEP = 0.004


def asked_of_arm(desired, state):
    """What the drives of the arm ask for at the end of a step in which it moves on, (8,)."""
    v = state[len(STATE_JOINTS) :][:8]
    return STIFFNESS[:8] * (desired[:8] - state[:8] - STEP * v) + DAMPING[:8] * (desired[len(JOINTS) :][:8] - v)


@given(arrays(float, 24, elements=st.floats(-2, 2)), arrays(float, 24, elements=st.floats(-2, 2)))
def test_the_arm_is_told_no_more_than_it_can_do_without_giving_all(desired, state):
    told = within_limits(desired, state, STEP)
    assert (told[8:10] == desired[8:10]).all() and (told[12:] == desired[12:]).all(), "head, and velocities, as told"
    assert (abs(told[10:12] - state[8:10]) <= FINGER_LEAD + 1e-12).all()
    near = abs(desired[10:12] - state[8:10]) <= FINGER_LEAD
    assert (told[10:12][near] == desired[10:12][near]).all(), "fingers that are there nearly do as told"
    before, after = asked_of_arm(desired, state), asked_of_arm(told, state)
    np.testing.assert_allclose(after, np.clip(before, -SHARE * LIMIT, SHARE * LIMIT), atol=1e-6)
    assert (told[:8][abs(before) <= SHARE * LIMIT] == desired[:8][abs(before) <= SHARE * LIMIT]).all()


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_an_arm_that_follows_its_motion_does_as_told(speed):
    state, desired = np.zeros(24), np.zeros(24)
    state[12:20] = desired[12:20] = speed
    desired[:8] = STEP * speed
    assert (within_limits(desired, state, STEP) == desired).all()


def test_a_finger_that_is_led_pushes_with_all_it_has_and_no_faster_than_it_may():
    state = np.zeros(24)
    state[8:10] = 0.02
    told = within_limits(np.zeros(24), state, STEP)
    force = STIFFNESS[-1] * (told[10:12] - state[8:10])
    assert (force <= -60.0).all(), "what it holds it holds with all"
    speed = force / FINGER_DAMPING  # at which the drive gives nothing any longer
    np.testing.assert_allclose(speed, -0.05)
