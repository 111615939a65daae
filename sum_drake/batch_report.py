"""A batch, or two side by side, as one HTML page that opens without a network."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake import page
from sum_drake.batch_figures import Row, paired_difference, pairs, same_runs
from sum_drake.batch_folder import read_batch
from sum_drake.batch_parts import Batch, link, made_of, seeds_of, shown, tiles
from sum_drake.files import write_whole
from sum_drake.fingerprint import different
from sum_drake.report_parts import count, seconds

SURE = 0.05
"""What chance gives more often is not told as a difference."""


def is_batch(folder: Path) -> bool:
    """Whether it is the folder of a batch."""
    return (folder / "batch.json").is_file()


def write_batch_report(folders: Sequence[Path], out: Path) -> Path:
    """Writes a page about one batch, or about two; returns its path. Raises InputError as `read_batch` does."""
    batches = [read_batch(folder) for folder in folders]
    names = [folder.resolve().name for folder in folders]
    if len(batches) == 1:
        within = out.resolve().parent == folders[0].resolve()
        write_whole(out, _one(names[0], batches[0], folders[0] if within else None))
    else:
        write_whole(out, _two(names, folders, batches, out.resolve().parent))
    return out


def _one(name: str, batch: Batch, folder: Path | None) -> str:
    """folder: the batch's, if the page goes there and can lead to what is in it."""

    rows = []
    for row in batch["episodes"]:
        run = str(row["seed"])
        reason = page.text(_reason(row))
        if folder is not None and (folder / run / "log.txt").is_file():
            reason += f' (<a href="{run}/log.txt">what it said last</a>)'
        rows.append([link(row["seed"], run, folder), *_run(row), reason])
    return page.page(
        f"Batch {name}",
        [
            f"<h1>Batch {page.text(name)}</h1>",
            _head(batch),
            tiles(batch["figures"]),
            "<h2>Figures</h2>",
            page.table(["figure", "value"], [[page.text(_words(k)), shown(v)] for k, v in batch["figures"].items()]),
            "<h2>What was lost</h2>",
            _losses([batch]),
            *_errors([batch]),
            "<h2>Runs</h2>",
            page.table(["seed", "sorted", "trials", "CPU", "reason"], rows) if rows else "<p>None is done.</p>",
            "<h2>Made with</h2>",
            made_of([batch]),
        ],
    )


def _two(names: Sequence[str], folders: Sequence[Path], batches: Sequence[Batch], at: Path) -> str:
    """at: where the page goes; it leads to runs that are below."""
    a, b = batches
    lead = [_lead_into(folder, at) for folder in folders]
    heads = "".join(
        f'<div><section class="head"><p><b>{of}</b> {page.text(name)}</p></section>{_head(batch)}'
        f"{tiles(batch['figures'])}</div>"
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
            *_errors([a, b]),
            "<h2>Runs that differ</h2>",
            _differing(a, b, lead),
            "<h2>Made with</h2>",
            *(f"<h3>{of}</h3>{made_of([batch])}" for of, batch in zip("AB", (a, b), strict=True)),
        ],
    )


def _head(batch: Batch) -> str:
    done = "" if batch["done"] == batch["runs"] else f"; {batch['done']} of them are done"
    return f"<p>{count(batch['runs'], 'run')}, {seeds_of(batch)}{done}</p>"


def _verdict(a: Batch, b: Batch) -> str:
    both = [(x, y) for _, x, y in pairs(a["episodes"], b["episodes"]) if x is not None and y is not None]
    if not both:
        return "They have no seed in common: how they compare is told by their intervals alone."
    same = same_runs(a["episodes"], b["episodes"])
    if same == len(both):
        return f"All {len(both)} runs of the same seeds are the same to the last bit: their digests are equal."
    words = f"{same} of {len(both)} runs of the same seeds are the same to the last bit."
    told = paired_difference(a["episodes"], b["episodes"])
    if told is None:
        return words
    words += (
        f" Over {told.runs} pairs of runs, {told.differ} of which differ, B sorted {told.share:+.3f} of the objects"
    )
    sure = "more than chance would give" if told.p_value <= SURE else "chance may have given it"
    return (
        f"{words} against A (95 % interval {told.low95:+.3f} to {told.high95:+.3f}): {sure}, "
        f"p = {told.p_value:.2g} by signs drawn at random."
    )


