import numpy as np
import pytest
from planner_bench import LOAD, PLAN, REFUSED, TRACK, Bench, perception

from sum_drake.robot import VIEW
from sum_drake.systems.sorting_planner import CARRY_ONS, PUSHING
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import (
    MotionStatus,
)


def test_waits_for_its_own_observation_before_it_decides():
    bench = Bench(Stop("cleared", ()))
    bench.wait(0.3)
    assert bench.out("observe")[0] == 0, "not before things have settled"
    bench.wait(2.0)
    assert bench.out("observe")[0] == 1
    assert bench.asked == [], "no perception yet"
    bench.fix("perception", perception(0))
    bench.wait()
    assert bench.out("outcome") == "cleared"
    assert len(bench.asked) == 1


def test_a_pick_that_holds_goes_on_to_place_and_is_told_with_what_was_felt():
    bench = Bench(Pick(PLAN, TRACK, "bin", (REFUSED,)), Stop("cleared", ()))
    bench.look(0)
    assert bench.out("motion").id == 0
    assert bench.out("executed_action") is None
    bench.hand(0.038)
    bench.finish()
    assert bench.out("motion").id == 1
    bench.fix("motion_status", MotionStatus(1, "transport", False))
    bench.hand(0.036)
    bench.wait()
    bench.fix("motion_status", MotionStatus(1, "open", False))
    bench.hand(0.1)
    bench.wait()
    bench.finish()
    assert bench.out("executed_action") is None, "not before the hand was weighed"
    bench.rest()
    action = bench.out("executed_action")
    assert (action.track, action.released) == (5, True)
    assert action.gap_lift == pytest.approx(0.038)
    assert action.gap_place == pytest.approx(0.036), "before the hand opened"
    assert (action.squeeze_lift, action.squeeze_place) == (60.0, 60.0)
    assert (action.held_lift, action.held_place, action.hangs) == (True, True, False)
    refused, attempt = bench.out("attempts")
    assert refused == REFUSED
    assert (attempt.reason, attempt.region, attempt.grasp_candidates) == ("executed", "bin", 20)
    bench.look(1)
    assert bench.out("outcome") == "cleared"


def test_a_move_is_told_as_one_and_felt_until_it_is_set_down():
    bench = Bench(Pick(PLAN, TRACK, "table", (), "move", "in the way"), Stop("cleared", ()))
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.fix("motion_status", MotionStatus(1, "transport", False))
    bench.wait()
    bench.fix("motion_status", MotionStatus(1, "lower", False))
    bench.hand(0.037)
    bench.wait()
    bench.fix("motion_status", MotionStatus(1, "open", False))
    bench.hand(0.1)
    bench.wait()
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    action = bench.out("executed_action")
    assert (attempt.kind, action.kind, attempt.region, attempt.why) == ("move", "move", "table", "in the way")
    assert action.gap_place == pytest.approx(0.037), "on its way down"


def test_an_empty_hand_gives_up_and_retreats():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.look(0)
    bench.hand(0.0005)
    bench.finish()
    assert bench.out("motion").id == 1
    bench.finish()
    (attempt,) = bench.out("attempts")
    assert attempt.reason == "empty_hand"
    assert not attempt.action.released and attempt.action.hangs is None


def test_an_object_lost_on_the_way_is_felt():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.fix("motion_status", MotionStatus(1, "transport", False))
    bench.hand(0.0)
    bench.wait()
    bench.finish()
    bench.rest()
    assert bench.out("attempts")[0].reason == "lost_in_transport"


def test_resistance_on_the_way_to_the_object_is_an_attempt_and_the_loop_goes_on():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.look(0)
    bench.run("reach", "unexpected_effort")
    assert bench.out("motion").id == 0, "not before the arm has come to rest"
    bench.finish("unexpected_effort")
    assert (bench.out("motion").id, bench.out("motion").insistence) == (1, 1.0)
    bench.finish()
    (attempt,) = bench.out("attempts")
    assert attempt.reason == "unexpected_effort"
    assert (attempt.action.released, attempt.action.held_lift) == (False, False)
    bench.look(1)
    assert bench.out("outcome") == "cleared"


def test_an_object_at_which_resistance_was_met_is_tried_again_with_more():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.look(0)
    assert bench.out("motion").insistence == 1.0
    bench.run("reach", "unexpected_effort")
    bench.finish("unexpected_effort")
    bench.finish()
    bench.look(1)
    assert bench.out("motion").insistence == 2.0


