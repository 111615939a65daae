"""Two runs side by side as one HTML page that opens without a network: what differs is marked."""

import difflib
from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake import page
from sum_drake.belief_chart import SHOWN, belief_chart
from sum_drake.drawing import draw_perception
from sum_drake.files import write_whole
from sum_drake.from_above import above_legend, from_above
from sum_drake.report_parts import cost_name, count, name, outcome_chip, place_chip, reason, seconds, tried_chip
from sum_drake.run_folder import RunFolder, Tried, catalogue_of_run, read_run_folder
from sum_drake.types import Perception

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

NOTHING = "Nothing was logged."
UNKNOWN = page.chip("unknown", "plain")
"""Where an object of a run without a summary ended."""
NOTABLE = 0.1
"""Probabilities that differ by less are not told of, where both runs accept or neither does."""
_FIGURES: tuple[tuple[str, Callable[[Mapping[str, Any]], Any]], ...] = (
    ("objects to be sorted", lambda s: s["objects_total"]),
    ("sorted", lambda s: s["objects_sorted"]),
    ("missorted", lambda s: s["objects_missorted"]),
    ("of these by perception", lambda s: s["missorted_by"]["perception"]),
    ("of these by manipulation", lambda s: s["missorted_by"]["manipulation"]),
    ("trials", lambda s: s["manipulation_trials"]),
    ("manipulation errors", lambda s: s["manipulation_errors"]),
    ("looks", lambda s: len(s["observations"])),
    ("false positives", lambda s: sum(row["false_positives"] or 0 for row in s["observations"])),
    ("of these rejected", lambda s: sum(row["false_positives_rejected"] or 0 for row in s["observations"])),
)


def write_comparison(
    folder_a: Path, folder_b: Path, out: Path, *, progress: Callable[[int, int], None] = lambda done, of: None
) -> Path:
    """Writes a page about two run folders, from whatever each holds; returns its path.

    progress: told how many looks of how many are drawn. Raises InputError for a folder without anything to report.
    """
    runs = read_run_folder(folder_a), read_run_folder(folder_b)
    write_whole(out, _page(*runs, progress))
    return out


def _page(a: RunFolder, b: RunFolder, progress: Callable[[int, int], None]) -> str:
    (own_a, problem_a), (own_b, problem_b) = catalogue_of_run(a), catalogue_of_run(b)
    problems = [("A", line) for line in (*a.problems, problem_a) if line]
    problems += [("B", line) for line in (*b.problems, problem_b) if line]
    parts = [
        "<h1>Two runs side by side</h1>",
        _heads(a, b),
        *(f'<p class="problem">{of}: {page.text(line)}</p>' for of, line in problems),
        f"<p>{page.text(_verdict(a, b))}</p>",
    ]
    if a.summary is not None and b.summary is not None:
        parts += ["<h2>Figures</h2>", _figures(a.summary, b.summary)]
    if a.summary is not None or b.summary is not None:
        parts += ["<h2>Objects</h2>", _objects(a, b, own_a)]
    if a.tried() or b.tried():
        parts += ["<h2>Attempts</h2>", _attempts(a.tried(), b.tried(), own_a, own_b)]
    if a.perceptions or b.perceptions:
        above = _pair(_drawn(from_above(a, own_a)), _drawn(from_above(b, own_b)))
        parts += ["<h2>From above, at the end</h2>", above, above_legend(a, b)]
        parts.append("<h2>Belief over time</h2>")
        for of, run, own in (("A", a, own_a), ("B", b, own_b)):
            unlikely = f"No track was ever above {SHOWN:g}." if run.perceptions else NOTHING
            parts += [f"<h3>{of}</h3>", _drawn(belief_chart(run.perceptions, own), unlikely)]
        parts.append(_probabilities(a, b, own_a))
        parts += ["<h2>Observations</h2>", *_observations(a.perceptions, b.perceptions, own_a, own_b, progress)]
    if a.summary is not None and b.summary is not None:
        parts += ["<h2>Costs</h2>", _costs(a.summary["timing"], b.summary["timing"])]
        parts += ["<h2>Made with</h2>", _made_with(a.summary, b.summary)]
    if a.scenario is not None and b.scenario is not None:
        parts += ["<h2>Scenario</h2>", _scenario(a.scenario, b.scenario)]
    return page.page(f"Runs {a.name} and {b.name}", parts)


def _heads(a: RunFolder, b: RunFolder) -> str:
    def head(of: str, run: RunFolder) -> str:
        named = f"<b>{of}</b> {page.text(run.name)}, seed {page.text(run.seed)}"
        return f'<section class="head"><p>{named}</p><p>{outcome_chip(run.outcome, run.summary)}</p></section>'

    return _pair(head("A", a), head("B", b))