def _settings(a: Batch, b: Batch) -> str:
    first, second = ({k: v for k, v in batch["settings"].items() if k != "first_seed"} for batch in (a, b))
    differs = different(first, second)
    return f"What A is of, and B is not: {differs}." if differs else "The same program, objects and scenario."


def _figures(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    rows = []
    for key in dict.fromkeys((*a, *b)):
        in_a, in_b = a.get(key), b.get(key)
        differs = in_a is not None and in_b is not None and in_a != in_b
        mark = page.chip(f"{float(in_b or 0) - float(in_a or 0):+.4g}", "plain") if differs else ""
        rows.append([page.text(_words(key)), shown(in_a), shown(in_b), mark])
    return page.table(["figure", "A", "B", "B against A"], rows)


def _losses(batches: Sequence[Batch]) -> str:
    """By cause: how many, and which object of which seed."""
    names = list(dict.fromkeys(cause for batch in batches for cause in batch["causes"]))
    if not names:
        return "<p>Nothing.</p>" if any(batch["done"] for batch in batches) else "<p>None is done.</p>"

    def cell(batch: Batch, cause: str) -> str:
        lost = [f"{loss['label']} ({loss['seed']})" for loss in batch["losses"] if loss["cause"] == cause]
        return f"{len(lost)}: {page.text(', '.join(lost))}" if lost else "0"

    heads = ["cause", *("objects lost (seed)" if len(batches) == 1 else f"lost in {of}" for of in "AB"[: len(batches)])]
    return page.table(heads, [[page.text(cause), *(cell(batch, cause) for batch in batches)] for cause in names])


def _errors(batches: Sequence[Batch]) -> list[str]:
    """By cause: how many; nothing of batches that were written before they told."""
    if any("errors" not in batch for batch in batches):
        return []
    names = list(dict.fromkeys(cause for batch in batches for cause in batch["errors"]))
    rows = [[page.text(name), *(str(batch["errors"].get(name, 0)) for batch in batches)] for name in names]
    heads = ["cause", *(("trials",) if len(batches) == 1 else ("in A", "in B"))]
    return ["<h2>Manipulation errors</h2>", page.table(heads, rows) if rows else "<p>None.</p>"]


def _lead_into(folder: Path, at: Path) -> Callable[[int, str], str]:
    """Words about a run of a seed that lead to its report, where the page at `at` can."""

    def lead(seed: int, words: str) -> str:
        if not folder.resolve().is_relative_to(at):
            return words
        return link(words, (folder.resolve() / str(seed)).relative_to(at).as_posix(), at)

    return lead


def _differing(a: Batch, b: Batch, lead: Sequence[Callable[[int, str], str]]) -> str:
    """lead: into either's runs."""
    rows = []
    for seed, x, y in pairs(a["episodes"], b["episodes"]):
        if x is not None and y is not None and same_runs([x], [y]):
            continue
        ends = [
            page.chip("not there", "plain") if one is None else to(seed, _run(one)[0])
            for one, to in zip((x, y), lead, strict=True)
        ]
        gain = 0 if x is None or y is None else y.get("objects_sorted", 0) - x.get("objects_sorted", 0)
        mark = page.chip(f"{gain:+d}", "good" if gain > 0 else "bad") if gain else ""
        rows.append([str(seed), *ends, mark, *("" if one is None else page.text(_reason(one)) for one in (x, y))])
    heads = ["seed", "sorted in A", "in B", "B against A", "A ended", "B ended"]
    return page.table(heads, rows) if rows else "<p>None.</p>"


def _run(row: Row) -> tuple[str, str, str]:
    """What was sorted, trials, CPU seconds."""
    if "objects_total" not in row:
        return page.chip(row["state"].replace("_", " "), "bad"), "", seconds(row["cpu_s"])
    whole = row["objects_sorted"] == row["objects_total"]
    words = f"{row['objects_sorted']} of {row['objects_total']}"
    return page.chip(words, "good" if whole else "poor"), str(row["manipulation_trials"]), seconds(row["cpu_s"])


def _reason(row: Row) -> str:
    return str(row.get("reason") or row.get("outcome") or row["state"])


def _words(figure: str) -> str:
    words = figure.replace("_low95", ", 95 % interval from").replace("_high95", ", 95 % interval to")
    return words.replace("_", " ").replace("cpu s", "CPU s").replace("mib", "MiB")
