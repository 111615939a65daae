import itertools
import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Box, Role
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from sum_drake import robot
from sum_drake.models.robots import build_fetch
from sum_drake.parsing import add_packages, make_parser, parser_allowed

HOME = np.concatenate([robot.VIEW, [robot.HAND.gap_max / 2] * 2, robot.VIEW_HEAD])
"""Positions of STATE_JOINTS."""


def make_plant() -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.004)
    make_parser(plant).AddModels(url=robot.FETCH_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    return plant


def make_diagram() -> RobotDiagram:
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.004)
    add_packages(builder.parser()).AddModels(url=robot.FETCH_URDF)
    builder.plant().WeldFrames(builder.plant().world_frame(), builder.plant().GetFrameByName("base_link"))
    return builder.Build()


def test_the_committed_model_is_what_the_script_writes(tmp_path):
    urdf = build_fetch.build(tmp_path)
    assert urdf.read_text() == (build_fetch.HERE / "fetch.urdf").read_text()
    written = {path.name for path in (tmp_path / "fetch").iterdir()}
    assert written == {path.name for path in (build_fetch.HERE / "fetch").iterdir()}


def test_the_model_loads_without_a_warning(caplog):
    with caplog.at_level(logging.WARNING, "drake"):
        make_diagram()
    assert not caplog.records


def test_the_model_loads_where_downloads_are_forbidden():
    code = "import test_robot; test_robot.make_plant(); test_robot.make_diagram()"
    environment = os.environ | {"DRAKE_ALLOW_NETWORK": "none", "PYTHONPATH": str(Path(__file__).parent)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=120)


def test_joints_are_those_of_the_table():
    plant = make_plant()
    for joint in robot.JOINTS:
        parsed = plant.GetJointByName(joint.name)
        assert parsed.parent_body().name() == joint.parent and parsed.child_body().name() == joint.child
        np.testing.assert_allclose(parsed.position_lower_limits(), joint.lower)
        np.testing.assert_allclose(parsed.position_upper_limits(), joint.upper)
        np.testing.assert_allclose(parsed.velocity_upper_limits(), joint.velocity)
        assert plant.GetJointActuatorByName(joint.name).effort_limit() == joint.effort


def test_orders_of_actuators_and_state():
    plant = make_plant()
    actuators = [plant.get_joint_actuator(index).joint().name() for index in plant.GetJointActuatorIndices()]
    assert actuators == [joint.name for joint in robot.JOINTS]
    starts = [plant.GetJointByName(joint.name).position_start() for joint in robot.STATE_JOINTS]
    assert starts == list(range(plant.num_positions()))


def test_both_fingers_are_one_drive():
    assert make_plant().num_constraints() == 1


def test_mass_is_that_of_a_fetch():
    plant = make_plant()
    mass = plant.CalcTotalMass(plant.CreateDefaultContext())
    assert 105 < mass < 120  # Fetch Robotics says 113.3 kg, wheels included.


def test_home_is_free_of_self_collision():
    diagram = make_diagram()
    context = diagram.CreateDefaultContext()
    diagram.plant().SetPositions(diagram.plant().GetMyMutableContextFromRoot(context), HOME)
    query = diagram.scene_graph().get_query_output_port().Eval(diagram.scene_graph().GetMyContextFromRoot(context))
    distances = [pair.distance for pair in query.ComputeSignedDistancePairwiseClosestPoints(0.05)]
    assert min(distances) > 0.01


@pytest.mark.parametrize("gap", [0.0, 0.03, 0.1])
def test_the_hand_is_the_boxes_of_the_table(gap):
    diagram = make_diagram()
    plant = diagram.plant()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.SetPositions(plant_context, np.concatenate([HOME[:8], [gap / 2, gap / 2], HOME[10:]]))
    inspector = diagram.scene_graph().model_inspector()
    X_GW = plant.GetFrameByName("gripper_link").CalcPoseInWorld(plant_context).inverse()

    def extent(name):
        body = plant.GetBodyByName(name)
        corners = []
        for geometry in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kProximity):
            shape = inspector.GetShape(geometry)
            assert isinstance(shape, Box)
            X_GS = X_GW @ body.EvalPoseInWorld(plant_context) @ inspector.GetPoseInFrame(geometry)
            half = np.array(shape.size()) / 2
            corners += [X_GS @ (half * signs) for signs in itertools.product((-1, 1), repeat=3)]
        return np.array(corners)

    hand = robot.HAND
    right, left, palm = (extent(n) for n in ("r_gripper_finger_link", "l_gripper_finger_link", "gripper_link"))
    for finger, side in ((right, -1), (left, 1)):
        y = side * finger[:, 1]
        np.testing.assert_allclose(finger[:, 0].max(), hand.pad_x[1], atol=1e-9)
        np.testing.assert_allclose([y.min(), y.max()], [gap / 2, gap / 2 + hand.pad_thickness], atol=1e-9)
        np.testing.assert_allclose(np.abs(finger[:, 2]).max(), hand.pad_half_width, atol=1e-9)
    np.testing.assert_allclose(palm[:, 0].max(), hand.palm_x[1], atol=1e-9)
    np.testing.assert_allclose(np.abs(palm[:, 1:]).max(0), hand.palm_half, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_state_is_read_as_the_plant_writes_it(seed, gap):
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=(2, 8))
    state = np.concatenate([q, [gap / 2, gap / 2], [0.1, 0.2], v, [0, 0], [0, 0]])
    np.testing.assert_array_equal(robot.arm_positions(state), q)
    np.testing.assert_array_equal(robot.arm_velocities(state), v)
    assert robot.finger_gap(state) == pytest.approx(gap)
    desired = robot.desired_state(q, gap, v=v, head=np.array([0.1, 0.2]))
    by_name = dict(zip([joint.name for joint in robot.JOINTS], desired[:12], strict=True))
    np.testing.assert_allclose([by_name[joint.name] for joint in robot.STATE_JOINTS], state[:12])


def test_camera_pose_is_the_models():
    plant = make_plant()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(-0.7, 0.7, plant.num_positions())
        plant.SetPositions(context, q)
        X_BC = plant.GetFrameByName("head_camera_optical_frame").CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(robot.camera_pose(np.concatenate([q, np.zeros(12)])), X_BC, atol=1e-9)
