"""What is told of an attempt that is over."""

import pytest
from test_sorting_planner import PLAN, TRACK

from sum_drake.attempted import Feel, attempt_of
from sum_drake.task import Pick

WIDE = Feel(PLAN.grasp.width, 60.0)


def test_a_hand_holds_what_is_about_as_wide_as_the_grasp():
    assert Feel(0.038, 60.0).holds(0.04)
    assert Feel(0.0025, 60.0).holds(0.003), "a thin wall"
    assert not Feel(0.001, 60.0).holds(0.003)
    assert not Feel(0.01, 60.0).holds(0.04)
    assert not Feel(0.1, 60.0).holds(0.08), "the fingers never closed"
    assert not Feel(0.038, 1.0).holds(0.04), "nothing resists the fingers"


@pytest.mark.parametrize(
    ("at_lift", "at_place", "hangs", "stopped", "reason"),
    [
        (WIDE, WIDE, False, "", "executed"),
        (WIDE, Feel(), False, "", "lost_in_transport"),
        (WIDE, Feel(), None, "empty_hand", "lost_in_transport"),
        (Feel(), Feel(), None, "", "empty_hand"),
        (WIDE, WIDE, None, "unexpected_effort", "unexpected_effort"),
        (WIDE, WIDE, True, "", "hangs_on_hand"),
        (WIDE, WIDE, True, "unexpected_effort", "hangs_on_hand"),
    ],
)
def test_the_reason_is_what_hangs_then_what_stopped_the_arm_then_what_was_felt(
    at_lift, at_place, hangs, stopped, reason
):
    pick = Pick(PLAN, TRACK, "bin", ())
    attempt = attempt_of(pick, 3, at_lift=at_lift, at_place=at_place, released=True, hangs=hangs, stopped=stopped)
    action = attempt.action
    assert (attempt.reason, attempt.step, action.step, action.hangs) == (reason, 3, 3, hangs)
    assert (action.held_lift, action.held_place) == (at_lift == WIDE, at_place == WIDE)
