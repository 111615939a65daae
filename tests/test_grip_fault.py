"""Fingers that let go: when, for how long, and once."""

import numpy as np
from pydrake.systems.analysis import Simulator

from sum_drake.drives import FINGER_LEAD
from sum_drake.robot import STATE_JOINTS, VIEW, desired_state
from sum_drake.systems.grip_fault import DELAYS, OPEN, GripFault
from sum_drake.systems.ports import abstract
from sum_drake.types import MotionStatus

CLOSED = desired_state(VIEW, 0.0)


class Bench:
    def __init__(self, *faults):
        self.dut = GripFault(faults=faults, period=0.1, step=0.004)
        self.simulator = Simulator(self.dut)
        self.context = self.simulator.get_mutable_context()
        self.dut.GetInputPort("desired_state").FixValue(self.context, CLOSED)
        self.dut.GetInputPort("observe").FixValue(self.context, [1.0])
        state = np.zeros(2 * len(STATE_JOINTS))
        state[:8], state[10:12] = CLOSED[:8], CLOSED[8:10]
        self.dut.GetInputPort("robot_state").FixValue(self.context, state)
        self.segment(0, "approach")

    def segment(self, motion, name):
        self.dut.GetInputPort("motion_status").FixValue(self.context, abstract(MotionStatus(motion, name, False)))

    def opened(self, seconds):
        """Share of the time that the fingers are open."""
        gaps = []
        for _ in range(round(seconds / 0.05)):
            self.simulator.AdvanceTo(self.context.get_time() + 0.05)
            out = self.dut.GetOutputPort("faulty_desired_state").Eval(self.context)
            assert np.array_equal(out[:10], CLOSED[:10]) and np.array_equal(out[12:], CLOSED[12:]), "the fingers alone"
            gaps.append(out[10] + out[11])
        assert set(np.round(gaps, 9)) <= {0.0, round(2 * FINGER_LEAD, 9)}, "no faster than they may"
        return float(np.mean(np.array(gaps) > 0))


def test_the_first_lift_after_its_observation_lets_go_for_a_moment_and_no_other():
    bench = Bench((0, "lift"))
    assert bench.opened(1.0) == 0.0
    bench.segment(0, "lift")
    assert abs(bench.opened(2.0) * 2.0 - OPEN) < 0.1
    bench.segment(2, "lift")
    assert bench.opened(2.0) == 0.0


def test_it_waits_for_its_observation_and_its_segment():
    bench = Bench((1, "transport"))
    bench.segment(1, "transport")
    assert bench.opened(2.0) == 0.0, "of an observation before"
    bench.dut.GetInputPort("observe").FixValue(bench.context, [2.0])
    bench.segment(2, "lift")
    assert bench.opened(2.0) == 0.0
    bench.segment(3, "transport")
    assert bench.opened(DELAYS["transport"]) == 0.0
    assert bench.opened(1.0) > 0.2


def test_two_faults_of_one_kind_strike_two_lifts():
    bench = Bench((0, "lift"), (0, "lift"))
    for motion in (0, 2):
        bench.segment(motion, "lift")
        assert bench.opened(1.5) > 0.1
    bench.segment(4, "lift")
    assert bench.opened(1.5) == 0.0
