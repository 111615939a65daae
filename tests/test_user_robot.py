"""A user's URDF and SRDF become a robot that Drake's checker knows."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Box
from small_robots import ARM, BASE, BEND, FOLLOWER, FOREARM, POST, TURN, collision, inertial, write_srdf, write_urdf

from sum_drake import robot as fetch
from sum_drake.assets import InputError, asset
from sum_drake.bench.plan_sets import fetch_robot
from sum_drake.geometry import transform
from sum_drake.kinematics import Arm
from sum_drake.user_robot import Obstacle, load_robot, make_checker, plant_positions

NAMES = ("turn", "bend")


def block(name, p_WO, size=0.1):
    return Obstacle(name, Box(size, size, size), transform(np.eye(3), np.array(p_WO)))


def free(checker, q, names=NAMES):
    return bool(checker.CheckConfigCollisionFree(plant_positions(checker, names, np.array(q, dtype=float))))


def test_joints_and_their_limits(tmp_path):
    robot = load_robot(write_urdf(tmp_path))
    assert robot.names == NAMES
    np.testing.assert_array_equal(robot.lower, [-np.inf, -2])
    np.testing.assert_array_equal(robot.upper, [np.inf, 2.5])
    np.testing.assert_array_equal(robot.velocity, [1.5, 0.7])
    assert [values.tolist() for values in robot.limits(("bend", "turn"))] == [[-2, -np.inf], [2.5, np.inf], [0.7, 1.5]]
    assert robot.notes == ()


def test_a_robot_without_collision_shapes_is_said_to_be_free_everywhere(tmp_path):
    bare = '<link name="base"/><link name="post"/>' + TURN
    robot = load_robot(write_urdf(tmp_path, bare))
    assert robot.notes == (f"{robot.path}: no link has a collision shape: everything is free",)


def test_the_arm_among_obstacles(tmp_path):
    robot = load_robot(write_urdf(tmp_path))
    # The forearm, bent forward by a right angle, lies along x from .1 to .4 m at a height of .5 m.
    checker = make_checker(robot, NAMES, [block("ahead", [0.3, 0.0, 0.5])])
    assert free(checker, [0, 0])
    assert not free(checker, [0, np.pi / 2])
    assert free(checker, [np.pi / 2, np.pi / 2])
    assert free(checker, [np.pi, np.pi / 2])
    assert not free(checker, [2 * np.pi, np.pi / 2]), "continuous"
    turned = plant_positions(checker, ("bend", "turn"), np.array([[np.pi / 2, 0.0], [np.pi / 2, np.pi]]))
    assert [checker.CheckConfigCollisionFree(q) for q in turned] == [False, True]


def test_joints_that_are_not_named_stay_at_0(tmp_path):
    robot = load_robot(write_urdf(tmp_path))
    checker = make_checker(robot, ("bend",), [block("ahead", [0.3, 0.0, 0.5])])
    assert checker.plant().num_positions() == 1
    assert free(checker, [0], ("bend",))
    assert not free(checker, [np.pi / 2], ("bend",))


def test_the_fetch_of_this_project_stands_where_its_kinematics_say(tmp_path):
    robot = fetch_robot()
    names = tuple(joint.name for joint in fetch.ARM_JOINTS)
    lower, upper, velocity = robot.limits(names)
    np.testing.assert_array_equal(np.stack([lower, upper]), np.stack(fetch.limits()))
    np.testing.assert_array_equal(velocity, fetch.velocity_limits())
    checker = make_checker(robot, names)
    rng = np.random.default_rng(3)
    for q in rng.uniform(np.maximum(lower, -3), np.minimum(upper, 3), (5, 8)):
        checker.UpdatePositions(plant_positions(checker, names, q))
        body = checker.plant().GetBodyByName("gripper_link")
        X_WG = checker.plant().EvalBodyPoseInWorld(checker.plant_context(), body).GetAsMatrix4()
        np.testing.assert_allclose(X_WG, Arm().forward(q), atol=1e-9)
    assert free(checker, fetch.VIEW, names)
    assert robot.path == asset(fetch.FETCH_URDF)


@pytest.mark.parametrize(
    ("uri", "file"),
    [
        ("block.stl", "robots/block.stl"),
        ("../meshes/block.stl", "meshes/block.stl"),
        ("package://my_robot/meshes/block.stl", "meshes/block.stl"),
        ("package://meshes/block.stl", "robots/meshes/block.stl"),
        ("package://description/meshes/block.stl", "description/meshes/block.stl"),
        ("package://elsewhere/block.stl", "road/elsewhere/block.stl"),
        ("model://my_robot/meshes/block.ply", "meshes/block.ply"),
        ("package://my_robot/meshes/block.obj", "meshes/block.obj"),
    ],
)
def test_collision_meshes_are_found(tmp_path, monkeypatch, uri, file):
    """Beside the URDF, in a package above it, or on ROS_PACKAGE_PATH; scaled, and where the link says."""
    (tmp_path / "robots").mkdir()
    (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box([40.0, 40.0, 300.0]).export(tmp_path / file)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'road'}")
    mesh = f'<mesh filename="{uri}" scale="0.001 0.001 0.001"/>'
    forearm = f'<link name="forearm"><collision><origin xyz="0 0 0.25"/><geometry>{mesh}</geometry></collision></link>'
    robot = load_robot(write_urdf(tmp_path / "robots", BASE + POST + forearm + TURN + BEND))
    checker = make_checker(robot, NAMES, [block("ahead", [0.3, 0.0, 0.5])])
    same = make_checker(load_robot(write_urdf(tmp_path)), NAMES, [block("ahead", [0.3, 0.0, 0.5])])
    for q in np.random.default_rng(0).uniform([-1, 0], [1, 2.5], (60, 2)):
        assert free(checker, q) == free(same, q)


def test_a_missing_collision_mesh_is_one_line_and_a_missing_picture_none(tmp_path):
    picture = '<visual><geometry><mesh filename="package://gone/picture.dae"/></geometry></visual>'
    forearm = FOREARM.replace("<collision>", picture + "<collision>")
    assert load_robot(write_urdf(tmp_path, BASE + POST + forearm + TURN + BEND)).names == NAMES
    gone = collision('<mesh filename="package://gone/arm.stl"/>')
    forearm = f'<link name="forearm">{gone}</link>'
    with pytest.raises(
        InputError, match=r"link 'forearm': collision: mesh 'package://gone/arm.stl' is missing"
    ) as caught:
        load_robot(write_urdf(tmp_path, BASE + POST + forearm + TURN + BEND))
    assert "\n" not in str(caught.value)


def test_downloads_need_not_be_allowed(tmp_path, monkeypatch):
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", "none")
    assert free(make_checker(load_robot(write_urdf(tmp_path)), NAMES), [0, 0])


def test_what_simulators_and_drivers_add_is_passed_over(tmp_path):
    extra = """<transmission name="t"><type>x</type><joint name="turn"/></transmission>
      <gazebo reference="post"><material>Gazebo/Red</material></gazebo>
      <material name="red"><color rgba="1 0 0 1"/></material>
      <link name="frame"/><joint name="odd" type="fixed"><parent link="forearm"/>
      <child link="frame"/><axis xyz="0 0 0"/></joint>"""
    robot = load_robot(write_urdf(tmp_path, ARM + extra))
    assert robot.names == NAMES
    assert free(make_checker(robot, NAMES), [0, 0])


def test_spheres_on_links_of_their_own(tmp_path):
    """As spherized robots have them: many spheres a link, some on links welded on."""
    spheres = "".join(
        f'<collision><origin xyz="0 0 {z}"/><geometry><sphere radius="0.03"/></geometry></collision>'
        for z in np.linspace(0.1, 0.4, 8)
    )
    body = f"""{BASE}{POST}{TURN}{BEND}<link name="forearm"/><link name="forearm_spheres">{spheres}</link>
      <joint name="weld" type="fixed"><parent link="forearm"/><child link="forearm_spheres"/></joint>"""
    checker = make_checker(load_robot(write_urdf(tmp_path, body)), NAMES, [block("ahead", [0.3, 0.0, 0.5])])
    assert free(checker, [0, 0])
    assert not free(checker, [0, np.pi / 2])


def test_a_joint_that_mimics_is_held_at_its_offset(tmp_path):
    robot = load_robot(write_urdf(tmp_path, ARM + FOLLOWER.format("lead", 0.3)))
    assert robot.names == NAMES, "neither leader nor follower can be planned for"
    # Bent forward, the tip is at x = .5 + .3 m.
    assert not free(make_checker(robot, NAMES, [block("out", [0.8, 0.0, 0.5])]), [0, np.pi / 2])
    assert free(make_checker(robot, NAMES, [block("in", [0.55, 0.0, 0.5])]), [0, np.pi / 2])
    for leader in ("nobody", "slide"):
        with pytest.raises(InputError, match=f"joint 'slide' mimics '{leader}'; expected a movable joint"):
            load_robot(write_urdf(tmp_path, ARM + FOLLOWER.format(leader, 0)))


def test_floating_and_planar_joints_are_held_and_said(tmp_path):
    for kind in ("floating", "planar"):
        body = (
            ARM
            + f'<link name="cart"/><joint name="roam" type="{kind}"><parent link="cart"/><child link="base"/></joint>'
        )
        robot = load_robot(write_urdf(tmp_path, body))
        assert (robot.base, robot.names) == ("cart", NAMES)
        assert robot.notes == (f"{robot.path}: joint 'roam' is {kind}: held where it is at 0",)
        assert free(make_checker(robot, NAMES), [0, 0])


def test_a_link_may_be_called_world(tmp_path):
    body = ARM + '<link name="world"/><joint name="fix" type="fixed"><parent link="world"/><child link="base"/></joint>'
    robot = load_robot(write_urdf(tmp_path, body))
    assert robot.base == "world"
    assert not free(make_checker(robot, NAMES, [block("ahead", [0.3, 0.0, 0.5])]), [0, np.pi / 2])


def test_pairs_that_an_srdf_disables_may_touch(tmp_path):
    low = BEND.replace('xyz="0 0 0.4"', 'xyz="0.2 0 0.0"')  # bent back, the forearm lies in the base
    urdf = write_urdf(tmp_path, BASE + POST + FOREARM + TURN + low.replace('lower="-2"', 'lower="-4"'))
    q = [0, -1.9]
    assert not free(make_checker(load_robot(urdf), NAMES), q)
    srdf = write_srdf(tmp_path, '<disable_collisions link1="forearm" link2="base" reason="Never"/>')
    robot = load_robot(urdf, srdf)
    assert robot.disabled == {("base", "forearm")}
    assert free(make_checker(robot, NAMES), q)
    assert not free(make_checker(robot, NAMES, [block("x", [0.1, 0, 0.05], 0.3)]), q), "obstacles count all the same"


@settings(max_examples=25)
@given(st.text(alphabet='<>/="linkjotraphs 01.-', max_size=60))
def test_any_text_loads_or_is_one_line(tmp_path_factory, text):
    path = write_urdf(tmp_path_factory.mktemp("any"), ARM + text)
    try:
        load_robot(path)
    except InputError as error:
        assert "\n" not in str(error)


def test_a_singular_inertia_is_a_note_and_nonsense_is_refused(tmp_path):
    """Fetch's published fingers have moments of .002, 0 and 0 kg m^2, and are to be planned with."""
    odd = FOREARM.replace("<collision>", inertial(0.0798, 0.002, 0, 0, xyz="-0.01 0 0") + "<collision>")
    robot = load_robot(write_urdf(tmp_path, BASE + POST + odd + TURN + BEND))
    assert len(robot.notes) == 1
    assert "the inertia of 'forearm' cannot be inverted" in robot.notes[0]
    bad = FOREARM.replace("<collision>", inertial(1, "nan", 1, 1) + "<collision>")
    with pytest.raises(InputError, match="link 'forearm': inertial: inertia: ixx is 'nan'; expected a finite number"):
        load_robot(write_urdf(tmp_path, BASE + POST + bad + TURN + BEND))
