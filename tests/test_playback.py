import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.playback import GAP_SPEED, desired, running_segment, segment_ends
from sum_drake.robot import HAND, VIEW
from sum_drake.types import Motion, Segment, Trajectory, readonly


def straight(name, q0, q1, seconds, gap):
    v = (np.asarray(q1) - q0) / seconds
    positions, velocities = np.stack([q0, q1]), np.stack([v, v])
    trajectory = Trajectory(readonly([0.0, seconds]), readonly(positions), readonly(velocities))
    return Segment(name, trajectory, gap)


A, B = np.zeros(8), np.full(8, 0.4)
MOTION = Motion(0, (straight("reach", A, B, 2.0, 0.08), straight("close", B, B, 1.5, 0.0)))


def test_without_segments_it_is_the_viewing_pose_with_an_open_hand():
    q, v, gap = desired(Motion(-1, ()), 3.0)
    np.testing.assert_array_equal(q, VIEW)
    np.testing.assert_array_equal(v, 0.0)
    assert gap == HAND.gap_max


def test_segments_follow_one_another_and_the_end_is_held():
    assert [MOTION.segments[running_segment(MOTION, t)].name for t in (0.0, 1.9, 2.1)] == ["reach", "reach", "close"]
    assert running_segment(MOTION, 3.6) is None
    np.testing.assert_allclose(segment_ends(MOTION), [2.0, 3.5])
    np.testing.assert_allclose(desired(MOTION, 1.0)[0], 0.2)
    np.testing.assert_allclose(desired(MOTION, 99.0)[0], B)


@given(st.floats(0, 5), st.floats(0, 0.2), st.floats(0, 0.1))
def test_the_gap_never_moves_faster_than_the_fingers(t, dt, gap_start):
    before, after = desired(MOTION, t, gap_start)[2], desired(MOTION, t + dt, gap_start)[2]
    # At a boundary the step of one segment may end before the next begins.
    assert abs(after - before) <= GAP_SPEED * dt + 1e-9


def test_the_gap_reaches_what_each_segment_asks_for():
    assert desired(MOTION, 2.0 - 1e-9, gap_start=0.1)[2] == pytest.approx(0.08)
    assert desired(MOTION, 3.5)[2] == pytest.approx(0.0)
