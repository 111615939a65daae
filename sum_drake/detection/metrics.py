"""How good a detector is: precision and recall, calibration, recall of proposals. Arrays in, figures out.

Matching, here as in PASCAL VOC and COCO (Everingham et al. 2010; Lin et al. 2014): the boxes of a picture are taken in
the order of their scores, and each takes the object of its label that it overlaps most, among those not yet taken,
if their IoU reaches the threshold. What takes none is false, a second box on one object among it. Objects too small or
too hidden to be scored are left out: nobody has to find them, and a box of their label that reaches the threshold with
one of them is neither a hit nor false.

Nothing depends on the order of pictures, boxes or objects: equal scores are ordered by their boxes, and count together.
Classes are numbered as the network numbers them: 0 is background, label i of the catalogue is class i + 1.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sum_drake.detection.dataset import AnnotatedImage, is_scored
from sum_drake.geometry import iou
from sum_drake.types import Array, Immutable, readonly

TRUE_IOU = 0.5
"""Least overlap of a hit where nothing else is said, the paper's (Sui et al. 2017, section VI)."""
COCO_IOUS = tuple(round(0.5 + 0.05 * i, 2) for i in range(10))
"""The thresholds over which mAP@.5:.95 is the mean."""
VISIBLE_EDGES = (0.25, 0.5, 0.7, 0.95, 1.0)
"""Bins of the visible share; scored objects have at least the first."""
FALSE, LEFT_OUT = -1, -2


@dataclasses.dataclass(frozen=True, eq=False)
class ScoredImage(Immutable):
    """What a detector makes of one picture, and what is to be seen in it. k labels, n boxes, m objects."""

    name: str
    boxes: Array
    """(n, 4): x, y, w, h in pixels."""
    probabilities: Array
    """(n, 1 + k): of background and of each label; rows sum to 1."""
    true_boxes: Array
    """(m, 4)."""
    true_classes: NDArray[np.int64]
    """(m,), in 1..k."""
    scored: NDArray[np.bool_]
    """(m,): False for an object that is left out."""
    visible_shares: Array
    """(m,), in [0, 1]."""
    true_probabilities: Array
    """(m, 1 + k): what the detector says of the true boxes, as in `probabilities`."""

    def __post_init__(self) -> None:
        n, m, classes = len(self.boxes), len(self.true_boxes), self.probabilities.shape[-1]
        expected = {
            "boxes": (n, 4), "probabilities": (n, classes), "true_boxes": (m, 4), "true_classes": (m,),
            "scored": (m,), "visible_shares": (m,), "true_probabilities": (m, classes),
        }  # fmt: skip
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{self.name}: {name} {getattr(self, name).shape}, expected {shape}")


def scored_image(
    image: AnnotatedImage,
    labels: Sequence[str],
    boxes: ArrayLike,
    probabilities: ArrayLike,
    true_probabilities: ArrayLike,
) -> ScoredImage:
    """An annotated picture of objects of `labels` (k), with a detector's answers; see ScoredImage for their shapes."""
    classes, objects = 1 + len(labels), image.objects
    return ScoredImage(
        name=image.name,
        boxes=readonly(np.reshape(boxes, (-1, 4))),
        probabilities=readonly(np.reshape(probabilities, (-1, classes))),
        true_boxes=readonly(np.reshape([one.box for one in objects], (-1, 4))),
        true_classes=readonly([1 + labels.index(one.label) for one in objects], np.int64),
        scored=readonly([is_scored(one) for one in objects], np.bool_),
        visible_shares=readonly([one.visible_share for one in objects]),
        true_probabilities=readonly(np.reshape(true_probabilities, (-1, classes))),
    )


# Precision and recall of each label.


