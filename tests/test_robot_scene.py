"""A user's robot as planning asks for it."""

import json

import numpy as np
import pytest
from small_robots import write_urdf

from sum_drake.planning_problems import load_problems
from sum_drake.robot_scene import RAMP, RobotScene
from sum_drake.user_robot import load_robot


@pytest.fixture
def scene(tmp_path):
    robot = load_robot(write_urdf(tmp_path))
    wall = {"id": "wall", "type": "box", "dimensions": [0.02, 1.0, 0.3], "position": [0.3, 0, 0.6],
            "quat_xyzw": [0, 0, 0, 1]}  # fmt: skip
    path = tmp_path / "problems.json"
    path.write_text(json.dumps([{"request": "over", "joints": ["bend", "turn"], "start": [0.2, 0.0],
                                 "goal": [1.9, 0.0], "obstacles": [wall]}]))  # fmt: skip
    return RobotScene.of(robot, load_problems(path, robot)[0])


def test_its_joints_come_from_the_base_outwards_with_their_limits(scene):
    assert scene.space.names == ("turn", "bend")
    assert scene.space.lower.tolist() == [-np.inf, -2]
    assert scene.space.upper.tolist() == [np.inf, 2.5]
    np.testing.assert_allclose(scene.space.acceleration, scene.space.velocity / RAMP)


def test_what_is_in_its_way_is_named_with_its_depth(scene):
    assert scene.is_free(np.array([0.0, 0.2]))
    inside = np.array([0.0, 1.4])
    assert not scene.is_free(inside)
    ((link, _, depth),) = scene.depths(inside)
    assert link == "forearm"
    assert 0 < depth < 0.12
    assert scene.colliding_pairs(inside) == tuple(sorted({pair[:2] for pair in scene.depths(inside)}))
    # Over the wall's other side there is no way but around.
    assert not scene.edge_free(np.array([0.0, 0.2]), np.array([0.0, 1.9]))
    assert not scene.confirmed(np.array([[0.0, 0.2], [0.0, 1.9]]))
