"""How sure a track is: p(x) of Sui et al. 2017, eq. 3, as a probability that its object is there and where it says.

That the object is there, in a pose that the belief holds, is a logistic function of what the final render, the belief's
spread, the table and the detector say; that it is in this one, the belief's share near it. The weights are learned from
the hypotheses of poured tables, right and wrong ones, and told on other tables: `benchmarks/existence_fit.py`.
"""

from collections.abc import Mapping

import numpy as np

from sum_drake.presence import Presence
from sum_drake.types import Array

EVIDENCE = ("detector", "likelihood", "close", "contradicted", "sides", "spread", "sunk", "lifted")
"""What speaks for and against a hypothesis, see `evidence`."""
SIGNS = (1, 1, 1, -1, -1, -1, -1, -1)
"""Which way each may count, whatever is learned."""
INTERCEPT = -8.39
WEIGHTS = (0.39, 2.52, 4.78, -10.27, -0.33, -1.23, -0.82, -4.08)
MISSED = 2.2
"""Logarithm of how much rarer a detector misses what it detected before, and can be seen, if it is real."""
PRESENCE = (0.0, 8.0, -8.0)
"""Of the shares that are not hidden, explained and free, in `presence_log_odds`. `benchmarks/presence_fit.py` learned
(.79, 5.96, -5.02); made firmer by hand, so that what is plainly seen outweighs what was felt."""
SURVIVES = 0.98
"""Probability that an object is still where it was, if nothing is known to have touched it."""
LEAST = 0.02
"""A track that is less probable, and was not detected, has ended."""
LIKELY = 0.5
"""A track that is at least as probable is believed in, accepted or not."""
AGREED = 0.4
"""Of a track's log-odds before, what an estimate that agrees with it is worth more. This and `MISSED` are learned on
tables that are looked at several times: `benchmarks/recursion_fit.py`."""


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


def presence_log_odds(seen: Presence) -> float:
    """How much more a look says that an object is where it is believed to be than that it is not there; 0: nothing.

    Depth at the object's distance speaks for it, farther away against it; what is hidden says nothing.
    """
    if seen.pixels <= 0:
        return 0.0
    visible = 1.0 - seen.hidden
    return visible * PRESENCE[0] + PRESENCE[1] * seen.explained + PRESENCE[2] * seen.free


def missed_probability(probability: float, seen: Presence, *, again: bool = False, survives: float = SURVIVES) -> float:
    """The probability of a track after a look that detected nothing where it is, at most what it was.

    Bayes' rule over three cases: it is real and still there; it is real, and gone since; it never was. What the look
    shows where it was (`presence_log_odds`) tells the second from the others. It does not tell these two apart, for
    a mistaken pose was made to explain that depth and still does; that nothing was detected does, as far as it can be
    seen. again: nor was it in the look before, of which this is no independent repetition.
    survives: the probability that it is still there, by what is known to have been done.
    """
    visible = 1.0 - seen.hidden if seen.pixels > 0 else 0.0
    there = float(np.exp(presence_log_odds(seen)))
    missed = float(np.exp(-MISSED * (AGREED if again else 1.0) * visible))
    real = probability * survives * there * missed
    gone = probability * (1 - survives)
    never = (1 - probability) * (SURVIVES * there + 1 - SURVIVES)
    return real / (real + gone + never) if real > 0 else 0.0


def agreed_probability(now: float, before: float) -> float:
    """The probability of a track whose estimate came out as before: by this look, and by those before.

    Looks at one scene are no independent witnesses: what was taken for the object is taken for it again. `AGREED` of
    what was believed before counts.
    """
    return _from_log_odds(_log_odds(now) + AGREED * _log_odds(SURVIVES * before))


def _log_odds(p: float) -> float:
    p = min(max(p, 1e-6), 1 - 1e-6)
    return float(np.log(p / (1 - p)))


def _from_log_odds(value: float) -> float:
    return float(1.0 / (1.0 + np.exp(-value)))
