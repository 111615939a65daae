"""The table seen from above: where things are believed to be at the end of a run, and where they were put."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake.belief_chart import SHOWN
from sum_drake.drawing import footprint, label_color
from sum_drake.geometry import apply
from sum_drake.report_parts import OUTCOME_KINDS
from sum_drake.run_folder import RunFolder, Tried
from sum_drake.svg import FAINT, INK, LINE, drawing, segment, titled, words
from sum_drake.types import Array, Region, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

SCALE = 280.0
"""Pixels a metre."""
_MARGIN = 0.07
"""Around all that is drawn, metres."""
_ROBOT = 0.27
"""Radius of the robot's base, metres."""
_EDGES = {"good": "#1a7f4b", "bad": "#b3261e", "plain": FAINT}


def from_above(run: RunFolder, catalogue: "Catalogue") -> str:
    """The last belief, regions and places seen along -z, the robot's x axis upwards; SVG, "" where no look was logged.

    Filled: accepted; dashed: tracks that were not. Dotted with a number: where that attempt let something go, ringed by
    how it ended. Crosses: where things truly lie.
    """
    if not run.perceptions:
        return ""
    tracks = [track for track in run.perceptions[-1].posterior.tracks if track.probability >= SHOWN]
    put = [one for one in run.tried() if _released(one)]
    regions = run.regions()
    objects = [] if run.summary is None else run.summary["objects"]
    seen = [track.X_WO[:3, 3] for track in tracks] + [_place(one)[:3, 3] for one in put]
    view = _View.of(regions, [*seen, *(np.array(row["p_W"]) for row in objects)])
    # The table first: other regions may lie within it.
    by_size = sorted(regions.values(), key=lambda region: -float(np.prod(region.half_extents[:2])))
    parts = [_robot(view)] + [_region(region, view) for region in by_size]
    parts += [_placed(one, view, catalogue) for one in put]
    parts += [_believed(track, view, catalogue) for track in sorted(tracks, key=lambda track: track.probability)]
    parts += _numbers(put, view)
    # Crosses last: an object that went where it was to go lies under its number.
    parts += [_truth(row, view, catalogue) for row in objects if view.holds(row["p_W"])]
    return drawing(*view.size, "The table seen from above after the last look", parts)


def above_legend(*runs: RunFolder) -> str:
    """What the marks of such drawings mean, HTML: crosses only where a run has some."""
    words = "Filled: accepted after the last look; dashed: not accepted."
    if any(_released(one) for run in runs for one in run.tried()):
        words += " Dotted with a number: where that attempt let go, its ring green if it ended as it was meant to."
    if any(run.summary is not None and run.summary["objects"] for run in runs):
        words += " Crosses: where things truly lie."
    return f'<p class="legend">{words}</p>'


def _released(one: Tried) -> bool:
    return one.attempt is not None and one.attempt.action is not None and one.attempt.action.released


def _place(one: Tried) -> Array:
    """X_WO (4, 4) where an attempt let go."""
    assert one.attempt is not None and one.attempt.action is not None
    return one.attempt.action.X_WO_place


class _View:
    """World to pixels: y to the left, x upwards."""

    def __init__(self, low: Array, high: Array) -> None:
        self._low, self._high = low, high

    @staticmethod
    def of(regions: Mapping[str, Region], p_Ws: Sequence[Array]) -> "_View":
        """Holds all of these, p_Ws (3,) as far as 3 m from the robot, and the robot."""
        points = [np.array([[-_ROBOT, -_ROBOT], [_ROBOT, _ROBOT]])]
        points += [region.p_W[:2] + np.outer([-1, 1], region.half_extents[:2]) for region in regions.values()]
        points += [np.clip(p_W[None, :2], -3.0, 3.0) + np.outer([-1, 1], [0.12, 0.12]) for p_W in p_Ws]
        every = np.concatenate(points)
        return _View(every.min(0) - _MARGIN, every.max(0) + _MARGIN)

    @property
    def size(self) -> tuple[int, int]:
        high, wide = SCALE * (self._high - self._low)
        return round(wide), round(high)

    def holds(self, p_W: Sequence[float]) -> bool:
        return bool(np.all(np.array(p_W)[:2] >= self._low) and np.all(np.array(p_W)[:2] <= self._high))

    def pixels(self, p_W: Any) -> Array:
        """(n, 2) of points (n, 2) or (n, 3)."""
        p = np.atleast_2d(np.asarray(p_W, dtype=float))[:, :2]
        return np.asarray(SCALE * (self._high - p)[:, ::-1])

    def path(self, outlines: Sequence[Array]) -> str:
        def one(outline: Array) -> str:
            return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in self.pixels(outline)) + "Z"

        return "".join(map(one, outlines))


