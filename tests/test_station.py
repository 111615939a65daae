import logging
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import LoadModelDirectives
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import Solve
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from sum_drake import robot
from sum_drake.assets import MODELS, InputError
from sum_drake.models.scenes import build_scene
from sum_drake.objects import load_catalogue
from sum_drake.parsing import make_parser
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig
from sum_drake.systems.station import (
    default_plant_config,
    make_station,
    object_bodies,
    object_render_labels,
    set_home,
)

SCENE = MODELS / "scenes" / "sorting.dmd.yaml"
SIDE, MASS = 0.05, 0.4
TABLE_TOP = build_scene.TABLE_SIZE[2]

BOX = """<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="any_name">
    <link name="body">
      <inertial><mass>{m}</mass><inertia><ixx>{i}</ixx><iyy>{i}</iyy><izz>{i}</izz></inertia></inertial>
      <visual name="v"><geometry>{geometry}</geometry></visual>
      <collision name="c">
        <geometry><box><size>{s} {s} {s}</size></box></geometry>
        <drake:proximity_properties>
          <drake:compliant_hydroelastic/>
          <drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
          <drake:hunt_crossley_dissipation>3</drake:hunt_crossley_dissipation>
          <drake:mu_static>0.6</drake:mu_static>
          <drake:mu_dynamic>0.6</drake:mu_dynamic>
        </drake:proximity_properties>
      </collision>
    </link>
  </model>
</sdf>
"""


def write_box(folder: Path, geometry: str = f"<box><size>{SIDE} {SIDE} {SIDE}</size></box>", name: str = "box") -> str:
    path = folder / f"{name}.sdf"
    path.write_text(BOX.format(m=MASS, i=MASS * SIDE**2 / 6, s=SIDE, geometry=geometry))
    return str(path)


def at(x: float, y: float, z: float) -> np.ndarray:
    X_WO = np.eye(4)
    X_WO[:3, 3] = [x, y, z]
    return X_WO


def make(objects, *, directives=None, seed=0, **changes) -> Diagram:
    settings = {
        "plant_config": default_plant_config(),
        "directives": LoadModelDirectives(str(SCENE)).directives if directives is None else directives,
        "camera": HeadCameraConfig(),
        "noise": DepthNoiseConfig(),
    } | changes
    return make_station(**settings, objects=objects, seed=seed)


@pytest.fixture(scope="module")
def station(tmp_path_factory) -> Diagram:
    sdf = write_box(tmp_path_factory.mktemp("objects"))
    rest = TABLE_TOP + SIDE / 2
    return make({"red": (sdf, at(0.60, 0.0, rest)), "blue": (sdf, at(0.60, 0.15, rest))})


@pytest.fixture
def simulator(station) -> Simulator:
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    home = robot.desired_state(robot.VIEW, robot.HAND.gap_max)
    station.GetInputPort("fetch.desired_state").FixValue(context, home)
    return simulator


def read(station: Diagram, simulator: Simulator, port: str):
    return station.GetOutputPort(port).Eval(simulator.get_context())


def test_scene_files_are_what_the_script_writes(tmp_path):
    build_scene.build(tmp_path)
    for path in sorted(tmp_path.glob("*.[somt]*")):
        if path.suffix != ".png":
            assert path.read_text() == (build_scene.HERE / path.name).read_text(), path.name


def test_names_and_ports(station):
    assert station.get_name() == "station"
    assert [station.get_input_port(i).get_name() for i in range(station.num_input_ports())] == ["fetch.desired_state"]
    assert {station.get_output_port(i).get_name() for i in range(station.num_output_ports())} == {
        "fetch.state",
        "fetch.effort",
        "head_camera.color_image",
        "head_camera.depth_image",
        "head_camera.label_image",
        "head_camera.X_WC",
        "truth.body_poses",
    }
    assert station.GetInputPort("fetch.desired_state").size() == 2 * len(robot.JOINTS)
    assert station.GetOutputPort("fetch.state").size() == 2 * len(robot.STATE_JOINTS)
    assert station.GetOutputPort("fetch.effort").size() == len(robot.JOINTS)


def test_building_warns_of_nothing(caplog, tmp_path):
    with caplog.at_level(logging.WARNING, "drake"):
        make({"red": (write_box(tmp_path), at(0.6, 0, 0.8))}).CreateDefaultContext()
    assert not caplog.records


