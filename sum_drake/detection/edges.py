"""Edges of a picture and of its depth, as one map of magnitude and orientation.

Edge Boxes was published on structured edges, a learned map. Here edges come from gradients of colour in a perceptual
space, of inverse depth and of surface normals. Each is a set of channels in units in which 1 is a clear edge, and what
they say is summed as one structure tensor (Di Zenzo, "A note on the gradient of a multi-image", 1986): its largest
eigenvalue is the edge's strength, and its eigenvector the direction across it.
"""

import dataclasses
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError

Floats = NDArray[np.float32]


@dataclasses.dataclass
class EdgesConfig:
    """How edges are found."""

    scale: float = 0.5
    """Size of the edge map as a share of the picture's; 1 finds most, .5 costs less than half."""
    blur: float = 1.0
    """Standard deviation of the smoothing before derivatives, pixels of the edge map."""
    color_edge: float = 30.0
    """Step of colour that is an edge of strength 1, CIE L*a*b* units."""
    depth_edge: float = 0.02
    """Step of depth that is, as a share of the depth."""
    crease: float = 0.7
    """Turn of the surface that is, radians."""
    focal_length: float = 0.82
    """Of the camera, as a share of the picture's width: what turns slopes into angles. It need not be exact."""

    def __post_init__(self) -> None:
        if not 0 < self.scale <= 1:
            raise InputError(f"edges: scale is {self.scale}, expected a number over 0, at most 1")
        for name in ("blur", "color_edge", "depth_edge", "crease", "focal_length"):
            if not getattr(self, name) > 0:
                raise InputError(f"edges: {name} is {getattr(self, name)}, expected a number > 0")


@dataclasses.dataclass(frozen=True, eq=False)
class Edges:
    """An edge map."""

    magnitude: Floats
    """(h, w): 0 to 1, and 0 wherever a neighbour across the edge has more."""
    orientation: Floats
    """(h, w): direction across the edge, of the gradient, radians in [0, pi), x right and y down."""
    scale: float
    """Pixels of the map for one of the picture."""


def find_edges(color: NDArray[np.uint8], depth: NDArray[np.floating] | None, config: EdgesConfig) -> Edges:
    """The edge map of color (h, w, 3), RGB, and, where there is one, depth (h, w), metres, 0 where it is missing.

    Raises InputError where these are no such arrays.
    """
    check_images(color, depth)
    h, w = color.shape[:2]
    size = (max(round(w * config.scale), 8), max(round(h * config.scale), 8))
    tensor = _tensor(*_color_gradients(color, size, config))
    if depth is not None:
        log_depth = fill_missing(depth)
        if log_depth is not None:
            log_depth = np.log(log_depth)
            log_depth = cv2.resize(cv2.medianBlur(log_depth, 5), size, interpolation=cv2.INTER_AREA)
            tensor += _tensor(*_steps(log_depth, config)) + _tensor(*_creases(log_depth, config))
    # Strength from the place itself, direction from around it: contours are smoother than their pixels.
    strength = _largest_eigenvalue(tensor)
    xx, xy, yy = cv2.GaussianBlur(tensor, (0, 0), 1.5).transpose(2, 0, 1)
    orientation = 0.5 * np.arctan2(2 * xy, xx - yy) % np.float32(np.pi)
    return Edges(_thin(strength / (1 + strength), orientation), orientation, size[0] / w)


def check_images(color: NDArray[np.uint8], depth: NDArray[np.floating] | None) -> None:
    """Raises InputError unless color is (h, w, 3) of bytes, at least 16 x 16, and depth, if any, (h, w) of floats."""
    if color.ndim != 3 or color.shape[2] != 3 or color.dtype != np.uint8 or min(color.shape[:2]) < 16:
        raise InputError(f"picture: {color.dtype} of shape {color.shape}, expected uint8 (h, w, 3) of at least 16 x 16")
    if depth is not None and (depth.shape != color.shape[:2] or not np.issubdtype(depth.dtype, np.floating)):
        raise InputError(
            f"depth: {depth.dtype} of shape {depth.shape}, expected floats {color.shape[:2]} as the picture has"
        )


def fill_missing(depth: NDArray[np.floating]) -> Floats | None:
    """Depth (h, w) without holes: each gets the farther of what bounds it along the row, else along the column.

    Structured light misses what lies in an object's shadow, which is background; taking the farther side leaves the
    step at the object's own contour. None where nothing at all was measured.
    """
    filled = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
    if not filled.any():
        return None
    filled = _fill_rows(filled)
    return filled if filled.all() else np.ascontiguousarray(_fill_rows(np.ascontiguousarray(filled.T)).T)


