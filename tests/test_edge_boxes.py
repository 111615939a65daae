"""Edge Boxes: groups, affinities and scores against their definition, and what the search finds."""

import math

import numpy as np
import pytest
from contours import grouped, scribble
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import observe, standing

from sum_drake.assets import InputError
from sum_drake.detection import edge_boxes as eb
from sum_drake.detection.edge_groups import affinities
from sum_drake.detection.edges import Edges, EdgesConfig
from sum_drake.detection.proposals import nms
from sum_drake.detection.proposers import PROPOSERS
from sum_drake.geometry import iou
from sum_drake.objects import load_catalogue

CONFIG = eb.EdgeBoxesConfig()


def score_by_definition(edges: Edges, box: tuple[int, int, int, int], kappa: float) -> float:
    """Eq. 2 to 4 without any of the shortcuts: all groups, all paths."""
    groups = grouped(edges)
    ties = affinities(groups, 2.0)
    n = len(groups.magnitude)
    chain = np.eye(n)
    for i in range(n):
        chain[i, ties.group[ties.start[i] : ties.start[i + 1]]] = ties.value[ties.start[i] : ties.start[i + 1]]
    x0, y0, x1, y1 = box
    # A group is in the box if its last pixel, column by column, is; paths stay in the box.
    inside = np.zeros(n, dtype=bool)
    for i in range(1, n):
        v, u = np.nonzero(groups.ids == i)
        last = np.lexsort([v, u])[-1]
        inside[i] = x0 <= u[last] <= x1 and y0 <= v[last] <= y1
    border = np.zeros(n, dtype=bool)
    rim = [groups.ids[[y0, y1], x0 : x1 + 1], groups.ids[y0 : y1 + 1, [x0, x1]]]
    border[np.unique(np.concatenate([part.ravel() for part in rim]))] = True
    border[0] = False
    strength = border.astype(float)
    for _ in range(n):
        through = (strength[:, None] * chain).max(0)
        through[(through < 0.05) | ~(inside | border)] = 0
        strength = np.maximum(strength, through)
    total = float(((1 - strength) * groups.magnitude)[inside].sum())
    b_w, b_h = (x1 - x0) // 2, (y1 - y0) // 2
    x_in, y_in = x0 + b_w // 2, y0 + b_h // 2
    middle = edges.magnitude[y_in : y_in + b_h + 1, x_in : x_in + b_w + 1]
    return (total - float(middle[middle > 0.1].sum())) / (b_w + b_h) ** kappa


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.data())
def test_score_is_that_of_equations_2_to_4(seed, data):
    edges = scribble(seed)
    h, w = edges.magnitude.shape
    groups = grouped(edges)
    index = eb._index(
        np.where(edges.magnitude > 0.1, edges.magnitude, 0), groups, affinities(groups, CONFIG.gamma), CONFIG.kappa
    )
    for _ in range(5):
        x0, y0 = data.draw(st.integers(0, w - 12)), data.draw(st.integers(0, h - 12))
        x1, y1 = data.draw(st.integers(x0 + 10, w - 1)), data.draw(st.integers(y0 + 10, h - 1))
        expected = score_by_definition(edges, (x0, y0, x1, y1), CONFIG.kappa)
        assert eb._score(index, x0, y0, x1, y1, 1e-6) == pytest.approx(max(expected, 0), abs=2e-5)


@settings(max_examples=50)
@given(st.floats(33, 300), st.floats(0.4, 2.5), st.floats(0, 1), st.floats(0, 1))
def test_no_box_is_far_from_a_window(side, aspect, x, y):
    w, h = side * math.sqrt(aspect), side / math.sqrt(aspect)
    if w > 318 or h > 238:
        return
    windows = eb.make_windows((240, 320), 0.65, 1000.0, 3.0)
    # Half a step off in each of position, scale and aspect ratio: .65 holds for one of them at a time.
    assert iou([[x * (320 - w), y * (240 - h), w, h]], windows).max() > 0.55


@settings(max_examples=30)
@given(st.lists(st.tuples(*[st.integers(0, 30)] * 2, *[st.integers(1, 40)] * 2), max_size=30), st.floats(0.3, 0.9))
def test_suppression_is_greedy_nms(boxes, beta):
    array = np.array(boxes, np.int32).reshape(-1, 4)
    kept = eb._suppress(array, beta, 1.0, 100)
    assert kept.tolist() == nms(array, -np.arange(len(array)), beta).tolist()
    assert eb._suppress(array, beta, 1.0, 3).tolist() == kept[:3].tolist()


def test_the_best_box_of_a_disc_is_the_discs():
    color = np.full((120, 160, 3), 90, np.uint8)
    v, u = np.mgrid[:120, :160]
    color[np.hypot(u - 70, v - 60) < 22] = (200, 60, 30)
    for scale in (1.0, 0.5):
        proposals = eb.EdgeBoxes(EdgesConfig(scale=scale))(color)
        assert iou(proposals.boxes[:1], [[48.5, 38.5, 43, 43]])[0, 0] > 0.85
    flat = eb.EdgeBoxes()(np.full((120, 160, 3), 90, np.uint8))
    assert len(flat) == 0


@pytest.fixture(scope="module")
def table():
    catalogue = load_catalogue()
    places = {"mug": (0.5, -0.2), "tea": (0.52, 0.0), "soup_can": (0.6, 0.12), "mustard": (0.68, -0.08)}
    return observe(catalogue, {label: standing(catalogue, label, *place) for label, place in places.items()})


def test_objects_on_a_table_are_found(table):
    frame, boxes = table
    proposals = PROPOSERS["edge_boxes"]()(frame.color, frame.depth)
    truth = np.array(list(boxes.values()))
    assert len(truth) == 4
    assert np.all(iou(truth, proposals.boxes[:300]).max(1) > 0.7)
    assert np.all(np.diff(proposals.scores) <= 0)
    assert np.all(proposals.boxes[:, 2:] > 0)
    assert np.all(proposals.boxes >= 0)
    assert np.all(proposals.boxes[:, :2] + proposals.boxes[:, 2:] <= (320, 240))


def test_the_same_picture_gives_the_same_boxes(table):
    frame, _ = table
    first, second = (eb.EdgeBoxes()(frame.color, frame.depth) for _ in range(2))
    np.testing.assert_array_equal(first.boxes, second.boxes)
    np.testing.assert_array_equal(first.scores, second.scores)


@pytest.mark.parametrize(
    "values",
    [{"alpha": 1.0}, {"beta": 0}, {"max_boxes": 0}, {"min_box_area": 1}, {"kappa": -1}, {"max_aspect_ratio": 0}],
)
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(InputError, match="edge boxes: "):
        eb.EdgeBoxesConfig(**values)
