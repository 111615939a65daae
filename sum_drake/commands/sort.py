"""`sum-drake sort`: the main job."""

import argparse
import contextlib
import logging
import shlex
import sys
import time
from pathlib import Path

from sum_drake.commands.common import (
    Commands,
    add_command,
    add_parallel,
    add_quiet,
    add_scenario,
    check_count,
    check_free,
    check_makeable,
    check_writable,
    fitted,
    redrawn,
    scenario_of,
)
from sum_drake.files import alone, write_whole


def add(commands: Commands) -> None:
    """Declares the command."""
    sort = add_command(
        commands, "sort", _run, "pour objects on the table, perceive and sort them", "sort --seed 3 --objects 5"
    )
    sort.description = (
        "Pour objects on the table, perceive and sort them. The exit code is 0 when the run came to its own end, with"
        " objects left on the table, too: the last line printed, outcome in summary.json and report.html tell how many"
        " were sorted and why it stopped. 1: the run failed; 2: bad input."
    )
    add_scenario(sort)
    sort.add_argument("--seed", type=int, metavar="S", help="seed of the run (default: the scenario's random_seed)")
    sort.add_argument("--graphviz", type=Path, metavar="FILE", help="write the diagram in Graphviz's format, too")
    sort.add_argument("--out", type=Path, metavar="DIR", help="run folder (default: runs/SEED)")
    sort.add_argument("--force", action="store_true", help="replace the run that is in the folder")
    add_parallel(sort, "--workers", "processes that estimate poses")
    add_quiet(sort)


def _run(options: argparse.Namespace) -> None:
    from pydrake.systems.framework import Diagram

    from sum_drake.doctor import device, require_rendering, versions
    from sum_drake.jsonio import write_json
    from sum_drake.report import write_report
    from sum_drake.runlog import RunLogWriter
    from sum_drake.summary_schema import FAILED
    from sum_drake.systems.episode import run
    from sum_drake.systems.scenario import catalogue_of, dump_scenario
    from sum_drake.systems.verdict import score

    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake has set it on import
    check_count("--workers", options.workers)
    scenario = scenario_of(options, options.seed)
    catalogue = catalogue_of(scenario)
    out = options.out if options.out is not None else Path("runs") / str(scenario.random_seed)
    check_free(out, RUN_FILES, force=options.force)
    if options.graphviz is not None:
        check_writable(options.graphviz)
    require_rendering()
    progress = _Progress(quiet=options.quiet)
    written = "nothing was written"
    stack, held = contextlib.ExitStack(), contextlib.ExitStack()
    if out.is_dir():
        held.enter_context(alone(out, "another run"))
    else:
        check_makeable(out)

    def open_log() -> RunLogWriter:
        """Only now, when everything has been made, is anything written."""
        nonlocal written
        if not out.is_dir():
            out.mkdir(parents=True)
            held.enter_context(alone(out, "another run"))
        for name in RUN_FILES:
            (out / name).unlink(missing_ok=True)
        write_whole(out / "scenario.yaml", dump_scenario(scenario))
        log = RunLogWriter(out / "run.mcap", metadata={"seed": str(scenario.random_seed)})
        written = f"{out} holds what was done until then: sum-drake report {shlex.quote(str(out))}"
        return stack.enter_context(log)

    def draw(diagram: Diagram) -> None:
        if options.graphviz is not None:
            write_whole(options.graphviz, diagram.GetGraphvizString())

    try:
        with held:
            with stack:
                episode = run(
                    scenario,
                    catalogue,
                    open_log=open_log,
                    progress=progress,
                    on_diagram=draw,
                    workers=options.workers,
                )
            summary = score(episode, scenario, catalogue, versions=versions(), device=device())
            write_json(out / "summary.json", summary)
            write_report(out, catalogue)
    except KeyboardInterrupt:
        progress.clear()
        raise KeyboardInterrupt(written) from None
    progress.done(
        f"{summary['outcome']}: {summary['objects_sorted']} of {summary['objects_total']} objects sorted, "
        f"{summary['objects_missorted']} missorted, {summary['manipulation_trials']} trials, "
        f"{episode.sim_time_s:.0f} s simulated in {episode.wall_s:.0f} s; {out / 'report.html'}"
    )
    if episode.error is not None:
        raise RuntimeError(summary["outcome"].removeprefix(FAILED)) from episode.error


RUN_FILES = ("scenario.yaml", "run.mcap", "summary.json", "report.html")


class _Progress:
    """What is being done: line by line; on a terminal with a bar below that is redrawn in place; nothing if quiet."""

    WIDTH = 24

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._terminal, self._start = quiet, redrawn(sys.stderr), time.monotonic()

    def __call__(self, what: str, sim_time: float, share: float = 0.0) -> None:
        """what: a step that was taken, "" between steps; share: of the objects that were let go where they belong."""
        if self._quiet:
            return
        now = f"{time.monotonic() - self._start:6.1f} s, simulated {sim_time:6.1f} s"
        if what:
            print(f"{self._clear()}[{now}] {what}", file=sys.stderr, flush=True)
        if self._terminal:
            done = round(self.WIDTH * share)
            bar = fitted(f"[{'#' * done:-<{self.WIDTH}}] {now}")
            print(f"{self._clear()}{bar}", end="", file=sys.stderr, flush=True)

    def done(self, what: str) -> None:
        """The last line, on standard output."""
        if not self._quiet:
            self.clear()
            print(what)

    def clear(self) -> None:
        """Takes the bar away."""
        if not self._quiet:
            print(self._clear(), end="", file=sys.stderr, flush=True)

    def _clear(self) -> str:
        return "\r\033[K" if self._terminal else ""
