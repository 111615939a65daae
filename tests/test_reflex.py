"""When a motion is broken off, and how the arm then comes to rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake import reflex, timing
from sum_drake.dynamics import ArmDynamics
from sum_drake.playback import desired, segment_ends
from sum_drake.reflex import CAUSES, EMPTY_IN_A_ROW, IN_A_ROW, Strikes, desired_after, look, stop
from sum_drake.robot import ACCELERATION, ARM_JOINTS, HAND, JOINTS, STATE_JOINTS, VIEW, velocity_limits
from sum_drake.types import Load, Motion, Segment

DYNAMICS = ArmDynamics()
THERE = VIEW + np.array([0.05, -0.8, -0.6, 0.4, -0.3, 0.5, -0.4, 0.6])
BACK = VIEW + np.array([0.0, -0.3, -0.3, 0.0, 0.3, 0.0, 0.0, 0.0])
LOAD = Load(0.04, 0.5)
MOTION = Motion(
    3,
    (
        Segment("approach", timing.time_path(np.stack([VIEW, THERE])), 0.08),
        Segment("close", timing.rest(THERE, 1.0), 0.0),
        Segment("lift", timing.time_path(np.stack([THERE, BACK])), 0.0),
    ),
    LOAD,
)
APPROACH, CLOSE, LIFT = segment_ends(MOTION)


def felt(elapsed, *, gap=0.04, more=None, astray=None, squeeze=60.0):
    """State (24,) and effort (12,) of a robot that does what the motion asks for."""
    q, v, _ = desired(MOTION, elapsed)
    a = (desired(MOTION, elapsed + 1e-3)[1] - desired(MOTION, elapsed - 1e-3)[1]) / 2e-3
    state, effort = np.zeros(2 * len(STATE_JOINTS)), np.zeros(len(JOINTS))
    state[:8], state[12:20], state[8:10] = q, v, gap / 2
    effort[:8] = DYNAMICS.efforts(q, v, a, LOAD.mass if elapsed > CLOSE else 0.0)
    effort[-2:] = -squeeze
    if more is not None:
        effort[:8] += more
    if astray is not None:
        state[:8] += astray
    return state, effort


def strikes(elapsed, motion=MOTION, looks=1, **what):
    found = Strikes()
    for _ in range(looks):
        found = look(motion, elapsed, HAND.gap_max, *felt(elapsed, **what), found, DYNAMICS)
    return found


@pytest.mark.parametrize("elapsed", [0.1, 0.5 * APPROACH, 0.9 * APPROACH, CLOSE + 0.1, 0.5 * (CLOSE + LIFT)])
def test_an_arm_that_does_what_it_should_is_left_alone(elapsed):
    assert strikes(elapsed) == Strikes()


@pytest.mark.parametrize("joint", range(8))
def test_resistance_stops_it_once_two_looks_agree(joint):
    push = np.eye(8)[joint] * 0.25 * ARM_JOINTS[joint].effort
    assert strikes(0.5 * APPROACH, more=push).cause == ""
    for sign in (1, -1):
        assert strikes(0.5 * APPROACH, more=sign * push, looks=IN_A_ROW).cause == "unexpected_effort"
    assert strikes(0.5 * APPROACH, more=0.4 * push, looks=9).cause == "", "as much as it does of itself"
    insistent = Motion(3, MOTION.segments, LOAD, insistence=2.0)
    assert strikes(0.5 * APPROACH, insistent, more=push, looks=9).cause == ""


def test_a_joint_that_does_not_follow_stops_it():
    astray = np.eye(8)[2] * 0.05
    assert strikes(0.5 * APPROACH, astray=astray, looks=IN_A_ROW).cause == "tracking_error"


def test_a_load_is_expected_where_there_is_one():
    heavy = Motion(3, MOTION.segments, Load(0.04, 8.0))
    elapsed = 0.5 * (CLOSE + LIFT)
    assert strikes(elapsed, heavy, looks=9).cause == "unexpected_effort", "a load that is not felt"


def test_a_hand_that_empties_stops_it_while_it_carries():
    elapsed = 0.5 * (CLOSE + LIFT)
    for empty in ({"gap": 0.001}, {"gap": HAND.gap_max}, {"squeeze": 0.0}):
        assert strikes(elapsed, **empty, looks=EMPTY_IN_A_ROW - 1).cause == ""
        assert strikes(elapsed, **empty, looks=EMPTY_IN_A_ROW).cause == "empty_hand"
        assert strikes(0.5 * APPROACH, **empty, looks=9).cause == "", "there is nothing to hold yet"
        unwatched = Motion(3, MOTION.segments)
        assert strikes(0.5 * APPROACH, unwatched, **empty, looks=9).cause == ""


def test_closing_is_not_watched_and_what_passes_is_forgotten():
    assert strikes(APPROACH + 0.5, more=np.full(8, 1e3), looks=9) == Strikes()
    once = look(MOTION, 0.5, HAND.gap_max, *felt(0.5, more=np.full(8, 1e3)), Strikes(), DYNAMICS)
    assert once.counts[0] == 1
    assert look(MOTION, 0.5, HAND.gap_max, *felt(0.5), once, DYNAMICS) == Strikes()


moments = st.floats(0.0, float(LIFT) - 1e-3)


@given(moments, st.sampled_from(list(CAUSES)))
def test_a_stopped_arm_comes_to_rest_on_its_way(elapsed, cause):
    stopped = stop(MOTION, elapsed, cause)
    begin = max(end for end in (0.0, *segment_ends(MOTION)) if end <= elapsed)
    times = np.linspace(0.0, stopped.duration + 0.2, 200)
    shown = np.array([stopped.clock(t)[0] for t in times])
    assert shown[0] == pytest.approx(elapsed, abs=1e-5)
    assert begin - 1e-9 <= shown.min() and shown.max() <= segment_ends(MOTION)[segment_ends(MOTION) > elapsed][0]
    assert desired_after(MOTION, stopped, times[-1], HAND.gap_max)[1] == pytest.approx(0.0)
    if cause == "empty_hand":
        assert np.all(np.diff(shown) >= -1e-12), "it has met nothing"
    else:
        assert shown[-1] == pytest.approx(max(elapsed - reflex.BACK, begin))
    gaps = {desired_after(MOTION, stopped, float(t), HAND.gap_max)[2] for t in times}
    assert gaps == {desired(MOTION, elapsed, HAND.gap_max)[2]}, "the fingers stay as they were"


@given(moments, st.sampled_from(list(CAUSES)))
def test_stopping_is_as_smooth_as_it_can_be(elapsed, cause):
    stopped, h = stop(MOTION, elapsed, cause), 1e-4
    before = desired(MOTION, elapsed)
    after = desired_after(MOTION, stopped, 0.0, HAND.gap_max)
    np.testing.assert_allclose(after[0], before[0], atol=1e-5)
    for t in np.linspace(h, stopped.duration - h, 40):
        (q0, v0, _), (q1, v1, _) = (desired_after(MOTION, stopped, float(t + s * h), HAND.gap_max) for s in (-1, 1))
        np.testing.assert_allclose((q1 - q0) / (2 * h), (v0 + v1) / 2, atol=2e-2)
        assert np.all(np.abs(v0) <= velocity_limits() + 1e-9)
        assert np.all(np.abs(v1 - v0) / (2 * h) <= 1.2 * (1.0 + reflex.BRAKE) * ACCELERATION)
