"""What `sum-drake bench reject` makes of what it measured: figures, and the curves of its plots."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sum_drake.bench.aims import Aims
from sum_drake.bench.hypotheses import FirstLook, Judged
from sum_drake.bench.sequences import LOOKS, Followed, Outcome
from sum_drake.reliability import Reliability, reliability
from sum_drake.types import Array

KEPT = 0.95
"""Share of what is true that may not be lost."""
AIMS: Aims = {
    "false_rejected": ("at least", 0.90),
    "true_kept": ("at least", KEPT),
    "calibration_error": ("at most", 0.05),
    "brier_skill": ("at least", 0.3),
    "recovered_within_2": ("at least", 0.90),
    "tracked_cpu_s_per_object": ("at most", 0.3),
    "paper.false_rejected": ("at least", 0.84),
}
"""What the figures are to reach; the last is the paper's."""
SAYERS = {
    "belief": "belief",
    "look_alone": "this look alone",
    "detector": "detector",
    "inliers": "I / N",
    "paper_score": "p(b) p(o|b) I / N",
}
"""What tells true hypotheses from false ones, in words: ours and three others, see `said`."""


@dataclasses.dataclass(frozen=True)
class Curve:
    """A threshold's two shares, at every threshold there is."""

    kept: Array
    """(k,): of what is true, ascending."""
    rejected: Array
    """(k,): of what is false."""

    @property
    def area(self) -> float:
        """Under the curve: how often a true one is put above a false one."""
        return float(np.sum(np.diff(self.kept) * (self.rejected[1:] + self.rejected[:-1]) / 2))

    def at(self, kept: float) -> float:
        """Rejected share at the least kept share of at least `kept`."""
        return float(self.rejected[np.searchsorted(self.kept, kept - 1e-9)])


def said(one: Judged) -> dict[str, float]:
    """How sure each of SAYERS is of a hypothesis.

    I / N is the paper's likelihood (eq. 8) of the same estimate; its product with the detector's confidence is what
    the paper thresholds.
    """
    features = dict(one.features)
    explained = features["inliers"] / max(features["observed"], 1.0)
    return {
        "belief": one.probability,
        "look_alone": features["p_look"],
        "detector": one.p_box * one.p_label,
        "inliers": explained,
        "paper_score": one.p_box * one.p_label * explained,
    }


def roc(scores: Array, right: NDArray[np.bool_]) -> Curve:
    """Of scores (n,) of hypotheses; there must be both right and wrong ones."""
    thresholds = np.r_[np.inf, np.unique(scores)[::-1]]
    kept = [float(np.mean(scores[right] >= t)) for t in thresholds]
    rejected = [float(np.mean(scores[~right] < t)) for t in thresholds]
    return Curve(np.array(kept), np.array(rejected))


def curves(said: Sequence[Mapping[str, float]], right: Sequence[bool]) -> dict[str, Curve]:
    """What can be told by each of SAYERS, of hypotheses of which this is said; nothing where all are alike."""
    so = np.array(right, bool)
    if so.all() or not so.any():
        return {}
    return {sayer: roc(np.array([one[sayer] for one in said]), so) for sayer in SAYERS}


def stated(judged: Sequence[Judged]) -> Reliability:
    """How far the belief's probabilities can be trusted."""
    return reliability([one.probability for one in judged], [one.right for one in judged])


def brier_skill(judged: Sequence[Judged]) -> float:
    """1 - Brier score over that of stating the mean of what was so each time; nan where all were alike."""
    right = np.array([one.right for one in judged], dtype=float)
    p = np.array([one.probability for one in judged])
    alike = right.mean() * (1 - right.mean()) if len(right) else 0.0
    return float(1 - np.mean((p - right) ** 2) / alike) if alike else float("nan")


def coverage_risk(looks: Sequence[FirstLook]) -> tuple[Array, Array]:
    """Share of visible objects accepted, and share of what is accepted that is wrong, (k,) each, by threshold.

    Of one label on one table the likeliest hypothesis counts, as labels are unique there.
    """
    best: list[tuple[float, bool, bool]] = []
    for look in looks:
        for label in {one.label for one in look.judged}:
            one = max((one for one in look.judged if one.label == label), key=lambda one: one.probability)
            best.append((one.probability, one.right and label in look.visible, one.right))
    best.sort(reverse=True)
    hits, right = np.cumsum([hit for _, hit, _ in best]), np.cumsum([right for _, _, right in best])
    count = np.arange(1, len(best) + 1)
    total = max(sum(len(look.visible) for look in looks), 1)
    return hits / total, 1 - right / count


