"""Hypotheses that cannot all be true: two objects in one place, or one patch of depth that two objects explain.

Each may be real; together they contend, and what one gains the others lose.
"""

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from sum_drake.geometry import apply, inverse, pose_error
from sum_drake.modes import RIGHT
from sum_drake.objects import ObjectModel, sample_surface
from sum_drake.presence import LEAST_PIXELS
from sum_drake.types import Array, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

PENETRATION = 0.012
"""How far two estimates of true objects reach into each other at most, metres: errors of both poses."""
SAME_M, SAME_RAD = RIGHT[0], np.radians(RIGHT[1])
"""Two estimates within these agree."""
SHARED = 0.5
"""Two hypotheses that explain more than this share of the depth pixels of either explain the same thing."""
EXACT = 12
"""Hypotheses that hang together by conflicts, up to which they are weighed exactly."""
POINTS = 400
"""Of a surface, that are looked for in another body."""


def contended(probabilities: Array, conflicts: NDArray[np.bool_]) -> Array:
    """(n,): probabilities (n,) of hypotheses of which some exclude each other, conflicts (n, n), symmetric.

    Each is true with its odds, and none beside one that it excludes: the share of all that may be true together in
    which it is. One without a conflict keeps its probability. Where more than EXACT hang together, the likeliest of
    them are weighed so, and each of the others in turn has what those before it that exclude it leave: no two that
    exclude each other are more than 1 together.
    """
    p = np.clip(np.asarray(probabilities, float), 0.0, 1 - 1e-6)
    odds: Array = p / (1 - p)
    found: Array = p.copy()
    for group in _connected(conflicts):
        order = sorted(group, key=lambda i: (-p[i], i))
        first, rest = np.array(order[:EXACT]), order[EXACT:]
        found[first] = _shares(odds[first], conflicts[np.ix_(first, first)])
        weighed = list(first)
        for i in rest:
            before = np.array(weighed)
            found[i] = p[i] * np.prod(1 - found[before[conflicts[i, before]]])
            weighed.append(i)
    return found


def _connected(conflicts: NDArray[np.bool_]) -> list[list[int]]:
    """Groups of those that hang together by conflicts, of two and more."""
    left, groups = set(range(len(conflicts))), []
    while left:
        group, waiting = [], [min(left)]
        left.discard(waiting[0])
        while waiting:
            group.append(waiting.pop())
            near = sorted(left & set(map(int, np.flatnonzero(conflicts[group[-1]]))))
            left.difference_update(near)
            waiting += near
        if len(group) > 1:
            groups.append(group)
    return groups


def _shares(odds: Array, conflicts: NDArray[np.bool_]) -> Array:
    """(n,): of all sets without a conflict, each as likely as the product of its odds (n,), the share that has each."""
    n = len(odds)
    sets = (np.arange(2**n)[:, None] >> np.arange(n)) & 1  # (2^n, n)
    allowed = ~((sets @ conflicts.astype(int) > 0) & (sets > 0)).any(axis=1)
    weights = np.where(allowed, np.where(sets > 0, odds, 1.0).prod(axis=1), 0.0)
    return np.asarray(weights @ sets / weights.sum())


def agree(X_WA: Array, X_WB: Array, label: str, catalogue: "Catalogue") -> bool:
    """Whether two estimates of an object's pose are the same, for all that is asked of them."""
    shift, angle = pose_error(X_WA, X_WB, catalogue[label].symmetry)
    return bool(shift < SAME_M and angle < SAME_RAD)


def conflicts(
    tracks: Sequence[Track], explained: Sequence[NDArray[np.bool_]], catalogue: "Catalogue"
) -> NDArray[np.bool_]:
    """(n, n): which tracks exclude each other. explained: the frame's pixels (h, w) that each explains.

    Two that say the same of the same label do not: if one is right, so is the other.
    """
    n = len(tracks)
    found = np.zeros((n, n), dtype=bool)
    masks = np.stack([mask.ravel() for mask in explained]).astype(np.float32)
    shared = masks @ masks.T  # (n, n): counts of pixels
    sizes = np.diag(shared)
    for i in range(n):
        for j in range(i):
            a, b = tracks[i], tracks[j]
            if a.label == b.label and agree(a.X_WO, b.X_WO, a.label, catalogue):
                continue
            least = min(sizes[i], sizes[j])
            same = least >= LEAST_PIXELS and shared[i, j] > SHARED * least
            found[i, j] = found[j, i] = same or penetration(a, b, catalogue) > PENETRATION
    return found


def penetration(a: Track, b: Track, catalogue: "Catalogue") -> float:
    """How far two tracks' estimates reach into each other, metres: the deepest point of either's surface."""
    of_a, of_b = catalogue[a.label], catalogue[b.label]
    X_AB = inverse(a.X_WO) @ b.X_WO
    if np.linalg.norm(X_AB[:3, 3]) > _reach(of_a) + _reach(of_b):
        return 0.0
    return max(0.0, _depth(_surface(of_b), X_AB, of_a), _depth(_surface(of_a), inverse(X_AB), of_b))


def _depth(points: Array, X_AB: Array, into: ObjectModel) -> float:
    p_A = apply(X_AB, points)
    # Within a convex piece a point is as deep as its nearest face.
    return max(float((-(p_A @ half[:, :3].T + half[:, 3])).min(axis=1).max()) for half in _pieces(into))


@functools.lru_cache(maxsize=64)
def _pieces(model: ObjectModel) -> tuple[Array, ...]:
    """Half-spaces (f, 4) of each convex piece of an object's body: outward normals and offsets."""
    return tuple(np.asarray(ConvexHull(piece.vertices).equations) for piece in model.load_collision())


@functools.lru_cache(maxsize=64)
def _surface(model: ObjectModel) -> Array:
    return sample_surface(model, POINTS, np.random.default_rng(0))[0]


@functools.lru_cache(maxsize=64)
def _reach(model: ObjectModel) -> float:
    """From the object's origin to its farthest point, metres."""
    return float(np.linalg.norm(np.asarray(model.load_mesh().vertices), axis=1).max())
