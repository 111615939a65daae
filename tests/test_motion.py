"""Paths, and the reasons why there are none."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
from arm_poses import ARM, pointing_down, sides_of_the_wall, solve, walled_scene

from sum_drake import motion
from sum_drake.motion import NoPath, Path, plan_path


@pytest.fixture(scope="module")
def walled():
    return walled_scene()


@pytest.fixture(scope="module")
def sides():
    return sides_of_the_wall()


def test_a_path_goes_around_and_is_free(walled, sides):
    left, right = sides
    padded = walled.padded(furniture=0.01, solids=0.006)
    assert not padded.edge_free(left, right)
    path = plan_path(padded, left, np.array([right]), seed=1)
    assert isinstance(path, Path)
    np.testing.assert_allclose(path.qs[[0, -1]], [left, right], atol=1e-9)
    assert path.goal == 0
    dense = np.concatenate([np.linspace(a, b, 2 + int(np.abs(b - a).max() / 0.004)) for a, b in
                            itertools.pairwise(path.qs)])  # fmt: skip
    assert padded.free_many(dense).all()


def test_a_goal_that_collides_is_passed_over(walled, sides):
    left, right = sides
    inside = solve(pointing_down([0.6, 0.0, 0.95]))
    path = plan_path(walled, left, np.array([inside, right]), seed=1)
    assert isinstance(path, Path)
    assert path.goal == 1


def test_why_there_is_no_path(walled, sides):
    left, right = sides
    inside = solve(pointing_down([0.6, 0.0, 0.95]))
    start = plan_path(walled, inside, np.array([left]), seed=1)
    assert isinstance(start, NoPath)
    assert start.reason == "start_in_collision"
    assert any("wall" in pair for pair in start.pairs)
    goal = plan_path(walled, left, np.array([inside]), seed=1)
    assert isinstance(goal, NoPath)
    assert goal.reason == "goal_in_collision"
    budget = plan_path(walled, left, np.array([right]), seed=1, budget=0)
    assert isinstance(budget, NoPath)
    assert budget.reason == "budget"


def moved(q, joint, value):
    return np.where(np.arange(8) == joint, value, q)


@pytest.mark.parametrize(
    ("start", "goals", "options", "words"),
    [
        (lambda q: q * np.nan, lambda q: q, {}, "q_start: is not finite; expected numbers"),
        (lambda q: q, lambda q: [q, moved(q, 3, np.inf)], {}, "q_goals: is not finite; expected numbers"),
        (lambda q: q[:7], lambda q: q, {}, r"q_start: has the shape \(7,\); expected \(8,\)"),
        (lambda q: q[None], lambda q: q, {}, r"q_start: has the shape \(1, 8\); expected \(8,\)"),
        (lambda q: q, lambda q: [q[:7]], {}, r"q_goals: has the shape \(1, 7\); expected \(n, 8\)"),
        (lambda q: "here", lambda q: q, {}, r"q_start: is no array of numbers; expected the shape \(8,\)"),
        (lambda q: q, lambda q: np.empty((0, 8)), {}, "q_goals: holds no goal; expected one or more"),
        (lambda q: q, lambda q: q, {"planner": "luck"}, "planner 'luck': unknown; expected one of rrt_connect, rrt, "),
    ],
)
def test_what_is_no_request_is_one_line(walled, sides, start, goals, options, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        plan_path(walled, start(sides[0]), goals(sides[1]), seed=1, **options)


def test_what_is_beyond_joint_limits_is_not_planned_for(walled, sides):
    left, right = sides
    above, below = moved(left, 4, 2.3), moved(moved(left, 0, -0.1), 6, -2.5)
    start = plan_path(walled, above, right, seed=1)
    assert start == NoPath("start_beyond_limits", (("elbow_flex_joint", "2.3 above its limit 2.251"),))
    goal = plan_path(walled, left, np.array([below, above]), seed=1)
    assert isinstance(goal, NoPath)
    assert goal.reason == "goal_beyond_limits"
    assert goal.pairs == (
        ("torso_lift_joint", "-0.1 below its limit 0"),
        ("wrist_flex_joint", "-2.5 below its limit -2.16"),
    )
    others = plan_path(walled, left, np.array([below, right]), seed=1)
    assert isinstance(others, Path)
    assert others.goal == 1, "goals beyond limits are passed over"
    inside = solve(pointing_down([0.6, 0.0, 0.95]))
    neither = plan_path(walled, left, np.array([below, inside]), seed=1)
    assert isinstance(neither, NoPath)
    assert neither.reason == "goal_in_collision"
    assert any("wall" in pair for pair in neither.pairs)


def test_an_arm_a_hair_beyond_a_limit_or_some_turns_on_can_be_planned_for(walled, sides):
    left, _ = sides
    start = moved(left, 0, 0.38615 + 0.9e-3)
    assert isinstance(plan_path(walled, start, moved(left, 7, left[7] + 4 * np.pi), seed=1), Path)


def test_the_same_query_gives_the_same_path_in_another_process(walled, sides):
    left, right = sides
    plan_path(walled, right, np.array([left]), seed=7)  # what was asked before must not matter
    path = plan_path(walled, left, np.array([right]), seed=3)
    assert isinstance(path, Path)
    assert len(path.qs) > 2
    script = """
import sys; sys.path.insert(0, "tests")
import numpy as np
from arm_poses import sides_of_the_wall, walled_scene
from sum_drake.motion import plan_path
left, right = sides_of_the_wall()
print(plan_path(walled_scene(), left, np.array([right]), seed=3).qs.tobytes().hex())
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == path.qs.tobytes().hex()


def test_the_hand_moves_straight_along_a_cartesian_path():
    X_WG = pointing_down([0.6, 0.1, 0.8], yaw=0.3)
    X_WG_goal = pointing_down([0.55, 0.15, 0.95], yaw=0.6)
    q = solve(X_WG)
    path = motion.cartesian_path(ARM, X_WG, X_WG_goal, q)[0]
    hands = ARM.forward_many(path)
    along = (X_WG_goal - X_WG)[:3, 3]
    off = np.cross(hands[:, :3, 3] - X_WG[:3, 3], along / np.linalg.norm(along))
    assert np.linalg.norm(off, axis=1).max() < 1e-6
    np.testing.assert_allclose(hands[-1], X_WG_goal, atol=1e-6)
