"""URDFs that cannot be used are refused in one line that says what, where and what was expected."""

import numpy as np
import pytest
from small_robots import ARM, BASE, BEND, FOREARM, POST, TURN, collision, write_urdf

from sum_drake.assets import InputError
from sum_drake.urdf import SPEED
from sum_drake.user_robot import load_robot


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("", "has no link; expected a robot"),
        (ARM + "<link", "arm.urdf: .*expected a URDF, which is XML"),
        (ARM + '<xacro:macro xmlns:xacro="http://ros.org/xacro" name="x"/>', "has xacro tags; expected a plain URDF"),
        (ARM + BASE, "link 'base' is there twice"),
        (ARM + BEND, "joint 'bend' is there twice"),
        (ARM + '<link name=""/>', "a link has no name"),
        (ARM + '<link name="loose"/>', r"has 2 links without a parent joint \(base, loose\); expected a tree"),
        (BASE + POST + TURN + BEND, "joint 'bend': there is no link 'forearm'"),
        (ARM + TURN.replace("turn", "again"), "link 'post' is the child of two joints"),
        (
            ARM + '<joint name="back" type="fixed"><parent link="forearm"/><child link="base"/></joint>',
            "has a loop; expected a tree",
        ),
        (BASE + POST + FOREARM + TURN + BEND.replace('"post"', '"forearm"'), "link 'forearm' is part of a loop"),
        (ARM.replace("continuous", "screw"), "joint 'turn': its type is 'screw'; expected one of revolute"),
        (ARM.replace('<parent link="base"/>', ""), "joint 'turn': has no parent link"),
        (ARM.replace('xyz="0 1 0"', 'xyz="0 0 0"'), "joint 'bend': its axis is 0"),
        (ARM.replace('xyz="0 1 0"', 'xyz="0 1"'), "joint 'bend': axis: xyz is '0 1'; expected 3 finite numbers"),
        (ARM.replace('xyz="0 0 0.4"', 'xyz="0 0 inf"'), "joint 'bend': origin: xyz is '0 0 inf'"),
        (ARM.replace('xyz="0 0 0.4"', 'rpy="0 0 1e9"'), "joint 'bend': origin: rpy is '0 0 1e9'"),
        (ARM.replace('lower="-2"', 'lower="3"'), "joint 'bend': its lower limit is 3, its upper 2.5"),
        (ARM.replace('lower="-2"', 'lower="low"'), "joint 'bend': limit: lower is 'low'; expected a number"),
        (ARM.replace('velocity="0.7"', 'velocity="nan"'), "joint 'bend': limit: velocity is 'nan'; expected a number"),
        (ARM.replace('lower="-2"', 'lower="1e16"'), "joint 'bend': its lower limit is inf, its upper 2.5"),
        (ARM.replace('"-2" upper="2.5"', '"-1e17" upper="-1e16"'), "its lower limit is -inf, its upper -inf"),
        (ARM.replace('velocity="0.7"', 'velocity="-1"'), "joint 'bend': limit: velocity is -1"),
        (ARM.replace("0.04 0.04 0.3", "0.04 0.04 0"), "link 'forearm': collision: box has the size 0.04 0.04 0"),
        (ARM.replace("0.04 0.04 0.3", "0.04"), "collision: box: size is '0.04'; expected 3 finite numbers"),
        (ARM.replace(' length="0.2"', ""), "link 'post': collision: cylinder: length is missing"),
        (ARM.replace("<box", "<cone"), "is a <cone>; expected a box, sphere, cylinder, capsule or mesh"),
        (ARM + f'<link name="x">{collision("")}</link>', "link 'x': collision: has 0 shapes"),
        (ARM + f'<link name="x">{collision("<mesh/>")}</link>', "link 'x': collision: a mesh has no filename"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(tmp_path, body, words):
    with pytest.raises(InputError, match=words) as caught:
        load_robot(write_urdf(tmp_path, body))
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_files_that_are_no_urdf(tmp_path):
    with pytest.raises(InputError, match="No such file or directory; expected a URDF"):
        load_robot(tmp_path / "none.urdf")
    sdf = tmp_path / "model.sdf"
    sdf.write_text('<sdf version="1.7"/>')
    with pytest.raises(InputError, match="its root is <sdf>; expected a URDF, whose root is <robot>"):
        load_robot(sdf)
    sdf.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="expected a URDF, which is XML"):
        load_robot(sdf)


def test_a_joint_without_limits_has_none_and_a_speed(tmp_path):
    body = ARM.replace('<limit lower="-2" upper="2.5" velocity="0.7" effort="1"/>', "")
    robot = load_robot(write_urdf(tmp_path, body))
    np.testing.assert_array_equal(robot.lower, [-np.inf, -np.inf])
    np.testing.assert_array_equal(robot.velocity, [1.5, SPEED])
    assert robot.notes == (f"{robot.path}: joint 'bend' has no limit: taken to have none",)


def test_limits_of_a_continuous_joint_are_not_limits(tmp_path):
    robot = load_robot(
        write_urdf(tmp_path, ARM.replace('<limit velocity="1.5"', '<limit lower="0" upper="0" velocity="0"'))
    )
    assert (robot.lower[0], robot.upper[0], robot.velocity[0]) == (-np.inf, np.inf, SPEED)


def test_limits_that_are_too_large_to_be_any_are_none(tmp_path):
    endless = ARM.replace('"-2" upper="2.5" velocity="0.7"', '"-1e16" upper="1e16" velocity="1e10"')
    robot = load_robot(write_urdf(tmp_path, endless))
    assert (robot.lower[1], robot.upper[1], robot.velocity[1]) == (-np.inf, np.inf, SPEED)
    assert robot.notes == (f"{robot.path}: joint 'bend' has no limit of speed: taken to move at 1 a second",)
    one_sided = load_robot(write_urdf(tmp_path, ARM.replace('upper="2.5"', 'upper="inf"')))
    assert (one_sided.lower[1], one_sided.upper[1], one_sided.velocity[1]) == (-2.0, np.inf, 0.7)
    assert one_sided.notes == ()
