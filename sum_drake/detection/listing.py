"""Detections as a file, as a table and on their picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sum_drake.detection.overlay import MarkedBox, draw_boxes
from sum_drake.drawing import nth_color
from sum_drake.types import Detection


def detection_rows(detections: Sequence[Detection]) -> list[dict[str, Any]]:
    """The content of detections.json, see docs/formats.md: a row a detection, in their order."""
    return [
        {
            "label": detection.p_labels[0][0],
            "box": list(detection.box),
            "score": _score(detection),
            "p_box": detection.p_box,
            "p_labels": dict(detection.p_labels),
        }
        for detection in detections
    ]


def detection_table(detections: Sequence[Detection]) -> str:
    """Aligned text, a line a detection."""
    if not detections:
        return "nothing detected"
    lines = [f"{'label':14} {'score':>5} {'p(box)':>6}  {'x, y, w, h':24}  others"]
    for detection in detections:
        (label, _), *others = detection.p_labels
        box = ", ".join(f"{value:.0f}" for value in detection.box)
        rivals = ", ".join(f"{other} {p:.2f}" for other, p in others)
        lines.append(f"{label:14} {_score(detection):5.2f} {detection.p_box:6.2f}  {box:24}  {rivals}".rstrip())
    return "\n".join(lines)


def draw_detections(
    picture: NDArray[np.uint8], detections: Sequence[Detection], labels: Sequence[str]
) -> NDArray[np.uint8]:
    """A copy of a picture (h, w, 3), RGB, with its detections; labels: all the detector knows, for their colours."""
    marked = []
    for detection in reversed(detections):  # the sure ones lie on top
        label = detection.p_labels[0][0]
        words = f"{label} {_score(detection):.2f}"
        marked.append(MarkedBox(detection.box, nth_color(labels.index(label)), words))
    return draw_boxes(picture, marked)


def _score(detection: Detection) -> float:
    """p(b | z) p(o | b, z) of the likeliest label."""
    return detection.p_box * detection.p_labels[0][1]
