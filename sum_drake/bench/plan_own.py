"""A user's own planning problems and robot: `bench plan --problems`, which leaves plan.json."""

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sum_drake.assets import InputError
from sum_drake.bench.plan_solve import Solved, solve, warm_up
from sum_drake.bench.resumed import Progress, RowLog, run_tasks
from sum_drake.doctor import device, versions
from sum_drake.fingerprint import code, digest
from sum_drake.jsonio import encode, write_json
from sum_drake.planning_problems import PlanningProblem, load_problems
from sum_drake.urdf import collision_meshes
from sum_drake.user_robot import UserRobot, load_robot

FILES = ("plan.json", "rows.jsonl")
SCHEMA = "sum-drake/plan/1"
TIME_LIMIT = 10.0
"""CPU seconds for each problem, if nothing else is said."""


def bench_problems(
    out: Path,
    problems: Path,
    urdf: Path,
    srdf: Path | None = None,
    *,
    time_limit: float = TIME_LIMIT,
    seed: int = 0,
    workers: int = 2,
    anew: bool = False,
    progress: Progress = lambda what, done, total: None,
) -> tuple[list[Solved], tuple[str, ...]]:
    """Solves a user's problems, writes rows.jsonl as it goes and plan.json at the end; returns what came, and notes.

    anew: what is in `out` is replaced. Raises InputError for a file that cannot be used, before anything is solved or
    written, and for rows of other settings in `out`.
    """
    robot = load_robot(urdf, srdf)
    wanted = load_problems(problems, robot)
    settings: dict[str, Any] = {"seed": seed, "time_limit_s": time_limit, "code": code()}
    for name, path in (("problems", problems), ("urdf", urdf), ("srdf", srdf)):
        settings[name] = None if path is None else digest([path])
    settings["meshes"] = digest(collision_meshes(urdf))
    if anew:
        for name in FILES:
            (out / name).unlink(missing_ok=True)
    refuse_others(out, settings)
    found = run_tasks(
        [("problem", i) for i in range(len(wanted))],
        RowLog(out, settings, Solved),
        _solve,
        workers=min(workers, len(wanted)),
        begin=_start_worker,
        arguments=(problems, urdf, srdf, seed, time_limit),
        progress=progress,
    )
    write_json(
        out / "plan.json",
        {
            "schema": SCHEMA,
            "seed": seed,
            "time_limit_s": time_limit,
            "solved": sum(one.solved for one in found),
            "problems": encode(found),
            "notes": list(robot.notes),
            "versions": versions(),
            "device": device(),
        },
    )
    return found, robot.notes


def refuse_others(out: Path, settings: Mapping[str, Any]) -> None:
    """Raises InputError, in words, for a folder of other problems, where `RowLog` could only tell digests apart."""
    rows = out / "rows.jsonl"
    try:
        begun = json.loads(rows.read_bytes().partition(b"\n")[0])
    except (OSError, ValueError):
        return  # there is none, or RowLog says what is wrong with it
    if not isinstance(begun, dict):
        return
    others = {"problems": "other problems", "urdf": "another robot", "srdf": "another --srdf"}
    if "problems" not in begun:
        said = ["the package's own experiments"] if "problems" in settings else []
    elif "problems" not in settings:
        said = ["problems of your own"]
    else:
        said = [words for key, words in others.items() if begun.get(key) != settings[key]]
    if said:
        raise InputError(f"{rows}: is of {', '.join(said)}; expected a new --out, or --force")


_robot: UserRobot
_wanted: tuple[PlanningProblem, ...]
_seed: int
_time_limit: float


def _start_worker(problems: Path, urdf: Path, srdf: Path | None, seed: int, time_limit: float) -> None:
    global _robot, _wanted, _seed, _time_limit
    logging.getLogger("drake").setLevel(logging.WARNING)
    _robot = load_robot(urdf, srdf)
    _wanted = load_problems(problems, _robot)
    _seed, _time_limit = seed, time_limit
    warm_up()


def _solve(_: str, i: int) -> Solved:
    return solve(_robot, _wanted[i], seed=_seed, time_limit=_time_limit)