def _pair(left: str, right: str) -> str:
    """Two parts beside each other, below each other on a narrow screen; HTML."""
    return f'<div class="pair"><div>{left}</div><div>{right}</div></div>'


def _drawn(svg: str, otherwise: str = NOTHING) -> str:
    return page.figure(svg) if svg else f"<p>{page.text(otherwise)}</p>"


def _verdict(a: RunFolder, b: RunFolder) -> str:
    """Whether the runs are the same, and where they part."""
    if a.summary is not None and b.summary is not None and a.summary["digest"] == b.summary["digest"]:
        return "Beliefs, attempts and final poses are the same to the last bit: their digests are equal."
    lacking = [of for of, run in (("A", a), ("B", b)) if not run.perceptions]
    if lacking:
        return f"Without looks in the log of {' and '.join(lacking)} nothing can be said about where they part."
    for one, other in zip_longest(a.perceptions, b.perceptions):
        if one is None or other is None:
            here = "B" if one is None else "A"
            step = (one or other).step
            return f"Up to look {step - 1} they look alike; then only {here} goes on."
        if _seen(one) != _seen(other):
            return f"They differ from look {one.step} on." if one.step else "They differ from the first look on."
    if a.summary is None or b.summary is None:
        return "All their looks look alike; without both summaries no more can be said."
    return "All their looks look alike; what they did after them differs."


def _seen(look: Perception) -> tuple[Any, ...]:
    """What a look came to, as far as a page tells."""
    tracks = sorted((t.label, t.accepted, round(t.probability, 3)) for t in look.posterior.tracks)
    return len(look.detections), tuple(tracks)


def _mark(differs: bool, words: str = "differs") -> str:
    return page.chip(words, "poor") if differs else ""


