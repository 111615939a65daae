"""Rigid motions as (4, 4) arrays, symmetry groups, pose errors and boxes."""

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sum_drake.types import Array, Box, readonly


def transform(R: Array, p: Array) -> Array:
    """X from rotations (..., 3, 3) and positions (..., 3); broadcasts. Returns (..., 4, 4)."""
    shape = np.broadcast_shapes(np.shape(R)[:-2], np.shape(p)[:-1])
    X = np.zeros((*shape, 4, 4))
    X[..., :3, :3] = R
    X[..., :3, 3] = p
    X[..., 3, 3] = 1.0
    return X


def inverse(X_AB: Array) -> Array:
    """X_BA of rigid motions (..., 4, 4)."""
    R_BA = np.swapaxes(X_AB[..., :3, :3], -1, -2)
    return transform(R_BA, -np.einsum("...ij,...j->...i", R_BA, X_AB[..., :3, 3]))


def apply(X_AB: Array, p_BQ: Array) -> Array:
    """p_AQ of points (..., n, 3) under motions (..., 4, 4)."""
    points: Array = p_BQ @ np.swapaxes(X_AB[..., :3, :3], -1, -2) + X_AB[..., None, :3, 3]
    return points


def rotation_from_vector(w: Array) -> Array:
    """exp of rotation vectors (..., 3), radians: Rodrigues' formula. Returns (..., 3, 3)."""
    w = np.asarray(w, dtype=float)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    K = np.zeros((*w.shape[:-1], 3, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    K[..., 1, 0], K[..., 2, 0], K[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    # sin(a)/a and (1 - cos a)/a^2 through sinc, which is exact at 0.
    R: Array = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (K @ K)
    return R


def rotation_from_quaternion(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) ordered w, x, y, z; normalised here."""
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


def super_fibonacci(n: int, rng: np.random.Generator) -> Array:
    """n unit quaternions (n, 4) spread evenly over all rotations, from a random start (Alexa, CVPR 2022)."""
    phi, psi = np.sqrt(2.0), 1.533751168755204288118041
    s = np.arange(n) + 0.5
    r, R = np.sqrt(s / n), np.sqrt(1 - s / n)
    a, b = 2 * np.pi * s / phi, 2 * np.pi * s / psi
    spiral = np.stack([r * np.sin(a), r * np.cos(a), R * np.sin(b), R * np.cos(b)], -1)
    # One random rotation for all: the product of unit quaternions is an isometry.
    w, x, y, z = rng.normal(size=4)
    q = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    turned: Array = spiral @ (q / np.linalg.norm(q[0])).T
    return turned


def rotation_angle(R: Array) -> Array:
    """Angle in [0, pi] of rotations (..., 3, 3); accurate near 0 and near pi."""
    trace = np.trace(R, axis1=-2, axis2=-1)
    skew = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1)
    return np.asarray(np.arctan2(np.linalg.norm(skew, axis=-1), trace - 1.0))


@dataclasses.dataclass(frozen=True, eq=False)
class Symmetry:
    """A subgroup of SO(3) about the object's origin: finitely many rotations, times all turns about one axis."""

    name: str
    rotations: Array
    """(k, 3, 3), the identity first."""
    axis: Array | None = None
    """(3,) unit vector of a continuous symmetry."""


def _turns(axis: int, count: int) -> list[Array]:
    return [rotation_from_vector(np.eye(3)[axis] * 2 * np.pi * i / count) for i in range(count)]


def symmetry_group(name: str) -> Symmetry:
    """The group of a name that a catalogue may use. Raises KeyError for an unknown one.

    none; twofold_x, twofold_y, twofold_z: a half-turn about that axis; fourfold_z: quarter turns; box: three
    half-turns; square: a box with square cross-section across z; revolution: all turns about z; cylinder: the same
    and end for end.
    """
    half_x = rotation_from_vector(np.array([np.pi, 0, 0]))
    z = np.array([0.0, 0.0, 1.0])
    groups: dict[str, tuple[list[Array], Array | None]] = {
        "none": ([np.eye(3)], None),
        "twofold_x": (_turns(0, 2), None),
        "twofold_y": (_turns(1, 2), None),
        "twofold_z": (_turns(2, 2), None),
        "fourfold_z": (_turns(2, 4), None),
        "box": ([A @ B for A in (np.eye(3), half_x) for B in _turns(2, 2)], None),
        "square": ([A @ B for A in (np.eye(3), half_x) for B in _turns(2, 4)], None),
        "revolution": ([np.eye(3)], z),
        "cylinder": ([np.eye(3), half_x], z),
    }
    rotations, axis = groups[name]
    return Symmetry(name, readonly(np.stack(rotations)), None if axis is None else readonly(axis))


SYMMETRIES = (
    "none", "twofold_x", "twofold_y", "twofold_z", "fourfold_z", "box", "square", "revolution", "cylinder",
)  # fmt: skip


def rotation_error(R_WA: Array, R_WB: Array, symmetry: Symmetry) -> Array:
    """Smallest angle between two orientations over the symmetry group, radians; broadcasts over (..., 3, 3)."""
    R_AB = np.swapaxes(R_WA, -1, -2) @ R_WB
    candidates = np.swapaxes(symmetry.rotations, -1, -2) @ R_AB[..., None, :, :]  # (..., k, 3, 3)
    if symmetry.axis is None:
        return np.asarray(rotation_angle(candidates).min(-1))
    # The best turn about the axis leaves the angle between the axis and its image.
    image = candidates @ symmetry.axis
    cross = np.linalg.norm(np.cross(symmetry.axis, image), axis=-1)
    return np.asarray(np.arctan2(cross, image @ symmetry.axis).min(-1))


def pose_error(X_WA: Array, X_WB: Array, symmetry: Symmetry) -> tuple[Array, Array]:
    """Translation error in metres and rotation error in radians (symmetry-aware) of poses (..., 4, 4)."""
    translation = np.linalg.norm(X_WA[..., :3, 3] - X_WB[..., :3, 3], axis=-1)
    return np.asarray(translation), rotation_error(X_WA[..., :3, :3], X_WB[..., :3, :3], symmetry)


def mask_box(mask: NDArray[np.bool_]) -> Box:
    """The tightest box of the pixels (h, w) that are set. Raises ValueError where none is."""
    rows, columns = np.nonzero(mask)
    return float(columns.min()), float(rows.min()), float(np.ptp(columns) + 1), float(np.ptp(rows) + 1)


def iou(a: ArrayLike, b: ArrayLike) -> Array:
    """Intersection over union of boxes (n, 4) with boxes (m, 4), each x, y, w, h: (n, m); 0 where both are empty."""
    a = np.asarray(a, dtype=np.float64).reshape(-1, 1, 4)
    b = np.asarray(b, dtype=np.float64).reshape(1, -1, 4)
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    intersection = np.prod(np.maximum(high - low, 0.0), axis=-1)
    union = np.prod(a[..., 2:], axis=-1) + np.prod(b[..., 2:], axis=-1) - intersection
    return np.asarray(np.divide(intersection, union, out=np.zeros_like(union), where=union > 0))


def shifted(X_WA: Array, p_W: Array) -> Array:
    """X_WA (4, 4), moved by p_W (3,), metres."""
    X = X_WA.copy()
    X[:3, 3] += p_W
    return X
