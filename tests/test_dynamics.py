"""Inverse dynamics against energy, and a load against the height that it gains."""

import numpy as np
import pytest
from arm_poses import ARM
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.dynamics import ArmDynamics
from sum_drake.robot import ARM_JOINTS, VIEW, limits

DYNAMICS = ArmDynamics()
ZERO = np.zeros(8)
shares = st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8).map(np.array)


def joints(share):
    """q (8,) within the limits."""
    lower, upper = limits()
    lower, upper = np.where(np.isfinite(lower), lower, -3.0), np.where(np.isfinite(upper), upper, 3.0)
    return lower + (share + 1) / 2 * (upper - lower)


def test_standing_still_takes_nothing():
    np.testing.assert_allclose(DYNAMICS.efforts(VIEW, ZERO, ZERO), 0.0, atol=1e-9)


def energy(q, v):
    """Kinetic energy, of the mass matrix that comes out column by column."""
    M = np.array([DYNAMICS.efforts(q, ZERO, column) for column in np.eye(8)])
    np.testing.assert_allclose(M, M.T, atol=1e-8)
    return v @ M @ v / 2


@settings(max_examples=25)
@given(shares, shares, shares)
def test_the_power_of_the_efforts_is_what_the_motion_gains(share, v, a):
    q, h = joints(share), 1e-5
    gained = (energy(q + h * v, v + h * a) - energy(q - h * v, v - h * a)) / (2 * h)
    assert v @ DYNAMICS.efforts(q, v, a) == pytest.approx(gained, abs=1e-4)


@settings(max_examples=25)
@given(shares)
def test_a_load_weighs_on_the_joints_as_it_rises_with_them(q):
    q, mass, h = joints(q), 0.8, 1e-6
    efforts = DYNAMICS.efforts(q, ZERO, ZERO, mass)
    for j in range(8):
        ahead, behind = (ARM.forward(q + sign * h * np.eye(8)[j])[2, 3] for sign in (1, -1))
        assert efforts[j] == pytest.approx(9.81 * mass * (ahead - behind) / (2 * h), abs=1e-4)
    assert efforts[0] == pytest.approx(9.81 * mass), "the torso bears all of it"


masses = st.floats(0.0, 3.0)


@settings(max_examples=25)
@given(shares, masses)
def test_what_hangs_on_the_hand_is_weighed_by_the_drives(q, mass):
    q = joints(q)
    efforts = DYNAMICS.efforts(q, ZERO, ZERO, mass)
    assert DYNAMICS.hanging(q, efforts) == pytest.approx(mass, abs=1e-9)


@settings(max_examples=25)
@given(shares, masses, shares)
def test_what_no_weight_explains_does_not_weigh(q, mass, more):
    q, limit = joints(q), np.array([joint.effort for joint in ARM_JOINTS])
    of_weight = DYNAMICS.efforts(q, ZERO, ZERO, 1.0) / limit
    across = more - of_weight * (more @ of_weight) / (of_weight @ of_weight)
    efforts = DYNAMICS.efforts(q, ZERO, ZERO, mass) + limit * across
    assert DYNAMICS.hanging(q, efforts) == pytest.approx(mass, abs=1e-9)


@settings(max_examples=25)
@given(shares, shares)
def test_an_error_of_the_drives_weighs_no_more_than_the_best_of_them_would_make_of_it(q, error):
    q, limit = joints(q), np.array([joint.effort for joint in ARM_JOINTS])
    of_weight = np.abs(DYNAMICS.efforts(q, ZERO, ZERO, 1.0) / limit).max()
    assert abs(DYNAMICS.hanging(q, 1e-3 * error * limit)) <= 1e-3 * np.sqrt(8) / of_weight + 1e-12