def figures(looks: Sequence[FirstLook], trials: Sequence[FirstLook], followed: Sequence[Followed]) -> dict[str, float]:
    """Name -> value; nan where there is nothing to measure it on.

    looks: at tables of all kinds; trials: the paper's experiment; followed: tables to which something happened.
    """
    judged = [one for look in looks for one in look.judged]
    right = np.array([one.right for one in judged])
    found = {
        "false_rejected": _mean([not one.accepted for one in judged if not one.right]),
        "true_kept": _mean(_kept(looks)),
        "calibration_error": stated(judged).error,
        "brier_skill": brier_skill(judged),
    }
    outcomes = [outcome for one in followed for outcome in one.outcomes]
    after = [one for each in followed for one in each.judged if one.observation > 0]
    found["recovered_within_2"] = recovered(outcomes)
    updates = [update for one in followed for update in one.updates if update.tracked]
    scratch = [update for one in followed for update in one.updates if update.spawned]
    found["tracked_cpu_s_per_object"] = _ratio(
        sum(update.tracking_cpu_s for update in updates), sum(update.tracked for update in updates)
    )
    found["scratch_cpu_s_per_object"] = _ratio(
        sum(update.spawning_cpu_s for update in scratch), sum(update.spawned for update in scratch)
    )
    found["false_rejected_in_boxes"], found["true_kept_in_boxes"] = _in_boxes(looks)
    found["coverage"] = _ratio(
        sum(one.accepted and one.right and one.label in look.visible for look in looks for one in look.judged),
        sum(len(look.visible) for look in looks),
    )
    found["risk"] = _mean([not one.right for one in judged if one.accepted])
    found["hypotheses"], found["hypotheses_right"] = float(len(judged)), float(right.sum())
    for sayer, curve in curves([said(one) for one in judged], [one.right for one in judged]).items():
        found[f"{sayer}.area_under_roc"] = curve.area
        found[f"{sayer}.false_rejected_at_95_kept"] = curve.at(KEPT)
    for detector, trained in (("trained", True), ("simulated", False)):
        of = [look for look in looks if look.judged and look.judged[0].trained == trained]
        wrong = [one for look in of for one in look.judged if not one.right]
        found[f"{detector}.false_rejected"] = _mean([not one.accepted for one in wrong])
        found[f"{detector}.true_kept"] = _mean(_kept(of))
        found[f"{detector}.calibration_error"] = stated([one for look in of for one in look.judged]).error
    found |= _paper(trials)
    found["followed.calibration_error"] = stated(after).error
    found["followed.brier_skill"] = brier_skill(after)
    found["followed.false_rejected"] = _mean([not one.accepted for one in after if not one.right])
    for fault in dict.fromkeys(outcome.fault for outcome in outcomes):
        found[f"recovered_within_2.{fault}"] = recovered([one for one in outcomes if one.fault == fault])
    acted = [one for one in outcomes if one.happened and one.believed]
    found["outcome_believed"] = _mean([one.happened == one.believed for one in acted])
    matched = [one for each in followed for one in each.matched]
    found["greedy_as_hungarian"] = _mean([one.same for one in matched])
    found["greedy_share_of_best_score"] = _ratio(
        sum(one.greedy_score for one in matched), sum(one.best_score for one in matched)
    )
    return found


def recovered(outcomes: Sequence[Outcome]) -> float:
    """Share of what something happened to that was found again, or given up, within LOOKS observations."""
    return _mean([0 < one.handled_after <= LOOKS for one in outcomes])


def confusion(outcomes: Sequence[Outcome]) -> Mapping[tuple[str, str], int]:
    """(what happened to an action's target, what was believed) -> how often."""
    counts: dict[tuple[str, str], int] = {}
    for one in outcomes:
        if one.happened and one.believed:
            counts[one.happened, one.believed] = counts.get((one.happened, one.believed), 0) + 1
    return counts


def _kept(looks: Sequence[FirstLook]) -> list[bool]:
    """Of each object that some hypothesis has right: whether one of these was accepted."""
    kept: dict[tuple[int, str], bool] = {}
    for one in (one for look in looks for one in look.judged if one.right):
        kept[one.table, one.label] = kept.get((one.table, one.label), False) or one.accepted
    return list(kept.values())


def _in_boxes(looks: Sequence[FirstLook]) -> tuple[float, float]:
    """Rejected share of the false ones, kept share of the true ones, as the paper counts: by boxes, not poses."""
    of = [look.counted for look in looks]
    return (
        _ratio(sum(c.false_positives_rejected for c in of), sum(c.false_positives for c in of)),
        _ratio(sum(c.true_tracks_accepted for c in of), sum(c.true_tracks for c in of)),
    )


def _paper(trials: Sequence[FirstLook]) -> dict[str, float]:
    """The mean ratio of rejected false positives over the scenes, and its standard error over the trials."""
    per_trial = []
    for trial in sorted({one.trial for one in trials}):
        rates = [_in_boxes([one])[0] for one in trials if one.trial == trial]
        per_trial.append(_mean([rate for rate in rates if np.isfinite(rate)]))
    finite = [rate for rate in per_trial if np.isfinite(rate)]
    error = float(np.std(finite, ddof=1) / np.sqrt(len(finite))) if len(finite) > 1 else float("nan")
    return {
        "paper.false_rejected": _mean(finite),
        "paper.standard_error": error,
        "paper.true_kept": _in_boxes(trials)[1],
    }


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")
