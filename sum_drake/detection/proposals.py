"""Region proposals: boxes that may hold an object, whatever it is. What makes them, and what is done with boxes.

A proposer is a function of a picture and, where there is one, its depth. This package's are listed in `proposers.py`.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sum_drake.types import Array, Immutable, readonly


@dataclasses.dataclass(frozen=True, eq=False)
class Proposals(Immutable):
    """Boxes that may hold an object, best first."""

    boxes: Array
    """(n, 4): x, y, w, h in pixels, as types.Box; w and h are positive."""
    scores: Array
    """(n,), descending. Each proposer has a scale of its own."""

    def __post_init__(self) -> None:
        if self.boxes.ndim != 2 or self.boxes.shape[1] != 4 or self.scores.shape != self.boxes.shape[:1]:
            raise ValueError(f"boxes {self.boxes.shape} and scores {self.scores.shape}, expected (n, 4) and (n,)")

    def __len__(self) -> int:
        return len(self.boxes)

    def best(self, count: int) -> "Proposals":
        """The first `count` of them."""
        return Proposals(self.boxes[:count], self.scores[:count])


Proposer = Callable[[NDArray[np.uint8], NDArray[np.float32] | None], Proposals]
"""color (h, w, 3) RGB, depth (h, w) in metres with 0 where it is missing, or None -> Proposals.

Raises InputError where a picture or its depth cannot be used, or depth is needed and missing.
"""


def make_proposals(boxes: ArrayLike, scores: ArrayLike) -> Proposals:
    """Proposals of boxes (n, 4) with scores (n,) in any order; equal scores stay in the order given."""
    boxes, scores = np.asarray(boxes, dtype=np.float64).reshape(-1, 4), np.asarray(scores, dtype=np.float64)
    order = np.argsort(-scores, kind="stable")
    return Proposals(readonly(boxes[order]), readonly(scores[order]))


def iou(a: ArrayLike, b: ArrayLike) -> Array:
    """Intersection over union of boxes (n, 4) with boxes (m, 4), each x, y, w, h: (n, m); 0 where both are empty."""
    a = np.asarray(a, dtype=np.float64).reshape(-1, 1, 4)
    b = np.asarray(b, dtype=np.float64).reshape(1, -1, 4)
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    intersection = np.prod(np.maximum(high - low, 0.0), axis=-1)
    union = np.prod(a[..., 2:], axis=-1) + np.prod(b[..., 2:], axis=-1) - intersection
    return np.asarray(np.divide(intersection, union, out=np.zeros_like(union), where=union > 0))


def nms(boxes: ArrayLike, scores: ArrayLike, threshold: float) -> NDArray[np.int64]:
    """Greedy non-maximum suppression: indices (k,) of the boxes (n, 4) that are kept, best first.

    A box is dropped where its IoU with a better one that was kept exceeds `threshold`. Of equal scores the first goes
    first.
    """
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 4)
    order = np.argsort(-np.asarray(scores, dtype=np.float64), kind="stable")
    kept = []
    while len(order):
        best, order = order[0], order[1:]
        kept.append(best)
        order = order[iou(boxes[best], boxes[order])[0] <= threshold]
    return np.array(kept, dtype=np.int64)
