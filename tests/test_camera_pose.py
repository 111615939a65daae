import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant

from sum_drake import robot
from sum_drake.parsing import make_parser
from sum_drake.systems.camera_pose import CameraPose

X_WB = RigidTransform(RollPitchYaw(0, 0, 0.4), [1.0, -2.0, 0.1])


def make_plant() -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.004)
    make_parser(plant).AddModels(url=robot.FETCH_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"), X_WB)
    plant.Finalize()
    return plant


PLANT = make_plant()


@given(st.floats(0, 0.386), st.floats(-1.57, 1.57), st.floats(-0.76, 1.45), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_it_is_the_forward_kinematics_of_the_model(torso, pan, tilt, seed):
    context = PLANT.CreateDefaultContext()
    PLANT.SetPositions(context, np.random.default_rng(seed).uniform(-1, 1, PLANT.num_positions()))
    PLANT.GetJointByName("torso_lift_joint").set_translation(context, torso)
    PLANT.GetJointByName("head_pan_joint").set_angle(context, pan)
    PLANT.GetJointByName("head_tilt_joint").set_angle(context, tilt)
    expected = PLANT.GetFrameByName("head_camera_optical_frame").CalcPoseInWorld(context)

    dut = CameraPose(X_WB=X_WB)
    dut_context = dut.CreateDefaultContext()
    dut.GetInputPort("state").FixValue(dut_context, PLANT.GetPositionsAndVelocities(context))
    X_WC = dut.GetOutputPort("X_WC").Eval(dut_context)
    np.testing.assert_allclose(X_WC.GetAsMatrix4(), expected.GetAsMatrix4(), atol=1e-9)


def test_at_home_it_looks_down_at_the_table():
    dut = CameraPose(X_WB=RigidTransform())
    context = dut.CreateDefaultContext()
    state = np.concatenate([robot.VIEW, [0.05, 0.05], robot.VIEW_HEAD, np.zeros(12)])
    dut.GetInputPort("state").FixValue(context, state)
    X_WC = dut.GetOutputPort("X_WC").Eval(context)
    right, down, ahead = X_WC.rotation().matrix().T
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-9)
    assert down[2] < 0 and ahead[2] < 0 and ahead[0] > 0
    # The optical axis meets the table's plane over the middle of the poured region.
    p_WC = X_WC.translation()
    p_WQ = p_WC + ahead * (0.70 - p_WC[2]) / ahead[2]
    assert 0.5 < p_WQ[0] < 0.8 and abs(p_WQ[1]) < 1e-9
