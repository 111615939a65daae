"""How sure a track is: p(x) of Sui et al. 2017, eq. 3, as a probability that its object is there and where it says."""

import numpy as np

# Logistic regression of "within 2 cm and 20 degrees" on the log-odds of the detector's confidence and on the
# likelihood of the pose estimate; benchmarks/existence_fit.py fits it on poured scenes and prints these numbers.
INTERCEPT = -2.9
DETECTOR = 0.6
LIKELIHOOD = 8.0


def track_probability(p_box: float, p_label: float, likelihood: float) -> float:
    """P(real, and within 2 cm and 20 degrees) from p(b | z), p(o | b, z) and the final likelihood, each in [0, 1]."""
    if likelihood <= 0.0:
        return 0.0
    confidence = np.clip(p_box * p_label, 1e-3, 1 - 1e-3)
    logit = INTERCEPT + DETECTOR * np.log(confidence / (1 - confidence)) + LIKELIHOOD * likelihood
    return float(1.0 / (1.0 + np.exp(-logit)))
