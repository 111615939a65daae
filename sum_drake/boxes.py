"""Boxes and the pixels of a picture that they hold."""

import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Box, Camera, Frame


def pixels_in(box: Box, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the pixels whose centres, whole numbers, lie in [x, x + w) x [y, y + h)."""
    x, y, w, h = box
    top, bottom = (int(np.clip(np.ceil(v), 0, camera.height)) for v in (y, y + h))
    left, right = (int(np.clip(np.ceil(u), 0, camera.width)) for u in (x, x + w))
    return slice(top, bottom), slice(left, right)


def pixels_around(box: Box, camera: Camera, margin: float) -> tuple[slice, slice]:
    """Rows and columns of the pixels in a box and up to `margin` times its size beyond its sides."""
    x, y, w, h = box
    left, top = max(0, int(np.floor(x - margin * w))), max(0, int(np.floor(y - margin * h)))
    right = min(camera.width, int(np.ceil(x + (1 + margin) * w)))
    bottom = min(camera.height, int(np.ceil(y + (1 + margin) * h)))
    return slice(top, max(bottom, top)), slice(left, max(right, left))


def measured(frame: Frame, box: Box) -> NDArray[np.float32]:
    """Depths (n,) that were measured in a box, metres."""
    depth = frame.depth[pixels_in(box, frame.camera)]
    return depth[np.isfinite(depth) & (depth > 0)]


def distance(frame: Frame, box: Box) -> float:
    """Lower quartile of the depth in a box, metres, since what is looked for has its background behind it; nan where
    nothing was measured."""
    seen = measured(frame, box)
    return float(np.quantile(seen, 0.25)) if len(seen) else float("nan")
