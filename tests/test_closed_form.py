"""The eight ways to reach a pose, and the search where a grid misses them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake import robot
from sum_drake.closed_form import Links, seek, sweep
from sum_drake.kinematics import LINKS, Arm

ARM = Arm()
WIDE = np.array([10.0, 10.0, np.pi, np.inf, np.pi, np.inf, np.pi, np.inf])
"""Limits that rule nothing out."""


def positions(seed):
    """(8,), within the limits and away from where branches meet."""
    rng = np.random.default_rng(seed)
    q = np.array([*rng.uniform([0.0, -1.6, -1.2], [0.38, 1.6, 1.5]), *rng.uniform(-np.pi, np.pi, 5)])
    for j, most in ((4, 2.2), (6, 2.1)):
        q[j] = np.copysign(0.05 + abs(q[j]) / np.pi * (most - 0.05), q[j])
    return q


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_there_are_eight_ways_and_the_one_that_made_the_pose_is_among_them(seed):
    q = positions(seed)
    qs = sweep(ARM.forward(q), q[:1], q[1:2], q, LINKS, -WIDE, WIDE)
    assert qs.shape == (8, 8)
    np.testing.assert_allclose(ARM.forward_many(qs), np.tile(ARM.forward(q), (8, 1, 1)), atol=1e-9)
    apart = np.abs(qs[:, None] - qs[None]).max(-1)
    assert (apart + np.eye(8) > 1e-3).all()
    assert np.abs(qs - q).max(1).min() < 1e-6
    turns = np.abs(qs - q)[:, np.isinf(WIDE)]
    assert (turns <= np.pi + 1e-9).all()


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_limits_leave_out_what_is_beyond_them_and_nothing_else(seed):
    q = positions(seed)
    lower, upper = robot.limits()
    every = sweep(ARM.forward(q), q[:1], q[1:2], q, LINKS, -WIDE, WIDE)
    inside = ((every >= lower) & (every <= upper)).all(1)
    found = sweep(ARM.forward(q), q[:1], q[1:2], q, LINKS, lower, upper)
    assert len(found) == inside.sum() >= 4
    np.testing.assert_array_equal(found, every[inside])
    assert len(sweep(ARM.forward(q), q[:1], upper[1:2] + 0.1, q, LINKS, lower, upper)) == 0
    assert len(sweep(ARM.forward(q), lower[:1] - 0.1, q[1:2], q, LINKS, lower, upper)) == 0


def test_a_search_goes_from_outside_the_limits_to_their_inside():
    lower, upper = robot.limits()
    torsos, pans = np.linspace(lower[0], upper[0], 4), np.linspace(lower[1], upper[1], 8)
    found = 0
    for seed in range(100):
        X_WG = ARM.forward(positions(seed))
        places = seek(X_WG, torsos, pans, LINKS, lower, upper)
        for torso, pan in places:
            assert lower[0] <= torso <= upper[0] and lower[1] <= pan <= upper[1]
            qs = sweep(X_WG, np.array([torso]), np.array([pan]), robot.VIEW.copy(), LINKS, lower, upper)
            np.testing.assert_allclose(ARM.forward_many(qs), np.tile(X_WG, (len(qs), 1, 1)), atol=1e-9)
            assert len(qs) >= 4
        found += len(places) > 0
    assert found == 100


def test_a_search_for_what_is_out_of_reach_ends_with_nothing():
    lower, upper = robot.limits()
    X_WG = np.eye(4)
    X_WG[:3, 3] = 2.0, 0.0, 0.8
    assert seek(X_WG, np.linspace(0, 0.38, 4), np.linspace(-1.6, 1.6, 8), LINKS, lower, upper).shape == (0, 2)


def test_a_wrist_on_the_axis_of_the_lift_is_out_of_reach():
    lower, upper = robot.limits()
    links = Links((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.35, 0.32, 0.0)
    torsos, pans = np.array([0.0, 0.1]), np.array([0.0, 0.5])
    assert sweep(np.eye(4), torsos, pans, np.zeros(8), links, lower, upper).shape == (0, 8)
    assert seek(np.eye(4), torsos, pans, links, lower, np.minimum(upper, [0.1, *[np.inf] * 7])).shape == (0, 2)
