"""Turns the network's logits into probabilities that come true as often as they say.

Guo et al., "On Calibration of Modern Neural Networks", 2017: one temperature for each of the two questions of SUM
(eq. 3), whether a box holds an object, p(b | z), and which, p(o | b, z). The first has an offset as well, since a box
that survived suppression is likelier an object than the boxes trained on.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Array


@dataclasses.dataclass(frozen=True)
class Calibration:
    """Temperatures of both questions. Raises ValueError for some that are not positive, or not finite numbers."""

    box_temperature: float = 1.0
    box_offset: float = 0.0
    label_temperature: float = 1.0

    def __post_init__(self) -> None:
        for name, value in dataclasses.asdict(self).items():
            if not math.isfinite(value) or (name != "box_offset" and value <= 0):
                raise ValueError(f"calibration: {name} is {value}")

    def probabilities(self, logits: Array) -> Array:
        """Probabilities (n, classes) from logits: column 0 is 1 - p(b | z), the others p(b | z) p(o | b, z)."""
        p_box = _sigmoid(box_margin(logits) / self.box_temperature + self.box_offset)
        return np.concatenate(
            [1 - p_box[:, None], p_box[:, None] * _softmax(logits[:, 1:] / self.label_temperature)], axis=1
        )


def box_margin(logits: Array) -> Array:
    """Log odds (n,) that a box holds an object, of whichever label, from logits (n, classes)."""
    objects = logits[:, 1:]
    top = objects.max(axis=1)
    margin: Array = top + np.log(np.exp(objects - top[:, None]).sum(axis=1)) - logits[:, 0]
    return margin


def fit(logits: Array, classes: NDArray[np.int64]) -> Calibration:
    """The calibration that the true classes (n,) of boxes with logits (n, classes) make likeliest.

    Before any data every parameter is its neutral value, give or take a factor of e: few examples, or examples of one
    kind alone, change little.
    """
    from scipy.optimize import minimize

    true = classes > 0
    margin, sign = box_margin(logits), np.where(true, 1.0, -1.0)

    def box_loss(x: Array) -> float:
        return float(np.logaddexp(0, -sign * (margin * np.exp(-x[0]) + x[1])).sum() + x @ x / 2)

    chosen, labels = logits[true, 1:], classes[true] - 1

    def label_loss(x: Array) -> float:
        likely = _softmax(chosen * np.exp(-x[0]))[np.arange(len(labels)), labels]
        return float(-np.log(likely + 1e-12).sum() + x @ x / 2)

    box = minimize(box_loss, np.zeros(2), method="Nelder-Mead").x
    label = minimize(label_loss, np.zeros(1), method="Nelder-Mead").x
    return Calibration(float(np.exp(box[0])), float(box[1]), float(np.exp(label[0])))


def _sigmoid(x: Array) -> Array:
    return np.exp(-np.logaddexp(0, -x))


def _softmax(x: Array) -> Array:
    exponents = np.exp(x - x.max(axis=1, keepdims=True))
    probabilities: Array = exponents / exponents.sum(axis=1, keepdims=True)
    return probabilities
