"""Where something may run on unseen: behind what stands in front of it, between two parts of it that show.

What lies under another shows on both sides of it, if at all, and is often not recognised. The hand must not be put
where it goes through.
"""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from sum_drake.standing import sights, thin
from sum_drake.types import Array, Frame

CELL = 0.008
"""Of space, metres: one point in each."""
PART, LEAST = 0.02, 8
"""Points that are no farther than this apart, metres, are of one part, if it fills so many cells."""
LONGEST = 0.25
"""Way behind something for which two parts are still taken for one thing's, metres."""
BEHIND = 0.01
"""What lies so far behind what was observed is hidden, metres."""
POINTS = 60
"""Of a part, from which lines are drawn."""


def hidden_between(frame: Frame, points_W: Array) -> Array:
    """(m, 3): points in W on straight lines between parts, that cannot be seen on any of their way.

    points_W: (n, 3), observed, of nothing that is believed. Lines may lead through what hides them.
    """
    lines = [np.empty((0, 3))]
    for a, b in itertools.combinations(_parts(_one_a_cell(points_W)), 2):
        lines.append(_hidden_lines(frame, thin(a, POINTS), thin(b, POINTS)))
    return _one_a_cell(np.concatenate(lines))


def _one_a_cell(points: Array) -> Array:
    """The first of the points (n, 3) in every cell."""
    _, first = np.unique(np.floor(points / CELL).astype(int), axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


def _parts(points: Array) -> list[Array]:
    """Points (n, 3), by which of them hang together."""
    pairs = cKDTree(points).query_pairs(PART, output_type="ndarray") if len(points) else np.empty((0, 2), int)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    count, part = connected_components(graph, directed=False) if len(points) else (0, np.empty(0, int))
    parts = [points[part == i] for i in range(count)]
    return [one for one in parts if len(one) >= LEAST]


def _hidden_lines(frame: Frame, a: Array, b: Array) -> Array:
    """Points (k, 3) of the lines from one of a (n, 3) to one of b (m, 3) of which all but the ends is hidden."""
    start, end = (part.reshape(-1, 3) for part in np.broadcast_arrays(a[:, None], b[None]))
    length = np.linalg.norm(end - start, axis=1)
    short = (length > 2 * PART) & (length <= LONGEST)
    start, end, length = start[short], end[short], length[short]
    share = np.linspace(0.0, 1.0, int(np.ceil(LONGEST / CELL)) + 1)
    lines = start[:, None] + share[:, None] * (end - start)[:, None]  # (lines, points, 3)
    between = np.minimum(share, 1 - share) * length[:, None] >= PART
    hidden = _is_hidden(frame, lines.reshape(-1, 3)).reshape(between.shape)
    return np.asarray(lines[between & (hidden | ~between).all(axis=1, keepdims=True)])


def _is_hidden(frame: Frame, points_W: Array) -> NDArray[np.bool_]:
    """Which of the points (n, 3) lie behind what was observed; where nothing was, none does."""
    z, depth = sights(frame, points_W)
    return np.asarray((depth > 0) & (z > depth + BEHIND))
