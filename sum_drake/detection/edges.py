"""Edges of a picture and of its depth, as one map of magnitude and orientation.

Edge Boxes was published on structured edges, a learned map. Here three cues take their place: gradients of colour in a
perceptual space, steps of depth, and creases of the surface. Each is the structure tensor of its channels (Di Zenzo, "A
note on the gradient of a multi-image", 1986), whose largest eigenvalue is the edge's strength and whose eigenvector is
the direction across it. Strengths saturate before they are mixed with fixed weights, so a loud print on a box adds no
more than its colour's share, and a contour that all three see stands out.
"""

import dataclasses
import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError

Floats = NDArray[np.float32]
Gradients = tuple[Floats, Floats]
"""Of an image's channels (h, w, c) along x and y."""


@dataclasses.dataclass
class EdgesConfig:
    """How edges are found."""

    scale: float = 0.75
    """Size of the edge map as a share of the picture's; 1 finds most, .5 costs half as much."""
    blur: float = 2.0
    """Standard deviation of the smoothing before derivatives, pixels of the picture."""
    color_edge: float = 30.0
    """Step of colour at which its cue is half of its most, CIE L*a*b* units."""
    depth_edge: float = 0.016
    """Step of depth at which that is so, as a share of the depth."""
    crease: float = 0.7
    """Turn of the surface at which that is so, radians."""
    color_weight: float = 0.3
    """Share of colour in the magnitude, where there is depth."""
    crease_weight: float = 0.1
    """Share of creases; steps of depth have the rest."""
    focal_length: float = 0.82
    """Of the camera, as a share of the picture's width: what turns slopes into angles. It need not be exact."""

    def __post_init__(self) -> None:
        if not 0 < self.scale <= 1:
            raise InputError(f"edges: scale is {self.scale}, expected a number over 0, at most 1")
        for name in ("blur", "color_edge", "depth_edge", "crease", "focal_length"):
            if not getattr(self, name) > 0:
                raise InputError(f"edges: {name} is {getattr(self, name)}, expected a number > 0")
        if not (min(self.color_weight, self.crease_weight) >= 0 and self.color_weight + self.crease_weight <= 1):
            raise InputError(
                f"edges: color_weight {self.color_weight} and crease_weight {self.crease_weight}, expected shares of 1"
            )


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
    cues = [(1.0, _tensor(*_color_gradients(color, size, config)))]
    filled = None if depth is None else fill_missing(depth)
    if filled is not None:
        steps, creases = _depth_gradients(smaller_log_depth(filled, size), config)
        step_weight = 1 - config.color_weight - config.crease_weight
        cues = [
            (config.color_weight, cues[0][1]),
            (step_weight, _tensor(*steps)),
            (config.crease_weight, _tensor(*creases)),
        ]
    strength, tensor = np.zeros(size[::-1], np.float32), np.zeros((*size[::-1], 3), np.float32)
    for weight, cue in cues:
        largest = _largest_eigenvalue(cue)
        strength += weight * largest / (1 + largest)
        tensor += weight * cue / (1 + largest)[..., None]
    # Strength comes from the place itself, direction from around it: contours are smoother than their pixels.
    xx, xy, yy = cv2.GaussianBlur(tensor, (0, 0), 1.0).transpose(2, 0, 1)
    orientation = 0.5 * np.arctan2(2 * xy, xx - yy) % np.float32(np.pi)
    return Edges(_thin(strength, orientation), orientation, size[0] / w)


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


