"""Edge maps of random pictures and their groups, for tests of Edge Boxes."""

import numpy as np

from sum_drake.detection.edge_groups import Groups, describe_groups, group_edges
from sum_drake.detection.edges import Edges, EdgesConfig, find_edges

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


def grouped(edges: Edges) -> Groups:
    ids = group_edges(edges.magnitude, edges.orientation, 0.1, 0.5, 0.5)
    return describe_groups(ids, edges.magnitude, edges.orientation)
