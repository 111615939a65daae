"""The measurement of inverse kinematics, on few poses."""

import dataclasses

import numpy as np
import pytest

from sum_drake import robot
from sum_drake.bench.plan_ik import errors, measure_ik, random_positions
from sum_drake.kinematics import Arm


def test_reachable_poses_are_solved_and_measured():
    told = []
    measured = measure_ik(300, 0, lambda *progress: told.append(progress))
    assert measured.poses == 300
    assert measured.success >= 0.99
    assert len(measured.rows) == pytest.approx(300 * (1 - measured.success))
    assert 0 < measured.median_s <= measured.p95_s
    assert measured.worst_position < 1e-9
    assert measured.worst_angle < 1e-7
    assert measured.median_solutions > 10
    assert measured.median_room > measured.median_room_drawn > 0
    assert told[0] == ("ik", 0, 300)
    assert told[-1] == ("ik", 300, 300)


def test_all_but_the_seconds_follows_from_the_seed():
    def of(seed):
        return dataclasses.replace(measure_ik(50, seed), median_s=0.0, p95_s=0.0)

    assert of(1) == of(1)
    assert of(1) != of(2)


def test_poses_without_a_solution_are_counted_and_told():
    # Nothing keeps so far from the limits of the shoulder's lift.
    measured = measure_ik(20, 0, arm=Arm(margin=1.5))
    assert measured.success == 0
    assert [row["pose"] for row in measured.rows] == list(range(20))
    assert all(row["solutions"] == 0 and len(row["drawn"]) == 8 for row in measured.rows)
    assert measured.worst_position == measured.median_room == 0


def test_solutions_that_miss_the_pose_are_no_success():
    class Bent(Arm):
        def solutions(self, *args, **options):
            return super().solutions(*args, **options) + 1e-3

    measured = measure_ik(10, 0, arm=Bent())
    assert measured.success == 0
    assert measured.worst_position > 1e-4
    assert measured.worst_angle > 1e-4


def test_positions_are_drawn_from_all_that_the_limits_allow():
    qs = random_positions(2000, np.random.default_rng(0))
    lower, upper = np.maximum(robot.limits()[0], -np.pi), np.minimum(robot.limits()[1], np.pi)
    assert ((qs >= lower) & (qs <= upper)).all()
    np.testing.assert_allclose(qs.min(0), lower, atol=0.02)
    np.testing.assert_allclose(qs.max(0), upper, atol=0.02)


def test_the_error_is_that_of_the_worst():
    arm, q = Arm(), np.array([0.2, 0.3, 0.2, 0.4, 0.9, 0.7, 0.5, -0.5])
    raised, rolled = q.copy(), q.copy()
    raised[0] += 0.01
    rolled[7] += 0.02
    assert errors(arm, np.stack([q, raised, rolled]), arm.forward(q)) == pytest.approx((0.01, 0.02))
    assert errors(arm, np.empty((0, 8)), arm.forward(q)) == (0.0, 0.0)
