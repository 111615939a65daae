"""Depth segments: planes, cuts, and the objects of a table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import observe, standing

from sum_drake.assets import InputError
from sum_drake.detection.depth_segments import DepthSegmentsConfig, depth_segments, on_planes
from sum_drake.detection.proposers import PROPOSERS
from sum_drake.geometry import iou
from sum_drake.objects import load_catalogue

CONFIG = DepthSegmentsConfig()


def slope(a: float, b: float, z: float = 1.0) -> np.ndarray:
    """Depth (120, 160) of a plane."""
    v, u = np.mgrid[:120, :160]
    return (z / (1 + a * (u / 160 - 0.5) + b * (v / 120 - 0.5))).astype(np.float32)


@settings(max_examples=20)
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.integers(0, 1000))
def test_a_noisy_plane_is_a_plane_wherever_it_leans(a, b, seed):
    noise = np.random.default_rng(seed).normal(0, 0.002, (120, 160))
    log_depth = np.log(slope(a, b) + noise).astype(np.float32)
    assert on_planes(log_depth, CONFIG).mean() > 0.97


def test_a_ball_on_a_plane_is_no_plane():
    v, u = np.mgrid[:120, :160]
    height = np.sqrt(np.maximum(30.0**2 - (u - 80) ** 2 - (v - 60) ** 2, 0)) / 400
    on = on_planes(np.log(slope(0, 0.4) - height).astype(np.float32), CONFIG)
    assert on[height == 0].mean() > 0.97
    assert on[height > 0.02].mean() < 0.05


def test_two_boxes_that_touch_are_two_and_their_union_is_tried():
    depth = slope(0, 0.3)
    depth[30:80, 30:70] -= 0.08
    depth[30:80, 70:120] -= 0.13
    proposals = depth_segments(depth, CONFIG)
    overlaps = iou([[30, 30, 40, 50], [70, 30, 50, 50], [30, 30, 90, 50]], proposals.boxes)
    assert np.all(overlaps.max(1) > 0.8)
    # What all sets of segments agree on comes first.
    assert overlaps[:2].argmax(1).max() < overlaps[2].argmax()


@pytest.fixture(scope="module")
def table():
    catalogue = load_catalogue()
    places = {"mug": (0.5, -0.2), "tea": (0.52, 0.0), "soup_can": (0.6, 0.12), "mustard": (0.68, -0.08)}
    return observe(catalogue, {label: standing(catalogue, label, *place) for label, place in places.items()})


def test_objects_on_a_table_are_found_with_few_boxes(table):
    frame, boxes = table
    proposals = PROPOSERS["depth_segments"]()(frame.color, frame.depth)
    assert len(proposals) < 40
    assert np.all(iou(np.array(list(boxes.values())), proposals.boxes).max(1) > 0.75)
    assert np.all(proposals.boxes >= 0)
    assert np.all(proposals.boxes[:, :2] + proposals.boxes[:, 2:] <= (320, 240))


def test_both_kinds_together_begin_with_the_segments(table):
    frame, boxes = table
    both = PROPOSERS["edge_boxes_and_segments"]()(frame.color, frame.depth)
    segments = PROPOSERS["depth_segments"]()(frame.color, frame.depth)
    edges = PROPOSERS["edge_boxes"]()(frame.color, frame.depth)
    np.testing.assert_array_equal(both.boxes[: len(segments)], segments.boxes)
    assert len(both) > len(segments)
    # Nothing that one of them found is lost.
    for part in (segments, edges):
        assert np.all(iou(part.boxes, both.boxes).max(1) > 0.85)
    assert np.all(iou(np.array(list(boxes.values())), both.boxes[:100]).max(1) > 0.75)


def test_without_depth_segments_say_so_and_both_are_edge_boxes(table):
    frame, _ = table
    with pytest.raises(InputError, match="no depth"):
        PROPOSERS["depth_segments"]()(frame.color, None)
    color = frame.color.copy()
    color[60:120, 80:140] = 200
    np.testing.assert_array_equal(
        PROPOSERS["edge_boxes_and_segments"]()(color, None).boxes, PROPOSERS["edge_boxes"]()(color, None).boxes
    )


@pytest.mark.parametrize("depth", [np.zeros((120, 160)), np.full((120, 160), np.nan), slope(0, 0)])
def test_nothing_to_segment_gives_no_box(depth):
    assert len(depth_segments(depth.astype(np.float32), CONFIG)) == 0


def test_settings_out_of_range_are_refused():
    with pytest.raises(InputError, match="depth segments: "):
        DepthSegmentsConfig(scale=0)
    with pytest.raises(InputError, match="depth segments: "):
        DepthSegmentsConfig(steps=())
