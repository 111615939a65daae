"""How far a detector's probabilities can be trusted: of boxes, and of labels."""

from collections.abc import Sequence

import numpy as np

from sum_drake.detection.metrics import TRUE_IOU, ScoredImage, likeliest
from sum_drake.geometry import iou
from sum_drake.reliability import Reliability, reliability


def box_reliability(images: Sequence[ScoredImage], bins: int = 10, *, least: float = 0.0) -> Reliability:
    """Of p(b | z) p(o | b, z) of each box's likeliest label: does it hold an object of that label, IoU >= .5?

    Boxes on objects that are left out do not count, nor those below `least`; of two boxes on one object each is right.
    """
    stated, was_so = [np.zeros(0)], [np.zeros(0, bool)]
    for image in images:
        classes, p = likeliest(image.probabilities)
        near = (iou(image.boxes, image.true_boxes) >= TRUE_IOU) & (classes[:, None] == image.true_classes)
        right = np.any(near & image.scored, axis=1)
        counted = (right | ~np.any(near & ~image.scored, axis=1)) & (p >= least)
        stated.append(p[counted])
        was_so.append(right[counted])
    return reliability(np.concatenate(stated), np.concatenate(was_so), bins)


def object_reliability(images: Sequence[ScoredImage], bins: int = 10) -> Reliability:
    """Of p(b | z) of each box: does it hold an object, whichever, IoU >= .5? Boxes on what is left out do not count."""
    stated, was_so = [np.zeros(0)], [np.zeros(0, bool)]
    for image in images:
        near = iou(image.boxes, image.true_boxes) >= TRUE_IOU
        right = np.any(near & image.scored, axis=1)
        counted = right | ~np.any(near & ~image.scored, axis=1)
        stated.append(1 - image.probabilities[counted, 0])
        was_so.append(right[counted])
    return reliability(np.concatenate(stated), np.concatenate(was_so), bins)


def label_reliability(images: Sequence[ScoredImage], bins: int = 10) -> Reliability:
    """Of p(o | b, z) of the likeliest label on the true boxes of the scored objects: is it the object's?"""
    stated, was_so = [np.zeros(0)], [np.zeros(0, bool)]
    for image in images:
        p = image.true_probabilities[image.scored]
        classes, of_label = likeliest(p)
        stated.append(of_label / np.maximum(p[:, 1:].sum(1), 1e-12))
        was_so.append(classes == image.true_classes[image.scored])
    return reliability(np.concatenate(stated), np.concatenate(was_so), bins)
