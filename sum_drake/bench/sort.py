"""`sum-drake bench sort`: the paper's sequential sorting, its table beside ours, and what larger batches come to.

The sequences are a batch like any other, in `sequences/` of the bench's folder: called again, it goes on. The figures
are of the sequences, unless batches of more runs are given, by number of objects on the table.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake import page
from sum_drake.assets import InputError
from sum_drake.batch import Executor, Progress, run_batch
from sum_drake.batch_figures import Row, batch_figures, causes, errors, known_figures, losses, objects_of
from sum_drake.batch_folder import brief, made_by, read_batch, read_episodes
from sum_drake.batch_parts import by_cause, every_loss, link, made_of, tiles
from sum_drake.bench.aims import Aims, figure_table
from sum_drake.bench.results import write_results
from sum_drake.episodes import EpisodeSpec
from sum_drake.files import write_whole
from sum_drake.fingerprint import different
from sum_drake.report_parts import count

FOLDER = "sequences"
FILES = ("results.json", "report.html", FOLDER)
AIMS: Aims = {
    "crashes": ("at most", 0),
    "hangs": ("at most", 0),
    "objects_sorted_share": ("at least", 0.98),
    "objects_sorted_low95": ("at least", 0.95),
    "trials_per_object": ("at most", 1.05),
    "missorted": ("at most", 0),
    "limit_violations": ("at most", 0),
    "cpu_s_per_run_median": ("at most", 300.0),
    "objects_sorted_share_10": ("at least", 0.93),
}
"""Of many pours: eight sequences alone cannot show them."""
SEQUENCES, OBJECTS = 8, 5
"""How many, of how many objects each: the paper's."""
PAPER: Mapping[str, tuple[float, ...]] = {
    "objects": (5,) * 8,
    "failed": (1, 1, 2, 0, 0, 1, 1, 0),
    "trials": (4, 6, 7, 5, 5, 5, 6, 5),
    "completion": (0.8, 1.0, 1.0, 1.0, 1.0, 0.8, 1.0, 1.0),
}
"""The table of Sui et al. 2017, sequences (a) to (h)."""


def bench_sort(
    out: Path,
    specs: Sequence[EpisodeSpec],
    settings: Mapping[str, Any],
    executor: Executor,
    batches: Sequence[Path],
    *,
    usual: Callable[[int], Mapping[str, Any]],
    quick: bool,
    progress: Progress,
) -> dict[str, float]:
    """Runs the sequences, and writes results.json and report.html of them and of the batches; returns the figures.

    Raises InputError as `read_batches` does.
    """
    larger = read_batches(batches, usual)
    run_batch(out / FOLDER, specs, settings, executor, progress)
    sequences = read_episodes(out / FOLDER)
    found = sort_figures(sequences, larger)
    rows = [{"table": "sequence", **brief(row)} for row in sequences]
    rows += [{"table": "run", **brief(row)} for row in larger]
    for kind, of in by_kind(sequences, larger).items():
        rows += [{"table": "loss", "of": kind, **loss} for loss in losses(of)]
        rows += [{"table": "error", "of": kind, "cause": cause, "trials": n} for cause, n in errors(of).items()]
    told = [made_by(folder) for folder in batches]
    own = made_by(out / FOLDER)
    write_whole(out / "report.html", _page(out, sequences, larger, found, [own, *told], quick=quick))
    write_results(
        out, "sort", quick=quick, settings={**settings, "batches": told},
        seeds={"first_sequence": specs[0].seed}, figures=found, rows=rows, batches=[own],
    )  # fmt: skip
    return found


SAME = ("scenario", "catalogue", "meshes", "models")
"""Settings of a batch that have to be the usual ones. Its program may be another: the page says which commit's."""


