"""report.html of `sum-drake bench plan`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake import page
from sum_drake.bench.aims import Aims, figure_table, number
from sum_drake.plots import Series, line_plot

Rows = Sequence[Mapping[str, Any]]


def report_page(rows: Rows, found: Mapping[str, float], aims: Aims) -> str:
    """The page, of the tables' rows and the figures."""
    of: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        of.setdefault(row["table"], []).append(row)
    queries, problems = of.get("query", []), of.get("problem", [])
    parts = [
        "<h1>Planning and picks with true poses</h1>",
        "<p>What is measured: inverse kinematics of reachable poses of the hand, paths that picks from poured tables "
        "ask for, paths in and out of shelves and cages and under tables, and picks in simulated physics, of objects "
        "alone and in clutter, whose true poses are told.</p>",
        page.tiles([(name.replace("_", " "), number(value)) for name, value in found.items() if name in aims]),
        figure_table(found, aims),
        '<div class="plots">',
        _shares(
            {kind: [q for q in queries if q["kind"] == kind] for kind in sorted({q["kind"] for q in queries})},
            "cpu_s",
            "Paths that picks ask for",
            1.0,
        ),
        _shares(
            {kind: [p for p in problems if p["kind"] == kind] for kind in sorted({p["kind"] for p in problems})},
            "time_s",
            "Shelves, cages, under tables",
            10.0,
        ),
        "</div>",
        "<h2>Picks, by object</h2>",
        page.table(
            ("setting", "object", "picks", "worked"),
            [
                (row["setting"], page.text(row["label"]), str(row["picks"]), str(row["succeeded"]))
                for row in of.get("pick_object", [])
            ],
        ),
        "<h2>Picks that failed, by cause</h2>",
        page.table(
            ("setting", "phase", "cause", "how many", "object and seed"),
            [
                (
                    row["setting"],
                    *(
                        page.text(text)
                        for text in (row["phase"], row["cause"], str(row["count"]), ", ".join(row["which"]))
                    ),
                )
                for row in of.get("pick_failure", [])
            ],
        ),
        "<h2>Paths that were not found</h2>",
        page.table(
            ("request", "CPU s", "why"),
            [
                (page.text(row["request"]), f"{row['cpu_s']:.2f}", page.text(row["reason"]))
                for row in queries
                if not row["solved"]
            ]
            + [
                (page.text(row["request"]), f"{row['time_s']:.2f}", page.text(row["message"]))
                for row in problems
                if not row["solved"]
            ],
        ),
        _why_not(queries, problems),
    ]
    return page.page("Planning", parts)


def _shares(of: Mapping[str, Rows], seconds: str, title: str, limit: float) -> str:
    """Share solved within so many CPU seconds, a line for each kind."""
    at = np.geomspace(0.01, limit, 40)
    series = [
        Series(name, at.tolist(), [float(np.mean([r["solved"] and r[seconds] <= t for r in rows])) for t in at])
        for name, rows in of.items()
    ]
    if not series:
        return ""
    return line_plot(series, title=title, x_label="CPU s", y_label="solved", y_range=(0.0, 1.0), log_x=True,
                     size=(420, 280))  # fmt: skip


def _why_not(queries: Rows, problems: Rows) -> str:
    reasons = Counter(row["reason"] for row in queries if not row["solved"])
    reasons += Counter("hard set" for row in problems if not row["solved"])
    if not reasons:
        return "<p>Every path was found.</p>"
    return "<p>" + page.text(", ".join(f"{count} {reason}" for reason, count in reasons.most_common())) + "</p>"
