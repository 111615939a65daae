"""How objects rest on a table: on which side, and whether they would without their neighbours."""

import functools

import numpy as np
from scipy.spatial import ConvexHull

from sum_drake.geometry import rotation_from_vector
from sum_drake.objects import ObjectModel, sample_surface
from sum_drake.types import Array, readonly

STEADY = np.radians(12)
"""An object that is tilted by less from lying on one of its sides is taken to lie on it: poses are off by as much."""
TIPPED = np.radians(8)
"""An object that rests, tipped by this in any direction, has its centre higher,"""
LEVEL = 0.0003
"""or at most this much lower, metres: round things may roll."""
POINTS = 8000


@functools.lru_cache(maxsize=64)
def outside(model: ObjectModel) -> Array:
    """(POINTS, 3) in O: points all over the surface, dense enough to be its shape seen from above; kept in memory."""
    return readonly(sample_surface(model, POINTS, np.random.default_rng(0))[0])


def centre(model: ObjectModel) -> Array:
    """(3,) in O: the mean of the surface, which stands for the centre of mass, as no catalogue tells it."""
    mesh = model.load_mesh()
    return np.average(np.asarray(mesh.triangles_center), axis=0, weights=np.asarray(mesh.area_faces))


@functools.lru_cache(maxsize=64)
def sides(model: ObjectModel) -> Array:
    """(k, 3) outward normals in O of the planes that the object can rest on, its centre being lowest there."""
    vertices = np.asarray(model.load_mesh().convex_hull.vertices, dtype=float)
    normals = np.unique(np.round(ConvexHull(vertices).equations[:, :3], 4), axis=0)  # (k, 3)
    across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normals, across)
    turn = np.pi / 4 * np.arange(8)[:, None, None]
    tipped = np.cos(TIPPED) * normals + np.sin(TIPPED) * (np.cos(turn) * across + np.sin(turn) * along)  # (8, k, 3)
    p = vertices - centre(model)
    lowest = (normals @ p.T).max(-1) <= (tipped @ p.T).max(-1).min(0) + LEVEL
    return readonly(normals[lowest])


def stands(model: ObjectModel, X_WO: Array) -> bool:
    """Whether an object at X_WO (4, 4) would stay so by itself, for all that is known of its pose."""
    return bool(np.max(sides(model) @ -X_WO[2, :3], initial=-1.0) > np.cos(STEADY))


def resting(model: ObjectModel, R_WO: Array) -> Array:
    """The rotation (3, 3) nearest to R_WO at which the object rests; R_WO itself where it may already do so.

    What is believed to be tilted a little is left so: in truth it lies flat, and will again.
    """
    normals = sides(model)
    if not len(normals):
        return R_WO
    down_O = -R_WO[2]
    best = normals[np.argmax(normals @ down_O)]
    # The turn that takes that side's normal straight down.
    n_W = R_WO @ best
    axis = np.cross(n_W, [0.0, 0.0, -1.0])
    angle = np.arctan2(np.linalg.norm(axis), -n_W[2])
    if angle < STEADY:
        return R_WO
    axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.asarray(rotation_from_vector(angle * axis) @ R_WO)
