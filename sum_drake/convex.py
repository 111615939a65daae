"""Convex bodies and their distances.

A body is the hull of points, or a cylinder, each swollen by a radius: spheres are one point, capsules would be two.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from sum_drake.collision_kernels import Ints, separation
from sum_drake.types import Array, Immutable

HULL, CYLINDER = 0, 1
"""Kinds of body."""


@dataclasses.dataclass(frozen=True, eq=False)
class Bodies(Immutable):
    """Convex bodies, each in a frame of its own whose origin is its middle."""

    kind: Ints
    """(n,) int64: HULL or CYLINDER."""
    first: Ints
    """(n + 1,) int64: points of body i are points[first[i] : first[i + 1]]."""
    points: Array
    """(m, 3). A cylinder has one: its radius, 0, half its length, along z."""
    swell: Array
    """(n,): radius by which each is swollen, metres."""
    radius: Array
    """(n,): of a ball about the origin that holds the body."""

    @staticmethod
    def make(kinds: Sequence[int], points: Sequence[Array], swell: Sequence[float]) -> "Bodies":
        """Of kinds, points (k, 3) and radii of n bodies."""
        counts = [len(p) for p in points]
        return Bodies(
            np.array(kinds, dtype=np.int64),
            np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            np.concatenate([np.zeros((0, 3)), *points]),
            np.array(swell, dtype=float),
            np.array([np.linalg.norm(p, axis=1).max() + s for p, s in zip(points, swell, strict=True)], dtype=float),
        )


def distance(bodies: Bodies, i: int, X_Wi: Array, j: int, X_Wj: Array, touch: float = 0.0) -> float:
    """`separation` of two of the bodies at X (4, 4) each, to the end: the distance, or something up to `touch`."""
    first = bodies.first
    R_i, p_i, R_j, p_j = (
        np.ascontiguousarray(a, dtype=float) for a in (X_Wi[:3, :3], X_Wi[:3, 3], X_Wj[:3, :3], X_Wj[:3, 3])
    )
    return float(
        separation(
            bodies.kind[i],
            bodies.points,
            first[i],
            first[i + 1],
            bodies.swell[i],
            R_i,
            p_i,
            bodies.kind[j],
            bodies.points,
            first[j],
            first[j + 1],
            bodies.swell[j],
            R_j,
            p_j,
            touch,
            np.inf,
            np.empty((8, 3)),
            np.empty(3, dtype=np.int64),
        )
    )
