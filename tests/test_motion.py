"""Scenes, paths, and the reasons why there are none."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.multibody.parsing import LoadModelDirectives

from sum_drake import motion, robot
from sum_drake.assets import InputError, asset
from sum_drake.kinematics import Arm
from sum_drake.motion import NoPath, Path, PlanningScene, Solid, plan_path
from sum_drake.objects import load_catalogue

ARM = Arm()
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def block(name, p_W, half_extents):
    X_WS = np.eye(4)
    X_WS[:3, 3] = p_W
    return Solid(name, (CORNERS * half_extents,), X_WS)


def pointing_down(p_WG, yaw=0.0):
    """X_WG with the palm's x axis down."""
    c, s = np.cos(yaw), np.sin(yaw)
    X_WG = np.eye(4)
    X_WG[:3, :3] = np.column_stack([[0, 0, -1], [-s, c, 0], [c, s, 0]])
    X_WG[:3, 3] = p_WG
    return X_WG


def solve(X_WG):
    """The arm's cheapest way to put its hand at X_WG (4, 4)."""
    return ARM.solutions(X_WG, count=1)[0]


@pytest.fixture(scope="module")
def bare():
    return PlanningScene()


@pytest.fixture(scope="module")
def walled():
    """A wall across the table, and a block behind it."""
    return PlanningScene(solids=(block("wall", [0.6, 0.0, 0.85], [0.15, 0.02, 0.15]),
                                 block("block", [0.6, 0.2, 0.75], [0.03, 0.03, 0.05])))  # fmt: skip


@pytest.fixture(scope="module")
def sides():
    """Free configurations with the hand on one side of the wall and on the other."""
    left, right = (solve(pointing_down([0.6, y, 0.9])) for y in (0.2, -0.2))
    return left, right


def test_the_viewing_pose_is_free_with_room_to_spare(bare):
    roomy = bare.padded(furniture=0.02, solids=0.02, self_distance=0.005)
    assert roomy.is_free(robot.VIEW)
    assert roomy.colliding_pairs(robot.VIEW) == ()


def test_what_touches_is_named(bare, walled):
    low = solve(pointing_down([0.6, 0.0, 0.72]))
    assert not bare.is_free(low)
    assert {pair[1] for pair in bare.colliding_pairs(low)} == {"table"}
    inside = solve(pointing_down([0.6, 0.0, 0.95]))
    assert bare.is_free(inside)
    assert "wall" in {pair[1] for pair in walled.colliding_pairs(inside)}


def test_scenes_are_values(walled):
    q = solve(pointing_down([0.6, 0.0, 0.95]))
    assert not walled.is_free(q)
    assert walled.ignoring("wall").is_free(q)
    assert not walled.ignoring("block").is_free(q)
    assert walled.with_solids(()).is_free(q)
    assert not walled.is_free(q)


def test_padding_keeps_a_distance(bare):
    q = solve(pointing_down([0.6, 0.0, 0.70 + robot.HAND.pad_x[1] + 0.008]))
    assert bare.is_free(q)
    assert not bare.padded(furniture=0.01, solids=0.0).is_free(q)
    assert bare.padded(furniture=0.005, solids=0.01).is_free(q)


def test_solids_of_equal_name_are_told_apart(bare):
    twins = [block("box", [0.6, y, 0.75], [0.06, 0.06, 0.05]) for y in (-0.1, 0.1)]
    scene = bare.with_solids(twins)
    assert scene.names == ("box", "box#2")
    q = solve(pointing_down([0.6, 0.1, 0.79]))
    assert {pair[1] for pair in scene.colliding_pairs(q)} == {"box#2"}


def test_a_held_object_counts(bare):
    q = solve(pointing_down([0.6, 0.0, 0.85]))
    assert bare.is_free(q)
    bar = (CORNERS * [0.03, 0.02, 0.02],)
    assert bare.holding(bar, np.eye(4)).is_free(q)  # it may touch the hand
    X_GO = np.eye(4)
    X_GO[0, 3] = 0.15
    assert not bare.holding(bar, X_GO).is_free(q)  # but not the table
    assert bare.is_free(q)


def test_directives_may_come_as_a_list():
    directives = LoadModelDirectives(str(asset(motion.SORTING))).directives
    assert PlanningScene(directives).is_free(robot.VIEW)


def test_directives_that_cannot_be_loaded_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.dmd\.yaml"):
        PlanningScene("package://sum_drake/scenes/nowhere.dmd.yaml")
    empty = tmp_path / "empty.dmd.yaml"
    empty.write_text("directives: []\n")
    with pytest.raises(InputError, match="a model 'fetch'"):
        PlanningScene(str(empty))


@settings(max_examples=50, deadline=None)
@given(arrays(float, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-0.5, 0.5, width=32)))
def test_boxes_cover_every_point_and_little_else(points):
    (solid,) = motion.solids_of_points(points, size=0.05)
    low, high = (np.array([f(hull, axis=0) for hull in solid.hulls]) for f in (np.min, np.max))
    inside = (points[:, None] >= low - 1e-9) & (points[:, None] <= high + 1e-9)
    assert inside.all(-1).any(1).all()
    cells = len(np.unique(np.floor(points / 0.05), axis=0))
    assert np.isclose((high - low).prod(1).sum(), cells * 0.05**3)
    assert len(solid.hulls) <= cells


def test_no_points_are_no_solid():
    assert motion.solids_of_points(np.empty((0, 3))) == ()


def test_an_object_is_its_collision_pieces():
    mug = load_catalogue()["mug"]
    solid = motion.solid_of(mug, np.eye(4))
    assert len(solid.hulls) == len(mug.collision) > 1
    extents = np.ptp(np.concatenate(solid.hulls), axis=0)
    np.testing.assert_allclose(extents, mug.dimensions, atol=0.01)


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


def test_the_same_query_gives_the_same_path_in_another_process(walled, sides):
    left, right = sides
    plan_path(walled, right, np.array([left]), seed=7)  # what was asked before must not matter
    path = plan_path(walled, left, np.array([right]), seed=3)
    assert isinstance(path, Path)
    assert len(path.qs) > 2
    script = """
import sys; sys.path.insert(0, "tests")
import numpy as np
from test_motion import PlanningScene, block, plan_path, pointing_down, solve
scene = PlanningScene(solids=(block("wall", [0.6, 0.0, 0.85], [0.15, 0.02, 0.15]),
                              block("block", [0.6, 0.2, 0.75], [0.03, 0.03, 0.05])))
left, right = (solve(pointing_down([0.6, y, 0.9])) for y in (0.2, -0.2))
print(plan_path(scene, left, np.array([right]), seed=3).qs.tobytes().hex())
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
