"""What `sum-drake bench detect` makes of what it measured: the figures and tables of its results.json."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sum_drake.bench.aims import Aims
from sum_drake.detection import metrics
from sum_drake.detection.metrics import FALSE, ScoredImage
from sum_drake.detection.reliability import box_reliability, label_reliability, object_reliability
from sum_drake.types import Array, Immutable

TEST, SHIFT = "test", "shift"
COUNTS = (1, 2, 5, 10, 20, 50, 100, 200, 300, 500, 1000)
"""Numbers of proposals at which their recall is told."""
AIMS: Aims = {
    "map50": ("at least", 0.92),
    "map50_shift": ("at least", 0.87),
    "recall": ("at least", 0.90),
    "false_positives_per_image": ("at most", 1.0),
    "top1_on_true_boxes": ("at least", 0.95),
    "edge_boxes_recall50_300": ("at least", 0.90),
    "edge_boxes_recall70_300": ("at least", 0.75),
    "edge_boxes_full_recall50_300": ("at least", 0.90),
    "edge_boxes_full_recall70_300": ("at least", 0.80),
    "calibration_error": ("at most", 0.05),
    "calibration_error_of_detections": ("at most", 0.05),
    "calibration_error_of_p_box": ("at most", 0.05),
    "cpu_s_per_image": ("at most", 1.2),
    "peak_memory_mib": ("at most", 1024.0),
}
"""What the figures are to reach."""


@dataclasses.dataclass(frozen=True, eq=False)
class Proposed(Immutable):
    """What a proposer made of one picture."""

    overlaps: Array
    """(m, counts): best IoU of each scored object with the first of its boxes, for each of COUNTS."""
    boxes: int
    cpu_s: float


@dataclasses.dataclass(frozen=True, eq=False)
class Measured(Immutable):
    """What the detector made of one picture."""

    split: str
    index: int
    """Of the picture in its split."""
    scored: ScoredImage
    cpu_s: float
    proposals: Mapping[str, Proposed]
    """By proposer; empty where they were not asked."""
    peak_memory_mib: float
    """Of a process that has loaded the detector and used it."""


def figures(measured: Sequence[Measured], threshold: float) -> dict[str, float]:
    """The figures of results.json from what was measured of pictures of both splits, at a working threshold.

    Names without a split are of `test`. cpu_s_per_image and peak_memory_mib are of detection alone.
    """
    images = {split: [one.scored for one in measured if one.split == split] for split in (TEST, SHIFT)}
    found: dict[str, float] = {}
    for split, ending in ((TEST, ""), (SHIFT, "_shift")):
        aps = metrics.average_precisions(images[split], _labels(measured))
        point = metrics.operating_point(images[split], threshold)
        found[f"map50{ending}"] = metrics.mean_average_precision(aps[:, :1])
        found[f"map50_95{ending}"] = metrics.mean_average_precision(aps)
        found[f"recall{ending}"] = point.recall
        found[f"false_positives_per_image{ending}"] = point.false_positives_per_image
        found[f"recall_at_1_false_positive{ending}"] = metrics.best_operating_point(images[split]).recall
        found[f"top1_on_true_boxes{ending}"] = metrics.top1(images[split])
        found[f"calibration_error{ending}"] = box_reliability(images[split]).error
        found[f"calibration_error_of_detections{ending}"] = box_reliability(images[split], least=threshold).error
        found[f"calibration_error_of_p_box{ending}"] = object_reliability(images[split]).error
        found[f"calibration_error_of_labels{ending}"] = label_reliability(images[split]).error
    for name, proposed in by_proposer(measured).items():
        overlaps = np.concatenate([one.overlaps for one in proposed])
        for percent in (50, 70):
            recall = metrics.proposal_recall(overlaps, percent / 100)
            found[f"{name}_recall{percent}_300"] = float(recall[COUNTS.index(300)])
    costs = [one.cpu_s for one in measured]
    found["cpu_s_per_image"] = float(np.mean(costs))
    found["cpu_s_per_image_p95"] = float(np.percentile(costs, 95))
    found["peak_memory_mib"] = max(one.peak_memory_mib for one in measured)
    return found


def rows(measured: Sequence[Measured], labels: Sequence[str], threshold: float) -> list[dict[str, Any]]:
    """The tables behind the figures: by label, by visible share, by proposer and number of boxes, and by picture."""
    table: list[dict[str, Any]] = []
    for split in (TEST, SHIFT):
        images = [one.scored for one in measured if one.split == split]
        aps = metrics.average_precisions(images, len(labels))
        counts = metrics.counts_by_label(images, len(labels), threshold)
        for label, ap, (objects, hits, false) in zip(labels, aps, counts.tolist(), strict=True):
            table.append(
                {
                    "table": "label",
                    "split": split,
                    "label": label,
                    "objects": objects,
                    "ap50": ap[0],
                    "ap50_95": ap.mean(),
                    "recall": hits / objects if objects else float("nan"),
                    "precision": hits / (hits + false) if hits + false else float("nan"),
                    "false_positives_per_image": false / max(len(images), 1),
                }
            )
        for low, high, objects, recall in metrics.recall_by_visible_share(images, threshold):
            table.append(
                {
                    "table": "visible_share",
                    "split": split,
                    "from": low,
                    "to": high,
                    "objects": objects,
                    "recall": recall,
                }
            )
    for name, proposed in by_proposer(measured).items():
        overlaps = np.concatenate([one.overlaps for one in proposed])
        recalls = [metrics.proposal_recall(overlaps, threshold) for threshold in (0.5, 0.7)]
        most = max(one.boxes for one in proposed)
        for count, at_50, at_70 in zip(COUNTS, *recalls, strict=True):
            table.append({"table": "proposals", "proposer": name, "boxes": count, "recall50": at_50, "recall70": at_70})
            if count >= most:
                break
        boxes, cpu_s = (float(np.mean([getattr(one, key) for one in proposed])) for key in ("boxes", "cpu_s"))
        table.append({"table": "proposers", "proposer": name, "mean_boxes": boxes, "cpu_s": cpu_s})
    for one in measured:
        verdict = judge(one.scored, threshold)
        table.append(
            {
                "table": "image",
                "split": one.split,
                "name": one.scored.name,
                "objects": int(one.scored.scored.sum()),
                "missed": [labels[one.scored.true_classes[i] - 1] for i in verdict.missed],
                "false": [labels[verdict.classes[i] - 1] for i in verdict.false],
                "cpu_s": one.cpu_s,
            }
        )
    return table


def _labels(measured: Sequence[Measured]) -> int:
    return int(measured[0].scored.probabilities.shape[1]) - 1


def by_proposer(measured: Sequence[Measured]) -> dict[str, list[Proposed]]:
    """What each proposer made of the pictures that it was asked about."""
    names = dict.fromkeys(name for one in measured for name in one.proposals)
    return {name: [one.proposals[name] for one in measured if name in one.proposals] for name in names}


@dataclasses.dataclass(frozen=True, eq=False)
class Verdict:
    """What is right and wrong about a picture's detections at the working threshold; indices of boxes and objects."""

    classes: NDArray[np.int64]
    """(n,): the boxes' likeliest labels."""
    scores: Array
    """(n,): their probabilities."""
    right: list[int]
    false: list[int]
    missed: list[int]
    """Of objects."""

    @property
    def errors(self) -> int:
        """How many."""
        return len(self.false) + len(self.missed)


def judge(image: ScoredImage, threshold: float) -> Verdict:
    """A picture's detections at a working threshold against what is there."""
    classes, scores = metrics.likeliest(image.probabilities)
    taken = metrics.take(image)
    at = scores >= threshold
    return Verdict(
        classes=classes,
        scores=scores,
        right=np.flatnonzero(at & (taken >= 0)).tolist(),
        false=np.flatnonzero(at & (taken == FALSE)).tolist(),
        missed=np.setdiff1d(np.flatnonzero(image.scored), taken[at]).tolist(),
    )
