"""What cameras make of a rendered picture: exposure, colour balance, contrast, blur, noise and compression."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]
"""(h, w, 3), RGB in [0, 1]."""


def develop(picture: Picture, rng: np.random.Generator) -> bytes:
    """Exposure, colour balance, contrast, blur, noise and compression of some camera; a JPEG."""
    # A camera measures the light; the middle of the picture, where the things are, counts most.
    h, w = picture.shape[:2]
    middle = picture[h // 4 : -h // 4, w // 4 : -w // 4]
    gain = np.clip(rng.uniform(0.3, 0.6) / max(float(middle.mean()), 1e-3), 0.6, 3.0)
    gain = min(gain, 1.25 / max(float(np.quantile(middle, 0.97)), 1e-3))
    balance = np.exp(rng.normal(0, 0.06, 3))
    color: NDArray[Any] = picture * (gain * balance).astype(np.float32)
    color = np.clip(color, 0, 1) ** np.float32(np.exp(rng.normal(0, 0.12)))
    gray = color.mean(axis=-1, keepdims=True)
    color = gray + np.float32(rng.uniform(0.7, 1.2)) * (color - gray)
    if rng.random() < 0.6:
        color = cv2.GaussianBlur(color, (0, 0), rng.uniform(0.3, 1.2))
    if rng.random() < 0.1:
        color = cv2.filter2D(color, -1, _streak(int(rng.integers(3, 8)), rng.uniform(0, np.pi)))
    noise = rng.standard_normal(color.shape, dtype=np.float32) * np.float32(rng.uniform(0, 0.025))
    return jpeg(color + noise, int(rng.integers(55, 97)))


def _streak(length: int, angle: float) -> NDArray[np.float32]:
    """The kernel of a picture that moved by `length` pixels while it was taken."""
    kernel: NDArray[Any] = np.zeros((9, 9), np.float32)
    along = np.array([np.cos(angle), np.sin(angle)]) * length / 2
    a, b = (tuple(int(i) for i in np.rint(4 + s * along)) for s in (-1, 1))
    cv2.line(kernel, a, b, 1.0)
    return np.asarray(kernel / kernel.sum())


def jpeg(color: NDArray[Any], quality: int) -> bytes:
    """A picture (h, w, 3), RGB in [0, 1], values beyond cut, as a JPEG."""
    bgr = np.rint(255 * np.clip(color[..., ::-1], 0, 1)).astype(np.uint8)
    return bytes(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes())