def smaller_log_depth(depth: Floats, size: tuple[int, int]) -> Floats:
    """Log of depth (h, w) without holes, at size (width, height), without the single pixels that fray contours."""
    median = cv2.medianBlur(np.log(depth), 3)
    return np.asarray(cv2.resize(median, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _fill_rows(depth: Floats) -> Floats:
    known = depth > 0
    columns = np.arange(depth.shape[1])
    before = np.maximum.accumulate(np.where(known, columns, 0), axis=1)
    after = np.minimum.accumulate(np.where(known, columns, depth.shape[1] - 1)[:, ::-1], axis=1)[:, ::-1]
    return np.maximum(np.take_along_axis(depth, before, 1), np.take_along_axis(depth, after, 1))


def _color_gradients(color: NDArray[np.uint8], size: tuple[int, int], config: EdgesConfig) -> Gradients:
    """Gradients along x and y (h, w, 3) of L*a*b*; a step of `color_edge` peaks at 1."""
    blur = config.blur * config.scale
    small = cv2.resize(color, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    lab = np.asarray(cv2.GaussianBlur(cv2.cvtColor(small, cv2.COLOR_RGB2Lab), (0, 0), blur), dtype=np.float32)
    unit = config.color_edge * (_below(1, blur) - _below(-1, blur))
    return _difference(lab, 1, 1) / unit, _difference(lab, 0, 1) / unit


def _below(x: float, sigma: float) -> float:
    """The normal distribution's share below x: a blurred step of 1 at 0, seen at x."""
    return 0.5 * (1 + math.erf(x / (math.sqrt(2) * sigma)))


def _shift(image: Floats, axis: int, by: int) -> Floats:
    """image[i + by] along an axis, the rim repeated."""
    index = np.clip(np.arange(image.shape[axis]) + by, 0, image.shape[axis] - 1)
    return np.take(image, index, axis)


def _difference(image: Floats, axis: int, reach: int) -> Floats:
    return _shift(image, axis, reach) - _shift(image, axis, -reach)


def _depth_gradients(log_depth: Floats, config: EdgesConfig) -> tuple[Gradients, Gradients]:
    """Steps (h, w, 1) and turns of the normal (h, w, 3) along x and y; a step of `depth_edge`, a turn of `crease` is 1.

    How far they reach is set in pixels of the picture, as the frayed contours of a depth image are.
    """
    reach = max(round(2 * config.scale), 1)
    x, y = depth_steps(log_depth, config.blur * config.scale, reach)
    normals = surface_normals(log_depth, config.focal_length * log_depth.shape[1], 3 * reach)
    # A fold turns the estimates over a width; smoothed, it has its peak in the middle.
    normals = np.asarray(cv2.GaussianBlur(normals, (0, 0), reach), dtype=np.float32)
    return (
        (x[..., None] / config.depth_edge, y[..., None] / config.depth_edge),
        (_difference(normals, 1, 2 * reach) / config.crease, _difference(normals, 0, 2 * reach) / config.crease),
    )


def depth_steps(log_depth: Floats, blur: float, reach: int = 1) -> tuple[Floats, Floats]:
    """Steps of log depth (h, w) along x and y, signed, as shares of the depth, over what the slopes beside account for.

    A slope is no step, however steep, and neither is a fold. blur: standard deviation of the smoothing before, pixels;
    reach: how far to either side the step is taken. The slopes are those of the next three times as many pixels.
    """
    smooth = np.asarray(cv2.GaussianBlur(log_depth, (0, 0), blur), dtype=np.float32)

    def beyond(far_before: Any, before: Any, after: Any, far_after: Any) -> Any:
        slopes = (before - far_before) * (2 / 3), (far_after - after) * (2 / 3)
        step = after - before
        return step - np.clip(step, np.minimum(*slopes), np.maximum(*slopes))

    reaches = (-4 * reach, -reach, reach, 4 * reach)
    unit = beyond(*(_below(by + 0.5, blur) for by in reaches))  # of a step of 1, half a pixel away
    x, y = (beyond(*(_shift(smooth, axis, by) for by in reaches)) / np.float32(unit) for axis in (1, 0))
    return x, y


def concave_folds(log_depth: Floats, focal_length: float) -> Floats:
    """How sharply the surface folds towards the camera (h, w), about radians; 0 where it is flat or folds away.

    Two bodies that touch meet in such a fold. Steps of depth give large values beside them, too.
    """
    smooth = _smooth_surface(log_depth)
    turns = [2 * smooth - _shift(smooth, axis, -3) - _shift(smooth, axis, 3) for axis in (1, 0)]
    return np.asarray(np.maximum(np.maximum(*turns) * np.float32(focal_length / 3), 0))


def surface_normals(log_depth: Floats, focal_length: float, reach: int = 3) -> Floats:
    """Unit normals (h, w, 3) in the camera's axes, towards the camera, of log depth (h, w); focal length in pixels.

    Slopes are taken over `reach` pixels, from the side on which the surface goes on straighter, so not over a step and
    not over a fold.
    """
    h, w = log_depth.shape
    smooth = _smooth_surface(log_depth)
    slopes = []
    for axis in (1, 0):
        before, after = (_shift(smooth, axis, by) for by in (-reach, reach))
        bend_before = np.abs(smooth - 2 * before + _shift(smooth, axis, -2 * reach))
        bend_after = np.abs(smooth - 2 * after + _shift(smooth, axis, 2 * reach))
        slopes.append(np.where(bend_before < bend_after, smooth - before, after - smooth) / reach)
    v, u = np.mgrid[:h, :w].astype(np.float32)
    # 1 / z of a plane is affine in the pixel: n ~ (f a, f b, c) for 1/z = a u + b v + c, here divided by 1/z.
    x, y = slopes
    n = np.stack([focal_length * x, focal_length * y, -1 - x * (u - (w - 1) / 2) - y * (v - (h - 1) / 2)], -1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True), dtype=np.float32)


def _smooth_surface(log_depth: Floats) -> Floats:
    """Without the sensor's noise and steps, which are under 1 % of the depth, and with the scene's."""
    return np.asarray(cv2.bilateralFilter(log_depth, 9, 0.01, 3.0), dtype=np.float32)


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
