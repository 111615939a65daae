"""Region proposals: boxes that may hold an object, whatever it is. What makes them, and their suppression.

A proposer is a function of a picture and, where there is one, its depth. This package's are listed in `proposers.py`.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sum_drake.geometry import iou
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
