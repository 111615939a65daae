"""Region proposals from depth alone: what stands out from the planes it lies on, cut where the surface steps or folds.

A plane is affine in pixel and inverse depth, so planes are found without the camera's intrinsics. What is left of the
picture falls apart into segments at steps of depth and at concave folds, which is where one body touches another. How
strong a step must be is not known, so several answers are given: segments that persist count more.
"""

import dataclasses

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError
from sum_drake.detection.edge_boxes import EdgeBoxes
from sum_drake.detection.edges import (
    EdgesConfig,
    check_images,
    concave_folds,
    depth_steps,
    fill_missing,
    smaller_log_depth,
)
from sum_drake.detection.proposals import Proposals, make_proposals, nms
from sum_drake.geometry import iou
from sum_drake.types import Array, Immutable

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]


GAPS = (3, 5)
"""Pixels between neighbours: about the widths of a cut."""
NEIGHBOURS = 3
"""Pixels of one segment that must have the other at such a gap."""


@dataclasses.dataclass
class DepthSegmentsConfig:
    """How segments are found."""

    scale: float = 0.5
    """Size of the map that is segmented as a share of the picture's."""
    planes: int = 3
    """The most planes taken away."""
    plane_share: float = 0.15
    """Share of the picture that a plane must fill to be taken for a support or a wall."""
    plane_tolerance: float = 0.008
    """What lies this near a plane belongs to it, as a share of the depth."""
    steps: tuple[float, ...] = (0.1, 0.05, 0.025)
    """Steps of depth at which segments are cut, as shares of the depth: one set of segments for each."""
    folds: tuple[float, ...] = (1.2, 0.6)
    """Concave turns of the surface, radians, at which the last set is cut further."""
    min_pixels: int = 150
    """Smaller segments are left out, pixels of the picture."""
    same: float = 0.85
    """IoU over which two boxes count as one."""

    def __post_init__(self) -> None:
        if not 0 < self.scale <= 1:
            raise InputError(f"depth segments: scale is {self.scale}, expected a number over 0, at most 1")
        if not self.steps or min(*self.steps, *self.folds, self.plane_tolerance) <= 0:
            raise InputError("depth segments: steps, folds and plane_tolerance are numbers > 0, at least one step")