def read_batches(folders: Sequence[Path], usual: Callable[[int], Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The runs of batches.

    usual: settings of runs of so many objects that nothing was changed about. Raises InputError for a folder that is no
    batch, one of another scenario, other objects or weights, or one of which nothing is done, and for a run that is
    in two of them.
    """
    for folder in folders:
        begun = read_batch(folder)
        made = begun["settings"]
        expected = usual(made["objects"])
        differs = different(made, {name: expected[name] for name in SAME})
        if differs:
            raise InputError(f"--batch {folder}: is of {differs}; expected runs of the scenario as it comes")
        if not begun["episodes"]:
            raise InputError(f"--batch {folder}: none of its {begun['runs']} runs is done; expected some")
    rows = [(folder, row) for folder in folders for row in read_episodes(folder)]
    first: dict[tuple[int, int], Path] = {}
    for folder, row in rows:
        other = first.setdefault((row["objects_asked"], row["seed"]), folder)
        if other is not folder:
            raise InputError(f"--batch {folder}: seed {row['seed']} is in {other}, too; expected each run once")
    return [row for _, row in rows]


def sort_figures(sequences: Sequence[Row], larger: Sequence[Row]) -> dict[str, float]:
    """Figures of the sequences, `sequences_*`, of the runs of five objects, and of those of so many others, as `*_10`.

    Without runs of five in larger batches the sequences are they.
    """
    kinds = by_kind(sequences, larger)
    five = kinds.get(_kind(OBJECTS), sequences)
    others = [number for number in _numbers(larger) if number != OBJECTS]
    return {
        **known_figures(five),
        "sequences": len(sequences),
        "sequences_complete": sum(row.get("objects_sorted") == objects_of(row) for row in sequences),
        "sequences_objects_sorted": sum(row.get("objects_sorted", 0) for row in sequences),
        "sequences_trials": sum(row.get("manipulation_trials", 0) for row in sequences),
        "sequences_errors": sum(row.get("manipulation_errors", 0) for row in sequences),
        **{
            f"{name}_{number}": value
            for number in others
            for name, value in known_figures(kinds[_kind(number)]).items()
        },
    }


def aims_for(larger: Sequence[Row]) -> Aims:
    """What is asked of the runs that there are, beside the sequences."""
    asked = _numbers(larger)
    return {name: of for name, of in AIMS.items() if (10 if name.endswith("_10") else OBJECTS) in asked}


def by_kind(sequences: Sequence[Row], larger: Sequence[Row]) -> dict[str, list[Row]]:
    """What is told apart: `sequences`, and the runs of batches by their number of objects, as `5 objects`."""
    batches = {_kind(number): [row for row in larger if row["objects_asked"] == number] for number in _numbers(larger)}
    return {FOLDER: list(sequences), **batches}


def _numbers(runs: Sequence[Row]) -> list[int]:
    """How many objects they have, each number once."""
    return sorted({row["objects_asked"] for row in runs})


def _kind(objects: int) -> str:
    return count(objects, "object")


def _page(
    out: Path,
    sequences: Sequence[Row],
    larger: Sequence[Row],
    found: Mapping[str, float],
    batches: Sequence[Mapping[str, Any]],
    *,
    quick: bool,
) -> str:
    kinds = by_kind(sequences, larger)
    aims = aims_for(larger)

    def lead(kind: str, seed: int) -> str:
        return link(seed, f"{FOLDER}/{seed}", out if kind == FOLDER else None)

    others = [f"*_{n} of runs of {count(n, 'object')}" for n in _numbers(larger) if n != OBJECTS]
    plain = f"runs of {OBJECTS} objects" if OBJECTS in _numbers(larger) else "the sequences"
    parts = [
        "<h1>Sequential sorting</h1>",
        "<p>Objects are poured on the table and sorted into two bins. First the paper's eight sequences with a Fetch, "
        "then ours in simulation: another robot's world, so the rows stand side by side, no more.</p>",
        *(f"<h3>{page.text(kind.capitalize())}</h3>{tiles(batch_figures(of))}" for kind, of in kinds.items()),
        made_of(batches, quick=quick),
        _table(
            "The paper's",
            "abcdefgh",
            objects=PAPER["objects"],
            failed=PAPER["failed"],
            trials=PAPER["trials"],
            completion=PAPER["completion"],
        ),
        _table(
            "Ours",
            [str(row["seed"]) for row in sequences],
            objects=[objects_of(row) for row in sequences],
            failed=[row.get("manipulation_errors", 0) for row in sequences],
            trials=[row.get("manipulation_trials", 0) for row in sequences],
            completion=[row.get("objects_sorted", 0) / max(objects_of(row), 1) for row in sequences],
            report=[lead(FOLDER, row["seed"]) for row in sequences],
        ),
        "<h2>Figures</h2>",
        f"<p>{'; '.join([f'Figures are of {plain}', 'sequences_* of the sequences', *others])}.</p>",
        figure_table(found, aims),
        "<h2>Manipulation errors, by cause</h2>",
        by_cause({kind: errors(of) for kind, of in kinds.items()}),
        "<h2>Objects lost, by cause</h2>",
        by_cause({kind: causes(of) for kind, of in kinds.items()}),
        every_loss(kinds, lead),
    ]
    return page.page("Sequential sorting", parts)


def _table(
    title: str,
    names: Sequence[str],
    *,
    objects: Sequence[float],
    failed: Sequence[float],
    trials: Sequence[float],
    completion: Sequence[float],
    report: Sequence[str] = (),
) -> str:
    """The paper's rows: a column for each sequence, and the sum. report: links to theirs, HTML."""
    done = sum(share * number for share, number in zip(completion, objects, strict=True)) / max(sum(objects), 1)
    rows = [
        ("objects", *map(str, objects), str(sum(objects))),
        ("manipulation errors", *map(str, failed), str(sum(failed))),
        ("manipulation trials", *map(str, trials), str(sum(trials))),
        ("completion ratio", *(f"{share:.2f}" for share in completion), f"{done:.3f}"),
    ]
    if report:
        rows.append(("report", *report, ""))
    return f"<h2>{title}</h2>" + page.table(("", *names, "all"), rows)