def _fill_rows(depth: Floats) -> Floats:
    known = depth > 0
    columns = np.arange(depth.shape[1])
    before = np.maximum.accumulate(np.where(known, columns, 0), axis=1)
    after = np.minimum.accumulate(np.where(known, columns, depth.shape[1] - 1)[:, ::-1], axis=1)[:, ::-1]
    return np.maximum(np.take_along_axis(depth, before, 1), np.take_along_axis(depth, after, 1))


def _color_gradients(color: NDArray[np.uint8], size: tuple[int, int], config: EdgesConfig) -> tuple[Floats, Floats]:
    """Gradients along x and y (h, w, 3) of L*a*b*; a step of `color_edge` peaks at 1."""
    small = cv2.resize(color, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    lab = cv2.GaussianBlur(cv2.cvtColor(small, cv2.COLOR_RGB2Lab), (0, 0), config.blur)
    unit = config.color_edge * _peak(config.blur)
    return _difference(lab, 1, 1) / unit, _difference(lab, 0, 1) / unit


def _peak(blur: float) -> float:
    """What x(+1) - x(-1) comes to at a step of 1 after the blur."""
    return math.erf(1 / (math.sqrt(2) * blur))


def _shift(image: Floats, axis: int, by: int) -> Floats:
    """image[i + by] along an axis, the rim repeated."""
    index = np.clip(np.arange(image.shape[axis]) + by, 0, image.shape[axis] - 1)
    return np.take(image, index, axis)


def _difference(image: Floats, axis: int, reach: int) -> Floats:
    return _shift(image, axis, reach) - _shift(image, axis, -reach)


def _steps(log_depth: Floats, config: EdgesConfig) -> tuple[Floats, Floats]:
    """Steps of log depth along x and y (h, w, 1) over the slopes on both sides; `depth_edge` gives 1.

    The slope itself is no edge, however steep the table looks, and neither is a step in the slope.
    """
    smooth = cv2.GaussianBlur(log_depth, (0, 0), config.blur)
    steps = []
    for axis in (1, 0):
        near = [_shift(smooth, axis, by) for by in (-4, -1, 1, 4)]
        step, before, after = near[2] - near[1], (near[1] - near[0]) * (2 / 3), (near[3] - near[2]) * (2 / 3)
        beyond = step - np.clip(step, np.minimum(before, after), np.maximum(before, after))
        steps.append(beyond[..., None] / (config.depth_edge * _peak(config.blur)))
    return steps[0], steps[1]


def _creases(log_depth: Floats, config: EdgesConfig) -> tuple[Floats, Floats]:
    """Turns of the surface normal along x and y (h, w, 3); `crease` gives 1."""
    normals = surface_normals(log_depth, config.focal_length * log_depth.shape[1])
    return _difference(normals, 1, 2) / config.crease, _difference(normals, 0, 2) / config.crease


def surface_normals(log_depth: Floats, focal_length: float) -> Floats:
    """Unit normals (h, w, 3) in the camera's axes, towards the camera, of log depth (h, w); focal length in pixels.

    Slopes are taken from the side on which the surface goes on more smoothly, so they do not reach over a step.
    """
    h, w = log_depth.shape
    smooth = cv2.bilateralFilter(log_depth, 9, 0.01, 3.0)
    slopes = []
    for axis in (1, 0):
        before, after = smooth - _shift(smooth, axis, -3), _shift(smooth, axis, 3) - smooth
        slopes.append(np.where(np.abs(before) < np.abs(after), before, after) / 3)
    v, u = np.mgrid[:h, :w].astype(np.float32)
    # 1 / z of a plane is affine in the pixel: n ~ (f a, f b, c) for 1/z = a u + b v + c, here divided by 1/z.
    x, y = slopes
    n = np.stack([focal_length * x, focal_length * y, -1 - x * (u - (w - 1) / 2) - y * (v - (h - 1) / 2)], -1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True), dtype=np.float32)


def _tensor(g_x: Floats, g_y: Floats) -> Floats:
    """Structure tensor (h, w, 3): xx, xy, yy, summed over channels (h, w, c)."""
    return np.stack([np.sum(g_x * g_x, -1), np.sum(g_x * g_y, -1), np.sum(g_y * g_y, -1)], -1)


def _largest_eigenvalue(tensor: Floats) -> Floats:
    xx, xy, yy = tensor.transpose(2, 0, 1)
    return np.asarray(0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4 * xy * xy)))


def _thin(strength: Floats, orientation: Floats) -> Floats:
    """0 where the strength a pixel further across the edge, interpolated, is larger on either side."""
    h, w = strength.shape
    v, u = np.mgrid[:h, :w].astype(np.float32)
    c, s = np.cos(orientation), np.sin(orientation)
    ahead, behind = (
        cv2.remap(strength, u + sign * c, v + sign * s, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for sign in (1, -1)
    )
    # On a ridge two pixels wide one of both stays.
    return np.where((strength >= ahead) & (strength > behind), strength, 0).astype(np.float32)
