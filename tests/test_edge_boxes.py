"""Edge Boxes: groups, affinities and scores against their definition, and what the search finds."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import X_WC, observe, standing

from sum_drake.assets import InputError
from sum_drake.detection import edge_boxes as eb
from sum_drake.detection.edges import Edges, EdgesConfig, find_edges
from sum_drake.detection.proposals import iou, nms
from sum_drake.detection.proposers import PROPOSERS
from sum_drake.objects import load_catalogue

CONFIG = eb.EdgeBoxesConfig()
FULL = EdgesConfig(scale=1.0, blur=1.0)


def scribble(seed: int, h: int = 60, w: int = 80) -> Edges:
    """Edges of a random picture of discs and bars."""
    rng = np.random.default_rng(seed)
    color = np.full((h, w, 3), 90, np.uint8)
    v, u = np.mgrid[:h, :w]
    for _ in range(4):
        x, y, r = rng.uniform(5, w - 5), rng.uniform(5, h - 5), rng.uniform(4, 15)
        inside = np.hypot(u - x, v - y) < r if rng.random() < 0.5 else np.maximum(abs(u - x), 2 * abs(v - y)) < r
        color[inside] = rng.integers(0, 256, 3)
    return find_edges(color, None, FULL)


def grouped(edges: Edges) -> eb.Groups:
    ids = eb.group_edges(edges.magnitude, edges.orientation, 0.1, 0.5, 0.5)
    return eb.describe_groups(ids, edges.magnitude, edges.orientation)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_groups_are_connected_edge_pixels_of_enough_weight(seed):
    edges = scribble(seed)
    groups = grouped(edges)
    count = len(groups.magnitude) - 1
    assert set(np.unique(groups.ids)) <= set(range(count + 1))
    assert np.all(edges.magnitude[groups.ids > 0] > 0.1)
    for i in range(1, count + 1):
        v, u = np.nonzero(groups.ids == i)
        m = edges.magnitude[v, u]
        assert groups.magnitude[i] == pytest.approx(m.sum(), rel=1e-5)
        assert groups.magnitude[i] > 0.5
        assert (groups.x[i], groups.y[i]) == pytest.approx((np.average(u, weights=m), np.average(v, weights=m)))
        # 8-connected: everything is reached from the first pixel.
        left, front = set(zip(u.tolist(), v.tolist(), strict=True)), [(int(u[0]), int(v[0]))]
        left.discard(front[0])
        while front:
            x, y = front.pop()
            near = {(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & left
            left -= near
            front += near
        assert not left


def test_a_straight_contour_is_one_group_and_a_corner_parts_two():
    color = np.full((60, 80, 3), 90, np.uint8)
    color[20:40, 20:60] = 220
    groups = grouped(find_edges(color, None, FULL))
    top, left = groups.ids[19:21, 30:50].max(0), groups.ids[25:35, 19:21].max(1)
    assert len(set(top)) == 1 and top[0] > 0
    assert len(set(left)) == 1 and left[0] > 0
    assert top[0] != left[0]


def test_affinity_is_that_of_equation_1():
    edges = scribble(3)
    groups = grouped(edges)
    ties = eb.affinities(groups, 2.0)
    n = len(groups.magnitude)
    found = {}
    for i in range(1, n):
        for k in range(ties.start[i], ties.start[i + 1]):
            found[i, int(ties.group[k])] = float(ties.value[k])
    expected = {}
    for i in range(1, n):
        for j in range(1, n):
            a, b = np.argwhere(groups.ids == i), np.argwhere(groups.ids == j)
            if i != j and np.abs(a[:, None] - b[None]).max(-1).min() <= 2:
                along = math.atan2(groups.y[j] - groups.y[i], groups.x[j] - groups.x[i])
                # The paper's angles are those along the contour: a quarter turn from the gradient's.
                o_i, o_j = groups.orientation[i] + np.pi / 2, groups.orientation[j] + np.pi / 2
                tie = abs(math.cos(o_i - along) * math.cos(o_j - along)) ** 2
                if tie >= 0.05:
                    expected[i, j] = tie
    assert len(expected) > 4
    assert found.keys() == expected.keys()
    assert found == pytest.approx(expected, abs=1e-5)


def score_by_definition(edges: Edges, box: tuple[int, int, int, int], kappa: float) -> float:
    """Eq. 2 to 4 without any of the shortcuts: all groups, all paths."""
    groups = grouped(edges)
    ties = eb.affinities(groups, 2.0)
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


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.data())
def test_score_is_that_of_equations_2_to_4(seed, data):
    edges = scribble(seed)
    h, w = edges.magnitude.shape
    groups = grouped(edges)
    index = eb._index(
        np.where(edges.magnitude > 0.1, edges.magnitude, 0), groups, eb.affinities(groups, CONFIG.gamma), CONFIG.kappa
    )
    for _ in range(5):
        x0, y0 = data.draw(st.integers(0, w - 12)), data.draw(st.integers(0, h - 12))
        x1, y1 = data.draw(st.integers(x0 + 10, w - 1)), data.draw(st.integers(y0 + 10, h - 1))
        expected = score_by_definition(edges, (x0, y0, x1, y1), CONFIG.kappa)
        assert eb._score(index, x0, y0, x1, y1, 1e-6) == pytest.approx(max(expected, 0), abs=2e-5)


@settings(max_examples=50, deadline=None)
@given(st.floats(33, 300), st.floats(0.4, 2.5), st.floats(0, 1), st.floats(0, 1))
def test_no_box_is_far_from_a_window(side, aspect, x, y):
    w, h = side * math.sqrt(aspect), side / math.sqrt(aspect)
    if w > 318 or h > 238:
        return
    windows = eb.make_windows((240, 320), 0.65, 1000.0, 3.0)
    # Half a step off in each of position, scale and aspect ratio: .65 holds for one of them at a time.
    assert iou([[x * (320 - w), y * (240 - h), w, h]], windows).max() > 0.55


@settings(max_examples=30, deadline=None)
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
    assert X_WC.shape == (4, 4)
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


def test_compiled_code_is_not_kept_where_nothing_can_be_written(monkeypatch):
    def refuse(function=None, **options):
        if options.get("cache"):
            return lambda f: (_ for _ in ()).throw(RuntimeError("cannot cache function: no locator available"))
        return function

    monkeypatch.setattr(eb.numba, "njit", refuse)
    assert eb.compiled(len) is len
