import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from test_playback import MOTION, B

from sum_drake.dynamics import ArmDynamics
from sum_drake.robot import HAND, JOINTS, VIEW
from sum_drake.systems.arm_controller import ArmController
from sum_drake.systems.ports import abstract
from sum_drake.types import MotionStatus


@pytest.fixture
def running():
    controller = ArmController(period=0.1)
    simulator = Simulator(controller)
    context = simulator.get_mutable_context()
    controller.GetInputPort("robot_state").FixValue(context, np.zeros(24))
    controller.GetInputPort("effort").FixValue(context, np.zeros(12))
    return controller, simulator


def ports(controller, context):
    desired = controller.GetOutputPort("desired_state").Eval(context)
    return desired, controller.GetOutputPort("motion_status").Eval(context)


def follow(controller, context, effort=0.0):
    """The joints are where they are to be; `effort` N m more than that takes at every one."""
    desired, _ = ports(controller, context)
    state = np.zeros(24)
    state[:8], state[12:20], state[8:10] = desired[:8], desired[12:20], desired[10:12]
    controller.GetInputPort("robot_state").FixValue(context, state)
    efforts = np.zeros(12)
    efforts[:8] = ArmDynamics().efforts(desired[:8], desired[12:20], np.zeros(8)) + effort
    controller.GetInputPort("effort").FixValue(context, efforts)


def test_stands_in_the_viewing_pose_before_the_first_motion(running):
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract())
    simulator.AdvanceTo(0.5)
    desired, status = ports(controller, context)
    assert desired.shape == (2 * len(JOINTS),)
    np.testing.assert_array_equal(desired[:8], VIEW)
    np.testing.assert_allclose(desired[10:12], HAND.gap_max / 2)
    assert (status.motion, status.done) == (-1, True)


def test_plays_a_motion_from_when_it_arrives_and_holds_its_end(running):
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract())
    simulator.AdvanceTo(1.0)
    controller.GetInputPort("motion").FixValue(context, abstract(MOTION))
    for time in np.arange(1.0, 2.05, 0.05):
        follow(controller, context)
        simulator.AdvanceTo(time)
    simulator.AdvanceTo(2.05)
    desired, status = ports(controller, context)
    # The motion was taken up at the poll at 1.0 or 1.1.
    assert 0.18 <= desired[0] <= 0.22
    np.testing.assert_allclose(desired[12:20], 0.2)
    assert (status.motion, status.segment, status.done) == (0, "reach", False)
    for time in np.arange(2.05, 6.0, 0.05):
        follow(controller, context)
        simulator.AdvanceTo(time)
    desired, status = ports(controller, context)
    np.testing.assert_allclose(desired[:8], B)
    np.testing.assert_allclose(desired[12:], 0.0, atol=1e-12)
    assert (status.segment, status.done) == ("", True)


def test_resistance_stops_the_arm_which_goes_back_a_little_and_takes_the_next_motion(running):
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract(MOTION))
    statuses = []
    for time in np.arange(0.05, 4.0, 0.05):
        follow(controller, context, 100.0 if time > 1.0 else 0.0)
        simulator.AdvanceTo(time)
        statuses.append(ports(controller, context)[1])
    stopped = [status for status in statuses if status.stopped]
    assert {status.stopped for status in stopped} == {"unexpected_effort"}
    assert not stopped[0].done and stopped[0].segment == "reach"
    assert stopped[-1].done and stopped[-1].segment == ""
    desired, _ = ports(controller, context)
    assert 0.1 < desired[0] < 0.3 and not desired[12:].any()
    controller.GetInputPort("motion").FixValue(context, abstract(dataclasses.replace(MOTION, id=1)))
    simulator.AdvanceTo(4.1)
    assert ports(controller, context)[1] == MotionStatus(1, "reach", False)


def test_desired_state_does_not_feed_through():
    assert not ArmController(period=0.1).HasAnyDirectFeedthrough()
