"""Parts of pages about batches: what they are of, the figures that matter most, what was lost."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sum_drake import page
from sum_drake.batch_figures import Row, losses
from sum_drake.report_parts import count, seconds

Batch = Mapping[str, Any]
"""What batch.json holds, or `batch_folder.made_by` tells of it."""


def told_of(batch: Batch) -> str:
    """What a batch was made of and with, in words."""
    done = batch["done"]
    told = f"{count(done, 'run')} of {count(batch['settings']['objects'], 'object')}, {seeds_of(batch)}"
    told += "" if done == batch["runs"] else f" of which {batch['runs'] - done} are not done"
    return f"{told}; commit {batch.get('commit') or 'unknown'}, on {batch['device']}."


def made_of(batches: Iterable[Batch], *, quick: bool = False) -> str:
    """What the figures of a page are of, HTML: `told_of` each batch, and the packages. quick: of short forms."""
    batches = list(batches)
    said = dict.fromkeys(told_of(batch) for batch in batches)
    said |= dict.fromkeys(f"With {with_}." for batch in batches if (with_ := packages(batch)))
    short = "<p>" + page.chip("the short form: too few runs to tell anything by", "poor") + "</p>" if quick else ""
    return short + "".join(f"<p>{page.text(line)}</p>" for line in said)


def link(words: object, run: str, within: Path | None) -> str:
    """What is said of a run, such as its seed, HTML, that leads to its report where there is one.

    run: the run's folder as the page has it. within: the page's folder; None: it cannot lead to the run.
    """
    there = within is not None and (within / run / "report.html").is_file()
    return f'<a href="{page.text(quote(run))}/report.html">{words}</a>' if there else str(words)


def seeds_of(batch: Batch) -> str:
    """Its seeds, in words."""
    first, last = batch["seeds"]
    return f"seed {first}" if first == last else f"seeds {first} to {last}"


def packages(batch: Batch, names: Sequence[str] = ("sum-drake", "drake", "python")) -> str:
    """Versions of those of the packages that are told, in words."""
    versions = batch.get("versions") or {}
    return ", ".join(f"{name} {versions[name]}" for name in names if name in versions)


def tiles(figures: Mapping[str, float | None]) -> str:
    """What matters most of `batch_figures`, large; HTML."""
    low, high = figures.get("objects_sorted_low95"), figures.get("objects_sorted_high95")
    interval = "" if low is None or high is None else f", 95 % interval {low:.3f} to {high:.3f}"

    def figure(name: str) -> str:
        return shown(figures.get(name))

    share, objects = figures.get("objects_sorted_share"), figures.get("objects") or 0.0
    done = round((share or 0.0) * objects)
    said = "none is done" if share is None else f"objects sorted: {share:.3f}{interval}"
    return page.tiles(
        [
            (said, "–" if share is None else f"{done} of {objects:.0f}"),
            ("missorted", figure("missorted")),
            ("trials an object sorted", figure("trials_per_object") or "–"),
            ("CPU a run, median", seconds(figures.get("cpu_s_per_run_median"))),
        ]
    )


def shown(value: float | None) -> str:
    """A figure to four digits; nothing for what cannot be told."""
    return "" if value is None else f"{value:.4g}"


def by_cause(counts: Mapping[str, Mapping[str, int]]) -> str:
    """A table; HTML. counts: by what stands over a column, how many of each cause."""
    names = list(dict.fromkeys(cause for of in counts.values() for cause in of))
    rows = [(page.text(name), *(str(of.get(name, 0)) for of in counts.values())) for name in names]
    return page.table(("cause", *counts), rows) if rows else "<p>None.</p>"


def every_loss(rows: Mapping[str, Sequence[Row]], lead: Callable[[str, int], str], head: str = "of") -> str:
    """Every object that was lost, HTML; nothing where none was.

    rows: by what is told apart, under `head`. lead: a seed of such rows, HTML.
    """
    lost = [
        (page.text(kind), lead(kind, loss["seed"]), *(page.text(loss[part]) for part in ("label", "place", "cause")))
        for kind, of in rows.items()
        for loss in losses(of)
    ]
    if not lost:
        return ""
    return "<h2>Every one of them</h2>" + page.table((head, "seed", "object", "ended", "cause"), lost)
