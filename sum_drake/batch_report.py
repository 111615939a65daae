"""A batch, or two side by side, as one HTML page that opens without a network."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake import page
from sum_drake.assets import InputError
from sum_drake.batch import SCHEMA
from sum_drake.batch_figures import share_interval
from sum_drake.bench.resumed import different
from sum_drake.files import write_whole
from sum_drake.report_parts import seconds

PARTS = ("settings", "seeds", "runs", "done", "figures", "causes", "losses", "episodes", "versions", "device")
Batch = Mapping[str, Any]
"""What batch.json holds."""


def is_batch(folder: Path) -> bool:
    """Whether it is the folder of a batch."""
    return (folder / "batch.json").is_file()


def read_batch(folder: Path) -> Batch:
    """batch.json of a folder. Raises InputError for one that is missing, unreadable, newer or not a batch's."""
    file = folder / "batch.json"
    try:
        data = json.loads(file.read_text())
    except FileNotFoundError:
        raise InputError(
            f"{file}: no such file; expected the folder of a batch, as sum-drake batch writes it"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: {error}; expected what sum-drake batch writes") from None
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != SCHEMA:
        raise InputError(f"{file}: schema {schema!r}; expected '{SCHEMA}'")
    missing = [part for part in PARTS if part not in data]
    if missing:
        raise InputError(f"{file}: has no {missing[0]}; expected what sum-drake batch writes")
    return dict(data)


def write_batch_report(folders: Sequence[Path], out: Path) -> Path:
    """Writes a page about one batch, or about two; returns its path. Raises InputError as `read_batch` does."""
    batches = [read_batch(folder) for folder in folders]
    names = [folder.resolve().name for folder in folders]
    if len(batches) == 1:
        write_whole(
            out, _one(names[0], batches[0], folders[0] if out.resolve().parent == folders[0].resolve() else None)
        )
    else:
        write_whole(out, _two(names, batches[0], batches[1]))
    return out


def paired_difference(a: Batch, b: Batch, seed: int = 0) -> tuple[int, float, float, float] | None:
    """How much more of its objects B sorted than A in runs of the same seeds, and the 95 % interval of that share.

    By bootstrap over those runs, in which both are drawn together, so that what a pour makes hard for both cancels.
    None without two such runs. Returns how many there are, the difference, the interval's ends; NaN for an interval of
    runs that have no object.
    """
    pairs = [(x, y) for x, y in _pairs(a, b) if x is not None and y is not None and x.get("objects_total")]
    if len(pairs) < 2:
        return None
    total = np.array([x["objects_total"] for x, _ in pairs], float)
    gain = np.array([y.get("objects_sorted", 0) - x.get("objects_sorted", 0) for x, y in pairs], float)
    return (len(pairs), float(gain.sum() / total.sum()), *share_interval(gain, total, seed))


def _pairs(a: Batch, b: Batch) -> list[tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]]:
    rows = [{row["seed"]: row for row in batch["episodes"]} for batch in (a, b)]
    return [(rows[0].get(seed), rows[1].get(seed)) for seed in sorted(rows[0].keys() | rows[1].keys())]


def _one(name: str, batch: Batch, folder: Path | None) -> str:
    """folder: the batch's, if the page goes there and can lead to what is in it."""

    def seed(row: Mapping[str, Any]) -> str:
        told = _seed(row)
        there = folder is not None and (folder / told / "report.html").is_file()
        return f'<a href="{told}/report.html">{told}</a>' if there else told

    rows = [[seed(row), *_run(row), _reason(row)] for row in batch["episodes"]]
    return page.page(
        f"Batch {name}",
        [
            f"<h1>Batch {page.text(name)}</h1>",
            _head(batch),
            _tiles(batch),
            "<h2>Figures</h2>",
            page.table(["of", "figure"], [[page.text(_words(k)), _number(v)] for k, v in batch["figures"].items()]),
            "<h2>What was lost</h2>",
            _losses([batch]),
            "<h2>Runs</h2>",
            page.table(["seed", "sorted", "trials", "CPU", "reason"], rows) if rows else "<p>None is done.</p>",
            "<h2>Made with</h2>",
            f"<p>{page.text(_made_with(batch))}</p>",
        ],
    )


def _two(names: Sequence[str], a: Batch, b: Batch) -> str:
    heads = "".join(
        f'<div><section class="head"><p><b>{of}</b> {page.text(name)}</p></section>{_head(batch)}{_tiles(batch)}</div>'
        for of, name, batch in zip("AB", names, (a, b), strict=True)
    )
    return page.page(
        f"Batches {names[0]} and {names[1]}",
        [
            "<h1>Two batches side by side</h1>",
            f'<div class="pair">{heads}</div>',
            f"<p>{page.text(_verdict(a, b))}</p>",
            f"<p>{page.text(_settings(a, b))}</p>",
            "<h2>Figures</h2>",
            _figures(a["figures"], b["figures"]),
            "<h2>What was lost</h2>",
            _losses([a, b]),
            "<h2>Runs that differ</h2>",
            _differing(a, b),
            "<h2>Made with</h2>",
            *(f"<p>{of}: {page.text(_made_with(batch))}</p>" for of, batch in zip("AB", (a, b), strict=True)),
        ],
    )


