"""`sum-drake bench faults`: runs in which things go wrong on purpose; whether any of it ends badly.

The runs are a batch, in `runs/` of the bench's folder: called again, it goes on.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake import page
from sum_drake.assets import InputError
from sum_drake.batch import Executor, Progress, run_batch
from sum_drake.batch_figures import Row, batch_figures, causes, errors, known_figures, losses
from sum_drake.batch_folder import brief, made_by, read_episodes
from sum_drake.batch_parts import by_cause, link, made_of, tiles
from sum_drake.bench.aims import Aims, figure_table
from sum_drake.bench.results import write_results
from sum_drake.episodes import EpisodeSpec
from sum_drake.executed import KINDS
from sum_drake.files import write_whole
from sum_drake.runlog_reader import read_what_there_is
from sum_drake.types import SceneBelief

FILES = ("results.json", "report.html", "runs")
AIMS: Aims = {
    "crashes": ("at most", 0),
    "hangs": ("at most", 0),
    "invalid_beliefs": ("at most", 0),
    "limit_violations": ("at most", 0),
    "missorted": ("at most", 0),
    "dealt_with_within_2": ("at least", 0.9),
}
RUNS = 10
SCENARIO = "faults"


def bench_faults(
    out: Path,
    specs: Sequence[EpisodeSpec],
    settings: Mapping[str, Any],
    executor: Executor,
    *,
    quick: bool,
    progress: Progress,
) -> dict[str, float]:
    """Runs them, and writes results.json and report.html; returns the figures."""
    run_batch(out / "runs", specs, settings, executor, progress)
    runs = read_episodes(out / "runs")
    broken = {row["seed"]: list(invalid_beliefs(out / "runs" / str(row["seed"]) / "run.mcap")) for row in runs}
    found = fault_figures(runs, sum(map(len, broken.values())))
    rows = (
        fault_rows(runs)
        + [{"table": "run", **brief(row)} for row in runs]
        + [{"table": "invalid_belief", "seed": seed, "what": what} for seed, said in broken.items() for what in said]
        + [{"table": "loss", **loss} for loss in losses(runs)]
        + [{"table": "error", "cause": cause, "trials": trials} for cause, trials in errors(runs).items()]
    )
    made = made_by(out / "runs")
    write_whole(out / "report.html", _page(out, runs, found, rows, made, quick=quick))
    write_results(
        out, "faults", quick=quick, settings=settings, seeds={"first": specs[0].seed}, figures=found, rows=rows,
        batches=[made],
    )  # fmt: skip
    return found


def fault_figures(runs: Sequence[Row], invalid: int) -> dict[str, float]:
    """Figures of the runs; invalid: how many beliefs were."""
    return {**known_figures(runs), "invalid_beliefs": invalid, **dealt_with(runs)}


def fault_rows(runs: Sequence[Row]) -> list[dict[str, Any]]:
    """A row for each fault that runs were to have."""
    return [{"table": "fault", "seed": row["seed"], **fault} for row in runs for fault in row.get("faults") or ()]


def dealt_with(runs: Sequence[Row]) -> dict[str, float]:
    """How many faults happened, and the share of them that the belief dealt with after at most two looks, by kind."""
    faults = [fault for row in runs for fault in row.get("faults") or () if fault["happened"]]
    kinds = sorted({fault["kind"] for fault in faults})

    def within_two(some: Sequence[Mapping[str, Any]]) -> float:
        soon = [fault["dealt_with_after"] is not None and fault["dealt_with_after"] <= 2 for fault in some]
        return float(np.mean(soon)) if soon else float("nan")

    return {
        "faults_happened": len(faults),
        "dealt_with_within_2": within_two(faults),
        **{f"dealt_with_within_2.{kind}": within_two([f for f in faults if f["kind"] == kind]) for kind in kinds},
    }


def invalid_beliefs(log: Path) -> Iterator[str]:
    """What is wrong with the beliefs of a log, in words; what cannot be read is none that is right.

    A log is read as far as its first pose belief that is none, which `types.PoseBelief` refuses.
    """
    try:
        record = read_what_there_is(log)
    except InputError as error:
        yield str(error)
        return
    for perception in record.perceptions:
        yield from (f"observation {perception.step}: {said}" for said in _invalid(perception.posterior))
    if record.problem is not None:
        yield record.problem


def _invalid(belief: SceneBelief) -> Iterator[str]:
    ids = [track.id for track in belief.tracks]
    if len(ids) != len(set(ids)):
        yield "two tracks of one id"
    for track in belief.tracks:
        if not 0.0 <= track.probability <= 1.0:  # nor is NaN
            yield f"track {track.id} has probability {track.probability}"
        if not np.isfinite(track.X_WO).all():
            yield f"track {track.id} is nowhere"


def _page(
    out: Path,
    runs: Sequence[Row],
    found: Mapping[str, float],
    rows: Sequence[Mapping[str, Any]],
    made: Mapping[str, Any],
    *,
    quick: bool,
) -> str:
    faults = [row for row in rows if row["table"] == "fault"]

    def lead(row: Mapping[str, Any]) -> str:
        return link(row["seed"], f"runs/{row['seed']}", out)

    parts = [
        "<h1>Runs with faults</h1>",
        "<p>Things slip, are dropped, swept, taken and added; camera and detector fail.</p>",
        tiles(batch_figures(runs)),
        made_of([made], quick=quick),
        figure_table(found, AIMS),
        "<h2>Runs</h2>",
        page.table(
            ("seed", "how it ended", "outcome", "sorted"),
            [
                (
                    lead(row),
                    page.text(row["state"] + (f": {row['reason']}" if row["reason"] else "")),
                    page.text(row.get("outcome", "")),
                    f"{row.get('objects_sorted', 0)} of {row.get('objects_total', '?')}",
                )
                for row in runs
            ],
        ),
        "<h2>Faults</h2>",
        page.table(
            ("seed", "look", "fault", "object", "dealt with after", "what the belief says"),
            [
                (
                    lead(row),
                    str(row["observation"]),
                    page.text(row["kind"].replace("_", " ")),
                    page.text(row["object"] or ""),
                    "" if row["dealt_with_after"] is None else str(row["dealt_with_after"]),
                    page.text(row["belief"]),
                )
                for row in faults
            ],
        ),
        "<h2>Objects lost, by cause</h2>",
        by_cause({"objects": causes(runs)}),
        "<h2>Manipulation errors, by cause</h2>",
        by_cause({"trials": errors(runs)}),
        "<h2>Samples over a joint's limits</h2>",
        page.table(
            ("seed", *KINDS),
            [
                (
                    lead(row),
                    *(str(row["limits"]["violations"].get(kind, 0)) for kind in KINDS),
                )
                for row in runs
                if row.get("limits") and any(row["limits"]["violations"].values())
            ],
        ),
    ]
    return page.page("Runs with faults", parts)
