import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from test_playback import MOTION

from sum_drake.dynamics import ArmDynamics
from sum_drake.picking import PickPlan
from sum_drake.robot import VIEW
from sum_drake.shaking import SHAKES
from sum_drake.systems.ports import abstract, unpack
from sum_drake.systems.sorting_planner import CARRY_ONS, PUSHING, SortingPlanner
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import (
    Attempt,
    Camera,
    Frame,
    Grasp,
    Load,
    Motion,
    MotionStatus,
    Perception,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)

EYE = readonly(np.eye(4))
BELIEF = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
TRACK = Track(5, "mug", (0, 0, 9, 9), 0.9, 0.9, BELIEF, EYE, 0.5, 0.7, True, 0, 0)
PLAN = PickPlan(
    grasp=Grasp("mug", EYE, width=0.04, quality=0.8), X_WG=EYE, pick=MOTION, place=MOTION,
    X_WG_place=EYE, X_WO_place=EYE, grasp_candidates=20, rejected_by=(("table", 3),),
)  # fmt: skip
LOAD = Load(0.04, 0.5)
REFUSED = Attempt(0, 6, "toy", "bin", "none", "ik", 10, (("ik", 10),), None)


def perception(step):
    frame = Frame(step, np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2), np.float32), Camera(2, 2, 1, 1, 0.5, 0.5), EYE)
    return Perception(step, frame, (), (), SceneBelief(step - 1), SceneBelief(step, (TRACK,), 6), None)


class Bench:
    """The planner between ports that the test turns."""

    def __init__(self, *choices, ways_on=0, shakes=True):
        self.asked, self.shaken, self.brought_back, self.shakes = [], [], [], shakes
        choices, ways_on = list(choices), [MOTION.segments] * ways_on

        def decide(perception, attempts, looks, q):
            self.asked.append((perception.step, len(attempts), looks))
            return choices.pop(0)

        def retreat(perception, q, motion, pick):
            self.brought_back.append(pick is not None)
            return Motion(motion, MOTION.segments)

        def carry_on(perception, pick, q, motion):
            if not ways_on:
                raise RuntimeError("no way on")
            return Motion(motion, ways_on.pop(), LOAD)

        def shake(perception, pick, q, motion, times):
            if not self.shakes:
                raise RuntimeError("no way there")
            self.shaken.append((pick.track.id, times))
            return Motion(motion, MOTION.segments)

        self.planner = SortingPlanner(
            decide=decide, retreat=retreat, carry_on=carry_on, shake=shake, period=0.1, settle_time=0.5
        )
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        self.fix("perception", None)
        self.fix("motion_status", MotionStatus(-1, "", True))
        self.hand(0.1)

    def fix(self, port, value):
        self.planner.GetInputPort(port).FixValue(self.context, abstract(value))

    def hand(self, gap, hanging=0.0):
        state = np.zeros(24)
        state[:8] = VIEW
        state[8:10] = gap / 2
        self.planner.GetInputPort("robot_state").FixValue(self.context, state)
        effort = np.zeros(12)
        effort[:8] = ArmDynamics().efforts(VIEW, np.zeros(8), np.zeros(8), hanging)
        effort[-2:] = -60.0 if 0.002 < gap < 0.1 else 0.0
        self.planner.GetInputPort("effort").FixValue(self.context, effort)

    def wait(self, seconds=0.25):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def out(self, port):
        return unpack(self.planner.GetOutputPort(port).Eval(self.context))

    def look(self, step):
        """Lets the planner ask for an observation, and answers it."""
        self.wait(0.8)
        assert self.out("observe")[0] == step + 1
        self.fix("perception", perception(step))
        self.wait()

    def finish(self, stopped=""):
        self.fix("motion_status", MotionStatus(self.out("motion").id, "", True, stopped))
        self.wait()

    def rest(self):
        """Until the arm has been at rest for so long that what hangs on it is weighed."""
        self.wait(0.6)

    def carried(self, step=0):
        """An object is picked after that look, and let go at the place."""
        self.look(step)
        self.hand(0.04)
        self.finish()
        self.run("transport")
        self.run("open")

    def shake_off(self):
        """What hangs on the hand falls off over the place, and the arm comes back."""
        for segment in ("shake", "weigh", "shake"):
            self.run(segment)
        self.hand(0.1)
        self.finish()
        self.rest()

    def run(self, segment, stopped=""):
        self.fix("motion_status", MotionStatus(self.out("motion").id, segment, False, stopped))
        self.wait()


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


def test_a_hand_that_is_stopped_while_it_shakes_goes_back_and_is_weighed_again():
    bench = Bench(Pick(PLAN, TRACK, "bin", ()))
    bench.carried()
    bench.hand(0.1, hanging=0.3)
    bench.finish()
    bench.rest()
    bench.run("weigh")
    bench.run("shake")
    bench.finish("unexpected_effort")
    assert (bench.out("motion").id, bench.out("attempts")) == (3, ())
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