@dataclasses.dataclass(frozen=True)
class DepthSegments(Immutable):
    """The proposer."""

    config: DepthSegmentsConfig = dataclasses.field(default_factory=DepthSegmentsConfig)

    def __call__(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> Proposals:
        """Boxes of depth (h, w), metres, 0 where it is missing. Raises InputError without one."""
        check_images(color, depth)
        if depth is None:
            raise InputError("depth segments: the picture has no depth, expected one, or another proposer: edge_boxes")
        return depth_segments(depth, self.config)


@dataclasses.dataclass(frozen=True)
class EdgeBoxesAndSegments(Immutable):
    """Both: the depth segments, which are few, before the edge boxes; these alone where there is no depth."""

    edge_boxes: EdgeBoxes = dataclasses.field(default_factory=EdgeBoxes)
    segments: DepthSegments = dataclasses.field(default_factory=DepthSegments)
    overlap: float = 0.85
    """IoU over which an edge box is dropped beside a segment."""

    def __call__(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> Proposals:
        """Boxes of color (h, w, 3), RGB, and depth (h, w), metres. Segments score over 1, edge boxes less."""
        edges = self.edge_boxes(color, depth)
        if depth is None:
            return edges
        segments = self.segments(color, depth)
        new = iou(edges.boxes, segments.boxes).max(1, initial=0) <= self.overlap
        # Scores of different kinds cannot be compared; the order of each is kept.
        below = edges.scores / (edges.scores + 1)
        boxes = np.concatenate([segments.boxes, edges.boxes[new]])
        return make_proposals(boxes, np.concatenate([1 + segments.scores, below[new]]))


def depth_segments(depth: NDArray[np.float32], config: DepthSegmentsConfig) -> Proposals:
    """Boxes of segments of depth (h, w), metres, 0 where it is missing; none where nothing was measured."""
    filled = fill_missing(depth)
    if filled is None:
        return make_proposals([], [])
    h, w = depth.shape
    size = (max(round(w * config.scale), 8), max(round(h * config.scale), 8))
    log_depth = smaller_log_depth(filled, size)
    outstanding = ~on_planes(log_depth, config)
    edges = EdgesConfig()
    steps = np.hypot(*depth_steps(log_depth, edges.blur * config.scale))
    folds = concave_folds(log_depth, edges.focal_length * size[0])

    cuts = [steps > least for least in config.steps]
    cuts += [cuts[-1] | (folds > least) for least in config.folds]
    boxes, merged = [], []
    for cut in cuts:
        found, unions = _boxes((outstanding & ~cut).astype(np.uint8), config.min_pixels * config.scale**2)
        boxes.append(found)
        merged.append(unions)
    every, unions = np.concatenate(boxes), np.concatenate(merged)
    # A box counts for every set of segments in which it is found again; unions of neighbours come after all of them.
    votes = np.array([sum(iou(box, b).max(initial=0) > config.same for b in boxes) for box in every], dtype=float)
    candidates = np.concatenate([every, unions])
    scores = np.concatenate([votes, np.full(len(unions), 0.5)]) / (len(cuts) + 1)
    kept = nms(candidates, scores, config.same)
    # Cuts are wide: what was left of a segment is about a pixel smaller on each side.
    low = np.maximum(candidates[kept, :2] - 1, 0)
    high = np.minimum(candidates[kept, :2] + candidates[kept, 2:] + 1, size)
    ratio = np.array([w, h] * 2) / np.array(size * 2)
    return make_proposals(np.concatenate([low, high - low], 1) * ratio, scores[kept])


def _boxes(mask: NDArray[np.uint8], min_pixels: float) -> tuple[Array, Array]:
    """Boxes (n, 4) of the mask's connected parts, and (m, 4) of each two that come near each other."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    large = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] >= min_pixels)
    large = large[large != 0]
    boxes = stats[large, :4].astype(np.float64)
    number = np.zeros(len(stats), np.int32)
    number[large] = np.arange(1, len(large) + 1)
    labels = number[labels]
    pairs: set[tuple[int, int]] = set()
    for axis in (0, 1):
        for gap in GAPS:
            n = labels.shape[axis] - gap
            a, b = (np.take(labels, np.arange(n) + shift, axis) for shift in (0, gap))
            near = (a > 0) & (b > 0) & (a != b)
            both = np.stack([np.minimum(a, b)[near], np.maximum(a, b)[near]], 1)
            found, counts = np.unique(both, axis=0, return_counts=True)
            pairs |= {(int(pair[0]), int(pair[1])) for pair in found[counts >= NEIGHBOURS]}
    unions = []
    for pair in sorted(pairs):
        both = boxes[np.array(pair) - 1]
        low, high = both[:, :2].min(0), (both[:, :2] + both[:, 2:]).max(0)
        unions.append([*low, *(high - low)])
    return boxes, np.array(unions).reshape(-1, 4)


def on_planes(log_depth: Floats, config: DepthSegmentsConfig) -> Mask:
    """Which pixels (h, w) lie on one of the large planes.

    1/z = a u + b v + c is fitted to the tiles of a grid; the tile whose plane most of the picture lies on gives the
    plane, fitted again to all of that.
    """
    h, w = log_depth.shape
    inverse = np.exp(-log_depth.astype(np.float64))
    v, u = np.mgrid[:h, :w]
    pixels = np.stack([u / w, v / h, np.ones((h, w))], -1)
    found = np.zeros((h, w), dtype=bool)
    side = max(min(h, w) // 12, 4)
    fits = []
    for y in range(0, h - side + 1, side):
        for x in range(0, w - side + 1, side):
            tile = (slice(y, y + side), slice(x, x + side))
            plane = _fit(pixels[tile], inverse[tile])
            if np.median(np.abs(pixels[tile] @ plane / inverse[tile] - 1)) < config.plane_tolerance / 2:
                fits.append(plane)
    # Votes of every eighth pixel do.
    sparse = (slice(None, None, 4), slice(None, None, 2))
    for _ in range(config.planes):
        left = ~found[sparse]
        if not fits or not left.any():
            break
        points, values = pixels[sparse][left], inverse[sparse][left]
        votes = (np.abs(points @ np.stack(fits, 1) / values[:, None] - 1) < config.plane_tolerance).sum(0)
        plane = fits[int(np.argmax(votes))]
        for _ in range(3):
            near = np.abs(points @ plane / values - 1) < config.plane_tolerance
            if near.sum() < 3:
                break
            plane = _fit(points[near], values[near])
        near_all = np.abs(pixels @ plane / inverse - 1) < config.plane_tolerance
        if (near_all & ~found).mean() < config.plane_share:
            break
        found |= near_all
    return found


def _fit(pixels: Array, inverse: NDArray[np.floating]) -> Array:
    plane: Array = np.linalg.lstsq(pixels.reshape(-1, 3), inverse.reshape(-1), rcond=None)[0]
    return plane
