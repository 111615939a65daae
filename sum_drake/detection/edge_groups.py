"""Edge groups and who is akin to whom: sections 3 and 3.1 of Edge Boxes (Zitnick and Dollár, ECCV 2014).

Edge pixels are joined to groups of little bend. Two near groups are akin when one continues the other.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sum_drake.compiled import compiled
from sum_drake.types import Array

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@compiled
def _turn(a: float, b: float) -> float:
    """Between two orientations, which are equal up to half a turn: 0 to .5, in units of pi."""
    turn = abs(a - b) / np.pi % 1.0
    return min(turn, 1.0 - turn)


@compiled
def group_edges(magnitude: Floats, orientation: Floats, least: float, bend: float, group_least: float) -> Ints:
    """Joins 8-connected edge pixels, always the one that turns least, until the turns sum to `bend`.

    magnitude, orientation: (h, w). Pixels up to `least` and the picture's rim belong to no group. What a group of up to
    `group_least` in sum held goes to the neighbouring groups of nearest orientation. Returns each pixel's group (h, w),
    counted from 1 with gaps; 0 or less: none.
    """
    h, w = magnitude.shape
    ids = np.full((h, w), -1, np.int32)
    for y in range(1, h - 1):
        for x in range(1, w - 1):
            if magnitude[y, x] > least:
                ids[y, x] = 0

    # Candidates of the group that grows: its pixels' neighbours, and how far each turns from the pixel that found it.
    xs, ys, turns = np.empty(h * w, np.int32), np.empty(h * w, np.int32), np.empty(h * w, np.float32)
    found_by = np.zeros((h, w), np.int32)
    count = 0
    for x_first in range(1, w - 1):
        for y_first in range(1, h - 1):
            if ids[y_first, x_first] != 0:
                continue
            count += 1
            x, y, total, n = x_first, y_first, 0.0, 0
            while total < bend:
                ids[y, x] = count
                for u in range(x - 1, x + 2):
                    for v in range(y - 1, y + 2):
                        if ids[v, u] == 0 and found_by[v, u] != count:
                            found_by[v, u] = count
                            xs[n], ys[n], turns[n] = u, v, _turn(orientation[v, u], orientation[y, x])
                            n += 1
                best, least_turn = -1, 1.0
                for i in range(n):
                    if turns[i] < least_turn:
                        best, least_turn = i, turns[i]
                if best < 0:
                    break
                x, y = xs[best], ys[best]
                total += least_turn
                turns[best] = 1.0  # taken: no turn is as large

    _give_away_small(ids, magnitude, orientation, count, group_least)
    return ids


@compiled
def _give_away_small(ids: Ints, magnitude: Floats, orientation: Floats, count: int, least: float) -> None:
    """Hands the pixels of small groups on, changing ids in place, until none has a neighbour left to go to."""
    h, w = ids.shape
    sums = np.zeros(count + 1, np.float32)
    for x in range(1, w - 1):
        for y in range(1, h - 1):
            if ids[y, x] > 0:
                sums[ids[y, x]] += magnitude[y, x]
    free_x, free_y = np.empty(h * w, np.int32), np.empty(h * w, np.int32)
    n = 0
    for x in range(1, w - 1):
        for y in range(1, h - 1):
            if ids[y, x] > 0 and sums[ids[y, x]] <= least:
                ids[y, x] = 0
                free_x[n], free_y[n] = x, y
                n += 1
    while True:
        left = 0
        for i in range(n):
            x, y = free_x[i], free_y[i]
            nearest, group = 1.0, 0
            for u in range(x - 1, x + 2):
                for v in range(y - 1, y + 2):
                    if ids[v, u] > 0:
                        turn = _turn(orientation[v, u], orientation[y, x])
                        if turn < nearest:
                            nearest, group = turn, ids[v, u]
            if group:
                ids[y, x] = group
            else:
                free_x[left], free_y[left] = x, y
                left += 1
        if left == n:
            return
        n = left


class Groups(NamedTuple):
    """Edge groups (section 3.1), numbered from 1. Entry 0 of the arrays is nobody's."""

    ids: Ints
    """(h, w): the pixel's group; 0: none."""
    magnitude: Array
    """(n,): sum over the group."""
    x: Array
    """(n,): mean position, weighted by magnitude."""
    y: Array
    orientation: Array
    """(n,): mean direction of the gradient, radians."""


def describe_groups(ids: Ints, magnitude: Floats, orientation: Floats) -> Groups:
    """The groups of pixels of equal positive id (h, w), renumbered without gaps."""
    rows, columns = np.nonzero(ids > 0)
    _, numbers = np.unique(ids[rows, columns], return_inverse=True)
    numbers = numbers + 1
    renumbered = np.zeros_like(ids)
    renumbered[rows, columns] = numbers
    m, angle = magnitude[rows, columns], 2 * orientation[rows, columns]

    def total(values: NDArray[Any]) -> Array:
        return np.asarray(np.bincount(numbers, m * values, minlength=1), dtype=np.float64)

    sums = total(np.ones_like(m))
    safe = np.where(sums > 0, sums, 1)
    mean = np.arctan2(total(np.sin(angle)), total(np.cos(angle))) / 2
    return Groups(renumbered, sums, total(columns) / safe, total(rows) / safe, mean)


class Affinities(NamedTuple):
    """Who is akin to whom, as compressed rows: group i's are at start[i] to start[i + 1]."""

    start: Ints
    """(n + 1,)."""
    group: Ints
    value: Floats


NEAR = 2
"""Pixels, along each axis: groups that come so near each other may be akin."""
LEAST_AFFINITY = 0.05
"""Weaker ties, and weaker chains of them, count as none (section 3.2)."""


def affinities(groups: Groups, gamma: float) -> Affinities:
    """|cos(o_i - o_ij) cos(o_j - o_ij)|^gamma of groups near each other (eq. 1)."""
    n = len(groups.magnitude)
    h, w = groups.ids.shape
    padded = np.pad(groups.ids, NEAR).astype(np.int64)
    pairs = []
    for dy in range(NEAR + 1):
        for dx in range(-NEAR if dy else 1, NEAR + 1):  # the other half is its mirror image
            there = padded[NEAR + dy : NEAR + dy + h, NEAR + dx : NEAR + dx + w]
            near = (groups.ids > 0) & (there > 0) & (groups.ids != there)
            a, b = groups.ids[near], there[near]
            pairs.append(np.unique(np.minimum(a, b) * n + np.maximum(a, b)))
    a, b = np.divmod(np.unique(np.concatenate(pairs)), n)
    # Orientations are gradients', so across a contour that runs from one mean to the other.
    across = np.arctan2(groups.y[a] - groups.y[b], groups.x[a] - groups.x[b]) + np.pi / 2
    value = np.abs(np.cos(groups.orientation[a] - across) * np.cos(groups.orientation[b] - across)) ** gamma
    strong = value >= LEAST_AFFINITY
    source, target = np.concatenate([a[strong], b[strong]]), np.concatenate([b[strong], a[strong]])
    order = np.lexsort([target, source])
    start = np.searchsorted(source[order], np.arange(n + 1))
    value = np.tile(value[strong], 2)[order]
    return Affinities(start.astype(np.int32), target[order].astype(np.int32), value.astype(np.float32))