@dataclasses.dataclass(frozen=True, eq=False)
class PrecisionRecall(Immutable):
    """Precision and recall of what scores at least each threshold."""

    thresholds: Array
    """(p,), descending: every score that occurs."""
    precision: Array
    """(p,)."""
    recall: Array
    """(p,), ascending."""
    objects: int
    """How many there were to find."""

    @property
    def envelope(self) -> Array:
        """(p,): the best precision at each recall or a higher one."""
        return np.asarray(np.maximum.accumulate(self.precision[::-1])[::-1])

    @property
    def average_precision(self) -> float:
        """Area under the precision envelope, interpolated at all points (PASCAL VOC from 2010); nan without objects."""
        if not self.objects:
            return float("nan")
        return float(np.sum(np.diff(self.recall, prepend=0.0) * self.envelope))


def precision_recall(images: Sequence[ScoredImage], label: int, threshold: float = TRUE_IOU) -> PrecisionRecall:
    """Of class `label` (1..k) at an IoU: every box is a detection of it with its probability, however small."""
    found = [_detections_of(image, label, threshold) for image in images]
    scores = np.concatenate([scores for scores, _ in found]) if found else np.zeros(0)
    taken = np.concatenate([taken for _, taken in found]) if found else np.zeros(0, np.int64)
    objects = sum(int(np.sum(image.scored & (image.true_classes == label))) for image in images)
    thresholds, hits, errors = _totals(scores, taken)
    return PrecisionRecall(thresholds, hits / np.maximum(hits + errors, 1), hits / max(objects, 1), objects)


def average_precisions(images: Sequence[ScoredImage], labels: int, thresholds: Sequence[float] = COCO_IOUS) -> Array:
    """Average precision (labels, thresholds) of classes 1..labels; nan where there is no object to find."""
    return np.array(
        [
            [precision_recall(images, label, threshold).average_precision for threshold in thresholds]
            for label in range(1, labels + 1)
        ]
    )


def mean_average_precision(average_precisions: Array) -> float:
    """The mean of (labels, thresholds) over both, the labels that occur; nan where none does."""
    occur = ~np.isnan(average_precisions)
    return float(np.mean(average_precisions[occur])) if occur.any() else float("nan")


def _detections_of(image: ScoredImage, label: int, threshold: float) -> tuple[Array, NDArray[np.int64]]:
    """Scores of the boxes as detections of a class, and the object that each takes."""
    scores = image.probabilities[:, label]
    possible = scores > 0.0  # what has no probability at all is no detection
    objects = np.flatnonzero(image.true_classes == label)
    taken = _match(image.boxes[possible], scores[possible], image.true_boxes[objects], image.scored[objects], threshold)
    return scores[possible], taken


def _match(
    boxes: Array, scores: Array, true_boxes: Array, scored: NDArray[np.bool_], threshold: float
) -> NDArray[np.int64]:
    """The object that each box takes, (n,): an index, FALSE or LEFT_OUT."""
    taken = np.full(len(boxes), FALSE)
    if not len(boxes) or not len(true_boxes):
        return taken
    overlaps = iou(boxes, true_boxes)
    near = overlaps >= threshold
    reaching = np.flatnonzero(near.any(axis=1))
    free = scored.copy()
    rank = np.argsort(_order(np.zeros(len(true_boxes)), true_boxes))
    for i in reaching[_order(scores[reaching], boxes[reaching])]:
        candidates = np.flatnonzero(near[i] & free)
        if len(candidates):
            taken[i] = candidates[np.lexsort((rank[candidates], -overlaps[i, candidates]))[0]]
            free[taken[i]] = False
        elif np.any(near[i] & ~scored):
            taken[i] = LEFT_OUT
    return taken


def _order(scores: Array, boxes: Array) -> NDArray[np.int64]:
    """Indices by falling score; equal ones by their boxes."""
    return np.lexsort((*boxes.T[::-1], -scores))


