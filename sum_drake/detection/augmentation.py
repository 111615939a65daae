"""A training picture made anew each time it is seen: cut out, scaled, mirrored, in other light."""

import dataclasses

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Array

CROP = 448
"""Sides of the pictures the network is trained on, pixels: two thirds of a whole one's cost."""
LEAST_LEFT = 0.4
"""An object of whose box less than this share is left in a cut-out is no example of anything."""


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """One training picture."""

    color: NDArray[np.uint8]
    """(CROP, CROP, 3) RGB."""
    boxes: Array
    """(n, 4) of the objects to be found."""
    classes: NDArray[np.int64]
    """(n,)."""
    ignored: Array
    """(m, 4) of those that are hardly visible."""


def augment(
    color: NDArray[np.uint8],
    boxes: Array,
    classes: NDArray[np.int64],
    scored: NDArray[np.bool_],
    rng: np.random.Generator,
) -> Example:
    """A cut-out of a picture (h, w, 3) with objects at boxes (n, 4); those not `scored` are hardly visible."""
    height, width = color.shape[:2]
    scale = np.exp(rng.uniform(np.log(0.75), np.log(1.4)))
    mirrored = rng.random() < 0.5
    # Mostly the cut-out is laid about one of the objects, wherever it falls in it.
    room = np.array([width, height]) * scale - CROP
    corner = rng.uniform(0, 1, 2) * room
    if len(boxes) and rng.random() < 0.7:
        x, y, w, h = boxes[rng.integers(len(boxes))] * scale
        corner = np.array([x, y]) + rng.uniform(0, 1, 2) * np.array([w, h]) - rng.uniform(0.15, 0.85, 2) * CROP
        corner = np.clip(corner, np.minimum(room, 0), np.maximum(room, 0))
    sign = -1.0 if mirrored else 1.0
    # Pixel i covers i to i + 1; warpAffine speaks of pixel centres.
    A = np.array([[sign * scale, 0.0], [0.0, scale]])
    b = np.array([CROP + corner[0] if mirrored else -corner[0], -corner[1]])
    warp = np.column_stack([A, A @ [0.5, 0.5] + b - 0.5])
    fill = color.reshape(-1, 3).mean(0).tolist()
    picture = cv2.warpAffine(color, warp, (CROP, CROP), flags=cv2.INTER_LINEAR, borderValue=fill)
    low = boxes[:, :2] @ A + b
    high = (boxes[:, :2] + boxes[:, 2:]) @ A + b
    low, high = np.minimum(low, high), np.maximum(low, high)
    area = (high - low).prod(1)
    low, high = np.clip(low, 0, CROP), np.clip(high, 0, CROP)
    left = (high - low).prod(1)
    seen = left > 0
    told = seen & scored & (left >= LEAST_LEFT * area) & ((high - low).min(1, initial=CROP) >= 8)
    moved = np.concatenate([low, high - low], 1)
    return Example(_relight(np.asarray(picture, dtype=np.uint8), rng), moved[told], classes[told], moved[seen & ~told])


def _relight(picture: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Other exposure, white balance and contrast, now and then little colour or a blur."""
    values = np.arange(256) / 255.0
    gains = np.exp(rng.normal(0, 0.18) + rng.normal(0, 0.06, 3))
    gamma, offset = np.exp(rng.normal(0, 0.15)), rng.normal(0, 0.03)
    table = np.clip(gains[None] * values[:, None] ** gamma + offset, 0, 1) * 255
    lit = np.stack([cv2.LUT(picture[..., c], table[:, c].round().astype(np.uint8)) for c in range(3)], -1)
    if rng.random() < 0.15:
        grey = cv2.cvtColor(lit, cv2.COLOR_RGB2GRAY)[..., None]
        share = rng.uniform(0.3, 0.9)
        lit = (share * grey + (1 - share) * lit).astype(np.uint8)
    if rng.random() < 0.15:
        lit = cv2.GaussianBlur(lit, (0, 0), rng.uniform(0.5, 1.3))
    return np.asarray(lit, dtype=np.uint8)
