"""Motions that nearly map an object onto itself: what depth can hardly tell apart.

A box of almost square section, turned by a quarter; a mug, turned about its axis with the handle out of sight; a
bottle, stood on its head or slid along itself. Found once per mesh, they are the alternatives that an estimate is to be
weighed against.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sum_drake.geometry import apply, rotation_angle, rotation_from_vector, transform
from sum_drake.rendering import sample_mesh
from sum_drake.types import Array

STEP = 30.0
"""Turns about an axis are tried in steps of so many degrees: between them registration finds its way."""
SLIDES = (-0.04, -0.02, 0.02, 0.04)
"""Metres along the longest axis."""
NEAR = 0.008
"""Metres from the surface within which a moved surface point is hard to tell from it."""
LEAST_OVERLAP = 0.5
"""Share of such points from which a motion is an alternative."""


def near_symmetries(
    vertices: Array, faces: NDArray[np.int64], p_OM: Array, *, limit: int = 48, seed: int = 0
) -> tuple[Array, Array]:
    """Motions X_MN (k, 4, 4) of an object about its middle M that nearly map it onto itself, and their overlaps (k,).

    What overlaps most comes first, at most `limit`; the identity is not among them.

    Args:
        vertices, faces: (v, 3), (f, 3), in O.
        p_OM: (3,): the middle.
    """
    from scipy.spatial import cKDTree

    surface, _ = sample_mesh(vertices - p_OM, faces, 4000, np.random.default_rng(seed))  # in random order
    few, tree = surface[:80], cKDTree(surface)
    _, principal = np.linalg.eigh(np.cov(surface.T))
    principal[:, 0] *= np.sign(np.linalg.det(principal))
    slides = transform(np.eye(3), np.array(SLIDES)[:, None] * principal[:, 2])
    turns = transform(np.concatenate([_turns(np.eye(3)), _turns(principal)]), np.zeros(3))
    tried = np.concatenate([_registered(turns, few, surface, tree), slides])
    overlaps = np.mean(tree.query(apply(tried, few), distance_upper_bound=NEAR)[0] < NEAR, axis=1)
    kept = [np.eye(4)]
    found: list[float] = []
    for i in np.argsort(-overlaps, kind="stable"):
        if overlaps[i] < LEAST_OVERLAP or len(found) == limit:
            break
        others = np.stack(kept)
        turned = np.degrees(rotation_angle(np.swapaxes(tried[i][:3, :3], -1, -2) @ others[:, :3, :3]))
        shifted = np.linalg.norm(tried[i][:3, 3] - others[:, :3, 3], axis=-1)
        if np.all((turned > 0.6 * STEP) | (shifted > 0.6 * abs(SLIDES[1]))):
            kept.append(tried[i])
            found.append(overlaps[i])
    return np.stack(kept)[1:], np.array(found)


def _turns(E: Array) -> Array:
    """Rotations (72, 3, 3) about the axes that are the columns of E (3, 3), either end up."""
    angles = np.radians(np.arange(0, 360, STEP))
    spins = rotation_from_vector(angles[None, :, None] * E.T[:, None])
    over = rotation_from_vector(np.pi * np.roll(E.T, -1, axis=0))
    return np.concatenate([spins, spins @ over[:, None]], axis=1).reshape(-1, 3, 3)


def _registered(Xs: Array, few: Array, surface: Array, tree: Any) -> Array:
    """The motions (m, 4, 4) after a few steps of closest points (Besl and McKay, 1992)."""
    for _ in range(4):
        moved = apply(Xs, few)
        distance, index = tree.query(moved)
        weight = (distance <= np.quantile(distance, 0.85, axis=1, keepdims=True))[..., None].astype(float)
        weight /= weight.sum(axis=1, keepdims=True)
        target = surface[index]
        a, b = (weight * moved).sum(1, keepdims=True), (weight * target).sum(1, keepdims=True)
        u, _, vt = np.linalg.svd(np.swapaxes(weight * (target - b), 1, 2) @ (moved - a))
        proper = np.ones((len(Xs), 3))
        proper[:, 2] = np.linalg.det(u @ vt)
        R = u * proper[:, None] @ vt
        Xs = transform(R, (b - a @ np.swapaxes(R, 1, 2))[:, 0]) @ Xs
    return Xs
