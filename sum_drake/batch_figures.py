"""What many runs come to: how much was sorted, at what cost, and what became of the rest."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake.types import Array

DRAWS = 10_000
"""Bootstrap draws."""
Row = Mapping[str, Any]
"""episode.json of one run."""


def batch_figures(rows: Sequence[Row], seed: int = 0) -> dict[str, float | None]:
    """Figures of episodes; shares are of objects, intervals by bootstrap over runs (95 %), `seed` is of its draws.

    A run that has no summary, as its process died, counts as one that sorted none of as many objects as the others
    had, so that nothing is gained by a crash. None is what cannot be told of so few.
    """
    told = [row for row in rows if "objects_total" in row]
    usual = round(float(np.median([row["objects_total"] for row in told]))) if told else 0
    total = np.array([row.get("objects_total", usual) for row in rows], float)
    done = np.array([row.get("objects_sorted", 0) for row in rows], float)
    trials = sum(row["manipulation_trials"] for row in told)
    moved = sum(attempt["outcome"] == "sorted" for row in told for attempt in row["attempts"])
    low, high = share_interval(done, total, seed)
    simulated = sum(row["timing"]["sim_time_s"] or 0.0 for row in told)
    violations = [sum(row["limits"]["violations"].values()) for row in told if row.get("limits")]
    figures = {
        "runs": len(rows),
        "runs_ended": sum(row["state"] == "ended" for row in rows),
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
        "cpu_s_per_run_median": _median([row["cpu_s"] for row in rows]),
        "cpu_s_per_run_max": max((row["cpu_s"] for row in rows), default=float("nan")),
        **{f"{what}_median": _median([row["timing"][what] for row in told]) for what in COSTS},
        "peak_memory_mib_max": max((row["peak_memory_mib"] for row in rows), default=float("nan")),
    }
    return {name: None if np.isnan(value) else float(value) for name, value in figures.items()}


COSTS = ("perception_cpu_s", "planning_cpu_s", "simulation_cpu_s", "sim_time_s")
"""Fields of a summary's `timing` of which medians are told, seconds."""


def losses(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every object that did not end where it belongs, with its seed and the reason: rows of a table.

    The reason is that another's pick knocked it off, else the last try at it, else why it was never tried.
    """
    found = []
    for row in rows:
        for one in row.get("objects", ()):
            if one["goal"] not in ("leave", one["place"]):
                why = _cause(one["label"], row)
                found.append({"seed": row["seed"], "label": one["label"], "place": one["place"], "cause": why})
    return found


def _cause(label: str, row: Row) -> str:
    if row["state"] != "ended":
        return f"the run {row['state']}"
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


def share_interval(done: Array, total: Array, seed: int = 0) -> tuple[float, float]:
    """The 95 % interval of sum(done) / sum(total), (n,) each, by bootstrap over the n runs; NaN for fewer than two.

    Where every run's share is the same, draws of runs say nothing: then the exact interval (Clopper and Pearson) of as
    many independent objects, so that two runs without a loss are no proof.
    """
    if len(done) < 2 or total.sum() == 0:
        return float("nan"), float("nan")
    shares = done / np.maximum(total, 1.0)
    if (shares == shares[0]).all():
        return exact_interval(float(done.sum()), float(total.sum()))
    return _drawn_interval(done, total, seed)


def _drawn_interval(done: Array, total: Array, seed: int) -> tuple[float, float]:
    """By bootstrap alone."""
    drawn = np.random.default_rng(seed).integers(0, len(done), (DRAWS, len(done)))
    low, high = np.quantile(done[drawn].sum(1) / np.maximum(total[drawn].sum(1), 1.0), (0.025, 0.975))
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


def paired_difference(a: Sequence[Row], b: Sequence[Row], seed: int = 0) -> tuple[int, float, float, float] | None:
    """How much more of the objects B sorted than A in runs of the same seeds, and the 95 % interval of that share.

    By bootstrap over those runs, in which both are drawn together, so that what a pour makes hard for both cancels. A
    run whose process died sorted none of what the other run of its seed was about. None without two such runs that
    tell how many objects there were. Returns how many runs there are, the difference, the interval's ends, which lie
    together where all differ by the same: of few runs that says nothing.
    """
    total, gain = [], []
    for _, x, y in pairs(a, b):
        if x is not None and y is not None and (objects := x.get("objects_total") or y.get("objects_total")):
            total.append(float(objects))
            gain.append(float(y.get("objects_sorted", 0) - x.get("objects_sorted", 0)))
    if len(total) < 2:
        return None
    low, high = _drawn_interval(np.array(gain), np.array(total), seed)
    return len(total), sum(gain) / sum(total), low, high


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")


def _median(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else float("nan")
