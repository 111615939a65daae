"""Edges of colour and of depth: where they lie, which way they run, and what is none."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.assets import InputError
from sum_drake.detection.edges import EdgesConfig, depth_steps, fill_missing, find_edges, surface_normals

FULL = EdgesConfig(scale=1.0, blur=1.0)
GREY = np.full((96, 128, 3), 128, np.uint8)


def disc(radius: float = 25.0) -> np.ndarray:
    v, u = np.mgrid[:96, :128]
    return np.hypot(u - 64, v - 48) < radius


def plane(tilt: float, f: float = 100.0) -> np.ndarray:
    """Depth of a plane .8 m ahead that leans away by `tilt` radians."""
    v = np.arange(96)[:, None] - 47.5
    return np.broadcast_to(0.8 / (1 + np.tan(tilt) * v / f), (96, 128)).astype(np.float32)


def on_circle(edges, radius: float = 25.0):
    v, u = np.nonzero(edges.magnitude > 0.2)
    return u, v, np.hypot(u - 64, v - 48) - radius


def test_a_colored_disc_has_its_outline_as_edge_and_nothing_else():
    color = GREY.copy()
    color[disc()] = (200, 40, 40)
    edges = find_edges(color, None, FULL)
    u, v, off = on_circle(edges)
    assert np.all(np.abs(off) < 2)
    # Thin, and closed: a good pixel for each of the outline, and every direction is there.
    assert 0.8 * 2 * np.pi * 25 < len(u) < 1.4 * 2 * np.pi * 25
    assert len(np.unique(np.degrees(np.arctan2(v - 48, u - 64)) // 10)) >= 36
    across = np.arctan2(v - 48, u - 64)
    turn = np.abs((edges.orientation[v, u] - across + np.pi / 2) % np.pi - np.pi / 2)
    assert np.percentile(turn, 95) < np.radians(12)


def test_the_same_outline_is_found_in_depth_alone():
    depth = np.where(disc(), 0.75, 0.85).astype(np.float32)
    u, _, off = on_circle(find_edges(GREY, depth, FULL))
    assert len(u) > 100
    assert np.all(np.abs(off) < 2.5)


@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.1])
def test_a_plane_has_no_edges_however_steep(tilt):
    edges = find_edges(GREY, plane(tilt), FULL)
    assert np.all(edges.magnitude[6:-6, 6:-6] < 0.1)


def test_a_fold_without_a_step_is_an_edge():
    roof = np.minimum(plane(1.0), plane(-1.0)).astype(np.float32)
    edges = find_edges(GREY, roof, dataclasses.replace(FULL, focal_length=100 / 128, crease_weight=0.5))
    v, u = np.nonzero(edges.magnitude[8:-8, 8:-8] > 0.1)
    assert set(np.unique(u)) == set(range(112))
    assert np.all(np.abs(v + 8 - 47.5) < 4)


def test_the_shadow_beside_an_object_moves_no_edge():
    depth = np.where(disc(), 0.75, 0.85).astype(np.float32)
    shadow = np.roll(disc(), -8, axis=1) & ~disc()
    depth[shadow] = 0
    _, _, off = on_circle(find_edges(GREY, depth, FULL))
    assert np.all(np.abs(off) < 2.5)


def test_a_picture_scaled_down_gives_the_same_edges_on_a_smaller_map():
    color = GREY.copy()
    color[disc()] = (200, 40, 40)
    edges = find_edges(color, None, EdgesConfig(scale=0.5))
    assert edges.magnitude.shape == (48, 64)
    assert edges.scale == 0.5
    v, u = np.nonzero(edges.magnitude > 0.2)
    assert np.all(np.abs(np.hypot(2 * u + 0.5 - 64, 2 * v + 0.5 - 48) - 25) < 4)


def test_depth_without_a_single_reading_is_as_no_depth():
    color = GREY.copy()
    color[disc()] = (200, 40, 40)
    nothing = np.zeros((96, 128), np.float32)
    np.testing.assert_array_equal(find_edges(color, nothing, FULL).magnitude, find_edges(color, None, FULL).magnitude)


@settings(max_examples=30)
@given(st.integers(0, 2**31), st.floats(0, 0.9))
def test_filled_depth_has_no_holes_and_keeps_what_was_measured(seed, share):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.5, 2, (20, 30)).astype(np.float32)
    missing = rng.random((20, 30)) < share
    missing[0, 0] = False
    holed = np.where(missing, rng.choice(np.float32([0, np.nan, np.inf, -1]), missing.shape), depth)
    filled = fill_missing(holed)
    assert np.all(filled > 0)
    np.testing.assert_array_equal(filled[~missing], depth[~missing])
    assert filled.max() <= depth[~missing].max()


def test_a_hole_gets_the_farther_side():
    row = np.array([[1.0, 0, 0, 2.0, 0, 1.5]], np.float32)
    np.testing.assert_array_equal(fill_missing(row), [[1.0, 2.0, 2.0, 2.0, 2.0, 1.5]])
    assert fill_missing(np.zeros((3, 3), np.float32)) is None


def test_a_step_is_measured_as_a_share_of_the_depth():
    depth = np.where(np.arange(128)[None] < 64, 1.0, 1.05) * np.ones((96, 1))
    x, y = depth_steps(np.log(depth).astype(np.float32), 1.0)
    assert x[48].max() == pytest.approx(np.log(1.05), rel=0.1)
    assert np.abs(y).max() < 1e-6


@pytest.mark.parametrize("tilt", [-0.9, 0.0, 0.5])
def test_normals_are_those_of_the_plane(tilt):
    normals = surface_normals(np.log(plane(tilt)), 100.0)
    # 1/z = (1 + tan(tilt) v / f) / .8: the surface comes nearer where v grows.
    expected = np.array([0, -np.sin(tilt), -np.cos(tilt)])
    np.testing.assert_allclose(normals[48, 64], expected, atol=0.03)


@pytest.mark.parametrize(
    ("color", "depth", "message"),
    [
        (np.zeros((96, 128), np.uint8), None, "picture: uint8 of shape"),
        (np.zeros((96, 128, 3)), None, "picture: float64"),
        (np.zeros((8, 128, 3), np.uint8), None, "at least 16 x 16"),
        (GREY, np.zeros((96, 127), np.float32), "expected floats"),
        (GREY, np.zeros((96, 128), np.uint16), "depth: uint16"),
    ],
)
def test_what_is_no_picture_is_refused_in_one_line(color, depth, message):
    with pytest.raises(InputError, match=message) as error:
        find_edges(color, depth, FULL)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("values", [{"scale": 0}, {"scale": 1.5}, {"blur": 0}, {"color_weight": 0.95}])
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(InputError, match="edges: "):
        EdgesConfig(**values)
