"""What hangs on the hand after it was opened: shaken off over its place, or told."""

import pytest
from planner_bench import PLAN, TRACK, Bench

from sum_drake.shaking import SHAKES
from sum_drake.task import Pick, Stop


def test_what_hangs_on_the_hand_is_shaken_off_where_it_was_to_go():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish()
    bench.rest()
    assert (bench.shaken, bench.out("motion").id, bench.out("attempts")) == ([(5, 0)], 2, ())
    assert bench.out("observe")[0] == 1, "it does not look with that on its hand"
    bench.shake_off()
    (attempt,) = bench.out("attempts")
    action = attempt.action
    assert (attempt.reason, action.released, action.hangs, action.held_place) == ("executed", True, False, True)
    bench.look(1)
    assert (bench.out("outcome"), len(bench.shaken)) == ("cleared", 1)


def test_what_hangs_on_the_hand_as_it_draws_back_is_shaken_off_before_the_arm_carries_it_away():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.run("retreat")
    assert bench.shaken == [], "a moving hand is not weighed"
    bench.run("weigh")
    assert bench.shaken == [], "nor one that swings, perhaps"
    bench.run("weigh")
    assert (bench.shaken, bench.out("motion").id) == ([(5, 0)], 2)
    bench.shake_off()
    (attempt,) = bench.out("attempts")
    action = attempt.action
    assert (attempt.reason, action.released, action.hangs, action.held_place) == ("executed", True, False, True)


def test_what_cannot_be_shaken_off_where_it_was_let_go_is_carried_back_and_told():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), shakes=False)
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    for segment in ("weigh", "weigh", "weigh", "return"):
        bench.run(segment)
        assert (bench.out("motion").id, bench.out("attempts")) == (1, ())
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.hangs) == ("hangs_on_hand", True)


@pytest.mark.parametrize("shakes", [True, False])
def test_what_stays_on_the_hand_was_not_placed_and_the_loop_goes_on(shakes):
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Stop("cleared", ()), shakes=shakes)
    bench.carried()
    bench.hand(0.1, hanging=0.06)
    for _ in range(1 + SHAKES * shakes):
        assert bench.out("attempts") == ()
        bench.finish()
        bench.rest()
    assert bench.shaken == ([(5, times) for times in range(SHAKES)] if shakes else [])
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.released, attempt.action.hangs) == ("hangs_on_hand", True, True)
    bench.look(1)
    assert bench.out("outcome") == "cleared"


def test_a_hand_that_is_stopped_while_it_shakes_goes_on_with_that_where_it_is():
    """What hangs on it is what was stopped, mostly, and would fall on the way back."""
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish()
    bench.rest()
    bench.run("weigh")
    bench.run("shake")
    bench.finish("unexpected_effort")
    assert (bench.shaken, bench.brought_back) == ([(5, 0), (5, 1)], [])
    assert (bench.out("motion").id, bench.out("attempts")) == (3, ())
    bench.shake_off()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.held_place, attempt.action.hangs) == ("executed", True, False)


def test_a_hand_that_is_stopped_in_its_last_shake_or_with_nothing_on_it_goes_back_and_is_weighed_again():
    for times in (1, SHAKES):
        bench = Bench(Pick(PLAN, TRACK, "bin", ()))
        bench.carried()
        bench.hand(0.1, hanging=0.3)
        bench.finish()
        bench.rest()
        for i in range(times):
            bench.run("weigh")
            bench.run("shake")
            if times == 1:
                bench.hand(0.1)
            bench.finish("unexpected_effort")
            assert bench.out("motion").id == 3 + i
        assert (len(bench.shaken), bench.brought_back, bench.out("attempts")) == (times, [False], ())
        bench.hand(0.1)
        bench.finish()
        bench.rest()
        (attempt,) = bench.out("attempts")
        assert (attempt.reason, attempt.action.hangs) == ("executed", False)


def test_an_arm_that_is_stopped_with_something_on_its_hand_goes_to_shake_it_off_not_back():
    """What hangs there is what was stopped, mostly: on the way back it would fall where it has no business."""
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.run("return")
    bench.finish("unexpected_effort")
    assert (bench.shaken, bench.brought_back, bench.out("motion").id) == ([(5, 0)], [], 2)
    bench.shake_off()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.hangs, attempt.action.held_place) == ("unexpected_effort", False, True)


def test_what_weighs_on_an_arm_that_was_stopped_may_be_what_stopped_it_and_undoes_nothing():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish("unexpected_effort")
    assert bench.shaken == [(5, 0)]
    bench.hand(0.1)
    bench.shake_off()
    (attempt,) = bench.out("attempts")
    assert (attempt.action.held_place, attempt.action.hangs) == (True, False)


def test_what_falls_off_the_hand_before_it_is_over_the_place_was_lost_on_the_way():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish()
    bench.rest()
    bench.run("shake")
    bench.hand(0.1)
    bench.run("weigh")
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    action = attempt.action
    assert (attempt.reason, action.hangs, action.held_lift, action.held_place) == (
        "lost_in_transport", False, True, False,
    )  # fmt: skip


def test_what_was_shaken_off_once_says_nothing_of_what_falls_off_in_the_next_pick():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish()
    bench.rest()
    bench.shake_off()
    bench.shakes = False
    bench.carried(1)
    bench.hand(0.1, hanging=0.3)
    bench.run("weigh")
    bench.run("weigh")
    bench.run("return")
    bench.hand(0.1)
    bench.finish()
    bench.rest()
    told = [(attempt.reason, attempt.action.held_place) for attempt in bench.out("attempts")]
    assert told == [("executed", True), ("lost_in_transport", False)]


def test_what_hangs_is_told_although_the_arm_was_stopped_after_the_release():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()), shakes=False)
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.run("return")
    bench.finish("unexpected_effort")
    bench.finish()
    bench.rest()
    (attempt,) = bench.out("attempts")
    assert (attempt.reason, attempt.action.hangs) == ("hangs_on_hand", True)