def test_it_starts_at_home_and_can_be_sent_back(station, simulator):
    context = simulator.get_mutable_context()

    def check():
        state = read(station, simulator, "fetch.state")
        np.testing.assert_allclose(robot.arm_positions(state), robot.VIEW)
        assert robot.finger_gap(state) == pytest.approx(robot.HAND.gap_max)
        poses = read(station, simulator, "truth.body_poses")
        for label, y in (("red", 0.0), ("blue", 0.15)):
            X_WO = poses[object_bodies(station)[label]].GetAsMatrix4()
            np.testing.assert_allclose(X_WO, at(0.60, y, TABLE_TOP + SIDE / 2), atol=1e-12)

    check()
    plant = station.GetSubsystemByName("plant")
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), np.random.default_rng(0).uniform(0, 1, 26))
    set_home(station, context)
    check()


def test_nothing_collides_at_home_and_it_stays_there(station, simulator):
    simulator.AdvanceTo(0.5)
    state = read(station, simulator, "fetch.state")
    np.testing.assert_allclose(robot.arm_positions(state), robot.VIEW, atol=1e-6)
    np.testing.assert_allclose(read(station, simulator, "fetch.effort"), 0, atol=1e-3)
    plant = station.GetSubsystemByName("plant")
    contacts = plant.get_contact_results_output_port().Eval(plant.GetMyContextFromRoot(simulator.get_context()))
    assert contacts.num_point_pair_contacts() == 0
    assert contacts.num_hydroelastic_contacts() == 2  # Each box on the table.


def test_pictures(station, simulator):
    color = read(station, simulator, "head_camera.color_image").data
    labels = read(station, simulator, "head_camera.label_image").data[..., 0]
    depth = read(station, simulator, "head_camera.depth_image").data[..., 0]
    assert color.shape == (480, 640, 4) and labels.shape == depth.shape == (480, 640)
    names = object_render_labels(station)
    assert set(names.values()) == {"red", "blue"}
    X_CW = read(station, simulator, "head_camera.X_WC").inverse()
    for value, label in names.items():
        v, u = np.nonzero(labels == value)
        assert u.size > 500
        p_C = X_CW @ np.array([0.60, 0.15 if label == "blue" else 0.0, TABLE_TOP + SIDE / 2])
        assert u.mean() == pytest.approx(525 * p_C[0] / p_C[2] + 319.5, abs=4)
        assert v.mean() == pytest.approx(525 * p_C[1] / p_C[2] + 239.5, abs=4)
        seen = depth[labels == value]
        assert np.median(seen[seen > 0]) == pytest.approx(p_C[2], abs=0.03)
    # The robot does not stand in its own light, and the whole near part of the table is seen.
    plant = station.GetSubsystemByName("plant")
    fetch = {int(body) for body in plant.GetBodyIndices(plant.GetModelInstanceByName("fetch"))}
    assert not fetch & set(np.unique(labels).tolist())
    assert 30 < color[300:330, 300:340, :3].mean() < 230


def test_depth_noise_is_a_function_of_seed_and_time(station, simulator):
    first = read(station, simulator, "head_camera.depth_image").data.copy()
    again = Simulator(station)
    np.testing.assert_array_equal(first, read(station, again, "head_camera.depth_image").data)
    simulator.get_mutable_context().SetTime(0.1)
    assert (first != read(station, simulator, "head_camera.depth_image").data).any()


def test_camera_pose_follows_the_head(station, simulator):
    plant = station.GetSubsystemByName("plant")
    context = simulator.get_mutable_context()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.GetJointByName("head_pan_joint").set_angle(plant_context, 0.3)
    optical = plant.GetFrameByName("head_camera_optical_frame").CalcPoseInWorld(plant_context)
    assert read(station, simulator, "head_camera.X_WC").IsNearlyEqualTo(optical, 1e-9)


def top_down(positions: list[list[float]]) -> list[np.ndarray]:
    """Arm positions (8,) with the fingers pointing down and closing along y at each p_WG."""
    plant = MultibodyPlant(time_step=0.004)
    make_parser(plant).AddModels(url=robot.FETCH_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    hand, world = plant.GetFrameByName("gripper_link"), plant.world_frame()
    R_WG = RotationMatrix(np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]))
    q = np.array([0.3, 0, 0.2, 0, 1.0, 0, 0.4, 0, 0, 0, 0, 0])
    found = []
    for p_WG in positions:
        ik = InverseKinematics(plant)
        p = np.array(p_WG)
        ik.AddPositionConstraint(hand, np.zeros(3), world, p - 5e-4, p + 5e-4)
        ik.AddOrientationConstraint(world, R_WG, hand, RotationMatrix(), 0.005)
        ik.prog().AddQuadraticErrorCost(np.eye(len(q)), q, ik.q())
        ik.prog().SetInitialGuess(ik.q(), q)
        result = Solve(ik.prog())
        assert result.is_success()
        q = result.GetSolution(ik.q())
        found.append(robot.arm_positions(q))
    return found


