"""What many runs come to: how much was sorted, at what cost, and what became of the rest."""

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake.summary_schema import is_manipulation_error
from sum_drake.types import Array

DRAWS = 10_000
"""Bootstrap draws."""
Row = Mapping[str, Any]
"""episode.json of one run, and `objects_asked`, how many objects it was to have."""


def batch_figures(rows: Sequence[Row], seed: int = 0) -> dict[str, float | None]:
    """Figures of episodes; shares are of objects, intervals by bootstrap over runs (95 %), `seed` is of its draws.

    A run that has no summary, as its process died, counts as one that sorted none of the objects it was to have, so
    that nothing is gained by a crash; what a run costs, and how many picks there are in an hour, is told by those that
    came to their own end. None is what cannot be told of so few.
    """
    ended = [row for row in rows if row["state"] == "ended"]
    told = [row for row in rows if "objects_total" in row]
    total = np.array([objects_of(row) for row in rows], float)
    done = np.array([row.get("objects_sorted", 0) for row in rows], float)
    trials = sum(row["manipulation_trials"] for row in told)
    moved = sum(attempt["outcome"] == "sorted" for row in ended for attempt in row["attempts"])
    low, high = share_interval(done, total, seed)
    simulated = sum(row["timing"]["sim_time_s"] or 0.0 for row in ended)
    violations = [sum(row["limits"]["violations"].values()) for row in told if row.get("limits")]
    figures = {
        "runs": len(rows),
        "runs_ended": len(ended),
        "runs_cleared": sum(row.get("outcome") == "cleared" for row in told),
        "crashes": sum(row["state"] in ("crashed", "failed", "lost") for row in rows),
        "hangs": sum(row["state"] == "timed_out" for row in rows),
        "objects": float(total.sum()),
        "objects_sorted_share": _share(done.sum(), total.sum()),
        "objects_sorted_low95": low,
        "objects_sorted_high95": high,
        "runs_complete_share": _share(float((done == total).sum()), len(rows)),
        "missorted": sum(row["objects_missorted"] for row in told),
        "trials": trials,
        "trials_per_object": _share(trials, done.sum()),
        "manipulation_errors": sum(row["manipulation_errors"] for row in told),
        "picks_per_simulated_hour": _share(3600.0 * moved, simulated),
        "limit_violations": sum(violations),
        "cpu_s_per_run_median": _median([row["cpu_s"] for row in ended]),
        "cpu_s_per_run_max": max((row["cpu_s"] for row in ended), default=float("nan")),
        **{f"{what}_median": _median([row["timing"][what] for row in ended]) for what in COSTS},
        "peak_memory_mib_max": max((row["peak_memory_mib"] for row in rows), default=float("nan")),
    }
    return {name: None if np.isnan(value) else float(value) for name, value in figures.items()}


def known_figures(rows: Sequence[Row]) -> dict[str, float]:
    """`batch_figures`, NaN for what cannot be told."""
    return {name: float("nan") if value is None else value for name, value in batch_figures(rows).items()}


COSTS = ("perception_cpu_s", "planning_cpu_s", "simulation_cpu_s", "sim_time_s")
"""Fields of a summary's `timing` of which medians are told, seconds."""


def objects_of(row: Row) -> int:
    """How many objects a run had; one whose process died: how many it was to have."""
    return int(row["objects_total"] if "objects_total" in row else row["objects_asked"])


