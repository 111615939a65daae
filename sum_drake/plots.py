"""Plots as SVG text: small, exact at any size, and at home in a file of their own as in a page of HTML."""

import dataclasses
import html
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sum_drake.svg import FAINT, INK, LINE, drawing, segment, words
from sum_drake.types import Array

PALETTE = (
    "#2f6fde", "#d1495b", "#1a8f5a", "#e08e0b", "#7a52c7", "#0e9aa7", "#8c5a2b", "#c44ec0",
    "#5c6773", "#7a9a01", "#ff7a59", "#3c4f9f", "#b08ea2", "#00a878", "#a89c1f", "#9e2a2b",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Series:
    """One line of a plot: points (n,) and (n,); one that is not finite leaves a gap."""

    name: str
    """As in the legend; a line without one is drawn grey, for comparison."""
    x: ArrayLike
    y: ArrayLike
    dashed: bool = False
    dots: bool = False
    """Mark each point; a title on each says its values."""


def line_plot(
    series: Sequence[Series],
    *,
    title: str,
    x_label: str,
    y_label: str,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    log_x: bool = False,
    size: tuple[int, int] = (560, 340),
) -> str:
    """Lines over a common pair of axes, with a legend at the right where any line has a name; SVG of `size` pixels.

    Ranges left out are those of the data. Raises ValueError for a logarithmic axis that reaches 0.
    """
    lines = [_Line.of(one) for one in series]
    x_low, x_high = x_range if x_range is not None else _extent([line.x for line in lines], log=log_x)
    y_low, y_high = y_range if y_range is not None else _extent([line.y for line in lines], from_zero=True)
    if log_x and x_low <= 0:
        raise ValueError(f"logarithmic x from {x_low}, expected more than 0")
    names = [one.name for one in series if one.name]
    legend = 26 + 7.0 * max((len(name) for name in names), default=-4) if names else 0.0
    width, height = size
    left, right, top, bottom = 56.0, width - 16.0 - legend, 34.0, height - 46.0

    def place_x(x: Array) -> Array:
        if log_x:
            share = np.log(np.maximum(x, x_low) / x_low) / math.log(x_high / x_low)
        else:
            share = (x - x_low) / (x_high - x_low)
        return np.asarray(left + (right - left) * share)

    def place_y(y: Array) -> Array:
        return np.asarray(bottom - (bottom - top) * (y - y_low) / (y_high - y_low))

    parts = [words(left, 20, title, size=14, weight=600)]
    for value in _log_ticks(x_low, x_high) if log_x else _ticks(x_low, x_high):
        at = float(place_x(np.array(value)))
        parts.append(segment(at, top, at, bottom, LINE))
        parts.append(words(at, bottom + 16, _number(value), anchor="middle", color=FAINT))
    for value in _ticks(y_low, y_high):
        at = float(place_y(np.array(value)))
        parts.append(segment(left, at, right, at, LINE))
        parts.append(words(left - 7, at + 4, _number(value), anchor="end", color=FAINT))
    parts.append(words((left + right) / 2, height - 10.0, x_label, anchor="middle", color=FAINT))
    parts.append(words(14, (top + bottom) / 2, y_label, anchor="middle", color=FAINT, turn=-90))
    # What leaves the axes is cut off, but for half a dot.
    window = f"{left - 3:g} {top - 3:g} {right - left + 6:g} {bottom - top + 6:g}"
    at_x, at_y, wide, high = window.split()
    parts.append(f"<svg x='{at_x}' y='{at_y}' width='{wide}' height='{high}' viewBox='{window}'>")
    colors = {name: PALETTE[row % len(PALETTE)] for row, name in enumerate(names)}
    for one, line in zip(series, lines, strict=True):
        parts.append(_drawn(one, line, place_x(line.x), place_y(line.y), colors.get(one.name, FAINT)))
    parts.append("</svg>")
    for row, one in enumerate(one for one in series if one.name):
        y = top + 8 + 17 * row
        parts.append(segment(right + 12, y, right + 28, y, colors[one.name], width=2.5, dashed=one.dashed))
        parts.append(words(right + 33, y + 4, one.name))
    return drawing(width, max(height, round(top + 17 * len(names) + 12)), title, parts)


def matrix_plot(
    matrix: ArrayLike,
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    title: str,
    x_label: str,
    y_label: str,
    cell: int = 30,
) -> str:
    """Counts (r, c) as a table shaded by the share of its row; SVG. Rows that are all 0 stay white."""
    counts = np.asarray(matrix)
    if counts.shape != (len(rows), len(columns)):
        raise ValueError(f"matrix {counts.shape} with {len(rows)} rows and {len(columns)} columns named")
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    margin = 12 + 6.4 * max((len(name) for name in rows), default=0)
    head = 12 + 6.4 * max((len(name) for name in columns), default=0)
    left, top = margin + 22, 34 + head
    width = max(left + cell * len(columns) + 12, 24 + 8.2 * len(title))
    height = top + cell * len(rows) + 30
    parts = [words(12, 20, title, size=14, weight=600)]
    parts.append(words(14, top + cell * len(rows) / 2, y_label, anchor="middle", color=FAINT, turn=-90))
    parts.append(words(left + cell * len(columns) / 2, height - 10, x_label, anchor="middle", color=FAINT))
    for j, name in enumerate(columns):
        parts.append(words(left + cell * (j + 0.5) + 4, top - 7, name, turn=-90))
    for i, name in enumerate(rows):
        parts.append(words(left - 7, top + cell * (i + 0.5) + 4, name, anchor="end"))
        for j, said in enumerate(columns):
            x, y, share = left + cell * j, top + cell * i, float(shares[i, j])
            parts.append(
                f"<rect x='{x:g}' y='{y:g}' width='{cell}' height='{cell}' fill='{_shade(share)}' stroke='{LINE}'>"
                f"<title>{html.escape(f'{name}, {said}: {counts[i, j]} ({share:.2f})')}</title></rect>"
            )
            if counts[i, j]:
                ink = "#fff" if share > 0.55 else INK
                parts.append(words(x + cell / 2, y + cell / 2 + 4, str(counts[i, j]), anchor="middle", color=ink))
    return drawing(round(width), round(height), title, parts)


def interval_plot(
    rows: Sequence[tuple[str, float, float, float]], *, title: str, x_label: str, width: int = 640
) -> str:
    """A row each of (name, value, low, high): a dot, and a line from low to high; SVG.

    0 is on the axis, and drawn. A row whose value is not finite has its name alone; ends that are not finite are not
    drawn.
    """
    numbers = np.array([[value, low, high] for _, value, low, high in rows], float).reshape(-1, 3)
    x_low, x_high = _extent([np.append(numbers[np.isfinite(numbers)], 0.0)])
    margin = 20 + 7.0 * max((len(name) for name, *_ in rows), default=0)
    left, right, top, pitch = margin, width - 20.0, 34.0, 22.0
    bottom = top + pitch * max(len(rows), 1)

    def place(x: float) -> float:
        return left + (right - left) * (x - x_low) / (x_high - x_low)

    parts = [words(12, 20, title, size=14, weight=600)]
    for value in _ticks(x_low, x_high):
        parts.append(segment(place(value), top, place(value), bottom, LINE))
        parts.append(words(place(value), bottom + 16, _number(value), anchor="middle", color=FAINT))
    parts.append(segment(place(0.0), top, place(0.0), bottom, FAINT))
    parts.append(words((left + right) / 2, bottom + 36, x_label, anchor="middle", color=FAINT))
    for i, (name, value, low, high) in enumerate(rows):
        y = top + pitch * (i + 0.5)
        parts.append(words(left - 8, y + 4, name, anchor="end"))
        if not math.isfinite(value):
            continue
        if math.isfinite(low) and math.isfinite(high):
            parts.append(segment(place(low), y, place(high), y, PALETTE[0], width=2))
        said = html.escape(f"{name}: {value:.3g} ({low:.3g} to {high:.3g})")
        parts.append(
            f"<circle cx='{place(value):g}' cy='{y:g}' r='4' fill='{PALETTE[0]}'><title>{said}</title></circle>"
        )
    return drawing(width, round(bottom + 48), title, parts)


@dataclasses.dataclass(frozen=True, eq=False)
class _Line:
    x: Array
    y: Array

    @staticmethod
    def of(series: Series) -> "_Line":
        x, y = np.asarray(series.x, dtype=float), np.asarray(series.y, dtype=float)
        if x.shape != y.shape or x.ndim != 1:
            raise ValueError(f"series {series.name!r}: x {x.shape} and y {y.shape}, expected (n,) and (n,)")
        return _Line(x, y)


def _drawn(series: Series, line: _Line, x: Array, y: Array, color: str) -> str:
    known = np.isfinite(x) & np.isfinite(y)
    parts, begun, path = [], False, []
    for i in range(len(x)):
        if known[i]:
            path.append(f"{'L' if begun else 'M'}{x[i]:.1f} {y[i]:.1f}")
        begun = bool(known[i])
    dash = " stroke-dasharray='5 4'" if series.dashed else ""
    if path:
        shown = f"<path d='{''.join(path)}' fill='none' stroke='{color}' stroke-width='1.8'{dash}>"
        parts.append(f"{shown}<title>{html.escape(series.name)}</title></path>")
    if series.dots:
        for i in map(int, np.flatnonzero(known)):
            said = html.escape(f"{series.name} {_number(line.x[i])}: {line.y[i]:.3f}".strip())
            parts.append(f"<circle cx='{x[i]:.1f}' cy='{y[i]:.1f}' r='3' fill='{color}'><title>{said}</title></circle>")
    return "".join(parts)


def _extent(values: Sequence[Array], *, from_zero: bool = False, log: bool = False) -> tuple[float, float]:
    """The range of what is finite; some range even where there is nothing, or only one value."""
    known = np.concatenate([np.zeros(0), *(value[np.isfinite(value)] for value in values)])
    low, high = (float(known.min()), float(known.max())) if len(known) else (float(log), 1.0)
    if from_zero:
        low, high = min(low, 0.0), high + 0.04 * (high - min(low, 0.0))
    if high > low:
        return low, high
    return (low / 2, low * 2) if log else (low - 0.5, low + 0.5)


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers within a range, about five."""
    rough = (high - low) / 5
    unit = 10 ** math.floor(math.log10(rough))
    step = next(factor * unit for factor in (1, 2, 2.5, 5, 10) if factor * unit >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    """Round numbers within a range, the fewer the more decades it spans."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    factors = (1, 2, 5) if high / low < 200 else (1, 3)
    return [f * 10.0**k for k in decades for f in factors if low * 0.999 <= f * 10.0**k <= high * 1.001]


def _number(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-12 else "0"


def _shade(share: float) -> str:
    """White to blue."""
    r, g, b = (round(255 + (end - 255) * math.sqrt(share)) for end in (37, 84, 176))
    return f"rgb({r},{g},{b})"
