import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from sum_drake.systems.ports import abstract
from sum_drake.systems.referee import Referee, TruthSample, transport_slip
from sum_drake.types import MotionStatus, readonly


def test_samples_every_period_and_has_no_output():
    referee = Referee(objects={"mug": 2}, hand=1, period=0.1)
    assert referee.num_output_ports() == 0
    simulator = Simulator(referee)
    context = simulator.get_mutable_context()
    poses = [RigidTransform(), RigidTransform([0.0, 0.0, 1.0]), RigidTransform([0.5, 0.0, 0.75])]
    referee.GetInputPort("body_poses").FixValue(context, Value[list[RigidTransform]](poses))
    referee.GetInputPort("observe").FixValue(context, [1.0])
    referee.GetInputPort("motion_status").FixValue(context, abstract(MotionStatus(0, "lift", False)))
    simulator.AdvanceTo(0.35)
    samples = referee.samples(context)
    assert [s.time for s in samples] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert (samples[0].observations, samples[0].segment) == (1, "lift")
    np.testing.assert_allclose(dict(samples[0].X_WOs)["mug"][:3, 3], [0.5, 0, 0.75])
    np.testing.assert_allclose(samples[0].X_WG[:3, 3], [0, 0, 1])


def sample(segment, p_WG, p_WO, motion=1):
    def at(p):
        return readonly(RigidTransform(p).GetAsMatrix4())

    return TruthSample(0.0, 1, motion, segment, (("mug", at(p_WO)),), at(p_WG))


def test_slip_is_the_objects_motion_in_the_hand_between_lift_and_release():
    samples = (
        sample("lift", [0, 0, 1.0], [0, 0, 0.9], motion=0),
        sample("transport", [0, 0, 1.0], [0, 0, 0.9]),
        sample("transport", [1, 0, 1.0], [1, 0, 0.88]),
        sample("open", [1, 0, 1.0], [1, 0, 0.3]),
    )
    assert transport_slip(samples, "mug") == pytest.approx(0.02)
    assert transport_slip(samples[:1], "mug") is None, "never carried"


def test_slip_may_be_told_from_when_the_hand_had_closed():
    samples = (
        sample("close", [0, 0, 0.8], [0, 0, 0.7], motion=0),
        sample("close", [0, 0, 0.8], [0, 0, 0.71], motion=0),
        sample("lift", [0, 0, 1.0], [0, 0, 0.9], motion=0),
        sample("transport", [0, 0, 1.0], [0, 0, 0.9]),
        sample("transport", [1, 0, 1.0], [1, 0, 0.88]),
    )
    assert transport_slip(samples, "mug", since="close") == pytest.approx(0.03)
