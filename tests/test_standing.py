"""What depth shows standing on the table."""

import dataclasses

import numpy as np
import pytest
from scenes import TABLE, observe, standing

from sum_drake.explaining import UNEXPLAINED
from sum_drake.geometry import apply
from sum_drake.objects import load_catalogue, sample_surface
from sum_drake.standing import not_of, owners, standing_points, table_shown, thin
from sum_drake.task_config import TaskConfig
from sum_drake.types import PoseBelief, Region, Track, readonly

CATALOGUE = load_catalogue()
TABLE_TOP = Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25]))
HEIGHT = TaskConfig().clear_height


def test_points_are_those_that_stand_over_the_table_and_no_others():
    there, beside = standing(CATALOGUE, "sugar", 0.6, 0.0), standing(CATALOGUE, "mug", 0.35, 0.0)
    table = dataclasses.replace(TABLE_TOP, half_extents=readonly([0.22, 0.45, 0.25]))
    frame, boxes = observe(CATALOGUE, {"sugar": there, "mug": beside})
    assert set(boxes) == {"sugar", "mug"}, "both are in the picture"
    points_W = standing_points(frame, table, HEIGHT)
    assert len(points_W) > 500
    assert points_W[:, 2].min() > TABLE + HEIGHT
    assert len(not_of(points_W, CATALOGUE["sugar"], there)) == 0, "all of them are the sugar's"
    assert len(standing_points(observe(CATALOGUE, {})[0], table, HEIGHT)) == 0


def test_pixels_without_depth_are_no_points():
    frame, _ = observe(CATALOGUE, {"sugar": standing(CATALOGUE, "sugar", 0.6, 0.0)})
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    assert standing_points(blind, TABLE_TOP, HEIGHT).shape == (0, 3)


def test_an_object_explains_the_points_on_it_and_not_those_beside_it():
    model = CATALOGUE["mug"]
    X_WO = standing(CATALOGUE, "mug", 0.6, 0.1, yaw=1.0)
    p_O, n_O = sample_surface(model, 500, np.random.default_rng(1))
    near, off = apply(X_WO, p_O + 0.008 * n_O), apply(X_WO, p_O) + np.array([0.0, 0.3, 0.0])
    np.testing.assert_array_equal(not_of(np.concatenate([near, off]), model, X_WO), off)
    assert not_of(np.empty((0, 3)), model, X_WO).shape == (0, 3)


def test_a_point_is_the_nearest_objects_if_it_is_near_to_any():
    belief = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
    mug, tea = (
        Track(i, label, (0, 0, 1, 1), 0.9, 0.9, belief, readonly(np.eye(4)), 0.9, 0.9, True, 0, 0)
        for i, label in enumerate(("mug", "tea"))
    )
    off = [np.array([0.001, 0.019, 0.3]), np.array([0.01, 0.018, 0.021])]
    assert owners([mug, tea], off, 3) == ["mug", "tea", UNEXPLAINED]
    assert owners([], [], 2) == [UNEXPLAINED] * 2


def test_how_much_of_the_table_is_shown_is_a_share_of_what_is_in_the_picture():
    frame, _ = observe(CATALOGUE, {})
    assert table_shown(frame, TABLE_TOP) == pytest.approx(1.0, abs=0.1)
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    assert table_shown(blind, TABLE_TOP) == 0.0
    behind = dataclasses.replace(TABLE_TOP, p_W=readonly([-5.0, 0.0, 0.95]))
    assert table_shown(frame, behind) == 0.0


@pytest.mark.parametrize(("count", "limit"), [(0, 3), (3, 3), (4, 3), (10_000, 3000)])
def test_thinning_keeps_at_most_so_many_points_from_all_over(count, limit):
    points = np.arange(count)
    kept = thin(points, limit)
    assert len(kept) <= limit
    assert len(kept) > limit / 2 or count <= limit / 2
    if count > limit:
        assert kept[-1] >= count - count / limit - 2
    else:
        np.testing.assert_array_equal(kept, points)
