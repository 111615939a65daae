import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from test_playback import MOTION, B

from sum_drake.robot import HAND, JOINTS, VIEW
from sum_drake.systems.arm_controller import ArmController
from sum_drake.systems.ports import abstract


@pytest.fixture
def running():
    controller = ArmController(period=0.1)
    simulator = Simulator(controller)
    simulator.get_mutable_context()
    return controller, simulator


def ports(controller, context):
    desired = controller.GetOutputPort("desired_state").Eval(context)
    return desired, controller.GetOutputPort("motion_status").Eval(context)


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
    simulator.AdvanceTo(2.05)
    desired, status = ports(controller, context)
    # The motion was taken up at the poll at 1.0 or 1.1.
    assert 0.18 <= desired[0] <= 0.22
    np.testing.assert_allclose(desired[12:20], 0.2)
    assert (status.motion, status.segment, status.done) == (0, "reach", False)
    simulator.AdvanceTo(6.0)
    desired, status = ports(controller, context)
    np.testing.assert_allclose(desired[:8], B)
    np.testing.assert_allclose(desired[12:], 0.0, atol=1e-12)
    assert (status.segment, status.done) == ("", True)


def test_desired_state_does_not_feed_through():
    assert not ArmController(period=0.1).HasAnyDirectFeedthrough()
