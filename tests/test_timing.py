"""Trajectories: limits hold, the path is followed, and what is sampled is what was meant."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake import robot, timing

SIZES = np.array([0.05, *[0.5] * 7])


def polyline(seed, corners=3):
    """(corners + 2, 8): a random walk."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(corners + 1, 8)) * SIZES * 10 ** rng.uniform(-2, 0.3, (corners + 1, 1))
    return robot.VIEW + np.cumsum(np.vstack([np.zeros(8), steps]), axis=0)


def distance_to(path, q):
    """Of q (8,) from a polyline (k, 8)."""
    a, d = path[:-1], np.diff(path, axis=0)
    s = np.clip(((q - a) * d).sum(1) / (d * d).sum(1), 0, 1)
    return np.linalg.norm(a + s[:, None] * d - q, axis=1).min()


def assert_sound(trajectory, start, end):
    assert max(timing.limit_use(trajectory)) <= 1.0 + 1e-6
    for t, q in ((0.0, start), (float(trajectory.times[-1]), end)):
        np.testing.assert_allclose(timing.evaluate(trajectory, t)[0], q, atol=1e-9)
        np.testing.assert_allclose(timing.evaluate(trajectory, t)[1], 0.0, atol=1e-9)
    # Position and velocity are one function and its derivative, within the limits in between the samples too.
    times = np.linspace(0, trajectory.times[-1], 400)
    qs, vs = (np.array([timing.evaluate(trajectory, t)[k] for t in times]) for k in (0, 1))
    dt = times[1] - times[0]
    assert (np.abs(vs) <= timing.LIMITS.velocity * (1 + 1e-6)).all()
    assert (np.abs(np.diff(vs, axis=0)) / dt <= timing.LIMITS.acceleration * (1 + 1e-6)).all()
    mean = (vs[1:] + vs[:-1]) / 2
    np.testing.assert_allclose(np.diff(qs, axis=0) / dt, mean, atol=2 * dt * timing.LIMITS.acceleration.max())


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_stopping_at_corners_follows_the_path_exactly(seed):
    path = polyline(seed)
    trajectory = timing.time_path(path)
    assert_sound(trajectory, path[0], path[-1])
    assert max(distance_to(path, q) for q in timing.sample(trajectory, 0.05)) < 1e-7


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_rounding_corners_keeps_the_limits_and_saves_time(seed):
    path = polyline(seed)
    stopping, rounded = timing.time_path(path), timing.time_path(path, is_free=lambda corner: True)
    assert_sound(rounded, path[0], path[-1])
    assert rounded.times[-1] <= stopping.times[-1] + 1e-9


def test_a_straight_on_corner_is_driven_through():
    path = robot.VIEW + np.linspace(0, 1, 3)[:, None] * 2 * SIZES
    rounded = timing.time_path(path, is_free=lambda corner: True)
    assert rounded.times[-1] < 0.9 * timing.time_path(path).times[-1]
    middle = timing.evaluate(rounded, float(rounded.times[-1]) / 2)[1]
    assert np.abs(middle / timing.LIMITS.velocity).max() > 0.3


def test_a_corner_that_would_touch_is_not_rounded():
    path = polyline(5)
    asked = []
    refused = timing.time_path(path, is_free=lambda corner: bool(asked.append(corner)))
    np.testing.assert_allclose(refused.times[-1], timing.time_path(path).times[-1])
    assert all(corner.shape[1] == 8 for corner in asked)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_a_smooth_curve_is_followed_without_stops(seed):
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, 15)[:, None]
    path = robot.VIEW + SIZES * (s * rng.normal(size=8) + 0.3 * np.sin(np.pi * s) * rng.normal(size=8))
    trajectory = timing.time_curve(path)
    assert_sound(trajectory, path[0], path[-1])
    waypoints = [np.linalg.norm(trajectory.positions - q, axis=1).min() for q in path]
    assert max(waypoints) < 0.05
    assert np.abs(trajectory.velocities[2:-2]).max(1).min() > 0


def test_half_the_speed_takes_twice_the_time():
    path = polyline(6)
    assert timing.time_path(path, speed=0.5).times[-1] == pytest.approx(2 * timing.time_path(path).times[-1])


def test_standing_still_is_a_trajectory():
    still = timing.rest(robot.VIEW, 0.7)
    assert still.times[-1] == 0.7
    assert timing.limit_use(still) == (0.0, 0.0, 0.0)
    for path in (np.array([robot.VIEW]), np.array([robot.VIEW, robot.VIEW])):
        for made in (timing.time_path(path), timing.time_curve(path)):
            np.testing.assert_array_equal(timing.evaluate(made, 0.5)[0], robot.VIEW)
            np.testing.assert_array_equal(timing.evaluate(made, 0.5)[1], np.zeros(8))


def test_beyond_its_times_a_trajectory_rests():
    path = polyline(7)
    trajectory = timing.time_path(path)
    for t, q in ((-1.0, path[0]), (1e3, path[-1])):
        np.testing.assert_allclose(timing.evaluate(trajectory, t)[0], q, atol=1e-12)
        np.testing.assert_array_equal(timing.evaluate(trajectory, t)[1], np.zeros(8))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_a_way_in_reverse_is_the_same_way_at_the_same_speeds(seed):
    there = timing.time_path(polyline(seed))
    back = timing.reverse(there)
    assert_sound(back, there.positions[-1], there.positions[0])
    for time in np.linspace(0.0, there.times[-1], 7):
        q, v, *_ = timing.evaluate(there, time)
        q_back, v_back, *_ = timing.evaluate(back, there.times[-1] - time)
        np.testing.assert_allclose(q_back, q, atol=1e-9)
        np.testing.assert_allclose(v_back, -v, atol=1e-9)
