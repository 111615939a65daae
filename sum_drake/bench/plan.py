"""`sum-drake bench plan`: inverse kinematics, paths, and picks with true poses.

Four experiments: poses of the hand that are reachable by construction; paths that picks from poured tables ask for
(`plan_queries`); the hard kinds of published sets, shelves, cages and what stands under tables, for this project's own
Fetch (`plan_sets`); and picks in the station's physics (`plan_picks`). What is done is kept in rows.jsonl: called
again, the bench goes on until it is done. `plan_own` is of a user's own problems and robot.
"""

import dataclasses
import functools
import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.assets import asset
from sum_drake.bench import plan_pick_trials, plan_picks
from sum_drake.bench.aims import Aims
from sum_drake.bench.plan_ik import IkMeasured, measure_ik
from sum_drake.bench.plan_own import TIME_LIMIT, refuse_others
from sum_drake.bench.plan_picks import Picked, pick_figures, pick_rows, pick_tasks
from sum_drake.bench.plan_queries import KINDS, Query, QueryMeasured, load_queries, measure_query
from sum_drake.bench.plan_report import report_page
from sum_drake.bench.plan_sets import KINDS as SETS
from sum_drake.bench.plan_sets import fetch_robot
from sum_drake.bench.plan_solve import Solved, revalidated, solve, warm_up
from sum_drake.bench.results import write_results
from sum_drake.bench.resumed import Progress, RowLog, Task, run_tasks
from sum_drake.files import write_whole
from sum_drake.fingerprint import code_and_meshes
from sum_drake.jsonio import encode
from sum_drake.objects import Catalogue
from sum_drake.planning_problems import PlanningProblem, load_problems
from sum_drake.planning_scene import PlanningScene
from sum_drake.types import Immutable
from sum_drake.user_robot import UserRobot

FILES = ("results.json", "report.html", "rows.jsonl")
AIMS: Aims = {
    **plan_picks.AIMS,
    "ik_success": ("at least", 0.999),
    "ik_median_s": ("at most", 0.001),
    "plan_success_1s": ("at least", 0.95),
    "plan_median_s": ("at most", 0.1),
    "paths_free": ("at least", 1.0),
    **{f"{kind}_solved_10s": ("at least", 0.75) for kind in SETS},
}


@dataclasses.dataclass(frozen=True)
class Size:
    """How much is measured."""

    poses: int
    """Of the hand."""
    queries: int
    """Of those committed, evenly picked."""
    problems: int
    """Of each hard set, the first."""
    picks: plan_picks.Size


FULL = Size(poses=10_000, queries=100_000, problems=100_000, picks=plan_picks.FULL)
QUICK = Size(poses=1_000, queries=30, problems=4, picks=plan_picks.QUICK)


@dataclasses.dataclass(frozen=True, eq=False)
class Measured(Immutable):
    """What came of a task; one of these."""

    ik: IkMeasured | None = None
    query: QueryMeasured | None = None
    solved: Solved | None = None
    valid: bool = True
    """Whether the path of `solved`, if there is one, is what was asked for, and free, by Drake alone."""
    picked: Picked | None = None


