"""A user's problems: solved, refused, given up."""

import json

import numpy as np
import pytest
from small_robots import ARM, write_urdf

from sum_drake.bench import plan_solve
from sum_drake.bench.plan_solve import revalidated, solve
from sum_drake.motion import Path, plan_path
from sum_drake.planning_problems import load_problems
from sum_drake.user_robot import load_robot

WALL = {"id": "wall", "type": "box", "dimensions": [0.02, 0.4, 0.3], "position": [0.3, 0, 0.6],
        "quat_xyzw": [0, 0, 0, 1]}  # fmt: skip


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    plan_solve.warm_up()  # compiling is no search
    return load_robot(write_urdf(tmp_path_factory.mktemp("robot")))


def problem(robot, tmp_path, start, goal, joints=("bend", "turn"), obstacles=(WALL,)):
    path = tmp_path / "problems.json"
    path.write_text(json.dumps([{"request": "one", "joints": joints, "start": start, "goal": goal,
                                 "obstacles": list(obstacles)}]))  # fmt: skip
    return load_problems(path, robot)[0]


def test_a_path_goes_around_in_the_order_of_the_problems_joints(robot, tmp_path):
    wanted = problem(robot, tmp_path, [1.2, 1.5], [1.2, -1.5])
    found = solve(robot, wanted, seed=0, time_limit=10.0)
    assert found.solved and found.start_valid and found.goal_valid and found.message == ""
    path = np.array(found.path)
    assert len(path) > 2
    np.testing.assert_allclose(path[[0, -1]], [[1.2, 1.5], [1.2, -1.5]], atol=1e-9)
    assert revalidated(robot, wanted, path)
    assert not revalidated(robot, wanted, path[[0, -1]])
    assert not revalidated(robot, wanted, path[1:])
    again = solve(robot, wanted, seed=0, time_limit=10.0)
    assert again.path == found.path


def test_an_end_that_cannot_be_is_said_with_bodies_and_depth(robot, tmp_path):
    found = solve(robot, problem(robot, tmp_path, [1.4, 0.0], [0.0, 0.0]), seed=0, time_limit=10.0)
    assert (found.start_valid, found.goal_valid, found.solved, found.path) == (False, True, False, [])
    assert "start in collision" in found.message and "forearm" in found.message and "wall" in found.message
    beyond = solve(robot, problem(robot, tmp_path, [0.0, 0.0], [2.6, 0.0]), seed=0, time_limit=10.0)
    assert beyond.start_valid and not beyond.goal_valid
    assert "bend 2.6 above its limit 2.5" in beyond.message


def test_what_has_no_solution_is_given_up_when_the_time_is_over(robot, tmp_path):
    # A ring of walls that the forearm, bent outwards, cannot leave: turning is all it can do, not rising.
    lid = WALL | {"id": "lid", "dimensions": [2.0, 2.0, 0.02], "position": [0, 0, 0.85]}
    found = solve(
        robot, problem(robot, tmp_path, [1.2, 0.8], [-1.2, 0.8], obstacles=(lid,)), seed=0, time_limit=0.5
    )  # fmt: skip
    assert not found.solved and found.start_valid and found.goal_valid
    assert 0.5 <= found.time_s < 3.0
    assert found.message.startswith("no path in 0.5 s")


def test_a_path_that_is_found_too_late_does_not_count(robot, tmp_path, monkeypatch):
    found = []

    def slow(*arguments, stop, **more):
        found.append(plan_path(*arguments, **more))
        while not stop():
            pass
        return found[-1]

    monkeypatch.setattr(plan_solve, "plan_path", slow)
    late = solve(robot, problem(robot, tmp_path, [1.2, 1.5], [1.2, -1.5]), seed=0, time_limit=0.3)
    assert isinstance(found[-1], Path)
    assert (late.start_valid, late.goal_valid, late.solved, late.path) == (True, True, False, [])
    assert late.time_s > 0.3
    assert late.message.startswith("a path was found too late, after ") and late.message.endswith("of 0.3 s")


@pytest.mark.parametrize("limits", ['lower="-1e16" upper="1e16" velocity="1e10"', 'lower="-2" upper="1e16"'])
def test_a_joint_may_have_limits_that_are_none_or_one(tmp_path, limits):
    plan_solve.warm_up()
    robot = load_robot(write_urdf(tmp_path, ARM.replace('lower="-2" upper="2.5" velocity="0.7"', limits)))
    wanted = problem(robot, tmp_path, [1.2, 1.5], [1.2, -1.5])
    found = solve(robot, wanted, seed=0, time_limit=10.0)
    assert found.solved and revalidated(robot, wanted, np.array(found.path))
