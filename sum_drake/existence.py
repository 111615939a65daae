"""How sure a track is: p(x) of Sui et al. 2017, eq. 3, as a probability that its object is there and where it says."""

import numpy as np

# A logistic function of the log-odds of the detector's confidence and of the likelihood of the pose estimate. The
# numbers are set by hand, for `filter: default`; benchmarks/existence_fit.py measures them on poured scenes and fits
# better ones, with the simulated detector's mistakes. On 66 hypotheses of its first 6 scenes (seeds 100 to 105), 29 of
# them within 2 cm and 20 degrees: Brier skill .61, all right ones accepted at .5, 30 of 37 wrong ones rejected.
INTERCEPT = -2.9
DETECTOR = 0.6
LIKELIHOOD = 8.0
MISS_RATE = 0.1
"""Share of observations in which a detector misses what is there."""
SUNK = 0.01
"""Standard deviation of the depth by which a true object's estimate sinks into the table, metres."""


def track_probability(p_box: float, p_label: float, likelihood: float, sunk: float = 0.0) -> float:
    """P(real, and within 2 cm and 20 degrees) from p(b | z), p(o | b, z) and the final likelihood, each in [0, 1].

    sunk: how far the estimate reaches below the table's top, metres. A patch of bare table is well explained by a box
    that lies in it.
    """
    if likelihood <= 0.0:
        return 0.0
    confidence = np.clip(p_box * p_label, 1e-3, 1 - 1e-3)
    logit = INTERCEPT + DETECTOR * np.log(confidence / (1 - confidence)) + LIKELIHOOD * likelihood
    return float(np.exp(-0.5 * (max(sunk, 0.0) / SUNK) ** 2) / (1.0 + np.exp(-logit)))


def missed_probability(probability: float) -> float:
    """The probability of a track after an observation in which nothing was detected where it is."""
    return probability * MISS_RATE / (probability * MISS_RATE + 1.0 - probability)
