"""Grasps from an object's mesh, wherever it stands; `grasp_ranking` orders them in a scene.

After ten Pas and Platt, "Localizing handle-like grasp affordances in 3D point clouds" (ISER 2014), as Sui et al. 2017
use it: hand frames are set up on Darboux frames (surface normal and principal curvature axes) of sampled surface
points, and kept where the hand fits and both pads find antipodal contact. Here the points come from the object's mesh
rather than from the depth image, because the pose of the mesh is what the robot estimates.

In a hand frame G (x out of the palm, y closing, origin between the pads) a grasp and its half-turn about x touch the
same spots with the fingers exchanged. Only one of the two is listed; they are different arm configurations, so try
`half_turn(X_WG)` as well.
"""

import dataclasses
import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sum_drake.geometry import apply, inverse, transform
from sum_drake.objects import ObjectModel
from sum_drake.robot import HAND
from sum_drake.types import Array, Grasp, Immutable, readonly

Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]


@dataclasses.dataclass
class GraspConfig:
    """How grasps are generated and ranked; SI units."""

    samples: int = 500
    """Pairs of opposite contacts on which hand frames are set up."""
    thin: float = 0.035
    """Where the object is thinner than this, half of the samples are placed: handles and rims are small."""
    spacing: float = 0.003
    """Mean distance of the points that stand for the object's surface when the hand is tested against it."""
    directions: int = 8
    """Approach directions about the closing axis at each sample; a multiple of 4 includes the principal axes."""
    depths: int = 3
    """Depths of the hand along each approach direction, from the deepest that the object leaves room for."""
    candidates: int = 2000
    """At most this many grasps of an object, spread over it."""
    friction: float = 0.5
    """Coefficient assumed at the pads, below the real one (.7) so that contacts are not on the edge of slipping."""
    contact_depth: float = 0.002
    """Surface within this depth of the outermost point counts as touched by a pad."""
    contact_area: float = 4e-4
    """Touched area of a pad, m^2, from which on more does not make a better contact."""
    clearance: float = 0.006
    """Free space between an open finger and the object, on each side."""
    min_clearance: float = 0.004
    """The same where the hand cannot open further."""
    palm_clearance: float = 0.003
    """Free space between the palm and the object."""
    table_clearance: float = 0.005
    """Free space between the hand and the table."""
    neighbour_clearance: float = 0.002
    """Free space between the hand and whatever is not the object."""
    approach: float = 0.1
    """Length of the straight approach along G's x axis that must be free of neighbours."""
    max_tilt: float = 1.5
    """Largest angle between the approach direction and straight down, radians."""
    particles: int = 10
    """Poses drawn from the belief on which a grasp is tried out."""
    tried: int = 80
    """So many of the best grasps are tried out at a time."""
    min_survival: float = 0.1
    """Share of those poses for which a grasp must hold."""
    weight_contact: float = 1.0
    """Weight of the contact quality in the score."""
    weight_above: float = 0.6
    """Weight of approaching from above."""
    weight_room: float = 0.3
    """Weight of room to the neighbours."""
    lift: float = 0.18
    """Length of the straight lift, over which room to the neighbours counts, too."""
    weight_lift: float = 0.4
    """How much less a grasp counts that has no room there, as a share."""
    torque: float = 0.3
    """Moment of the object's weight about the closing axis, N m, at which a grasp of best contact counts half as much;
    one of quality .4 lets the object swing at somewhat more than that."""


@dataclasses.dataclass(frozen=True, eq=False)
class Cloud(Immutable):
    """Evenly spread points on an object's surface; so is every leading part of them."""

    p_OQs: Array
    """(n, 3)."""
    normals_O: Array
    """(n, 3), unit length, outward."""
    area: float
    """Of the whole surface, m^2."""


def half_turn(X_WG: Array) -> Array:
    """The same grasp with the fingers exchanged: G turned by pi about its x axis; (..., 4, 4)."""
    turned: Array = X_WG @ np.diag([1.0, -1.0, -1.0, 1.0])
    return turned


