"""How sure a track is: p(x) of Sui et al. 2017, eq. 3, as a probability that its object is there and where it says.

That the object is there, in a pose that the belief holds, is a logistic function of what the final render, the belief's
spread, the table and the detector say; that it is in this one, the belief's share near it. The weights are learned from
the hypotheses of poured tables, right and wrong ones, and told on other tables: `benchmarks/existence_fit.py`.
"""

from collections.abc import Mapping

import numpy as np

from sum_drake.types import Array

EVIDENCE = ("detector", "likelihood", "close", "contradicted", "sides", "spread", "sunk", "lifted")
"""What speaks for and against a hypothesis, see `evidence`."""
SIGNS = (1, 1, 1, -1, -1, -1, -1, -1)
"""Which way each may count, whatever is learned."""
INTERCEPT = -7.37
WEIGHTS = (0.38, 2.48, 4.28, -9.59, -0.44, -1.1, -0.66, -3.89)
MISS_RATE = 0.1
"""Share of observations in which a detector misses what is there."""


def evidence(p_box: float, p_label: float, likelihood: float, features: Mapping[str, float]) -> Array:
    """The arguments of the logistic function, (8,), each within bounds.

    detector: log-odds of p(b | z) p(o | b, z). likelihood: of the pose. close, contradicted, sides: the terms of the
    pose's render (`likelihood.terms`). spread: logarithm of the belief's standard deviation. sunk, lifted: centimetres
    below the table's top and decimetres above it, 0 where nothing is known of a table; a patch of bare table is well
    explained by a box that lies in it.
    """
    confidence = np.clip(p_box * p_label, 1e-3, 1 - 1e-3)
    sunk = features.get("sunk_m", 0.0)
    return np.array(
        [
            np.log(confidence / (1 - confidence)),
            likelihood,
            features["close"],
            min(features["free_space"] / max(features["observed"], 1.0), 1.0),
            min(features["sides"], 8.0),
            np.log(np.clip(features["translation_std_m"], 1e-3, 0.2)),
            np.clip(sunk, 0.0, 0.05) / 0.01,
            np.clip(-sunk, 0.0, 0.1) / 0.1,
        ]
    )


def track_probability(p_box: float, p_label: float, likelihood: float, features: Mapping[str, float]) -> float:
    """P(real, and within 2 cm and 20 degrees) from p(b | z), p(o | b, z) and the estimate, by one observation.

    features: of `filtering.PoseEstimate`, and sunk_m where the table is known (`support.sunk`). Nothing explained is
    nothing there.
    """
    if likelihood <= 0.0:
        return 0.0
    log_odds = INTERCEPT + float(evidence(p_box, p_label, likelihood, features) @ np.array(WEIGHTS))
    return features["near_share"] / (1.0 + float(np.exp(-log_odds)))


def missed_probability(probability: float) -> float:
    """The probability of a track after an observation in which nothing was detected where it is."""
    return probability * MISS_RATE / (probability * MISS_RATE + 1.0 - probability)
