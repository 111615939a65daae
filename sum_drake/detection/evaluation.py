"""A detector on pictures whose truth is known: what it makes of each, and the calibration that follows from it."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from sum_drake.detection import calibration, metrics
from sum_drake.detection.dataset import AnnotatedImage, is_scored
from sum_drake.detection.inference import Detector
from sum_drake.detection.proposers import LEARNED
from sum_drake.detection.weights import Weights
from sum_drake.geometry import iou
from sum_drake.types import Array

Progress = Callable[[str, int, int], None]
"""Told what is being done, and how many pictures of how many are."""


def evaluate(
    detector: Detector, images: Sequence[AnnotatedImage], progress: Progress = lambda what, done, total: None
) -> list[metrics.ScoredImage]:
    """What a detector makes of each picture."""
    scored: list[metrics.ScoredImage] = []
    for image in images:
        progress("validating", len(scored), len(images))
        true_boxes = np.reshape([one.box for one in image.objects], (-1, 4))
        found, true = detector.examine(image.color, image.depth, true_boxes)
        scored.append(metrics.scored_image(image, detector.labels, found.boxes, found.probabilities, true))
    progress("validating", len(scored), len(images))
    return scored


def figures(images: Sequence[metrics.ScoredImage]) -> dict[str, float]:
    """The figures a training is followed by."""
    labels = images[0].probabilities.shape[1] - 1
    precisions = metrics.average_precisions(images, labels)
    at = metrics.best_operating_point(images)
    return {
        "map50": metrics.mean_average_precision(precisions[:, :1]),
        "map50_95": metrics.mean_average_precision(precisions),
        "recall": at.recall,
        "top1": metrics.top1(images),
    }


ALLOWED_FALSE = 0.5
"""False positives a picture at the working threshold. On validation pictures of up to 15 objects among distractors, .9
instead of .5 finds another half a percent of the objects, and takes a robot's wrist for a bottle twice as often."""


def calibrated(
    weights: Weights,
    images: Sequence[AnnotatedImage],
    *,
    proposer: str = LEARNED,
    report: Callable[[str], None] = print,
    progress: Progress = lambda what, done, total: None,
) -> Weights:
    """The same network with probabilities and working threshold fitted to pictures it was not trained on.

    The threshold is the one of the best recall at no more than ALLOWED_FALSE false positives a picture.
    """
    detector = Detector(weights, proposer=proposer)
    logits, classes = [], []
    for done, image in enumerate(images):
        progress("calibrating", done, len(images))
        found = detector.detect(image.color, image.depth)
        shown = _classes(found.boxes, image, weights.labels)
        logits.append(found.logits[shown != _LEFT_OUT])
        classes.append(shown[shown != _LEFT_OUT])
    progress("calibrating", len(images), len(images))
    fitted = dataclasses.replace(weights, calibration=calibration.fit(np.concatenate(logits), np.concatenate(classes)))
    scored = evaluate(Detector(fitted, proposer=proposer), images, progress)
    at = metrics.best_operating_point(scored, ALLOWED_FALSE)
    report(
        f"calibrated: {fitted.calibration}; threshold {at.threshold:.3f}: recall {at.recall:.3f} at "
        f"{at.false_positives_per_image:.2f} false positives a picture"
    )
    return dataclasses.replace(fitted, threshold=at.threshold)


_LEFT_OUT = -1


def _classes(boxes: Array, image: AnnotatedImage, labels: Sequence[str]) -> NDArray[np.int64]:
    """Class (n,) of the object that each box shows, 0 for none, _LEFT_OUT for one that is hardly visible."""
    classes = np.zeros(len(boxes), np.int64)
    best = np.full(len(boxes), metrics.TRUE_IOU)
    for one in image.objects:
        overlap = iou(boxes, one.box)[:, 0]
        scored = is_scored(one)
        # What can be asked for goes before what is hardly visible, however much a box overlaps that.
        taken = overlap >= best if scored else (overlap >= metrics.TRUE_IOU) & (classes == 0)
        classes[taken] = labels.index(one.label) + 1 if scored else _LEFT_OUT
        if scored:
            best[taken] = overlap[taken]
    return classes
