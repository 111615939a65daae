"""The plane that things stand on, where depth shows one: what lies in it is none of them, and they end above it.

A bottle that lies in the table top explains the bare table well. Told what the table is, the likelihood does not ask
for it to be explained. Among clutter little of a table shows: one that is known is taken for it there. Of a table that
is known it is known, too, that nothing reaches into it with what does not show.
"""

import dataclasses

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.geometry import apply
from sum_drake.particles import Particles
from sum_drake.types import Array, Box, Frame, Immutable, Region, readonly

LEAST_SHARE = 0.3
"""Of the points around the box: fewer make no support."""
LEAST_POINTS = 100
TRIES, POINTS = 200, 1500
"""Planes tried, on so many points at most."""
AS_LEVEL, AS_HIGH = np.radians(5.0), 0.02
"""How far a table may be from where it is known to be: turned, radians, and at the box, metres."""
SUNK = 0.01
"""What reaches less than this under a plane may stand on it, metres: plane, mesh and pose may be off."""
SOFT = 0.005
"""Standard deviation of how much deeper a pose reaches into a known table, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Plane(Immutable):
    """Points with normal_C . p_CQ + offset = 0; the camera is on the side where that is positive."""

    normal_C: Array
    """(3,), unit."""
    offset: float
    """Metres: the camera's height above it."""

    def height(self, p_CQs: Array) -> Array:
        """Of points (..., 3) above the plane, metres."""
        return np.asarray(p_CQs @ self.normal_C + self.offset)


@dataclasses.dataclass(frozen=True, eq=False)
class Ground(Immutable):
    """The top of a table that is known, where a frame shows it."""

    plane: Plane
    X_WC: Array
    """(4, 4)."""
    table: Region

    def log_prior(self, particles: Particles, p_MQs: Tensor) -> Tensor:
        """Of poses, (n,), up to a constant: what an object's outermost points p_MQs (k, 3) have to do with the table.

        What is beside the table may hang below its top.
        """
        R_COs, p_CMs = particles.R_COs, particles.p_CMs
        normal_C = torch.tensor(self.plane.normal_C, dtype=torch.float32)
        heights = (normal_C @ R_COs) @ p_MQs.T + (p_CMs @ normal_C + self.plane.offset)[:, None]
        depth = torch.zeros(len(particles))
        low = (heights.amin(1) < -SUNK).nonzero()[:, 0]
        if len(low):
            X_WC = torch.tensor(self.X_WC, dtype=torch.float32)
            p_CQs = p_MQs @ R_COs[low].transpose(1, 2) + p_CMs[low, None]
            p_WQs = p_CQs @ X_WC[:2, :3].T + X_WC[:2, 3]
            middle, half = (torch.tensor(a[:2], dtype=torch.float32) for a in (self.table.p_W, self.table.half_extents))
            over = ((p_WQs - middle).abs() < half).all(-1)
            depth[low] = torch.where(over, -heights[low], 0.0).amax(1)
        return -(((depth - SUNK).clamp(min=0) / SOFT) ** 2) / 2


def table_plane(frame: Frame, box: Box, table: Region) -> Plane | None:
    """A known table's top, if what was observed in the box is over it; else None: it may stand on anything."""
    points_C = _around(frame, box, 0.0)
    if len(points_C) == 0:
        return None
    (p_W,) = apply(frame.X_WC, np.median(points_C, axis=0, keepdims=True))
    if (np.abs(p_W[:2] - table.p_W[:2]) > table.half_extents[:2]).any():
        return None
    return Plane(readonly(frame.X_WC[2, :3]), float(frame.X_WC[2, 3] - table.floor_height))


def support_plane(
    frame: Frame,
    box: Box,
    rng: np.random.Generator,
    *,
    tolerance: float,
    margin: float = 1.0,
    known: Plane | None = None,
) -> Plane | None:
    """The plane that holds most of what was observed around a box, up to `margin` times its size away; None: none does.

    What is in the box has no say, so that a box-shaped object does not take its own side for the table. tolerance: by
    which observed points may be off it, metres. known: where a table should be; a plane that is far from it is none,
    and where clutter hides the table it is taken to be there.
    """
    points = _around(frame, box, margin, inside=False)
    if len(points) < LEAST_POINTS:
        return known
    points = points[rng.permutation(len(points))[:POINTS]]
    a, b, c = points[rng.integers(len(points), size=(3, TRIES))]
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    usable = length > 1e-6
    normals, a = normals[usable] / length[usable, None], a[usable]
    if known is not None:
        near = _near(normals, a, known, np.median(points, axis=0))
        normals, a = normals[near], a[near]
    if len(normals) == 0:
        return known
    on_it = np.abs(normals @ points.T - (normals * a).sum(1)[:, None]) < tolerance
    best = int(on_it.sum(1).argmax())
    inliers = points[on_it[best]]
    if len(inliers) < max(LEAST_SHARE * len(points), 3):
        return known
    middle = inliers.mean(0)
    normal = np.linalg.svd(inliers - middle, full_matrices=False)[2][2]
    offset = -float(normal @ middle)
    sign = 1.0 if offset > 0 else -1.0
    return Plane(readonly(sign * normal), sign * offset)


def _near(normals: Array, points: Array, known: Plane, p_CQ: Array) -> NDArray[np.bool_]:
    """Which of the planes (n, 3) through points (n, 3) nearly are a known one, as seen below or above p_CQ."""
    foot = p_CQ - known.height(p_CQ) * known.normal_C
    level = np.abs(normals @ known.normal_C) > np.cos(AS_LEVEL)
    high = np.abs((normals * (foot - points)).sum(1)) < AS_HIGH
    return np.asarray(level & high)


def _around(frame: Frame, box: Box, margin: float, inside: bool = True) -> Array:
    """p_CQ (n, 3) of what was observed around a box, and inside it if that is wanted, thinned out."""
    x, y, w, h = box
    camera = frame.camera
    left, top = max(0, int(x - margin * w)), max(0, int(y - margin * h))
    right, bottom = min(camera.width, int(x + (1 + margin) * w)), min(camera.height, int(y + (1 + margin) * h))
    if right <= left or bottom <= top:
        return np.zeros((0, 3))
    step = max(1, int(np.sqrt((right - left) * (bottom - top) / (4 * POINTS))))
    v, u = np.mgrid[top:bottom:step, left:right:step]
    z: NDArray[np.float64] = frame.depth[v, u].astype(np.float64)
    outside = (u < x) | (u >= x + w) | (v < y) | (v >= y + h)
    seen = (outside | inside) & np.isfinite(z) & (z > 0)
    u, v, z = u[seen], v[seen], z[seen]
    return np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z], -1)


def sunk(vertices: Array, X_WO: Array, table: Region) -> float:
    """How far an object with vertices (v, 3) at X_WO (4, 4) reaches below a table's top, metres.

    Negative: by how much it is above it. Only what is over the table counts; 0 where nothing is.
    """
    p_W = apply(X_WO, vertices)
    over = (np.abs(p_W[:, :2] - table.p_W[:2]) < table.half_extents[:2]).all(axis=1)
    return float(table.floor_height - p_W[over, 2].min()) if over.any() else 0.0