def move(station, simulator, start, goal, duration, gap, period=0.02) -> float:
    """Drives the arm along a fifth-order polynomial; returns the largest tracking error of the joints, m or rad."""
    port = station.GetInputPort("fetch.desired_state")
    context = simulator.get_mutable_context()
    begin, worst = context.get_time(), 0.0
    for i in range(round(duration / period)):
        s = i * period / duration
        q = start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        v = (goal - start) / duration * (30 * s**2 - 60 * s**3 + 30 * s**4)
        state = read(station, simulator, "fetch.state")
        # What was asked for holds for one period.
        worst = max(worst, np.abs(robot.arm_positions(state) - q).max()) if i else worst
        port.FixValue(context, robot.desired_state(q, gap, v=v))
        simulator.AdvanceTo(begin + (i + 1) * period)
    return worst


def hand_and_object(station, simulator, label) -> tuple[RigidTransform, RigidTransform]:
    poses = read(station, simulator, "truth.body_poses")
    gripper = station.GetSubsystemByName("plant").GetBodyByName("gripper_link").index()
    return poses[int(gripper)], poses[object_bodies(station)[label]]


def test_the_hand_lifts_a_box_and_holds_it(station, simulator):
    above, grasp, lifted = top_down([[0.60, 0.0, 0.83], [0.60, 0.0, 0.74], [0.60, 0.0, 0.90]])
    plant = station.GetSubsystemByName("plant")
    context = simulator.get_mutable_context()
    fetch = plant.GetModelInstanceByName("fetch")
    q = np.concatenate([above, [0.05, 0.05], robot.VIEW_HEAD])
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), fetch, q)

    move(station, simulator, above, grasp, 1.5, gap=0.1)
    move(station, simulator, grasp, grasp, 0.5, gap=0.0)
    state = read(station, simulator, "fetch.state")
    assert robot.finger_gap(state) == pytest.approx(SIDE, abs=0.003)
    assert np.abs(read(station, simulator, "fetch.effort")[-2:]).max() <= 60.0

    X_WG, X_WO = hand_and_object(station, simulator, "red")
    before = X_WG.inverse() @ X_WO
    move(station, simulator, grasp, lifted, 2.0, gap=0.0)
    move(station, simulator, lifted, lifted, 2.0, gap=0.0)
    X_WG, X_WO = hand_and_object(station, simulator, "red")
    assert X_WO.translation()[2] > TABLE_TOP + SIDE / 2 + 0.14
    slip = X_WG.inverse() @ X_WO
    assert np.linalg.norm(slip.translation() - before.translation()) < 0.002

    move(station, simulator, lifted, lifted, 0.6, gap=0.1)
    _, X_WO = hand_and_object(station, simulator, "red")
    assert X_WO.translation()[2] < TABLE_TOP + 0.1
    # The other one was not touched.
    _, X_WO = hand_and_object(station, simulator, "blue")
    np.testing.assert_allclose(X_WO.translation(), [0.60, 0.15, TABLE_TOP + SIDE / 2], atol=1e-3)


def test_drives_follow_a_smooth_motion(station, simulator):
    (start,) = top_down([[0.60, 0.0, 0.95]])
    plant = station.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    q = np.concatenate([start, [0.05, 0.05], robot.VIEW_HEAD])
    plant.SetPositions(plant_context, plant.GetModelInstanceByName("fetch"), q)
    goal = start + np.array([-0.05, 0.5, -0.1, 0.4, -0.3, 0.4, 0.2, 0.8])
    worst = move(station, simulator, start, goal, 2.0, gap=0.1, period=0.004)
    assert worst < 0.004  # Most of it is the period's delay.


def test_motion_is_the_same_twice(station):
    def run() -> np.ndarray:
        simulator = Simulator(station)
        home = robot.desired_state(robot.VIEW + 0.1, 0.02)
        station.GetInputPort("fetch.desired_state").FixValue(simulator.get_mutable_context(), home)
        simulator.AdvanceTo(0.2)
        return read(station, simulator, "fetch.state").copy()

    np.testing.assert_array_equal(run(), run())


