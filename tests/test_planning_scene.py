"""What is free for the arm, what touches what, and how scenes are made from scenes."""

import numpy as np
import pytest
from arm_poses import CORNERS, block, pointing_down, solve, walled_scene
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.multibody.parsing import LoadModelDirectives

from sum_drake import planning_scene, robot
from sum_drake.assets import InputError, asset
from sum_drake.objects import load_catalogue
from sum_drake.planning_scene import PlanningScene


@pytest.fixture(scope="module")
def bare():
    return PlanningScene()


@pytest.fixture(scope="module")
def walled():
    return walled_scene()


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
    directives = LoadModelDirectives(str(asset(planning_scene.SORTING))).directives
    assert PlanningScene(directives).is_free(robot.VIEW)


def test_directives_that_cannot_be_loaded_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.dmd\.yaml"):
        PlanningScene("package://sum_drake/scenes/nowhere.dmd.yaml")
    empty = tmp_path / "empty.dmd.yaml"
    empty.write_text("directives: []\n")
    with pytest.raises(InputError, match="a model 'fetch'"):
        PlanningScene(str(empty))


@settings(max_examples=50)
@given(arrays(float, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-0.5, 0.5, width=32)))
def test_boxes_cover_every_point_and_little_else(points):
    (solid,) = planning_scene.solids_of_points(points, size=0.05)
    low, high = (np.array([f(hull, axis=0) for hull in solid.hulls]) for f in (np.min, np.max))
    inside = (points[:, None] >= low - 1e-9) & (points[:, None] <= high + 1e-9)
    assert inside.all(-1).any(1).all()
    cells = len(np.unique(np.floor(points / 0.05), axis=0))
    assert np.isclose((high - low).prod(1).sum(), cells * 0.05**3)
    assert len(solid.hulls) <= cells


def test_no_points_are_no_solid():
    assert planning_scene.solids_of_points(np.empty((0, 3))) == ()


def test_an_object_is_its_collision_pieces():
    mug = load_catalogue()["mug"]
    solid = planning_scene.solid_of(mug, np.eye(4))
    assert len(solid.hulls) == len(mug.collision) > 1
    extents = np.ptp(np.concatenate(solid.hulls), axis=0)
    np.testing.assert_allclose(extents, mug.dimensions, atol=0.01)
