"""`sum-drake bench ablations`: what each ingredient of the whole system is worth, in objects sorted on the same pours.

With faults, things go wrong in each run as in `bench faults`: a pour of which all goes well asks little of a belief.
Each variant is a batch in a folder of its name below the bench's: called again, it goes on. Differences are over pairs
of runs of the same seed, which are of the same pour.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake import page
from sum_drake.assets import InputError
from sum_drake.batch import Executor, check_batch, run_batch
from sum_drake.batch_figures import Row, causes, known_figures, losses, paired_difference, same_runs
from sum_drake.batch_folder import brief, made_by, read_batch, read_episodes
from sum_drake.batch_parts import by_cause, every_loss, link, made_of
from sum_drake.bench.aims import number
from sum_drake.bench.faults import dealt_with, fault_rows
from sum_drake.bench.results import write_results
from sum_drake.doctor import versions
from sum_drake.episodes import EpisodeSpec
from sum_drake.files import write_whole
from sum_drake.fingerprint import different

DEFAULT = "default"


@dataclasses.dataclass(frozen=True)
class Variant:
    """The system, but for one ingredient of what it is compared with."""

    words: str
    """What is changed."""
    changes: str = "{}"
    """What goes over the scenario, YAML."""
    against: str = DEFAULT
    """The variant that it is compared with."""


VARIANTS = {
    DEFAULT: Variant("the system as it is"),
    "no_existence": Variant(
        "the paper's score in the place of the learned probability of existence, at a threshold that keeps .95 of what "
        "is right",
        "{acceptance: {by: score, threshold: 0.45}}",
    ),
    # The learned probability was made of the default filter's estimates, and accepts none of this one's.
    "paper_filter": Variant(
        "the published pose filter, beside the paper's score at a threshold that keeps as much",
        "{filter: paper, acceptance: {by: score, threshold: 0.3}}",
        against="no_existence",
    ),
    "no_action_model": Variant(
        "each look starts anew, whatever was done and believed", "{association: {carry: false}}"
    ),
    "no_memory": Variant("grasps like one that failed are tried again", "{task: {remember: false}}"),
    "surest_first": Variant(
        "the object that is likeliest to be brought away first, not the likeliest", "{task: {policy: surest}}"
    ),
    "simulated_detector": Variant(
        "a simulated detector with few errors: boxes off by 5 %, .05 missed, .1 mislabelled, .5 false boxes a picture",
        "{detector: SimulatedDetector}",
    ),
    "erring_detector": Variant(
        "a simulated detector that errs often: .15 missed, .25 mislabelled, 1.5 false boxes a picture",
        "{detector: SimulatedDetector, "
        "simulated_detector: {miss_rate: 0.15, wrong_label_rate: 0.25, false_boxes: 1.5}}",
    ),
    "no_camera_noise": Variant("depth as it is rendered", "{depth_noise: {enabled: false}}"),
}
"""By name. What one is compared with comes before it. Thresholds of the score: benchmarks/score_thresholds.py."""
RUNS, OBJECTS = 20, 5
QUICK_RUNS, QUICK_OBJECTS = 1, 1
FILES = ("results.json", "report.html", *VARIANTS)
FIGURES = (
    "runs", "objects", "objects_sorted_share", "objects_sorted_low95", "objects_sorted_high95", "missorted",
    "trials_per_object", "manipulation_errors", "cpu_s_per_run_median",
)  # fmt: skip

Prepare = Callable[[str], tuple[list[EpisodeSpec], dict[str, Any]]]
"""The runs of a scenario with such text over it, and their settings, as `commands.batch.prepare` makes them."""


def bench_ablations(
    out: Path,
    prepare: Prepare,
    executor: Executor,
    *,
    variants: Sequence[str] = tuple(VARIANTS),
    default: Path | None = None,
    faults: bool = False,
    quick: bool = False,
    progress: Callable[[str, int, int], None],
) -> dict[str, float]:
    """Runs variants and what they are compared with, writes report.html after each and results.json at the end.

    Returns the figures. variants: of VARIANTS. default: a batch's folder, whose runs of the same seeds stand for the
    default's. faults: whether things go wrong on purpose in what `prepare` makes; it is told. Raises InputError for a
    variant that is unknown, a folder that holds no such batch, and batches of other settings in `out`.
    """
    unknown = [name for name in variants if name not in VARIANTS]
    if unknown:
        raise InputError(f"variant {unknown[0]!r}: unknown; expected some of {', '.join(VARIANTS)}")
    names = [name for name in VARIANTS if name in {DEFAULT, *variants, *(VARIANTS[of].against for of in variants)}]
    jobs = {name: prepare(VARIANTS[name].changes) for name in names}
    specs, common = jobs[DEFAULT]
    rows: dict[str, list[dict[str, Any]]] = {}
    folders = {name: out / name for name in names}
    if default is not None:
        folders[DEFAULT] = default
        _check_default(default, specs, common)
    for name in names:
        if name != DEFAULT or default is None:
            check_batch(folders[name], jobs[name][1])
    out.mkdir(parents=True, exist_ok=True)
    seeds = {spec.seed for spec in specs}
    found: dict[str, float] = {}
    made: dict[str, dict[str, Any]] = {}
    for name in names:

        def told(what: str, done: int, total: int, name: str = name) -> None:
            progress(f"{name}: {what}", done, total)

        if name != DEFAULT or default is None:
            run_batch(folders[name], *jobs[name], executor, told)
        rows[name] = [row for row in read_episodes(folders[name]) if row["seed"] in seeds]
        found = figures(rows)
        made[name] = made_by(folders[name])
        ran = {"seeds": [min(seeds), max(seeds)], "runs": len(seeds), "done": len(seeds)}  # of a default that has more
        of = [batch | ran for batch in made.values()]
        write_whole(out / "report.html", _page(out, folders, rows, found, of, quick=quick))
    # At the end alone: a bench whose results.json is there counts as done.
    same = {key: value for key, value in common.items() if key != "scenario"}
    changes = {name: VARIANTS[name].changes for name in names}
    write_results(
        out, "ablations", quick=quick,
        settings={**same, "faults": faults, "variants": changes, "default": made[DEFAULT]},
        seeds={"first": specs[0].seed}, figures=found, rows=_rows(rows), batches=list(made.values()),
    )  # fmt: skip
    return found


def _check_default(folder: Path, specs: Sequence[EpisodeSpec], settings: Mapping[str, Any]) -> None:
    """Raises InputError for a batch that is not what the default's own would be; it may have more seeds."""
    begun = read_batch(folder)
    same = {**begun["settings"], "first_seed": settings["first_seed"], **begun["versions"]}
    other = different(same, {**settings, **versions()})
    if other:
        raise InputError(f"--default {folder}: is of {other}; expected a batch of this program and scenario")
    done = {row["seed"] for row in read_episodes(folder)}
    lacking = [spec.seed for spec in specs if spec.seed not in done]
    if lacking:
        raise InputError(
            f"--default {folder}: seed {lacking[0]} is not done; expected {len(specs)} from {specs[0].seed}"
        )


