"""Belief over time: what became of each track's probability, look by look."""

import dataclasses
import html
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sum_drake.belief import ENDS
from sum_drake.drawing import label_color, verdict
from sum_drake.svg import FAINT, INK, LINE, drawing, segment, titled, words
from sum_drake.types import Gone, Perception, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

SHOWN = 0.05
"""Tracks that were never more probable than that are counted, not drawn."""
_COLUMN, _ROW, _BAR, _TOP = 56, 31, 48, 30


@dataclasses.dataclass(frozen=True, eq=False)
class Lane:
    """One track through the looks of a run."""

    id: int
    label: str
    states: tuple[tuple[int, Track], ...]
    """(index of the look, the track after it)."""
    end: tuple[int, Gone] | None
    """(index of the look that ended it, why)."""

    @property
    def likeliest(self) -> float:
        """Its highest probability."""
        return max(track.probability for _, track in self.states)


def lanes(looks: Sequence[Perception]) -> list[Lane]:
    """All tracks that the looks of a run held, in the order of their ids."""
    states: dict[int, list[tuple[int, Track]]] = {}
    ends: dict[int, tuple[int, Gone]] = {}
    for i, look in enumerate(looks):
        for track in look.posterior.tracks:
            states.setdefault(track.id, []).append((i, track))
        for gone in look.posterior.gone:
            ends[gone.track] = (i, gone)
    return [Lane(id, held[0][1].label, tuple(held), ends.get(id)) for id, held in sorted(states.items())]


def belief_chart(looks: Sequence[Perception], catalogue: "Catalogue") -> str:
    """A lane for each track that was worth a thought, a bar for its probability after each look; SVG, "" for none.

    Bars are filled where the track was accepted, pale and dashed where it was not. A lane that ends says why.
    """
    shown = [lane for lane in lanes(looks) if lane.likeliest >= SHOWN]
    if not shown:
        return ""
    left = 46 + 7.6 * max(len(lane.label) + len(str(lane.id)) for lane in shown)
    width, height = left + _COLUMN * len(looks) + 36, _TOP + _ROW * len(shown) + 6
    parts = []
    for i, look in enumerate(looks):
        said = f"look {look.step}"
        parts.append(words(left + _COLUMN * i + _BAR / 2, 18, said, anchor="middle", color=FAINT))
    for row, lane in enumerate(shown):
        parts.append(_lane(lane, looks, left, _TOP + _ROW * row, width, catalogue))
    return drawing(round(width), round(height), "Probability of each track after each look", parts)


def left_out(looks: Sequence[Perception]) -> int:
    """How many tracks the chart does not show."""
    return sum(lane.likeliest < SHOWN for lane in lanes(looks))


def reasons(looks: Sequence[Perception]) -> dict[str, str]:
    """The reasons for which tracks of these looks ended, and what each means."""
    said = dict.fromkeys(gone.reason for look in looks for gone in look.posterior.gone)
    return {reason: ENDS.get(reason, reason) for reason in said}


def _lane(
    lane: Lane, looks: Sequence[Perception], left: float, top: float, width: float, catalogue: "Catalogue"
) -> str:
    color = "rgb({},{},{})".format(*label_color(lane.label, catalogue))
    middle = top + _ROW / 2
    parts = [
        segment(8, top + _ROW, width - 8, top + _ROW, LINE),
        f"<rect x='8' y='{middle - 5.5:g}' width='11' height='11' rx='3' fill='{color}'/>",
        words(25, middle + 4, lane.label),
        words(left - 10, middle + 4, str(lane.id), anchor="end", color=FAINT),
    ]
    for i, track in lane.states:
        said = f"{lane.label}, track {lane.id}, look {looks[i].step}: {track.probability:.3f}, "
        said += verdict(track, looks[i].posterior.observation)
        parts.append(titled(_bar(left + _COLUMN * i, top + 3, track, color), said))
    if lane.end is not None:
        i, gone = lane.end
        end = words(left + _COLUMN * i, middle + 4, f"\N{MULTIPLICATION X} {gone.reason}", color=FAINT)
        parts.append(titled(end, f"{lane.label}, track {lane.id}: {ENDS.get(gone.reason, gone.reason)}"))
    return "".join(parts)


def _bar(x: float, y: float, track: Track, color: str) -> str:
    """A box, filled from its bottom as far as the track is probable, and the probability in figures."""
    high = _ROW - 7
    level = high * min(max(track.probability, 0.0), 1.0)
    fill = html.escape(color)
    opacity, edge = (0.5, f"stroke='{fill}' stroke-width='1.6'") if track.accepted else (
        0.16, f"stroke='{FAINT}' stroke-dasharray='3 3'")  # fmt: skip
    box = f"<rect x='{x:g}' y='{y:g}' width='{_BAR}' height='{high}' rx='2' fill='none' {edge}/>"
    filled = f"<rect x='{x:g}' y='{y + high - level:.1f}' width='{_BAR}' height='{level:.1f}' rx='2' fill='{fill}' "
    figure = words(
        x + _BAR / 2, y + high / 2 + 4.5, f"{track.probability:.2f}", anchor="middle",
        weight=600 if track.accepted else 400, color=INK if track.accepted else FAINT,
    )  # fmt: skip
    return f"{filled}fill-opacity='{opacity}'/>{box}{figure}"