def bad_object(folder: Path, kind: str) -> tuple[str, np.ndarray]:
    pose = np.zeros((4, 4)) if kind == "pose" else at(0.6, 0, 0.8)
    path = folder / f"{kind}.sdf"
    if kind == "broken":
        path.write_text("<sdf version='1.9'><model name='m'><link")
    elif kind == "two_links":
        path.write_text("<sdf version='1.9'><model name='m'><link name='a'/><link name='b'/></model></sdf>")
    elif kind == "no_mesh":
        write_box(folder, "<mesh><uri>nowhere.obj</uri></mesh>", kind)
    elif kind == "bad_mesh":
        (folder / "bad.obj").write_text("v 0 0 zero\nf 1 2 3\n")
        write_box(folder, "<mesh><uri>bad.obj</uri></mesh>", kind)
    elif kind != "missing":
        write_box(folder, name=kind)
    return str(path), pose


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("missing", "missing.sdf"),
        ("broken", "broken.sdf"),
        ("two_links", "2 links"),
        ("no_mesh", "nowhere.obj"),
        ("bad_mesh", "bad.obj"),
        ("pose", "X_WO"),
    ],
)
def test_bad_objects_are_refused_in_one_line(tmp_path, kind, word):
    with pytest.raises(InputError, match=word) as error:
        make({"red": bad_object(tmp_path, kind)})
    assert "\n" not in str(error.value) and "expected" in str(error.value)


def test_a_label_that_the_scene_has_is_refused(tmp_path):
    with pytest.raises(InputError, match=r'"table".*expected'):
        make({"table": (write_box(tmp_path), at(0.6, 0, 0.8))})


def test_bad_scenes_are_refused_in_one_line(tmp_path):
    path = tmp_path / "scene.dmd.yaml"
    for text, word in (
        ("directives:\n- add_model: {name: fetch, file: package://sum_drake/robots/none.urdf}\n", "none.urdf"),
        ("directives:\n- add_model: {name: table, file: package://sum_drake/scenes/table.sdf}\n", "fetch"),
        ("directives:\n- add_model: {name: fetch, file: package://sum_drake/scenes/table.sdf}\n", "JOINTS"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=word) as error:
            make({}, directives=LoadModelDirectives(str(path)).directives)
        assert "\n" not in str(error.value) and "expected" in str(error.value)


@pytest.mark.parametrize("label", ["scotch_brite", "sugar", "mug", "soup_can", "tea"])
def test_what_falls_from_the_table_is_not_thrown_back_by_the_floor(label):
    """Nothing gets faster than it fell."""
    place = (-1.0, -0.4, 0.7)
    station = make({label: (str(load_catalogue()[label].sdf), at(*place))})
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("fetch.desired_state").FixValue(context, robot.desired_state(robot.VIEW, 0.1))
    plant = station.GetSubsystemByName("plant")
    body = plant.get_body(plant.GetFloatingBaseBodies().pop())
    speeds = []
    for time in np.arange(0.004, 1.0, 0.004):
        simulator.AdvanceTo(time)
        velocity = plant.EvalBodySpatialVelocityInWorld(plant.GetMyContextFromRoot(context), body)
        speeds.append(np.linalg.norm(velocity.translational()))
    fastest = int(np.argmax(speeds))
    fall = 9.81 * 0.004 * (fastest + 1)
    assert speeds[fastest] == pytest.approx(fall, abs=0.01), "the end of the fall"
    assert max(speeds[fastest + 1 :]) < 0.9 * fall
    assert speeds[-1] < 0.5


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_what_rolls_away_stays_in_the_room(direction):
    """Off an edge of the floor it would fall, spin ever faster, and end the run."""
    heading, half = np.array([*direction, 0.0]), build_scene.ROOM / 2
    start = 2.4 * heading + [0.0, 0.0, 0.05]
    station = make({"can": (str(load_catalogue()["soup_can"].sdf), at(*start))})
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("fetch.desired_state").FixValue(context, robot.desired_state(robot.VIEW, 0.1))
    plant = station.GetSubsystemByName("plant")
    body = plant.get_body(plant.GetFloatingBaseBodies().pop())
    state = plant.GetMyMutableContextFromRoot(context)
    axis = np.cross([0.0, 0.0, 1.0], heading)
    lying = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), start)
    plant.SetFreeBodyPose(state, body, lying)
    plant.SetFreeBodySpatialVelocity(state, body, SpatialVelocity(2.0 / 0.033 * axis, 2.0 * heading))
    simulator.AdvanceTo(0.25)
    assert lying.translation() @ heading + 0.3 < plant.EvalBodyPoseInWorld(state, body).translation() @ heading, "rolls"
    simulator.AdvanceTo(2.0)
    p_W = plant.EvalBodyPoseInWorld(state, body).translation()
    assert 0.0 < p_W[2] < 0.1 and np.abs(p_W[:2]).max() < half
