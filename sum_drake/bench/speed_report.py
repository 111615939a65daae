"""report.html of `sum-drake bench speed`."""

from collections.abc import Mapping, Sequence
from typing import Any

from sum_drake import page
from sum_drake.bench.aims import Aims, figure_table, number
from sum_drake.plots import Series, line_plot

Rows = Sequence[Mapping[str, Any]]


def report_page(rows: Rows, found: Mapping[str, float], aims: Aims) -> str:
    """The page, of the tables' rows and the figures."""
    of: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        of.setdefault(row["table"], []).append(row)
    parts = [
        "<h1>What a pose costs</h1>",
        page.tiles([(name.replace("_", " "), number(value)) for name, value in found.items() if name in aims]),
        figure_table(found, aims),
        '<div class="plots">',
        _line(of["particles"], "particles", "particles", "cpu_s", "An object, by particles at the start", "CPU s"),
        _line(
            _kind(of["renders"], "tile"),
            "size",
            "pixels a side",
            "cpu_ms",
            "A particle, by tile size in pixels",
            "CPU ms",
        ),
        _line(
            _kind(of["renders"], "triangles"),
            "size",
            "triangles",
            "cpu_ms",
            "A particle, by triangles of the mesh",
            "CPU ms",
        ),
        _line(
            _kind(of["renders"], "tile"),
            "size",
            "pixels a side",
            "error",
            "Error of the score, by tile size",
            "of inliers / N",
        ),
        _objects(of["objects"]),
        "</div>",
        "<h2>Where the time of an estimate goes</h2>",
        page.table(("part", "share"), [(page.text(row["part"]), f"{row['share']:.0%}") for row in of["shares"]]),
        "<h2>A particle, from its pose to its score</h2>",
        "<p>Each alone, many in one picture of tiles, or looked up among renders made once; the error is of inliers "
        "/ N, beside renders at the observation's own pixels (exact).</p>",
        page.table(
            ("way", "size", "CPU ms", "error"),
            [
                (row["kind"], str(row["size"] or ""), f"{row['cpu_ms']:.3f}", f"{row['error']:.4f}")
                for row in of["renders"]
            ],
        ),
        "<h2>Memory</h2>",
        page.table(
            ("models", "MiB of all", "MiB each", "CPU s to make one ready"),
            [
                (str(row["models"]), f"{row['peak_mib']:.0f}", f"{row['mib_per_model']:.1f}", f"{row['warm_s']:.2f}")
                for row in of["memory"]
            ],
        ),
    ]
    return page.page("Speed", parts)


def _kind(rows: Rows, kind: str) -> Rows:
    return [row for row in rows if row["kind"] == kind]


def _line(rows: Rows, x: str, x_label: str, y: str, title: str, y_label: str) -> str:
    values = [row[y] for row in rows]
    return line_plot(
        [Series("", [row[x] for row in rows], values, dots=True)],
        title=title,
        x_label=x_label,
        y_label=y_label,
        y_range=(0.0, 1.1 * max(values)),
        size=(420, 280),
    )


def _objects(rows: Rows) -> str:
    by = {n: [row for row in rows if row["processes"] == n] for n in (1, 2)}
    return line_plot(
        [
            Series(f"{n} process{'es' if n > 1 else ''}", [r["objects"] for r in part], [r["wall_s"] for r in part],
                   dots=True)
            for n, part in by.items()
        ],
        title="Several objects at once",
        x_label="objects",
        y_label="wall s",
        y_range=(0.0, 1.1 * max(row["wall_s"] for row in rows)),
        size=(420, 280),
    )  # fmt: skip
