import math

import numpy as np
import pytest
from contours import FULL, grouped, scribble
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.detection.edge_groups import affinities
from sum_drake.detection.edges import find_edges


@settings(max_examples=15)
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
    ties = affinities(groups, 2.0)
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