def bench_plan(
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

    anew: what is in `out` is replaced. Raises InputError for rows of other settings in `out`.
    """
    start = time.monotonic()
    settings: dict[str, Any] = {"seed": seed} | code_and_meshes(catalogue)
    if anew:
        for name in FILES:
            (out / name).unlink(missing_ok=True)
    refuse_others(out, settings)
    log = RowLog(out, settings, Measured)
    tasks = plan_tasks(size, catalogue, seed)
    done = run_tasks(
        tasks, log, _measure, workers=workers, begin=_start_worker, arguments=(catalogue, seed), progress=progress
    )
    found = figures(dict(zip(tasks, done, strict=True)))
    rows = _rows(dict(zip(tasks, done, strict=True)))
    write_whole(out / "report.html", report_page(rows, found, AIMS))
    write_results(
        out,
        "plan",
        quick=size == QUICK,
        settings=settings | {"time_limit_s": TIME_LIMIT, "wall_s": time.monotonic() - start},
        seeds={"seed": seed, "picks": plan_picks.FIRST_ALONE},
        figures=found,
        rows=rows,
    )
    return found


def plan_tasks(size: Size, catalogue: Catalogue, seed: int) -> list[Task]:
    """In the order in which they are done: the short ones first, so that progress shows."""
    queries = len(_queries())
    chosen = np.unique(np.linspace(0, queries - 1, min(size.queries, queries)).round().astype(int))
    return [
        ("ik", size.poses),
        *(("query", int(i)) for i in chosen),
        *(("problem", kind, i) for kind in SETS for i in range(min(size.problems, len(_problems(kind))))),
        *(("pick", *task) for task in pick_tasks(size.picks, catalogue, seed)),
    ]


def figures(done: Mapping[Task, Measured]) -> dict[str, float]:
    """Of all that was measured; nan where there was nothing to measure one on."""
    found = pick_figures([one.picked for one in done.values() if one.picked is not None])
    for one in (one.ik for one in done.values() if one.ik is not None):
        found |= {"ik_success": one.success, "ik_median_s": one.median_s, "ik_p95_s": one.p95_s}
    queries = [one.query for one in done.values() if one.query is not None]
    found |= query_figures(queries)
    solved = {task: one for task, one in done.items() if one.solved is not None}
    for kind in SETS:
        of = [one for (_, name, *_), one in solved.items() if name == kind]
        found |= set_figures(kind, of)
    returned = [one.free for one in queries if one.solved]
    returned += [one.valid for one in solved.values() if one.solved is not None and one.solved.solved]
    found["paths_free"] = float(np.mean(returned)) if returned else np.nan
    found["limit_violations"] += sum(one.limit_use > 1.0 for one in queries)
    return found


def query_figures(queries: Sequence[QueryMeasured]) -> dict[str, float]:
    """Of paths that picks ask for."""
    if not queries:
        return {"plan_success_1s": np.nan, "plan_median_s": np.nan}
    seconds = np.array([one.cpu_s for one in queries])
    solved = np.array([one.solved for one in queries])
    found = {
        "plan_success_1s": float(np.mean(solved & (seconds <= 1.0))),
        "plan_success": float(solved.mean()),
        "plan_median_s": float(np.median(seconds)),
        "plan_p95_s": float(np.percentile(seconds, 95)),
        "plan_queries": float(len(queries)),
    }
    for kind in KINDS:
        of = [one for one in queries if one.kind == kind]
        if of:
            found[f"plan_{kind}_success_1s"] = float(np.mean([one.solved and one.cpu_s <= 1.0 for one in of]))
            found[f"plan_{kind}_median_s"] = float(np.median([one.cpu_s for one in of]))
    return found


def set_figures(kind: str, of: Sequence[Measured]) -> dict[str, float]:
    """Of a hard set."""
    if not of:
        return {f"{kind}_solved_10s": np.nan}
    solved = [one.solved for one in of if one.solved is not None]
    return {
        f"{kind}_solved_10s": float(np.mean([one.solved and one.time_s <= TIME_LIMIT for one in solved])),
        f"{kind}_solved_1s": float(np.mean([one.solved and one.time_s <= 1.0 for one in solved])),
        f"{kind}_median_s": float(np.median([one.time_s for one in solved])),
    }


def _rows(done: Mapping[Task, Measured]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = [dict(row) for row in pick_rows([one.picked for one in done.values() if one.picked])]
    for task, one in done.items():
        if one.ik is not None:
            rows += [dict(row) for row in one.ik.rows]
        if one.query is not None:
            rows.append({"table": "query"} | encode(one.query))
        if one.solved is not None:
            row = encode(one.solved)
            row["waypoints"] = len(row.pop("path"))
            rows.append({"table": "problem", "kind": task[1], "valid": one.valid} | row)
    return rows


# Measuring, in processes of their own.

_robot: UserRobot
_base: PlanningScene
_catalogue: Catalogue
_seed: int


@functools.cache
def _queries() -> tuple[Query, ...]:
    return load_queries(asset("package://sum_drake/problems/table.json"))


@functools.cache
def _problems(kind: str) -> tuple[PlanningProblem, ...]:
    return load_problems(asset(f"package://sum_drake/problems/{kind}.json"), fetch_robot())


def _start_worker(catalogue: Catalogue, seed: int) -> None:
    global _robot, _base, _catalogue, _seed
    logging.getLogger("drake").setLevel(logging.WARNING)
    _robot, _base, _catalogue, _seed = fetch_robot(), PlanningScene(), catalogue, seed
    plan_pick_trials.start_worker(catalogue)
    warm_up()


def _measure(what: str, *which: Any) -> Measured:
    if what == "ik":
        return Measured(ik=measure_ik(which[0], _seed))
    if what == "query":
        return Measured(query=measure_query(_queries()[which[0]], _catalogue, _base, seed=_seed))
    if what == "problem":
        problem = _problems(which[0])[which[1]]
        solved = solve(_robot, problem, seed=_seed, time_limit=TIME_LIMIT)
        valid = not solved.solved or revalidated(_robot, problem, np.array(solved.path))
        return Measured(solved=solved, valid=valid)
    return Measured(picked=plan_pick_trials.measure_pick(*which))