def test_a_hand_that_empties_on_the_way_does_not_go_on_to_the_place():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.run("transport")
    bench.hand(0.0)
    bench.run("transport", "empty_hand")
    bench.hand(0.04)  # it closes on something once more: too late
    bench.finish("empty_hand")
    assert bench.out("motion").id == 2
    bench.finish()
    (attempt,) = bench.out("attempts")
    action = attempt.action
    assert attempt.reason == "lost_in_transport"
    assert (action.released, action.held_lift, action.held_place) == (False, True, False)


def test_a_hand_that_empties_in_the_lift_is_an_empty_hand_whatever_it_closes_on_then():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.look(0)
    bench.hand(0.04)
    bench.finish("empty_hand")
    bench.finish()
    (attempt,) = bench.out("attempts")
    assert attempt.reason == "empty_hand"
    assert (attempt.action.held_lift, attempt.action.gap_lift) == (False, 0.0)


def test_resistance_with_the_object_in_the_hand_is_gone_around_once():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), ways_on=2)
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.run("transport")
    bench.finish("unexpected_effort")
    assert (bench.out("motion").id, bench.out("motion").load) == (2, LOAD)
    bench.run("lift")
    bench.run("transport")
    bench.run("open")
    bench.hand(0.1)
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.released, attempt.action.held_place) == ("executed", True, True)


def test_resistance_in_the_lift_is_gone_around_where_the_hand_holds_something():
    for holds in (True, False):
        bench = Bench(Pick(PLAN, TRACK, "bin", ()), ways_on=2)
        bench.look(0)
        bench.hand(0.04 if holds else 0.0)
        bench.run("lift")
        bench.finish("unexpected_effort")
        assert bench.out("motion").load == (LOAD if holds else None)
        bench.finish()
        if holds:
            bench.rest()
        (attempt,) = bench.out("attempts")
        assert (attempt.reason, attempt.action.released) == (
            ("executed", True) if holds else ("unexpected_effort", False)
        )


@pytest.mark.parametrize("ways_on", [0, 1, 5])
def test_an_object_that_cannot_be_carried_on_is_brought_back_if_it_is_still_held(ways_on):
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), ways_on=ways_on)
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    for _ in range(1 + min(ways_on, CARRY_ONS)):
        bench.run("transport")
        bench.finish("unexpected_effort")
    assert bench.out("motion").load is None and bench.brought_back == [True]
    bench.run("transport")
    bench.finish("unexpected_effort")
    assert bench.brought_back == [True, False], "stopped on that way, it lets go where it is"
    bench.finish()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.released, attempt.action.held_place) == ("unexpected_effort", False, True)


def test_an_arm_that_was_stopped_goes_on_once_it_no_longer_swings():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), ways_on=1)
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.run("transport")
    state = np.zeros(24)
    state[:8], state[8:10], state[15] = VIEW, 0.02, 0.2
    bench.planner.GetInputPort("robot_state").FixValue(bench.context, state)
    bench.finish("unexpected_effort")
    assert bench.out("motion").id == 1, "what it feels while it swings is no resistance"
    bench.hand(0.04)
    bench.wait()
    assert (bench.out("motion").id, bench.out("motion").insistence) == (2, PUSHING)


def test_a_hand_that_is_empty_brings_nothing_back():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.look(0)
    bench.hand(0.04)
    bench.finish()
    bench.run("transport")
    bench.hand(0.0)
    bench.finish("empty_hand")
    assert bench.brought_back == [False]


def test_resistance_after_the_release_does_not_undo_it():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1)
    bench.run("retreat")
    bench.finish("unexpected_effort")
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.released) == ("unexpected_effort", True)
    assert attempt.action.held_place, "until it let go"


def test_a_way_back_that_meets_resistance_is_tried_again_with_more_and_then_no_more():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.look(0)
    bench.finish("unexpected_effort")
    for insistence in (1.0, 2.0, 4.0):
        assert bench.out("motion").insistence == insistence
        assert bench.out("attempts") == ()
        bench.finish("unexpected_effort")
    assert bench.out("outcome") == "stopped: the arm was stopped on 3 ways back to the viewing pose"
    assert [attempt.reason for attempt in bench.out("attempts")] == ["unexpected_effort"]


def test_looks_again_when_nothing_can_be_done_and_counts_it():
    bench = Bench(Look((REFUSED,)), Look(()), Stop("stopped: nothing", ()))
    for step in range(3):
        bench.look(step)
    assert bench.asked == [(0, 0, 0), (1, 1, 1), (2, 1, 2)]
    assert bench.out("outcome") == "stopped: nothing"
    assert bench.out("executed_action") is None


def test_no_input_reaches_an_output_within_an_instant():
    planner = Bench().planner
    assert not planner.HasAnyDirectFeedthrough()
