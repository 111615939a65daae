"""What there is to plot of results of benches and batches, from their JSON alone, and the plots; SVG."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sum_drake.bench import pose_figures
from sum_drake.bench.reject_figures import SAYERS, curves
from sum_drake.plots import Series, interval_plot, line_plot
from sum_drake.reliability import reliability
from sum_drake.types import Array

WITHIN_M = np.linspace(0.0025, 0.2, 80)
"""Distances of the plot of poses, metres."""
Result = Mapping[str, Any]
"""What a results.json or batch.json holds."""


def rows_of(data: Result, table: str) -> list[dict[str, Any]]:
    """The rows of one table of a result."""
    return [row for row in data["rows"] if row["table"] == table]


def _estimates(data: Result, *, detected: bool) -> dict[str, tuple[Array, Array]]:
    """By method, errors of the estimates in metres and degrees, in the detector's boxes or in those that are off."""
    rows = [row for row in rows_of(data, "estimate") if row.get("detected", False) == detected]
    right = [row for row in rows if detected or not row["wrong_box"]]
    found = {}
    for method in dict.fromkeys(row["method"] for row in right):
        own = [row for row in right if row["method"] == method]
        far, turned = (np.array([row[error] for row in own], float) for error in ("translation_m", "rotation_deg"))
        found[method] = far, turned
    return found


def pose_series(data: Result) -> list[Series]:
    """Share of estimates in right boxes whose distance is less than so many centimetres, whatever their angle."""
    off = _estimates(data, detected=False)
    return [Series(m, 100 * WITHIN_M, [(metres <= d).mean() for d in WITHIN_M]) for m, (metres, _) in off.items()]


def pose_plot(data: Result) -> str:
    """`pose_series`."""
    return line_plot(
        pose_series(data), title="Poses within a distance", x_label="cm", y_label="share", y_range=(0, 1),
        size=(640, 340),
    )  # fmt: skip


def trials_series(data: Result, metres: float) -> list[Series]:
    """The paper's experiment: share of estimates in the detector's boxes within a distance and so many degrees."""
    degrees, off = pose_figures.DEGREES, _estimates(data, detected=True)
    return [Series(m, degrees, pose_figures.curve_of(far, turned, metres, degrees)) for m, (far, turned) in off.items()]


def trials_plot(data: Result, metres: float) -> str:
    """`trials_series`."""
    return line_plot(
        trials_series(data, metres), title=f"The paper's scenes: poses within {centimetres(metres)} cm",
        x_label="rotation bound, degrees", y_label="share", x_range=(0, 180), y_range=(0, 1), size=(560, 300),
    )  # fmt: skip


def centimetres(metres: float) -> str:
    """As in names and titles of plots."""
    return f"{100 * metres:.0f}"


def gain_rows(data: Result) -> list[tuple[str, float, float, float]]:
    """Of each variant of ablations: share of the objects sorted more than by what it is compared with, and its ends."""
    figures = data["figures"]
    rows = []
    for name in [name.removesuffix(".gain") for name in figures if name.endswith(".gain")]:
        gain = (figures[f"{name}.gain{end}"] for end in ("", "_low95", "_high95"))
        value, low, high = (float("nan") if one is None else float(one) for one in gain)
        rows.append((name.replace("_", " "), value, low, high))
    return rows


def gain_plot(data: Result) -> str:
    """`gain_rows`."""
    return interval_plot(gain_rows(data), title="Objects sorted more", x_label="share of the objects")


def belief_series(data: Result) -> list[Series]:
    """How often what was stated came true, beside what it should be."""
    rows = rows_of(data, "hypothesis")
    told = reliability([row["probability"] for row in rows], [row["right"] for row in rows])
    return [Series("", [0, 1], [0, 1], dashed=True), Series("belief", told.stated, told.observed, dots=True)]


def belief_plot(data: Result) -> str:
    """`belief_series`."""
    return line_plot(
        belief_series(data), title="Stated probability, and how often it came true",
        x_label="stated", y_label="came true", x_range=(0, 1), y_range=(0, 1),
    )  # fmt: skip


def telling_series(data: Result) -> list[Series]:
    """Share of the wrong hypotheses that is rejected over the share of the right ones that is kept, by what tells."""
    rows = rows_of(data, "hypothesis")
    told = curves([row["said"] for row in rows], [row["right"] for row in rows])
    return [Series(SAYERS[sayer], curve.kept, curve.rejected) for sayer, curve in told.items()]


def telling_plot(data: Result) -> str:
    """`telling_series`."""
    return line_plot(
        telling_series(data), title="Wrong ones rejected, right ones kept", x_label="share of right ones kept",
        y_label="share of wrong ones rejected", x_range=(0, 1), y_range=(0, 1), size=(560, 380),
    )  # fmt: skip


def plan_series(data: Result) -> list[Series]:
    """Share of planning problems that is solved within so many CPU seconds, by kind."""
    seconds = np.geomspace(0.01, 10.0, 80)
    kinds = {"pick": [row["cpu_s"] if row["solved"] else np.inf for row in rows_of(data, "query")]}
    for row in rows_of(data, "problem"):
        kinds.setdefault(row["kind"], []).append(row["time_s"] if row["solved"] else np.inf)
    return [Series(kind, seconds, [(np.array(t) <= s).mean() for s in seconds]) for kind, t in kinds.items()]


def plan_plot(data: Result) -> str:
    """`plan_series`."""
    return line_plot(
        plan_series(data), title="Paths found", x_label="CPU s", y_label="share", y_range=(0, 1), log_x=True,
        size=(640, 340),
    )  # fmt: skip


def lost_series(*batches: Result) -> list[Series]:
    """Objects lost, over objects poured, run after run; by how many were poured at a time."""
    series = []
    for batch in batches:
        asked = batch["settings"]["objects"]
        poured = np.array([0, *(row.get("objects_total", asked) for row in batch["episodes"])])
        done = np.array([0, *(row.get("objects_sorted", 0) for row in batch["episodes"])])
        series.append(Series(f"{asked} at a time", np.cumsum(poured), np.cumsum(poured - done)))
    return series


def lost_plot(*batches: Result) -> str:
    """`lost_series`."""
    return line_plot(lost_series(*batches), title="Objects lost", x_label="objects poured", y_label="objects lost")
