"""A detector made of the simulator's label image and set error rates: for diagnosis and ablation."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sum_drake.detection.sigma_c import sigma_c_rule
from sum_drake.geometry import mask_box
from sum_drake.types import Box, Detection

MIN_SIDE = 4.0
"""Pixels; a smaller box is no use to any estimator."""


@dataclasses.dataclass
class SimulatedDetectorConfig:
    """Error rates of the simulated detector."""

    miss_rate: float = 0.05
    """Share of visible objects that get no box."""
    box_jitter: float = 0.05
    """Standard deviation of each box edge, as a share of the box's side."""
    wrong_label_rate: float = 0.1
    """Share of boxes whose most likely label is not the true one."""
    true_label_lost_rate: float = 0.2
    """Share of wrongly labelled boxes in which the true label does not appear at all."""
    false_boxes: float = 0.5
    """Mean number of boxes an image that hold no object (Poisson)."""
    min_pixels: int = 150
    """Objects with fewer visible pixels are never seen."""


def simulate_detections(
    label_image: NDArray[np.integer],
    objects: Mapping[int, str],
    labels: Sequence[str],
    *,
    sigma_c: float,
    config: SimulatedDetectorConfig,
    rng: np.random.Generator,
) -> tuple[Detection, ...]:
    """Boxes of the visible objects, corrupted by misses, jitter, wrong labels and false boxes.

    label_image: (h, w) render labels; objects: render label -> object label; labels: every label a box may get.
    """
    height, width = label_image.shape
    detections = []
    for value in sorted(objects):
        own = label_image == value
        if np.count_nonzero(own) < config.min_pixels:
            continue
        box = mask_box(own)
        # Draw everything before deciding, so that one object's fate does not shift the draws of the next.
        missed, mislabelled, lost = rng.random(3) < (
            config.miss_rate, config.wrong_label_rate, config.true_label_lost_rate,
        )  # fmt: skip
        jittered = _jitter(box, rng.normal(0.0, config.box_jitter, 4), width, height)
        p_box = rng.uniform(0.7, 1.0)
        p_labels = _confidences(objects[value], labels, wrong=mislabelled, lost=lost, rng=rng)
        if not missed and jittered is not None:
            detections.append(Detection(jittered, p_box, sigma_c_rule(p_labels, sigma_c)))
    for _ in range(rng.poisson(config.false_boxes)):
        w, h = rng.uniform(0.06, 0.22, 2) * width
        h = min(h, height / 2)
        box = (rng.uniform(0, width - w), rng.uniform(height / 3, height - h), float(w), float(h))
        true = str(rng.choice(labels))
        p_labels = _confidences(true, labels, wrong=False, lost=False, rng=rng)
        detections.append(Detection(box, rng.uniform(0.3, 0.8), sigma_c_rule(p_labels, sigma_c)))
    return tuple(detections)


def _jitter(box: Box, edges: NDArray[np.float64], width: int, height: int) -> Box | None:
    """The box with its left, top, right and bottom edge moved by shares of its sides, clipped to the picture."""
    x, y, w, h = box
    left, right = np.clip([x + edges[0] * w, x + w + edges[2] * w], 0, width)
    top, bottom = np.clip([y + edges[1] * h, y + h + edges[3] * h], 0, height)
    if right - left < MIN_SIDE or bottom - top < MIN_SIDE:
        return None
    return float(left), float(top), float(right - left), float(bottom - top)


def _confidences(
    true: str, labels: Sequence[str], *, wrong: bool, lost: bool, rng: np.random.Generator
) -> list[tuple[str, float]]:
    """A softmax-like distribution: one label in front, one behind it, the rest negligible."""
    others = [label for label in labels if label != true]
    first = rng.uniform(0.6, 0.98)
    second = (1.0 - first) * rng.uniform(0.2, 0.9)
    if not others:
        return [(true, first)]
    i, j = rng.choice(len(others), size=2, replace=len(others) < 2)
    if not wrong:
        return [(true, first), (others[i], second)]
    if lost and i != j:
        return [(others[i], first), (others[j], second)]
    return [(others[i], 0.5 + first / 4), (true, 0.5 - first / 4 - 0.05)]