def figures(rows: Mapping[str, Sequence[Row]]) -> dict[str, float]:
    """VARIANT.NAME -> value: `batch_figures`, and of the objects how many more it sorts than what it is against.

    With faults, what became of them, too. CPU seconds of variants say little: a batch may have been run beside others.
    """
    found: dict[str, float] = {}
    for name, of in rows.items():
        known = known_figures(of)
        found |= {f"{name}.{figure}": known[figure] for figure in FIGURES}
        if any(row.get("faults") for row in of):
            found |= {f"{name}.{figure}": value for figure, value in dealt_with(of).items()}
        if name != DEFAULT:
            gain = paired_difference(rows[VARIANTS[name].against], of)
            told = (float("nan"),) * 5 if gain is None else dataclasses.astuple(gain)[1:]
            found |= dict(zip((f"{name}.{figure}" for figure in GAIN), told, strict=True))
            found[f"{name}.{SAME}"] = float(same_runs(rows[VARIANTS[name].against], of))
    return found


GAIN = ("pairs_that_differ", "gain", "gain_low95", "gain_high95", "gain_p")
"""Of a variant against another, as `batch_figures.Gain` has them."""
SAME = "runs_the_same"
"""Of a variant: runs that are, to the last bit, those of what it is compared with. What was changed never mattered."""
WITHIN_2 = "dealt_with_within_2"
INTERVALS = {"objects_sorted_share": ("", "objects_sorted"), "gain": ("+", "gain")}
"""Columns that have one: sign of what is told, and what stands before the names of its ends."""


