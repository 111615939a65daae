"""How far probabilities can be trusted: what is stated against how often it is so."""

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sum_drake.types import Array, Immutable


@dataclasses.dataclass(frozen=True, eq=False)
class Reliability(Immutable):
    """Stated probabilities against observed frequencies, in bins of equal mass."""

    stated: Array
    """(bins,): mean probability, ascending."""
    observed: Array
    """(bins,): share that was the case."""
    counts: NDArray[np.int64]
    """(bins,)."""

    @property
    def error(self) -> float:
        """Expected calibration error: mean of |stated - observed| over all that was stated; nan of nothing."""
        if not self.counts.sum():
            return float("nan")
        return float(np.average(np.abs(self.stated - self.observed), weights=self.counts))


def reliability(stated: ArrayLike, was_so: ArrayLike, bins: int = 10) -> Reliability:
    """Of probabilities (n,) and whether each came true (n,), in `bins` bins of equal mass (fewer where n is less).

    Equal probabilities share their outcomes evenly, so that it does not matter which of them fall into which bin.
    """
    p, outcome = np.asarray(stated, dtype=float), np.asarray(was_so, dtype=float)
    values, group = np.unique(p, return_inverse=True)
    mean = np.bincount(group, outcome, len(values)) / np.maximum(np.bincount(group, minlength=len(values)), 1)
    order = np.argsort(p)
    parts = [part for part in np.array_split(order, bins) if len(part)]
    return Reliability(
        stated=np.array([p[part].mean() for part in parts]),
        observed=np.array([mean[group[part]].mean() for part in parts]),
        counts=np.array([len(part) for part in parts], dtype=np.int64),
    )