def _figures(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    rows = []
    for words, of in _FIGURES:
        in_a, in_b = of(a), of(b)
        rows.append([words, str(in_a), str(in_b), _mark(in_a != in_b, f"{in_b - in_a:+d}")])
    return page.table(["of", "A", "B", "B against A"], rows)


def _objects(a: RunFolder, b: RunFolder, catalogue: "Catalogue") -> str:
    places: list[dict[str, Mapping[str, Any]]] = [
        {} if run.summary is None else {row["label"]: row for row in run.summary["objects"]} for run in (a, b)
    ]
    rows = []
    for label in dict.fromkeys((*places[0], *places[1])):
        in_a, in_b = (place.get(label) for place in places)
        ends = [UNKNOWN if run.summary is None else _place(row) for run, row in ((a, in_a), (b, in_b))]
        goals = dict.fromkeys(row["goal"] for row in (in_a, in_b) if row is not None)
        differs = UNKNOWN not in ends and (in_a and in_a["place"]) != (in_b and in_b["place"])
        rows.append([name(label, catalogue), page.text(", ".join(goals)), *ends, _mark(differs)])
    heads = ["object", "belongs in", "ended in A", "ended in B", "difference"]
    return page.table(heads, rows) if rows else "<p>There was none.</p>"


def _place(row: Mapping[str, Any] | None) -> str:
    return page.chip("not there", "plain") if row is None else place_chip(row)


def _attempts(in_a: Sequence[Tried], in_b: Sequence[Tried], own_a: "Catalogue", own_b: "Catalogue") -> str:
    """What was tried after each look, aligned by look."""
    rows = []
    for step in sorted({one.row["step"] for one in (*in_a, *in_b)}):
        of_a, of_b = ([one for one in tried if one.row["step"] == step] for tried in (in_a, in_b))
        for one, other in zip_longest(of_a, of_b):
            cells = [_tried(one, own_a), _tried(other, own_b)]
            rows.append([str(step), *cells, _mark(_tell_apart(one, other))])
    return page.table(["after look", "A", "B", "difference"], rows)


def _tried(one: Tried | None, catalogue: "Catalogue") -> str:
    if one is None:
        return page.text("nothing more")
    row = one.row
    told = page.text(f" to {row['region']}: {reason(row)} ")
    return f"{name(row['label'], catalogue)}{told}{tried_chip(row['outcome'])}"


def _tell_apart(one: Tried | None, other: Tried | None) -> bool:
    """Whether two attempts differ, as far as both runs know of them: an outcome is the summary's alone."""
    if one is None or other is None:
        return one is not other
    known = ("label", "region", "kind", "reason")
    ends = one.row["outcome"], other.row["outcome"]
    return any(one.row[key] != other.row[key] for key in known) or (None not in ends and ends[0] != ends[1])


def _likeliest(look: Perception | None) -> dict[str, tuple[float, bool]]:
    """(probability, accepted) of the likeliest track of each label: ids are not the same from run to run."""
    found: dict[str, tuple[float, bool]] = {}
    for track in () if look is None else look.posterior.tracks:
        found[track.label] = max(found.get(track.label, (0.0, False)), (track.probability, track.accepted))
    return found


def _probabilities(a: RunFolder, b: RunFolder, catalogue: "Catalogue") -> str:
    if not a.perceptions or not b.perceptions:
        return "<p>Only one of them has looks: probabilities cannot be compared.</p>"
    rows = []
    for one, other in zip(a.perceptions, b.perceptions, strict=False):
        in_a, in_b = _likeliest(one), _likeliest(other)
        for label in sorted({*in_a, *in_b}):
            (p_a, accepted_a), (p_b, accepted_b) = in_a.get(label, (0.0, False)), in_b.get(label, (0.0, False))
            if abs(p_a - p_b) < NOTABLE and accepted_a == accepted_b:
                continue
            cells = [_probability(label in in_a, p_a, accepted_a), _probability(label in in_b, p_b, accepted_b)]
            rows.append([str(one.step), name(label, catalogue), *cells, _mark(True, f"{p_b - p_a:+.2f}")])
    if not rows:
        return f"<p>Probabilities agree within {NOTABLE:g}, and both accepted the same.</p>"
    words = (
        f"{count(len(rows), 'difference')}: labels of which the likeliest track differs by {NOTABLE:g} or more after "
        "the same look, or was accepted in one run only"
    )
    table = page.table(["look", "label", "A", "B", "B against A"], rows)
    # Runs of other objects differ everywhere.
    shown = " open" if len(rows) <= 12 else ""
    return f"<details{shown}><summary>{words}</summary>{table}</details>"


def _probability(there: bool, p: float, accepted: bool) -> str:
    if not there:
        return page.chip("no track", "plain")
    return f"{p:.2f} {page.chip('accepted' if accepted else 'not accepted', 'good' if accepted else 'plain')}"


def _observations(
    of_a: Sequence[Perception],
    of_b: Sequence[Perception],
    own_a: "Catalogue",
    own_b: "Catalogue",
    progress: Callable[[int, int], None],
) -> list[str]:
    parts: list[str] = []
    for one, other in zip_longest(of_a, of_b):
        progress(len(parts), max(len(of_a), len(of_b)))
        step = (one or other).step
        parts.append(f"<section><h3>Look {step}</h3>{_pair(_look(one, own_a), _look(other, own_b))}</section>")
    return parts


def _look(look: Perception | None, catalogue: "Catalogue") -> str:
    if look is None:
        return "<p>There was none.</p>"
    accepted = sum(track.accepted for track in look.posterior.tracks)
    told = f"at {look.frame.time:.1f} s: {count(len(look.detections), 'detection')}, {accepted} accepted"
    drawn = draw_perception(look, catalogue, scale=1)
    return f"{page.picture(drawn, f'Look {look.step}')}<p class='legend'>{told}</p>"


def _costs(a: Mapping[str, float | None], b: Mapping[str, float | None]) -> str:
    rows = []
    for of in dict.fromkeys((*a, *b)):
        in_a, in_b = a.get(of), b.get(of)
        if in_a is None and in_b is None:
            continue
        ratio = f"{in_b / in_a:.2f} times" if in_a and in_b is not None else ""
        rows.append([page.text(cost_name(of)), seconds(in_a), seconds(in_b), ratio])
    return page.table(["cost", "A", "B", "B against A"], rows) if rows else "<p>Nothing was measured.</p>"


def _made_with(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    made = [{**one["versions"], "device": one["device"], "digest": one["digest"]} for one in (a, b)]
    rows = [
        [
            page.text(of),
            page.text(str(made[0].get(of, "missing"))),
            page.text(str(made[1].get(of, "missing"))),
            _mark(True),
        ]
        for of in dict.fromkeys((*made[0], *made[1]))
        if made[0].get(of) != made[1].get(of)
    ]
    told = page.table(["of", "A", "B", "difference"], rows)
    return f'<div class="wraps">{told}</div>' if rows else "<p>The same versions on the same device.</p>"


def _scenario(a: str, b: str) -> str:
    lines = list(difflib.unified_diff(a.splitlines(), b.splitlines(), "A", "B", lineterm="", n=2))
    if not lines:
        return "<p>The same.</p>"
    return f"<pre>{page.text(chr(10).join(lines))}</pre>"