def _rows(rows: Mapping[str, Sequence[Row]]) -> list[dict[str, Any]]:
    told = [{"table": "run", "variant": name, **brief(row)} for name, of in rows.items() for row in of]
    told += [{"table": "loss", "variant": name, **loss} for name, of in rows.items() for loss in losses(of)]
    return told + [{"variant": name, **fault} for name, of in rows.items() for fault in fault_rows(of)]


def worth_table(found: Mapping[str, float | None]) -> list[tuple[str, ...]]:
    """What each variant has come to, in words: heads, then a row for each; nothing stands for what cannot be told.

    found: as `figures` makes them, None for NaN as results.json has it.
    """
    known = {name: float("nan") if value is None else float(value) for name, value in found.items()}
    columns = {
        "runs": "runs", "objects_sorted_share": "objects sorted", "against": "compared with", "gain": "gain",
        "pairs_that_differ": "pairs that differ", "gain_p": "p", SAME: "runs the same", "missorted": "missorted",
        "trials_per_object": "trials an object",
    }  # fmt: skip
    if any(name.endswith(WITHIN_2) for name in known):
        columns[WITHIN_2] = "faults dealt with within two looks"

    def cell(variant: str, column: str) -> str:
        if column == "against":
            return "" if variant == DEFAULT else VARIANTS[variant].against
        value = known.get(f"{variant}.{column}", float("nan"))
        if math.isnan(value):
            return ""
        if column not in INTERVALS:
            return number(value)
        sign, ends = INTERVALS[column]
        low, high = (known[f"{variant}.{ends}{end}"] for end in ("_low95", "_high95"))
        return f"{value:{sign}.3f}" + ("" if math.isnan(low) else f" ({low:{sign}.3f} to {high:{sign}.3f})")

    names = dict.fromkeys(name.split(".")[0] for name in known)
    heads = ("variant", "what is changed", *columns.values())
    return [heads, *((name, VARIANTS[name].words, *(cell(name, column) for column in columns)) for name in names)]


def _page(
    out: Path,
    folders: Mapping[str, Path],
    rows: Mapping[str, Sequence[Row]],
    found: Mapping[str, float],
    made: Iterable[Mapping[str, Any]],
    *,
    quick: bool,
) -> str:
    """folders: of the batches that the rows, by variant, are of."""
    heads, *table = worth_table(found)

    def lead(name: str, seed: int) -> str:
        return link(seed, f"{name}/{seed}", out if folders[name].parent == out else None)

    return page.page(
        "Ablations",
        [
            "<h1>What each ingredient is worth</h1>",
            "<p>The same pours, sorted with one thing changed of what a variant is compared with. Gain: of the "
            "objects, how many more are sorted than by that, over pairs of runs; in brackets, 95 % intervals; p: how "
            "often signs drawn at random make as large a difference. Pairs differ in how many were sorted; where runs "
            "are the same, to the last bit, the change made no difference at all.</p>",
            made_of(made, quick=quick),
            page.table(heads, [tuple(map(page.text, row)) for row in table]),
            "<h2>What was lost, by cause</h2>",
            by_cause({name: causes(of) for name, of in rows.items()}),
            every_loss(rows, lead, "variant"),
        ],
    )  # fmt: skip
