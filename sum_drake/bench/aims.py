"""What a bench's figures are to reach, and whether they do."""

import math
from collections.abc import Mapping

from sum_drake import page

Aims = Mapping[str, tuple[str, float]]
"""Name of a figure -> "at least" or "at most", and a number."""


def aim(aims: Aims, name: str, value: float) -> str:
    """What a figure is to reach, and whether it does; empty where nothing is asked of it."""
    if name not in aims:
        return ""
    words, goal = aims[name]
    if math.isnan(value):
        return f"{words} {goal:g}: nothing to measure it on"
    return f"{words} {goal:g}: {'reached' if reached(aims, name, value) else 'missed'}"


def reached(aims: Aims, name: str, value: float) -> bool:
    """Whether a figure that something is asked of is where it should be."""
    words, goal = aims[name]
    return value >= goal if words == "at least" else value <= goal


def number(value: float, digits: int = 3) -> str:
    """A figure to so many significant digits; more where it would read 1 without being it, as .9999 would."""
    while float(shown := f"{value:.{digits}g}") == 1.0 != value and digits < 12:
        digits += 1
    return shown


def figure_table(found: Mapping[str, float], aims: Aims) -> str:
    """The figures as a table of a page, with what they are to reach; HTML."""
    rows = []
    for name, value in found.items():
        kind = "plain" if math.isnan(value) else "good" if name in aims and reached(aims, name, value) else "bad"
        chip = page.chip(aim(aims, name, value), kind) if name in aims else ""
        rows.append((page.text(name), "" if math.isnan(value) else number(value, 4), chip))
    return page.table(("figure", "value", "aim"), rows)


def format_figures(found: Mapping[str, float], aims: Aims) -> str:
    """The figures as aligned text, with what they are to reach; "-" for what cannot be told."""
    width = max(map(len, found), default=0)
    lines = []
    for name, value in found.items():
        words = aim(aims, name, value)
        shown = "-" if math.isnan(value) else f"{value:.3f}"
        lines.append(f"{name:{width}}  {shown:>8}" + (f"  {words}" if words else ""))
    return "\n".join(lines)