def _totals(scores: Array, taken: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Every score that occurs, descending, with the numbers of hits and of errors that score at least as much."""
    counted = taken != LEFT_OUT
    scores, hit = scores[counted], taken[counted] >= 0
    order = np.argsort(-scores)
    scores, hit = scores[order], hit[order]
    last = np.flatnonzero(np.append(scores[1:] != scores[:-1], True)) if len(scores) else np.zeros(0, np.int64)
    return scores[last], np.cumsum(hit)[last].astype(float), np.cumsum(~hit)[last].astype(float)


# What is detected when a threshold decides.


@dataclasses.dataclass(frozen=True)
class OperatingPoint:
    """What a threshold on p(b | z) p(o | b, z) of each box's likeliest label gives."""

    threshold: float
    recall: float
    """Share of the scored objects that were found, under their own label; nan where there are none."""
    precision: float
    """Share of the detections that are right; 1 where there are none."""
    false_positives_per_image: float


def likeliest(probabilities: Array) -> tuple[NDArray[np.int64], Array]:
    """The likeliest label's class (n,), background aside, and its probability (n,), of probabilities (n, 1 + k)."""
    classes = 1 + np.argmax(probabilities[:, 1:], axis=1)
    return classes, np.take_along_axis(probabilities, classes[:, None], 1)[:, 0]


def take(image: ScoredImage, threshold: float = TRUE_IOU) -> NDArray[np.int64]:
    """The object (n,) that each box takes as a detection of its likeliest label: an index, FALSE or LEFT_OUT.

    Boxes of a lower score never change what those of a higher one take, so a working threshold may be put on the
    scores afterwards.
    """
    classes, scores = likeliest(image.probabilities)
    taken = np.full(len(image.boxes), FALSE)
    for label in np.unique(classes):
        rows, objects = np.flatnonzero(classes == label), np.flatnonzero(image.true_classes == label)
        found = _match(image.boxes[rows], scores[rows], image.true_boxes[objects], image.scored[objects], threshold)
        taken[rows] = np.where(found >= 0, np.append(objects, FALSE)[found], found)
    return taken


def operating_point(images: Sequence[ScoredImage], threshold: float) -> OperatingPoint:
    """What there is at a working threshold, at an IoU of .5."""
    scores, taken = _likeliest_taken(images)
    at = scores >= threshold
    return _operating_point(images, threshold, int(np.sum(taken[at] >= 0)), int(np.sum(taken[at] == FALSE)))


def best_operating_point(images: Sequence[ScoredImage], false_positives_per_image: float = 1.0) -> OperatingPoint:
    """The one of the highest recall that has at most so many false positives an image; the strictest of equals.

    Where even the best box is false too often, its threshold is infinite.
    """
    scores, taken = _likeliest_taken(images)
    thresholds, hits, errors = _totals(scores, taken)
    allowed = errors <= false_positives_per_image * len(images)
    if not allowed.any() or hits[allowed].max() == 0:
        return _operating_point(images, float("inf"), 0, 0)
    best = int(np.argmax(np.where(allowed, hits, -1.0)))
    return _operating_point(images, float(thresholds[best]), int(hits[best]), int(errors[best]))


def recall_curve(images: Sequence[ScoredImage]) -> tuple[Array, Array, Array]:
    """Thresholds (p,), descending, with recall (p,) and false positives an image (p,) at each."""
    thresholds, hits, errors = _totals(*_likeliest_taken(images))
    return thresholds, hits / max(_objects(images), 1), errors / max(len(images), 1)


def recall_by_visible_share(
    images: Sequence[ScoredImage], threshold: float, edges: Sequence[float] = VISIBLE_EDGES
) -> list[tuple[float, float, int, float]]:
    """(from, to, objects, recall) of the scored objects in each bin of the visible share, nan where there are none.

    A bin holds its lower edge, the last one its upper edge, too.
    """
    shares, found = [], []
    for image in images:
        _, scores = likeliest(image.probabilities)
        taken = take(image)
        hit = np.isin(np.arange(len(image.true_boxes)), taken[scores >= threshold])
        shares.append(image.visible_shares[image.scored])
        found.append(hit[image.scored])
    share, hit = np.concatenate([np.zeros(0), *shares]), np.concatenate([np.zeros(0, bool), *found])
    rows = []
    for low, high in itertools.pairwise(edges):
        inside = (share >= low) & ((share <= high) if high == edges[-1] else (share < high))
        rows.append((low, high, int(inside.sum()), float(hit[inside].mean()) if inside.any() else float("nan")))
    return rows


def counts_by_label(images: Sequence[ScoredImage], labels: int, threshold: float) -> NDArray[np.int64]:
    """Of each label (labels, 3) at a working threshold: objects to find, those found, false boxes."""
    counts = np.zeros((1 + labels, 3), np.int64)
    for image in images:
        classes, scores = likeliest(image.probabilities)
        at, taken = scores >= threshold, take(image)
        for column, members in enumerate(
            (image.true_classes[image.scored], classes[at & (taken >= 0)], classes[at & (taken == FALSE)])
        ):
            counts[:, column] += np.bincount(members, minlength=1 + labels)
    return counts[1:]


def confusion_matrix(images: Sequence[ScoredImage], threshold: float) -> NDArray[np.int64]:
    """Counts (1 + k, 1 + k): row what stands there, column what the detector says of it.

    Here a box takes an object whatever its label. Row 0 is nothing: false boxes by their label; column 0 is nothing:
    objects that were missed.
    """
    size = images[0].probabilities.shape[1] if images else 1
    counts = np.zeros((size, size), np.int64)
    for image in images:
        classes, scores = likeliest(image.probabilities)
        at = np.flatnonzero(scores >= threshold)
        at = at[np.argsort(classes[at], kind="stable")]  # what else equal scores and boxes are ordered by
        taken = _match(image.boxes[at], scores[at], image.true_boxes, image.scored, TRUE_IOU)
        for said, index in zip(classes[at], taken, strict=True):
            if index != LEFT_OUT:
                counts[image.true_classes[index] if index >= 0 else 0, said] += 1
        missed = np.setdiff1d(np.flatnonzero(image.scored), taken)
        counts[:, 0] += np.bincount(image.true_classes[missed], minlength=size)
    return counts


def _likeliest_taken(images: Sequence[ScoredImage]) -> tuple[Array, NDArray[np.int64]]:
    scores = [likeliest(image.probabilities)[1] for image in images]
    return np.concatenate([np.zeros(0), *scores]), np.concatenate([np.zeros(0, np.int64), *map(take, images)])


def _objects(images: Sequence[ScoredImage]) -> int:
    return sum(int(image.scored.sum()) for image in images)


def _operating_point(images: Sequence[ScoredImage], threshold: float, hits: int, errors: int) -> OperatingPoint:
    objects = _objects(images)
    return OperatingPoint(
        threshold=threshold,
        recall=hits / objects if objects else float("nan"),
        precision=hits / (hits + errors) if hits + errors else 1.0,
        false_positives_per_image=errors / max(len(images), 1),
    )


def top1(images: Sequence[ScoredImage]) -> float:
    """Share of the scored objects whose own label is the likeliest class of their true box, background included."""
    right = [
        np.argmax(image.true_probabilities[image.scored], axis=1) == image.true_classes[image.scored]
        for image in images
    ]
    all_of_them = np.concatenate([np.zeros(0, bool), *right])
    return float(all_of_them.mean()) if len(all_of_them) else float("nan")


# Proposals.


def proposal_overlaps(boxes: Array, image: AnnotatedImage, counts: Sequence[int]) -> Array:
    """Best IoU (m, counts) of each scored object of a picture with the first `count` of boxes (n, 4), best first."""
    true_boxes = np.reshape([one.box for one in image.objects if is_scored(one)], (-1, 4))
    best = np.maximum.accumulate(np.vstack([np.zeros((1, len(true_boxes))), iou(boxes, true_boxes)]))  # (1 + n, m)
    return np.asarray(best[np.minimum(counts, len(boxes))].T)


def proposal_recall(overlaps: Array, threshold: float) -> Array:
    """Share (counts,) of the objects whose best IoU (m, counts) reaches a threshold; nan without objects."""
    if not len(overlaps):
        return np.full(overlaps.shape[1], np.nan)
    return np.asarray(np.mean(overlaps >= threshold, axis=0))
