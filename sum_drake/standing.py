"""What depth shows standing on the table, and of which believed object each point is."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sum_drake.explaining import UNEXPLAINED
from sum_drake.geometry import apply, inverse
from sum_drake.objects import ObjectModel, sample_surface
from sum_drake.sensor import back_project
from sum_drake.types import Array, Frame, Region, Track

EXPLAINED, NAMED = 0.012, 0.02
"""Depth points this near to a believed object are on it, metres: pose error and sensor noise together; and so much
farther ones are still named after it, where they are in the way."""


def standing_points(frame: Frame, table: Region, height: float) -> Array:
    """Depth points in W (n, 3) that stand more than `height` above the table, over its area."""
    p_CQ = back_project(frame.depth, frame.camera).reshape(-1, 3)
    p_WQ = apply(frame.X_WC, p_CQ[frame.depth.reshape(-1) > 0])
    over = np.all(np.abs(p_WQ[:, :2] - table.p_W[:2]) < table.half_extents[:2], axis=1)
    between = (p_WQ[:, 2] > table.floor_height + height) & (p_WQ[:, 2] < table.rim_height)
    return np.asarray(p_WQ[over & between])


def table_shown(frame: Frame, table: Region) -> float:
    """Share of the table's top, as far as it lies in the picture, at which there is depth; 0 where none of it does."""
    x, y = np.meshgrid(*(np.linspace(-0.95, 0.95, 24),) * 2)
    spots = np.stack([x, y, np.full_like(x, -1.0)], -1).reshape(-1, 3)
    _, depth = sights(frame, table.p_W + table.half_extents * spots)
    inside = ~np.isnan(depth)
    return float(np.mean(depth[inside] > 0)) if inside.any() else 0.0


def sights(frame: Frame, points_W: Array) -> tuple[Array, Array]:
    """How far in front of the camera points (n, 3) are, and what depth was observed there: 0 none, NaN out of sight."""
    camera = frame.camera
    x, y, z = apply(inverse(frame.X_WC), points_W).T
    ahead = np.maximum(z, 1e-6)
    u = np.round(camera.fx * x / ahead + camera.cx).astype(int)
    v = np.round(camera.fy * y / ahead + camera.cy).astype(int)
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    depth = np.full(len(z), np.nan)
    depth[inside] = frame.depth[v[inside], u[inside]]
    return z, depth


def thin(points: NDArray[Any], count: int) -> NDArray[Any]:
    """At most `count` of the points (or of their numbers), evenly picked."""
    return points[:: max(1, -(-len(points) // count))]


def distances(points_W: Array, model: ObjectModel, X_WO: Array) -> Array:
    """(n,): how far points (n, 3) are from the surface of an object."""
    of_it, _ = sample_surface(model, 3000, np.random.default_rng(0))
    distance, _ = cKDTree(of_it).query(apply(inverse(X_WO), points_W))
    return np.asarray(distance)


def not_of(points_W: Array, model: ObjectModel, X_WO: Array) -> Array:
    """The points that are not explained by the object at that pose."""
    return np.asarray(points_W[distances(points_W, model, X_WO) > EXPLAINED])


def owners(tracks: Sequence[Track], off: Sequence[Array], count: int) -> list[str]:
    """Label of the object that each of `count` points is nearest to, UNEXPLAINED for those that are near to none."""
    if not tracks:
        return [UNEXPLAINED] * count
    far = np.array(off)  # (tracks, points)
    return [tracks[i].label if far[i, point] < NAMED else UNEXPLAINED for point, i in enumerate(far.argmin(axis=0))]
