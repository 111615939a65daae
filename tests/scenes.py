"""Rendered observations for tests: catalogue objects on a table, seen from above."""

from collections.abc import Mapping

import numpy as np

from sum_drake.geometry import inverse
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Array, Box, Camera, Frame, readonly

CAMERA = Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
TABLE = 0.70


def looking_down(p_WC: Array, p_WT: Array) -> Array:
    """X_WC (4, 4) of a camera at p_WC that looks at p_WT with the world's up towards the top of the picture."""
    z = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    X_WC[:3, 3] = p_WC
    return X_WC


X_WC = looking_down(np.array([0.1, 0.0, 1.3]), np.array([0.6, 0.0, TABLE]))


def standing(catalogue: Catalogue, label: str, x: float, y: float, yaw: float = 0.0) -> Array:
    """X_WO (4, 4) of an object standing on the table."""
    c, s = np.cos(yaw), np.sin(yaw)
    X_WO = np.eye(4)
    X_WO[:2, :2] = [[c, -s], [s, c]]
    X_WO[:3, 3] = x, y, TABLE - catalogue[label].load_mesh().bounds[0, 2]
    return X_WO


def observe(
    catalogue: Catalogue, X_WOs: Mapping[str, Array], observation: int = 0, noise: float = 0.001
) -> tuple[Frame, dict[str, Box]]:
    """A frame of the objects on the table, and the box of each one's visible part."""
    renderer = DepthRenderer(catalogue)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays_C = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], -1)
    down = rays_C @ X_WC[2, :3]
    table = np.where(down < 0, (TABLE - X_WC[2, 3]) / np.minimum(down, -1e-9), np.inf)
    depths = {label: renderer.depth(label, inverse(X_WC) @ X_WO, CAMERA) for label, X_WO in X_WOs.items()}
    filled = {label: np.where(depth > 0, depth, np.inf) for label, depth in depths.items()}
    nearest = np.minimum.reduce([table, *filled.values()])
    boxes: dict[str, Box] = {}
    for label, depth in filled.items():
        rows, columns = np.nonzero(depth <= nearest)
        if len(rows):
            boxes[label] = (
                float(columns.min()), float(rows.min()), float(np.ptp(columns) + 1), float(np.ptp(rows) + 1),
            )  # fmt: skip
    shaken = nearest + np.random.default_rng(observation).normal(0, noise, nearest.shape)
    depth = np.where(nearest < 3.0, shaken, 0.0)
    color = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    frame = Frame(observation, readonly(color, np.uint8), readonly(depth, np.float32), CAMERA, readonly(X_WC))
    return frame, boxes