def opening(width: float | Array, config: GraspConfig) -> Array:
    """Distance between the open fingers before a grasp of `width`, metres."""
    return np.minimum(np.asarray(width) + 2 * config.clearance, HAND.gap_max)


def grasp_candidates(model: ObjectModel, *, config: GraspConfig, seed: int) -> tuple[Grasp, ...]:
    """Grasps all over an object, whatever its pose: antipodal, no wider than the hand, free of the object itself.

    A function of its arguments; the last few results are kept in memory.
    """
    return _candidates(model, dataclasses.astuple(config), seed)


@functools.lru_cache(maxsize=64)
def surface(model: ObjectModel, spacing: float) -> Cloud:
    """Quasi-random points on the model's mesh, one for each `spacing` squared, at most 12,000; kept in memory."""
    mesh = model.load_mesh()
    vertices = np.asarray(mesh.vertices, dtype=float)
    faces = np.asarray(mesh.faces)
    corners = vertices[faces]  # (f, 3, 3)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(cross, axis=1)
    flat = cross / np.maximum(2 * areas, 1e-15)[:, None]
    # Vertex normals make a coarse mesh round, but only where it is meant to be: not across sharp edges.
    normals = np.asarray(mesh.vertex_normals, dtype=float)[faces]
    smooth = np.einsum("fck,fk->fc", normals, flat) > np.cos(0.5)
    normals = np.where(smooth[..., None], normals, flat[:, None])

    # Roberts' R3 sequence: spread more evenly than independent draws, and so is each of its beginnings.
    count = int(np.clip(areas.sum() / spacing**2, 1000, 12000))
    root = 1.2207440846057596  # of x^4 = x + 1
    u = (0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, 4.0)) % 1.0
    face = np.searchsorted(np.cumsum(areas), u[:, 0] * areas.sum()).clip(max=len(faces) - 1)
    s = np.sqrt(u[:, 1])
    barycentric = np.stack([1 - s, s * (1 - u[:, 2]), s * u[:, 2]], 1)
    n = np.einsum("nc,nck->nk", barycentric, normals[face])
    return Cloud(
        p_OQs=readonly(np.einsum("nc,nck->nk", barycentric, corners[face])),
        normals_O=readonly(n / np.linalg.norm(n, axis=1, keepdims=True)),
        area=float(areas.sum()),
    )


@functools.lru_cache(maxsize=64)
def _candidates(model: ObjectModel, settings: tuple[Any, ...], seed: int) -> tuple[Grasp, ...]:
    config = GraspConfig(*settings)
    cloud = surface(model, config.spacing)
    count = min(4 * config.samples, len(cloud.p_OQs))
    start = int(np.random.default_rng(seed).integers(len(cloud.p_OQs) - count + 1))
    samples, widths = _opposite_contacts(model, cloud, np.arange(start, start + count), config)
    thin, thick = np.flatnonzero(widths < config.thin), np.flatnonzero(widths >= config.thin)
    half = config.samples // 2
    chosen = np.concatenate(
        [_every(thin, max(half, config.samples - len(thick))), _every(thick, max(half, config.samples - len(thin)))]
    )
    samples, widths = samples[chosen], widths[chosen]
    axes = _principal_directions(cloud, samples)
    found: list[tuple[Array, float, float]] = []
    for sample, axis, width in zip(samples, axes, widths, strict=True):
        found += _grasps_across(cloud, cloud.p_OQs[sample], cloud.normals_O[sample], axis, width, config)
    if not found:
        return ()
    X_OGs, touched, qualities = (np.array(column) for column in zip(*found, strict=True))
    return tuple(
        Grasp(model.label, readonly(X_OGs[i]), float(touched[i]), float(qualities[i]))
        for i in _spread(X_OGs, qualities, config.candidates)
    )