def losses(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every object that did not end where it belongs, with its seed and the reason: rows of a table.

    The reason is that another's pick knocked it off, else the last try at it, else why it was never tried. Of a run
    that cannot tell, as its process died, all were lost, by no name.
    """
    found = []
    for row in rows:
        if "objects_total" not in row:
            lost = {"seed": row["seed"], "label": "any", "place": "unknown", "cause": RUN_LOST[row["state"]]}
            found += [lost] * objects_of(row)
        for one in row.get("objects", ()):
            if one["goal"] not in ("leave", one["place"]):
                why = _cause(one["label"], row)
                found.append({"seed": row["seed"], "label": one["label"], "place": one["place"], "cause": why})
    return found


RUN_LOST = {
    "failed": "the run failed", "crashed": "the run crashed", "timed_out": "the run timed out",
    "lost": "the cluster lost the run",
}  # fmt: skip
"""What took the objects of a run that did not come to its own end, by `episodes.STATES`."""


def _cause(label: str, row: Row) -> str:
    if row["state"] != "ended":
        return RUN_LOST[row["state"]]
    knocked = [a["label"] for a in row["attempts"] if label in a["knocked_off"]]
    tried = [a for a in row["attempts"] if label in (a["label"], a["object"])]
    executed = [a for a in tried if a["outcome"] not in ("infeasible", "moved")]
    if knocked:
        return "knocked off by another's pick"
    if executed:
        return f"{executed[-1]['outcome']}: {executed[-1]['reason']}"
    return f"not tried: {tried[-1]['reason']}" if tried else "not believed there"


def causes(rows: Sequence[Row]) -> dict[str, int]:
    """How many objects were lost to each cause, the most frequent first."""
    return dict(Counter(loss["cause"] for loss in losses(rows)).most_common())


def errors(rows: Sequence[Row]) -> dict[str, int]:
    """How many manipulation errors there were of each cause, the most frequent first.

    An object that slipped and was taken later was not lost, but is an error.
    """
    trials = [a for row in rows for a in row.get("attempts", ()) if a["outcome"] != "infeasible"]
    return dict(Counter(_error(trial) for trial in trials if is_manipulation_error(trial)).most_common())


def _error(trial: Mapping[str, Any]) -> str:
    return "knocked another off" if trial["knocked_off"] else f"{trial['outcome']}: {trial['reason']}"


def share_interval(done: Array, total: Array, seed: int = 0) -> tuple[float, float]:
    """The 95 % interval of sum(done) / sum(total), (n,) each; NaN for fewer than two runs.

    By bootstrap over the n runs, whose objects hang together, but no narrower than the exact interval (Clopper and
    Pearson) of as many independent objects: where nearly nothing is lost, draws of runs say too little, and two runs
    without a loss are no proof.
    """
    if len(done) < 2 or total.sum() == 0:
        return float("nan"), float("nan")
    drawn, exact = _drawn_interval(done, total, seed), exact_interval(float(done.sum()), float(total.sum()))
    return min(drawn[0], exact[0]), max(drawn[1], exact[1])


def _drawn_interval(part: Array, whole: Array, seed: int) -> tuple[float, float]:
    """Of sum(part) / sum(whole), by bootstrap over the runs alone."""
    kinds, count = np.unique(np.stack([part, whole], -1), axis=0, return_counts=True)
    drawn = np.random.default_rng(seed).multinomial(len(part), count / len(part), DRAWS) @ kinds
    low, high = np.quantile(drawn[:, 0] / np.maximum(drawn[:, 1], 1.0), (0.025, 0.975))
    return float(low), float(high)


def exact_interval(done: float, total: float) -> tuple[float, float]:
    """The 95 % interval of a share by Clopper and Pearson, of `total` independent tries."""
    from scipy.stats import beta

    low = 0.0 if done == 0 else float(beta.ppf(0.025, done, total - done + 1))
    high = 1.0 if done == total else float(beta.ppf(0.975, done + 1, total - done))
    return low, high


def pairs(a: Sequence[Row], b: Sequence[Row]) -> list[tuple[int, Row | None, Row | None]]:
    """Seed, A's run, B's run, of the seeds of either."""
    in_a, in_b = ({row["seed"]: row for row in rows} for rows in (a, b))
    return [(seed, in_a.get(seed), in_b.get(seed)) for seed in sorted(in_a.keys() | in_b.keys())]


def same_runs(a: Sequence[Row], b: Sequence[Row]) -> int:
    """How many runs of the same seeds are the same to the last bit, by their digests."""
    both = [(x, y) for _, x, y in pairs(a, b) if x is not None and y is not None]
    return sum(x.get("digest") is not None and x.get("digest") == y.get("digest") for x, y in both)


@dataclasses.dataclass(frozen=True)
class Gain:
    """How much more of the objects B sorted than A, in runs of the same seeds."""

    runs: int
    """Pairs of runs."""
    differ: int
    """Those in which one sorted more than the other."""
    share: float
    """Of all objects of the pairs."""
    low95: float
    high95: float
    """95 %, by bootstrap over pairs, so that what a pour makes hard for both cancels, but no narrower than that of as
    many independent objects: where few pairs differ, draws of them say too little."""
    p_value: float
    """How often signs drawn by chance would make a difference as large, either way: exact."""


def paired_difference(a: Sequence[Row], b: Sequence[Row], seed: int = 0) -> Gain | None:
    """What B gains over A. A run whose process died sorted nothing.

    None without two pairs of runs, or where two runs of a seed have not the same number of objects.
    """
    both = [(x, y) for _, x, y in pairs(a, b) if x is not None and y is not None]
    total = np.array([[objects_of(x), objects_of(y)] for x, y in both], float).reshape(-1, 2)
    if len(both) < 2 or (total[:, 0] != total[:, 1]).any() or not total.any():
        return None
    gain = np.array([y.get("objects_sorted", 0) - x.get("objects_sorted", 0) for x, y in both])
    objects = float(total[:, 0].sum())
    drawn = _drawn_interval(gain.astype(float), total[:, 0], seed)
    apart = _gain_interval(gain, objects)
    low, high = min(drawn[0], apart[0]), max(drawn[1], apart[1])
    return Gain(len(both), int(np.count_nonzero(gain)), float(gain.sum() / objects), low, high, _sign_flip(gain))


def _gain_interval(gains: Array, objects: float) -> tuple[float, float]:
    """Of the share of objects that one sorts and not the other, less that of the reverse, as if they were independent.

    From the exact intervals of both shares, whose distances from them are added in quadrature (Zou and Donner 2008).
    """
    more, less = float(gains[gains > 0].sum()), float(-gains[gains < 0].sum())
    (low_more, high_more), (low_less, high_less) = (exact_interval(part, objects) for part in (more, less))
    share, p_more, p_less = (more - less) / objects, more / objects, less / objects
    low = share - float(np.hypot(p_more - low_more, high_less - p_less))
    return low, share + float(np.hypot(high_more - p_more, p_less - low_less))


def _sign_flip(gains: Array) -> float:
    """Two-sided p-value of a sum of whole numbers (n,), each of which might as well have had the other sign."""
    sums = np.ones(1)  # how likely each sum is, from the least to the largest
    for size in np.abs(gains[gains != 0]).astype(int):
        sums = (np.pad(sums, (2 * size, 0)) + np.pad(sums, (0, 2 * size))) / 2
    values = np.arange(len(sums)) - len(sums) // 2
    return float(sums[np.abs(values) >= abs(gains.sum())].sum())


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")


def _median(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else float("nan")