def _robot(view: _View) -> str:
    ((x, y),) = view.pixels([0.0, 0.0])
    disc = f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{SCALE * _ROBOT:.1f}' fill='#f0f2f4' stroke='{LINE}'/>"
    ahead = f"<path d='M{x - 9:.1f} {y - 44:.1f}l9 -14l9 14z' fill='{FAINT}'/>"
    return disc + ahead + words(x, y + 4, "robot", anchor="middle", color=FAINT)


def _region(region: Region, view: _View) -> str:
    (left, top), (right, bottom) = view.pixels(region.p_W[:2] + np.outer([1, -1], region.half_extents[:2]))
    fill = "#f6efe4" if region.name == "table" else "#e6eef7"
    box = f"<rect x='{left:.1f}' y='{top:.1f}' width='{right - left:.1f}' height='{bottom - top:.1f}' rx='4' "
    said = words(left + 7, top + 17, region.name, color=FAINT)
    return f"{box}fill='{fill}' stroke='{FAINT}' stroke-opacity='0.5'/>{said}"


def _outline(label: str, X_WO: Array, view: _View, catalogue: "Catalogue", style: str) -> str:
    """What an object covers, or a dot where nothing is known of its shape."""
    color = "rgb({},{},{})".format(*label_color(label, catalogue))
    if label in catalogue:
        mesh = catalogue[label].load_mesh()
        path = view.path(footprint(apply(X_WO, np.asarray(mesh.vertices)), np.asarray(mesh.faces)))
        return f"<path d='{path}' fill='{color}' fill-rule='evenodd' stroke='{color}' {style}/>"
    ((x, y),) = view.pixels(X_WO[None, :3, 3])
    return f"<circle cx='{x:.1f}' cy='{y:.1f}' r='12' fill='{color}' stroke='{color}' {style}/>"


def _believed(track: Track, view: _View, catalogue: "Catalogue") -> str:
    style = "fill-opacity='0.55' stroke-width='2'" if track.accepted else (
        "fill-opacity='0.08' stroke-width='1.5' stroke-dasharray='5 3'")  # fmt: skip
    ((x, y),) = view.pixels(track.X_WO[None, :3, 3])
    said = f"{track.label} {track.probability:.2f}"
    outline = _outline(track.label, track.X_WO, view, catalogue, style)
    name = words(x, y + 4, said, anchor="middle", weight=600 if track.accepted else 400)
    return titled(outline + name, f"{said}, track {track.id}, {'accepted' if track.accepted else 'not accepted'}")


def _placed(one: Tried, view: _View, catalogue: "Catalogue") -> str:
    style = "fill-opacity='0.3' stroke-width='1.2' stroke-dasharray='2 3'"
    return titled(_outline(one.row["label"], _place(one), view, catalogue, style), _told(one))


def _told(one: Tried) -> str:
    row = one.row
    return f"{one.number}: {row['label']} let go over {row['region']}, {row['outcome'] or 'outcome unknown'}"


def _numbers(put: Sequence[Tried], view: _View) -> list[str]:
    """Numbers of attempts where they let go, beside that where another number is in the way."""
    taken: list[Array] = []
    parts = []
    for one in put:
        (at,) = view.pixels(_place(one)[None, :3, 3])
        ring = [at + r * np.array([np.cos(a), np.sin(a)]) for r in (21, 42) for a in np.arange(8) * np.pi / 4]
        free = (p for p in [at, *ring] if all(np.linalg.norm(p - other) > 20 for other in taken))
        x, y = place = next(free, at)
        taken.append(place)
        edge = _EDGES[OUTCOME_KINDS.get(one.row["outcome"], "bad")]
        lead = segment(at[0], at[1], x, y, edge, width=1.5) if place is not at else ""
        disc = f"<circle cx='{x:.1f}' cy='{y:.1f}' r='9' fill='#fff' stroke='{edge}' stroke-width='2.5'/>"
        figure = words(x, y + 4.5, str(one.number), anchor="middle", weight=600, color=INK)
        parts.append(titled(lead + disc + figure, _told(one)))
    return parts


def _truth(row: Mapping[str, Any], view: _View, catalogue: "Catalogue") -> str:
    ((x, y),) = view.pixels(row["p_W"])
    color = "rgb({},{},{})".format(*label_color(row["label"], catalogue))
    # Longer than a number's disc is wide, and thin: both are to be read.
    cross = f"M{x - 13:.1f} {y - 13:.1f}l26 26m0 -26l-26 26"
    lines = (("#fff", 3.5), (color, 1.8))
    marks = "".join(f"<path d='{cross}' stroke='{ink}' stroke-width='{width}'/>" for ink, width in lines)
    return titled(marks, f"{row['label']}: truly here, {row['place']}")
