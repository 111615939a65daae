import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from test_playback import MOTION, B

from sum_drake.drives import DAMPING, SHARE, STIFFNESS
from sum_drake.dynamics import ArmDynamics
from sum_drake.robot import ARM_JOINTS, HAND, JOINTS, VIEW
from sum_drake.systems.arm_controller import ArmController
from sum_drake.systems.ports import abstract
from sum_drake.types import MotionStatus

STEP = 0.004


@pytest.fixture
def running():
    controller = ArmController(period=0.1, step=STEP)
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
    desired, before = ports(controller, context)[0], None
    while before is None or np.abs(desired - before).max() > 1e-12:  # it leads the joints by so much at once, no more
        state = np.zeros(24)
        # Where they will be a step later is where they are to be.
        state[:8] = desired[:8] - STEP * desired[12:20]
        state[12:20], state[8:10] = desired[12:20], desired[10:12]
        controller.GetInputPort("robot_state").FixValue(context, state)
        before, desired = desired, ports(controller, context)[0]
    efforts = np.zeros(12)
    efforts[:8] = ArmDynamics().efforts(desired[:8], desired[12:20], np.zeros(8)) + effort
    controller.GetInputPort("effort").FixValue(context, efforts)


def test_stands_in_the_viewing_pose_before_the_first_motion(running):
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract())
    simulator.AdvanceTo(0.5)
    follow(controller, context)
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
    for time in np.arange(1.0, 2.05, 0.01):
        follow(controller, context)
        simulator.AdvanceTo(time)
    simulator.AdvanceTo(2.05)
    follow(controller, context)
    desired, status = ports(controller, context)
    # The motion was taken up at the poll at 1.0 or 1.1.
    assert 0.18 <= desired[0] <= 0.22
    np.testing.assert_allclose(desired[12:20], 0.2)
    assert (status.motion, status.segment, status.done) == (0, "reach", False)
    for time in np.arange(2.05, 6.0, 0.01):
        follow(controller, context)
        simulator.AdvanceTo(time)
    follow(controller, context)
    desired, status = ports(controller, context)
    np.testing.assert_allclose(desired[:8], B)
    np.testing.assert_allclose(desired[12:], 0.0, atol=1e-12)
    assert (status.segment, status.done) == ("", True)


def test_resistance_stops_the_arm_which_goes_back_a_little_and_takes_the_next_motion(running):
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract(MOTION))
    statuses = []
    for time in np.arange(0.05, 4.0, 0.01):
        follow(controller, context, 100.0 if time > 1.0 else 0.0)
        simulator.AdvanceTo(time)
        statuses.append(ports(controller, context)[1])
    stopped = [status for status in statuses if status.stopped]
    assert {status.stopped for status in stopped} == {"unexpected_effort"}
    assert not stopped[0].done and stopped[0].segment == "reach"
    assert stopped[-1].done and stopped[-1].segment == ""
    follow(controller, context)
    desired, _ = ports(controller, context)
    assert 0.1 < desired[0] < 0.3 and not desired[12:].any()
    controller.GetInputPort("motion").FixValue(context, abstract(dataclasses.replace(MOTION, id=1)))
    simulator.AdvanceTo(4.1)
    assert ports(controller, context)[1] == MotionStatus(1, "reach", False)


def test_of_what_is_measured_only_the_joints_feed_through_to_what_they_are_to_do():
    """The plant's state is no function of what is asked of it at the same moment: there is no loop."""
    controller = ArmController(period=0.1, step=STEP)
    ports_in = (controller.get_input_port(i) for i in range(controller.num_input_ports()))
    ports_out = [controller.get_output_port(i) for i in range(controller.num_output_ports())]
    found = [
        (one.get_name(), other.get_name())
        for one in ports_in
        for other in ports_out
        if controller.HasDirectFeedthrough(one.get_index(), other.get_index())
    ]
    assert found == [("robot_state", "desired_state")]


def test_an_arm_that_is_held_does_not_push_with_all_it_has(running):
    """Its joints stand still while the motion goes on."""
    controller, simulator = running
    context = simulator.get_mutable_context()
    controller.GetInputPort("motion").FixValue(context, abstract(MOTION))
    simulator.AdvanceTo(0.7)
    desired, _ = ports(controller, context)
    effort = STIFFNESS[:8] * desired[:8] + DAMPING[:8] * desired[12:20]
    assert (np.abs(effort) <= (SHARE + 1e-9) * np.array([joint.effort for joint in ARM_JOINTS])).all()
    assert effort.any()