def _every(indices: Indices, count: int) -> Indices:
    """At most `count` of the indices, evenly picked."""
    return indices if len(indices) <= count else indices[np.arange(count) * len(indices) // count]


def _opposite_contacts(
    model: ObjectModel, cloud: Cloud, samples: Indices, config: GraspConfig
) -> tuple[Indices, Array]:
    """Samples and widths (n,) wherever the line into the surface at a sample leaves the object within the hand's reach,
    through a surface that the other pad can press on. A thin wall and what lies behind it give one each.
    """
    cone = np.cos(np.arctan(config.friction))
    reach = HAND.gap_max - 2 * config.min_clearance
    eps = 1e-5
    found: list[tuple[int, float]] = []
    for some in np.array_split(samples, -(-len(samples) // 250)):  # bounds the memory
        ts, cosines = _crossings(model, cloud.p_OQs[some], -cloud.normals_O[some])
        for sample, t, cosine in zip(some, ts, cosines, strict=True):
            # Shells may overlap (a handle's end sunk into a jug): count in how many the line runs. Walking backwards
            # from the sample, entering and leaving are exchanged.
            step = np.where(cosine > 0, -1, 1)
            if step[t < -eps].sum() > 0:
                continue  # the sample lies inside another shell
            hits = np.flatnonzero(t > eps)
            hits = hits[np.argsort(t[hits])]
            free = 1 + np.cumsum(step[hits]) <= 0
            good = hits[free & (t[hits] < reach) & (cosine[hits] > cone)]
            found += [(int(sample), float(width)) for width in t[good]]
    return np.array([sample for sample, _ in found], dtype=np.intp), np.array([width for _, width in found])


def _crossings(model: ObjectModel, p: Array, d: Array) -> tuple[Array, Array]:
    """Where lines p + t d cross the mesh: t (n, f), nan where they miss, and d's cosine with the outward normals.

    A line meets a triangle when it passes all three edges on the same side, which are products of Pluecker
    coordinates: matrix products over all pairs.
    """
    mesh = model.load_mesh()
    corners = np.asarray(mesh.vertices, dtype=float)[np.asarray(mesh.faces)]
    line = np.hstack([d, np.cross(p, d)])  # (n, 6)
    sides = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, b] - corners[:, a]
        sides.append(line @ np.hstack([np.cross(corners[:, a], edge), edge]).T)
    side = np.stack(sides)  # (3, n, f)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-15)[:, None]
    cosine = d @ normals.T
    hit = ((side > 0).all(0) | (side < 0).all(0)) & (np.abs(cosine) > 1e-9)
    offset = np.einsum("fk,fk->f", corners[:, 0], normals) - p @ normals.T
    return np.where(hit, offset / np.where(hit, cosine, 1.0), np.nan), cosine


def _principal_directions(cloud: Cloud, samples: Indices) -> Array:
    """Principal curvature directions at samples: (n, 3), tangent; the other one is their cross product with the normal.

    The shape operator is fitted to the neighbours' normals, dn = S du. Where the surface bends alike in all
    directions there are no such axes: the object's own axis that lies flattest on it stands in, so that boxes are
    grasped squarely.
    """
    p, n = cloud.p_OQs[samples], cloud.normals_O[samples]
    # Any tangent basis; the object's own axis closest to the tangent plane makes it a useful one.
    flattest = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    e1 = flattest - np.einsum("ni,ni->n", flattest, n)[:, None] * n
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    e2 = np.cross(n, e1)
    _, near = cKDTree(cloud.p_OQs).query(p, k=32)
    du = cloud.p_OQs[near] - p[:, None]  # (n, k, 3)
    dn = cloud.normals_O[near] - n[:, None]
    same_side = (np.einsum("nki,ni->nk", cloud.normals_O[near], n) > 0.5).astype(float)
    u, v = np.einsum("nki,ni->nk", du, e1), np.einsum("nki,ni->nk", du, e2)
    a, b = np.einsum("nki,ni->nk", dn, e1), np.einsum("nki,ni->nk", dn, e2)
    # Least squares for S = [[s, m], [m, r]]: rows s u + m v = a and m u + r v = b.
    zero = np.zeros_like(u)
    rows = np.concatenate([np.stack([u, v, zero], -1), np.stack([zero, u, v], -1)], 1)  # (n, 2k, 3)
    weighted = rows * np.concatenate([same_side, same_side], 1)[..., None]
    normal_matrix = np.einsum("nki,nkj->nij", weighted, rows) + 1e-12 * np.eye(3)
    right = np.einsum("nki,nk->ni", weighted, np.concatenate([a, b], 1))
    s, m, r = np.moveaxis(np.linalg.solve(normal_matrix, right[..., None])[..., 0], -1, 0)
    angle = 0.5 * np.arctan2(2 * m, s - r)
    angle = np.where(np.hypot(s - r, 2 * m) > 3.0, angle, 0.0)  # 1/m: less is noise of the fit
    axes: Array = np.cos(angle)[:, None] * e1 + np.sin(angle)[:, None] * e2
    return axes


def _grasps_across(
    cloud: Cloud, p_OQ: Array, normal: Array, axis: Array, width: float, config: GraspConfig
) -> list[tuple[Array, float, float]]:
    """(X_OG, width, quality) of the grasps that close along `normal` on a contact at p_OQ and one `width` behind it."""
    gap = float(opening(width, config))
    centre = p_OQ - 0.5 * width * normal
    angles = 2 * np.pi * np.arange(config.directions) / config.directions
    other = np.cross(normal, axis)
    approach = np.cos(angles)[:, None] * axis + np.sin(angles)[:, None] * other  # (a, 3)
    R_OGs = np.stack([approach, np.broadcast_to(normal, approach.shape), np.cross(approach, normal)], -1)

    # How far the hand can come in each direction before a finger or the palm meets the object. Fingers and palm pass
    # through all that lies behind them, so only the nearest point ahead counts.
    q = cloud.p_OQs - centre
    y = np.abs(q @ normal)
    q, y, p_OQs, normals_O = (column[y < HAND.palm_half[0]] for column in (q, y, cloud.p_OQs, cloud.normals_O))
    x, z = q @ R_OGs[:, :, 0].T, np.abs(q @ R_OGs[:, :, 2].T)  # (m, a)
    beside = (y > gap / 2 - 1e-3) & (y < gap / 2 + HAND.pad_thickness + 1e-3)
    in_finger = beside[:, None] & (z < HAND.pad_half_width + 1e-3)
    in_palm = z < HAND.palm_half[1]
    ahead_of_fingers = np.where(in_finger, x, np.inf).min(0) - 1e-3 - HAND.pad_x[1]
    ahead_of_palm = np.where(in_palm, x, np.inf).min(0) - config.palm_clearance - HAND.palm_x[1]
    margin = 0.004  # the contact lies at least this far from the ends of the pads
    shallow, deep = -HAND.pad_x[1] + margin, -HAND.pad_x[0] - margin
    deepest = np.minimum(np.minimum(ahead_of_fingers, ahead_of_palm), deep)

    which = np.flatnonzero(deepest > shallow)
    if len(which) == 0:
        return []
    share = np.arange(config.depths) / config.depths
    depth = (deepest[which, None] - share * (deepest[which, None] - shallow)).ravel()
    which = np.repeat(which, config.depths)
    X_OGs = transform(R_OGs[which], centre + depth[:, None] * approach[which])

    # The sampled contact itself keeps the pads at least `width` apart: nothing further in is touched.
    local = (
        (y > width / 2 - config.contact_depth) & (y < gap / 2) & (np.linalg.norm(q, axis=1) < np.hypot(0.055, gap / 2))
    )
    X_GOs = inverse(X_OGs)
    p_GQs = apply(X_GOs, p_OQs[local])
    n_Gs = normals_O[local] @ np.swapaxes(X_GOs[:, :3, :3], 1, 2)
    low, high, quality = contacts(p_GQs, n_Gs, np.full(len(X_OGs), gap), cloud.area / len(cloud.p_OQs), config)
    # What the pads meet first may lie off the sampled line: centre the hand on it, unless that uses up the clearance.
    shift = 0.5 * (low + high)
    good = (quality > 0) & (np.abs(shift) < config.min_clearance / 2) & (high - low < width + config.min_clearance)
    X_OGs[:, :3, 3] += np.where(good, shift, 0.0)[:, None] * normal
    return [(X_OGs[i], float(high[i] - low[i]), float(quality[i])) for i in np.flatnonzero(good)]


def contacts(
    p_GQs: Array, n_Gs: Array, gaps: Array, point_area: float, config: GraspConfig
) -> tuple[Array, Array, Array]:
    """What closing fingers would touch: y of the touched points and contact quality in [0, 1], 0 if it would not hold.

    A pad presses on the points within `contact_depth` of the outermost one, the more the further out they lie, as in
    hydroelastic contact. Both resultant forces must lie in the friction cone, and so must the line between their
    points of attack (antipodal contact).

    Args:
        p_GQs, n_Gs: (b, m, 3) surface points and normals in each hand's frame.
        gaps: (b,) distances between the open fingers.

    Returns:
        lowest y, highest y, quality: (b,) each.
    """
    x, y, z = np.moveaxis(p_GQs, -1, 0)
    between = (x > HAND.pad_x[0]) & (x < HAND.pad_x[1]) & (np.abs(z) < HAND.pad_half_width)
    between &= np.abs(y) < gaps[:, None] / 2
    high = np.where(between, y, -np.inf).max(1)
    low = np.where(between, y, np.inf).min(1)
    touched = high > low
    high, low = np.where(touched, high, 0.0), np.where(touched, low, 0.0)

    cone = np.cos(np.arctan(config.friction))
    quality = touched.astype(float)
    attack = []
    for sign, outermost in ((1.0, high), (-1.0, -low)):
        depth = outermost[:, None] - sign * y
        pressed = between & (sign * n_Gs[..., 1] > 0) & (depth < config.contact_depth)
        pressure = np.where(pressed, config.contact_depth - depth, 0.0)  # (b, m)
        total = np.maximum(pressure.sum(1), 1e-12)
        force = np.einsum("bm,bmk->bk", pressure, n_Gs)
        alignment = sign * force[:, 1] / np.maximum(np.linalg.norm(force, axis=1), 1e-12)
        flatness = sign * force[:, 1] / total  # mean cosine: 1 on a face, less on an edge or a corner
        area = np.minimum(pressed.sum(1) * point_area / config.contact_area, 1.0)
        quality *= (alignment > cone) * np.sqrt(area) * flatness**2
        attack.append(np.einsum("bm,bmk->bk", pressure, p_GQs) / total[:, None])
    line = attack[0] - attack[1]
    # On a thin wall the centres of two patches are a few points' spacing apart for no mechanical reason.
    antipodal = np.hypot(line[:, 0], line[:, 2]) < config.friction * np.abs(line[:, 1]) + 0.004
    return low, high, np.where(antipodal, quality, 0.0)


def _spread(X_OGs: Array, qualities: Array, count: int) -> list[int]:
    """Indices of at most `count` grasps that cover all of them, best first: the best of each cell of a grid."""
    closing = X_OGs[:, :3, 1]
    # The half-turn is the same grasp: give the closing axis a sign of its own.
    largest = np.take_along_axis(closing, np.abs(closing).argmax(1)[:, None], 1)
    features = np.hstack([X_OGs[:, :3, 3] / 0.006, X_OGs[:, :3, 0] / 0.25, closing * np.sign(largest) / 0.25])
    best_first = np.argsort(-qualities, kind="stable")
    _, first = np.unique(np.round(features[best_first]), axis=0, return_index=True)
    # The cells come sorted by position, so that every so-manieth of them still covers the object.
    kept = best_first[first[:: -(-len(first) // count)]]
    return [int(i) for i in kept[np.argsort(-qualities[kept], kind="stable")]]
