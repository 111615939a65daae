"""Plots of what benches and batches have written, from their JSON alone; SVG."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sum_drake.bench import pose_figures
from sum_drake.plots import Series, interval_plot, line_plot
from sum_drake.reliability import reliability

WITHIN_M = np.linspace(0.0025, 0.2, 80)
"""Distances of the plot of poses, metres."""


def rows_of(data: Mapping[str, Any], table: str) -> list[dict[str, Any]]:
    """The rows of one table of a result."""
    return [row for row in data["rows"] if row["table"] == table]


def pose_plot(data: Mapping[str, Any]) -> str:
    """Share of estimates in right boxes whose distance is less than so much, whatever their angle, by method."""
    rows = [row for row in rows_of(data, "estimate") if not row["wrong_box"] and not row.get("detected", False)]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    off = {m: np.array([row["translation_m"] for row in rows if row["method"] == m], float) for m in methods}
    series = [Series(m, 100 * WITHIN_M, [(off[m] <= d).mean() for d in WITHIN_M]) for m in methods]
    return line_plot(
        series, title="Poses within a distance", x_label="cm", y_label="share", y_range=(0, 1), size=(640, 340)
    )  # fmt: skip


def trials_plot(data: Mapping[str, Any], metres: float) -> str:
    """The paper's experiment: share of estimates in the detector's boxes within a distance and a rotation bound."""
    rows = [row for row in rows_of(data, "estimate") if row.get("detected", False)]
    degrees, series = pose_figures.DEGREES, []
    for method in dict.fromkeys(row["method"] for row in rows):
        off = [[row[name] for row in rows if row["method"] == method] for name in ("translation_m", "rotation_deg")]
        series.append(Series(method, degrees, pose_figures.curve_of(off[0], off[1], metres, degrees)))
    return line_plot(
        series, title=f"The paper's scenes: poses within {centimetres(metres)} cm", x_label="rotation bound, degrees",
        y_label="share", x_range=(0, 180), y_range=(0, 1), size=(560, 300),
    )  # fmt: skip


def centimetres(metres: float) -> str:
    """As in names and titles of plots."""
    return f"{100 * metres:.0f}"


def gain_plot(data: Mapping[str, Any]) -> str:
    """What is lost without each ingredient: share of the objects sorted more than by what it is compared with."""
    figures = data["figures"]
    names = [name.removesuffix(".gain") for name in figures if name.endswith(".gain")]
    rows = []
    for name in names:
        gain = (figures[f"{name}.gain{end}"] for end in ("", "_low95", "_high95"))
        value, low, high = (float("nan") if one is None else float(one) for one in gain)
        rows.append((name.replace("_", " "), value, low, high))
    return interval_plot(rows, title="Objects sorted more", x_label="share of the objects")


def belief_plot(data: Mapping[str, Any]) -> str:
    """How often what was stated came true."""
    rows = rows_of(data, "hypothesis")
    told = reliability([row["probability"] for row in rows], [row["right"] for row in rows])
    diagonal = Series("", [0, 1], [0, 1], dashed=True)
    return line_plot(
        [diagonal, Series("belief", told.stated, told.observed, dots=True)],
        title="Stated probability, and how often it came true",
        x_label="stated", y_label="came true", x_range=(0, 1), y_range=(0, 1),
    )  # fmt: skip


def plan_plot(data: Mapping[str, Any]) -> str:
    """Share of planning problems that is solved within so many CPU seconds."""
    seconds = np.geomspace(0.01, 10.0, 80)
    kinds = {"pick": [row["cpu_s"] if row["solved"] else np.inf for row in rows_of(data, "query")]}
    for row in rows_of(data, "problem"):
        kinds.setdefault(row["kind"], []).append(row["time_s"] if row["solved"] else np.inf)
    series = [Series(kind, seconds, [(np.array(t) <= s).mean() for s in seconds]) for kind, t in kinds.items()]
    return line_plot(
        series, title="Paths found", x_label="CPU s", y_label="share", y_range=(0, 1), log_x=True, size=(640, 340)
    )  # fmt: skip


def lost_plot(*batches: Mapping[str, Any]) -> str:
    """Objects lost, over objects poured, run after run; by how many were poured at a time."""
    series = []
    for batch in batches:
        asked = batch["settings"]["objects"]
        poured = np.array([0, *(row.get("objects_total", asked) for row in batch["episodes"])])
        done = np.array([0, *(row.get("objects_sorted", 0) for row in batch["episodes"])])
        series.append(Series(f"{asked} at a time", np.cumsum(poured), np.cumsum(poured - done)))
    return line_plot(series, title="Objects lost", x_label="objects poured", y_label="objects lost")
