"""Words and cells that all parts of a run's report share."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake import page
from sum_drake.drawing import label_color
from sum_drake.making_way import MOVE
from sum_drake.types import LEAVE

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

OUTCOME_KINDS = {"sorted": "good", "moved": "good", "infeasible": "plain", None: "plain"}
"""Chips of an attempt's outcomes; all others are bad."""


def name(label: str, catalogue: "Catalogue") -> str:
    """A label with its colour, HTML."""
    r, g, b = label_color(label, catalogue)
    return f'<span class="name"><i style="background:rgb({r},{g},{b})"></i>{page.text(label)}</span>'


def outcome_chip(outcome: str, summary: Mapping[str, Any] | None = None) -> str:
    """How a run ended, HTML; good if all that was to be sorted was, as far as a summary tells."""
    kind = {"cleared": "good", "unfinished": "poor"}.get(outcome, "bad")
    if summary is not None and kind == "good" and summary["objects_sorted"] < summary["objects_total"]:
        kind = "poor"
        outcome += f", {summary['objects_sorted']} of {summary['objects_total']} sorted"
    return page.chip(outcome, kind)


def place_chip(row: Mapping[str, Any]) -> str:
    """Where an object ended, a row of `objects` in summary.json, HTML; good if it belongs there."""
    kind = "good" if row["place"] == row["goal"] else "plain" if row["goal"] == LEAVE else "bad"
    return page.chip(row["place"], kind)


def tried_chip(outcome: str | None) -> str:
    """How an attempt ended, HTML."""
    return page.chip(outcome or "unknown", OUTCOME_KINDS.get(outcome, "bad"))


def reason(row: Mapping[str, Any]) -> str:
    """How an attempt ended by what the robot knows, and, of one that was more than a pick and place, what it was."""
    said = str(row["reason"]).replace("_", " ")
    return f"moved out of the way: {said}" if row["kind"] == MOVE else said


def believed(outcomes: Mapping[str, float] | None) -> str:
    """What the belief made of an attempt: its likeliest outcomes."""
    likely = sorted((outcomes or {}).items(), key=lambda item: -item[1])
    return ", ".join(f"{outcome} {share:.2f}" for outcome, share in likely[:2] if share >= 0.05)


def count(number: int, noun: str) -> str:
    """As in "2 looks"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def millimetres(value: float | None) -> str:
    """Of metres."""
    return "" if value is None else f"{1000 * value:.1f} mm"


def degrees(value: float | None) -> str:
    """Of radians."""
    return "" if value is None else f"{np.degrees(value):.1f}°"


def seconds(value: float | None) -> str:
    """Seconds, or that they are not known."""
    return "unknown" if value is None else f"{value:.1f} s"


def cost_name(of: str) -> str:
    """Of a field of `timing`, in words."""
    return {"wall_s": "wall clock", "sim_time_s": "simulated time"}.get(
        of, of.removesuffix("_cpu_s") + " (CPU)" if of.endswith("_cpu_s") else of
    )
