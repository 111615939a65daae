"""Systematic resampling."""

import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Array


def systematic(weights: Array, n: int, offset: float) -> NDArray[np.int64]:
    """Indices (n,), ascending, of the particles that n equally spaced marks on the running sum of weights fall on.

    offset: where in its share each mark lies, in [0, 1): uniformly drawn for a fair sample, .5 for the belief's
    quantiles, the same every time. Weights (k,) need not sum to 1, and a weight of 0 is never chosen.
    """
    total = np.cumsum(weights)
    marks = (np.arange(n) + offset) / n * total[-1]
    return np.asarray(np.minimum(np.searchsorted(total, marks, side="right"), len(total) - 1))