def _head(batch: Batch) -> str:
    first, last = batch["seeds"]
    done = "" if batch["done"] == batch["runs"] else f"; {batch['done']} of them are done"
    return f"<p>{batch['runs']} runs, seeds {first} to {last}{done}</p>"


def _tiles(batch: Batch) -> str:
    figures = batch["figures"]
    low, high = figures.get("objects_sorted_low95"), figures.get("objects_sorted_high95")
    interval = "" if low is None else f", {low:.3f} to {high:.3f}"
    return page.tiles(
        [
            (f"of {figures['objects']:.0f} objects sorted{interval}", _number(figures["objects_sorted_share"])),
            ("missorted", _number(figures["missorted"])),
            ("trials an object", _number(figures["trials_per_object"])),
            ("CPU a run, median", seconds(figures["cpu_s_per_run_median"])),
        ]
    )


def _verdict(a: Batch, b: Batch) -> str:
    both = [(x, y) for x, y in _pairs(a, b) if x is not None and y is not None]
    if not both:
        return "They have no seed in common: how they compare is told by their intervals alone."
    same = sum(x.get("digest") is not None and x.get("digest") == y.get("digest") for x, y in both)
    if same == len(both):
        return f"All {len(both)} runs of the same seeds are the same to the last bit: their digests are equal."
    words = f"{same} of {len(both)} runs of the same seeds are the same to the last bit."
    told = paired_difference(a, b)
    if told is None or np.isnan(told[2]):
        return words
    runs, gain, low, high = told
    sure = "more than chance would give" if low > 0 or high < 0 else "no more than chance would give"
    return (
        f"{words} Over the {runs} runs, B sorted {gain:+.3f} of the objects against A ({low:+.3f} to {high:+.3f} in"
        f" 95 % of bootstrap draws over pairs): {sure}."
    )


def _settings(a: Batch, b: Batch) -> str:
    first, second = ({k: v for k, v in batch["settings"].items() if k != "first_seed"} for batch in (a, b))
    differs = different(first, second).replace("scenario ", "scenarios ")
    return f"A against B: {differs}." if differs else "The same program, objects and scenario."


def _figures(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    rows = []
    for key in dict.fromkeys((*a, *b)):
        in_a, in_b = a.get(key), b.get(key)
        differs = in_a is not None and in_b is not None and in_a != in_b
        mark = page.chip(f"{float(in_b or 0) - float(in_a or 0):+.4g}", "plain") if differs else ""
        rows.append([page.text(_words(key)), _number(in_a), _number(in_b), mark])
    return page.table(["of", "A", "B", "B against A"], rows)


def _losses(batches: Sequence[Batch]) -> str:
    """By cause: how many, and which object of which seed."""
    names = list(dict.fromkeys(cause for batch in batches for cause in batch["causes"]))
    if not names:
        return "<p>Nothing.</p>"

    def cell(batch: Batch, cause: str) -> str:
        lost = [f"{loss['label']} ({loss['seed']})" for loss in batch["losses"] if loss["cause"] == cause]
        return f"{len(lost)}: {page.text(', '.join(lost))}" if lost else "0"

    heads = ["cause", *("objects lost (seed)" if len(batches) == 1 else f"lost in {of}" for of in "AB"[: len(batches)])]
    return page.table(heads, [[page.text(cause), *(cell(batch, cause) for batch in batches)] for cause in names])


def _differing(a: Batch, b: Batch) -> str:
    rows = []
    for x, y in _pairs(a, b):
        if x is None or y is None or x.get("digest") != y.get("digest") or x["state"] != y["state"]:
            row = x if x is not None else y
            assert row is not None  # a seed comes from one of the two
            ends = [_run(one)[0] if one is not None else page.chip("not there", "plain") for one in (x, y)]
            gain = 0 if x is None or y is None else y.get("objects_sorted", 0) - x.get("objects_sorted", 0)
            mark = page.chip(f"{gain:+d}", "good" if gain > 0 else "bad") if gain else ""
            rows.append([_seed(row), *ends, mark, *(_reason(one) if one is not None else "" for one in (x, y))])
    heads = ["seed", "sorted in A", "in B", "B against A", "A ended", "B ended"]
    return page.table(heads, rows) if rows else "<p>None.</p>"


def _seed(row: Mapping[str, Any]) -> str:
    return str(row["seed"])


def _run(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """What was sorted, trials, CPU seconds."""
    if "objects_total" not in row:
        return page.chip(row["state"].replace("_", " "), "bad"), "", seconds(row["cpu_s"])
    whole = row["objects_sorted"] == row["objects_total"]
    words = f"{row['objects_sorted']} of {row['objects_total']}"
    return page.chip(words, "good" if whole else "poor"), str(row["manipulation_trials"]), seconds(row["cpu_s"])


def _reason(row: Mapping[str, Any]) -> str:
    return page.text(str(row.get("reason") or row.get("outcome") or row["state"]))


def _words(figure: str) -> str:
    return figure.replace("_", " ").replace("cpu s", "CPU s").replace("mib", "MiB")


def _number(value: Any) -> str:
    return "" if value is None else f"{value:.4g}"


def _made_with(batch: Batch) -> str:
    names = [
        f"{name} {batch['versions'][name]}" for name in ("sum-drake", "drake", "python") if name in batch["versions"]
    ]
    return ", ".join([*names, batch["device"]])
