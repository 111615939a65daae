"""`sum-drake bench reject`: whether a belief can be trusted, and what it makes of what goes wrong.

Three experiments, on poured tables that nothing was tuned or learned on: hypotheses of one look at tables of all kinds,
right or wrong; the paper's false positives, ten scenes of five objects, ten trials each; and tables to which something
happens between looks (`bench.sequences`). What is done is kept in rows.jsonl: called again, the bench goes on.
"""

import dataclasses
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sum_drake.bench.hypotheses import FirstLook, first_look
from sum_drake.bench.pose_scenes import FIRST_SCENE, other_meshes
from sum_drake.bench.reject_figures import figures, said
from sum_drake.bench.reject_report import report_page
from sum_drake.bench.results import write_results
from sum_drake.bench.resumed import Progress, RowLog, Task, run_tasks
from sum_drake.bench.sequences import FAULTS, Followed, run_sequence
from sum_drake.bench.watching import Setting, Tables, setting
from sum_drake.detection.inference import load_detector
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.fingerprint import code_and_meshes
from sum_drake.jsonio import encode
from sum_drake.objects import Catalogue

FILES = ("results.json", "report.html", "rows.jsonl")
FIRST_TRIAL_SCENE, FIRST_SEQUENCE = FIRST_SCENE + 20_000, FIRST_SCENE + 40_000
"""Seeds, so that no table is in two experiments."""


@dataclasses.dataclass(frozen=True)
class Size:
    """How much is measured."""

    tables: int
    scenes: int
    """Of the paper's experiment."""
    trials: int
    """Of each of those scenes."""
    sequences: int
    """Of each of `sequences.FAULTS`."""


FULL, QUICK = Size(tables=100, scenes=10, trials=10, sequences=10), Size(tables=8, scenes=2, trials=2, sequences=1)


@dataclasses.dataclass(frozen=True)
class Measured:
    """What came of a task; one of the two, or neither where a fault could happen to nothing."""

    look: FirstLook | None = None
    followed: Followed | None = None


def bench_reject(
    out: Path,
    catalogue: Catalogue,
    *,
    size: Size = FULL,
    seed: int = 0,
    workers: int = 2,
    anew: bool = False,
    progress: Progress = lambda what, done, total: None,
) -> dict[str, float]:
    """Measures, writes rows.jsonl as it goes and results.json and report.html at the end, and returns the figures.

    anew: what is in `out` is replaced. Raises InputError for rows of other settings in `out`, and where the detector
    does not know the catalogue's labels.
    """
    start = time.monotonic()
    load_detector(None, labels=catalogue.labels)  # refused here rather than in a worker
    settings: dict[str, Any] = {"seed": seed} | code_and_meshes(catalogue)
    if anew:
        for name in FILES:
            (out / name).unlink(missing_ok=True)
    log = RowLog(out, settings, Measured)
    tasks = _tasks(size, 100_000 * seed)
    with tempfile.TemporaryDirectory(prefix="sum-drake-") as scratch:
        told = other_meshes(catalogue, Path(scratch), FIRST_SCENE + seed)
        done = dict(
            zip(
                tasks,
                run_tasks(
                    tasks,
                    log,
                    _measure,
                    workers=workers,
                    begin=_start_worker,
                    arguments=(catalogue, told),
                    progress=progress,
                ),
                strict=True,
            )
        )
    looks = [one.look for task, one in done.items() if task[0] == "table" and one.look is not None]
    trials = [one.look for task, one in done.items() if task[0] == "trial" and one.look is not None]
    followed = [one.followed for one in done.values() if one.followed is not None]
    found = figures(looks, trials, followed)
    write_whole(out / "report.html", report_page(looks, trials, followed, found))
    write_results(
        out,
        "reject",
        quick=size == QUICK,
        settings=settings | dataclasses.asdict(size) | {"wall_s": time.monotonic() - start},
        seeds={"tables": _first(seed, 0), "scenes": _first(seed, 1), "sequences": _first(seed, 2)},
        figures=found,
        rows=_rows(looks, trials, followed),
    )
    return found


def _first(seed: int, experiment: int) -> int:
    return (FIRST_SCENE, FIRST_TRIAL_SCENE, FIRST_SEQUENCE)[experiment] + 100_000 * seed


def _tasks(size: Size, offset: int) -> list[Task]:
    faults = list(FAULTS)
    sequences = range(FIRST_SEQUENCE + offset, FIRST_SEQUENCE + offset + size.sequences * len(faults))
    trial_scenes = range(FIRST_TRIAL_SCENE + offset, FIRST_TRIAL_SCENE + offset + size.scenes)
    return [
        *(("table", table) for table in range(FIRST_SCENE + offset, FIRST_SCENE + offset + size.tables)),
        *(("trial", scene, trial) for scene in trial_scenes for trial in range(size.trials)),
        *(("sequence", table, faults[i % len(faults)]) for i, table in enumerate(sequences)),
    ]


def _rows(looks: list[FirstLook], trials: list[FirstLook], followed: list[Followed]) -> list[Mapping[str, Any]]:
    rows: list[Mapping[str, Any]] = [
        {"table": "hypothesis"} | _flat(one) | {"said": said(one)} for look in looks for one in look.judged
    ]
    rows += [{"table": "trial", "scene": t.table, "trial": t.trial, **encode(t.counted)} for t in trials]
    for each in followed:
        rows += [{"table": "outcome"} | _flat(one) for one in each.outcomes]
        for table, of in (("update", each.updates), ("association", each.matched)):
            rows += [{"table": table, "scene": each.judged[0].table} | encode(one) for one in of]
    return rows


def _flat(one: Any) -> dict[str, Any]:
    """As a row: its table's seed is called scene, and features are rounded, of which there are many."""
    data: dict[str, Any] = encode(one)
    data["scene"] = data.pop("table")
    if "features" in data:
        data["features"] = {name: float(f"{value:.4g}") for name, value in data["features"]}
    return data


# Measuring, in processes of their own.

_tables: Tables
"""This process's, in those that measure."""


def _start_worker(catalogue: Catalogue, told: Catalogue) -> None:
    global _tables
    _tables = Tables(catalogue, told, load_detector(None, labels=catalogue.labels), filter_config())


def _measure(kind: str, seed: int, which: int | str = 0) -> Measured:
    if kind == "sequence":
        return Measured(followed=run_sequence(_tables, setting(seed), str(which)))
    if kind == "trial":
        return Measured(look=first_look(_tables, paper_setting(seed), int(which)))
    return Measured(look=first_look(_tables, setting(seed)))


def paper_setting(seed: int) -> Setting:
    """Five objects before the robot, whose meshes it knows, as in the paper's single scenes.

    The simulated detector sees them: there is hardly anything to reject of what the trained one sees there.
    """
    return Setting(seed, objects=5, others=0, head=True, sensor="structured_light", trained=False, own_meshes=True)
