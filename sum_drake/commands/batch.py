"""`sum-drake batch`: many runs."""

import argparse
import dataclasses
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    Commands,
    Counting,
    add_command,
    add_parallel,
    add_quiet,
    add_scenario,
    check_count,
    if_interrupted,
    scenario_of,
)

if TYPE_CHECKING:
    from sum_drake.episodes import EpisodeSpec
    from sum_drake.systems.scenario import Scenario

TIME_LIMIT_S, MEMORY_MIB = 3600.0, 4096
LONGEST_S, LEAST_MIB, MOST_MIB = 1e7, 512, 1 << 30
"""Of what may be asked for: beyond, timers and the kernel's limits overflow."""


def add(commands: Commands) -> None:
    """Declares the command."""
    text = "many sorting runs, each in a fresh process; called again, it goes on until all are done"
    batch = add_command(commands, "batch", _run, text, "batch --runs 60 --first-seed 1000 --workers 2 --out out/b60")
    batch.description = (
        f"{text[0].upper()}{text[1:]}. DIR/SEED/ holds a run's folder and episode.json, DIR/batch.json what all come"
        " to. A run that crashes or hangs is a result with its reason, never the end of the batch."
    )
    batch.add_argument(
        "--runs", type=int, required=True, metavar="N", help="how many; a begun batch may be made longer"
    )
    batch.add_argument("--first-seed", type=int, default=0, metavar="S", help="seeds are S, S + 1, ... (default: 0)")
    add_scenario(batch)
    add_parallel(batch, "--workers", "runs at a time on this machine")
    batch.set_defaults(workers=None)  # so that it is known whether it was asked for
    batch.add_argument("--cluster", metavar="ADDRESS", help="run them on this Dask cluster instead (extra `cluster`)")
    batch.add_argument(
        "--time-limit", type=float, default=TIME_LIMIT_S, metavar="SECONDS",
        help=f"wall time after which a run is ended (default: {TIME_LIMIT_S:g})",
    )  # fmt: skip
    batch.add_argument(
        "--memory-limit", type=int, default=MEMORY_MIB, metavar="MIB",
        help=f"memory that a run may allocate (default: {MEMORY_MIB})",
    )  # fmt: skip
    batch.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder")
    add_quiet(batch)


def prepare(
    scenario: "Scenario",
    first_seed: int,
    runs: int,
    *,
    time_limit_s: float = TIME_LIMIT_S,
    memory_mib: int = MEMORY_MIB,
) -> "tuple[list[EpisodeSpec], dict[str, Any]]":
    """The episodes of a scenario with so many seeds, and the settings that they have in common."""
    import hashlib

    from sum_drake.episodes import EpisodeSpec
    from sum_drake.fingerprint import code_and_meshes
    from sum_drake.systems.scenario import catalogue_of, dump_scenario

    text, seedless = (dump_scenario(one) for one in (scenario, dataclasses.replace(scenario, random_seed=0)))
    specs = [EpisodeSpec(seed, text, time_limit_s, memory_mib) for seed in range(first_seed, first_seed + runs)]
    settings = {
        "first_seed": first_seed,
        "objects": len(scenario.objects.labels) or scenario.objects.count,
        "scenario": hashlib.sha256(seedless.encode()).hexdigest()[:16],
        "time_limit_s": time_limit_s,
        "memory_limit_mib": memory_mib,
        **code_and_meshes(catalogue_of(scenario), of_runs=True),
    }
    return specs, settings


def _run(options: argparse.Namespace) -> None:
    from sum_drake.batch import Processes, check_batch, run_batch
    from sum_drake.cluster import Cluster
    from sum_drake.doctor import require_rendering

    check_count("--runs", options.runs)
    check_count("--first-seed", options.first_seed, 0)
    check_count("--workers", options.workers)
    if options.cluster is not None and options.workers is not None:
        raise InputError(f"--workers {options.workers}: of this machine; expected none with --cluster")
    if not 0 < options.time_limit <= LONGEST_S:
        raise InputError(f"--time-limit {options.time_limit:g}: expected more than 0 and at most {LONGEST_S:g} seconds")
    if not LEAST_MIB <= options.memory_limit <= MOST_MIB:
        raise InputError(f"--memory-limit {options.memory_limit}: expected {LEAST_MIB} to {MOST_MIB} MiB")
    scenario = scenario_of(options, options.first_seed)
    specs, settings = prepare(
        scenario, options.first_seed, options.runs, time_limit_s=options.time_limit, memory_mib=options.memory_limit
    )
    check_batch(options.out, settings)
    if options.cluster is None:
        require_rendering()
        executor: Processes | Cluster = Processes(options.workers or os.cpu_count() or 1)
    else:
        executor = Cluster(options.cluster, Path(scenario.catalogue) if scenario.catalogue else None)
        if any(not (options.out / str(spec.seed) / "episode.json").is_file() for spec in specs):
            if not options.quiet:
                waiting = f"for which it waits {executor.patience_s:g} s if there are none"
                print(f"{options.cluster}: asking the scheduler and its workers, {waiting}", file=sys.stderr)
            executor.check()
    kept = f"{options.out} keeps what was done: the same command goes on"
    with if_interrupted(lambda: kept, quiet=options.quiet):
        told = run_batch(options.out, specs, settings, executor, Counting(quiet=options.quiet))
    _tell(told, options.out, {str(spec.seed) for spec in specs})


def _tell(told: "dict[str, Any]", out: Path, asked: set[str]) -> None:
    """Prints what a batch has come to. asked: seeds of its runs; the folder may hold more."""
    from sum_drake.report_parts import count

    figures = told["figures"]
    share, low, high = (figures[f"objects_sorted_{what}"] for what in ("share", "low95", "high95"))
    interval = "" if low is None else f" (95 % interval {low:.3f} to {high:.3f})"
    done, objects = round((share or 0.0) * figures["objects"]), figures["objects"]
    said = "" if share is None else f", {share:.3f}{interval}"
    print(f"{count(round(figures['runs']), 'run')}: {done} of {objects:.0f} objects sorted{said}")
    for cause, lost in told["causes"].items():
        print(f"  lost: {lost}, {cause}")
    apart = sum(path.parent.name not in asked for path in out.glob("*/episode.json"))
    if apart:
        print(f"  kept and not told of, as not asked for: {count(apart, 'run')}")
    print(out / "batch.json")
    again = " --force" if (out / "report.html").exists() else ""
    print(f"a page of it: sum-drake report {shlex.quote(str(out))}{again}")
