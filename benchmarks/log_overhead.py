"""What logging costs a run: CPU seconds in the log system against those of the run, and that it changes nothing.

    python benchmarks/log_overhead.py --seed 5 --labels sugar --out benchmarks/results/log_overhead.json

The run is done twice: without a log, which also compiles what there is to compile, and with one. There a second log
is written from the same records, without the topics that came later (associations, belief, plan, grasps, hand), so
that both are timed on the same input.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from pydrake.systems.framework import Context, EventStatus

from sum_drake.bench.results import made_with
from sum_drake.jsonio import write_json
from sum_drake.runlog import RunLogWriter
from sum_drake.systems import sorting
from sum_drake.systems.episode import Episode, run
from sum_drake.systems.run_log import RunLog
from sum_drake.systems.scenario import catalogue_of, load_scenario
from sum_drake.systems.verdict import score


class Clock:
    """CPU seconds by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._running: set[str] = set()

    @contextmanager
    def of(self, name: str) -> Iterator[None]:
        """Adds the block's, unless it is within another of its name."""
        if name in self._running:
            yield
            return
        self._running.add(name)
        start = time.process_time()
        try:
            yield
        finally:
            self._running.remove(name)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start


class Mute:
    """A channel that says nothing."""

    def log(self, message: Any, log_time: int = 0) -> None:
        """Nothing."""


class Before(RunLogWriter):
    """A log without the topics that came later."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._associations = self._belief = self._plan = Mute()

    def _write_candidates(self, *told: Any) -> None:
        pass


class Twice(RunLogWriter):
    """A log, and beside it one as it was before, each timed; what is written by name."""

    def __init__(self, path: Path, before: RunLogWriter, clock: Clock) -> None:
        super().__init__(path)
        self._before, self._clock = before, clock

    def write_perception(self, *told: Any) -> None:
        """Both."""
        self._both("write_perception", *told)

    def write_attempt(self, *told: Any) -> None:
        """Both."""
        self._both("write_attempt", *told)

    def write_event(self, *told: Any) -> None:
        """Both."""
        self._both("write_event", *told)

    def write_motion(self, time_s: float, motion: Any, names: Any) -> None:
        """The new one."""
        with self._clock.of("now"), self._clock.of("write_motion"):
            super().write_motion(time_s, motion, names)

    def write_joint_state(self, time_s: float, names: Any, positions: Any, X_WG: Any = None) -> None:
        """Both."""
        with self._clock.of("now"), self._clock.of("write_joint_state"):
            super().write_joint_state(time_s, names, positions, X_WG)
        with self._clock.of("before"):
            self._before.write_joint_state(time_s, names, positions)

    def _both(self, name: str, *told: Any) -> None:
        with self._clock.of("now"), self._clock.of(name):
            getattr(super(), name)(*told)
        with self._clock.of("before"):
            getattr(self._before, name)(*told)


def timed(clock: Clock) -> type[RunLog]:
    """The log system with a clock on everything it does."""

    class TimedRunLog(RunLog):
        def _write(self, context: Context) -> EventStatus:
            with clock.of("system"):
                return super()._write(context)

        def _write_joint_state(self, context: Context) -> EventStatus:
            with clock.of("system"):
                return super()._write_joint_state(context)

    return TimedRunLog


def main() -> None:
    """Runs twice, prints and writes the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--labels", nargs="+", default=["sugar"])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--keep", type=Path, metavar="FILE", help="where the log goes that is written")
    options = parser.parse_args()
    scenario = load_scenario(text=f"{{objects: {{labels: [{', '.join(options.labels)}]}}}}", seed=options.seed)
    catalogue, clock = catalogue_of(scenario), Clock()

    def digest(episode: Episode) -> str:
        summary = score(episode, scenario, catalogue, versions={}, device="")
        print(summary["outcome"], summary["digest"], summary["timing"], flush=True)
        return str(summary["digest"])

    with clock.of("run without a log"):
        silent = run(scenario, catalogue)
    with tempfile.TemporaryDirectory() as folder:
        now, before = options.keep or Path(folder) / "now.mcap", Path(folder) / "before.mcap"
        with (
            mock.patch.object(sorting, "RunLog", timed(clock)),
            Before(before) as other,
            Twice(now, other, clock) as writer,
            clock.of("run"),
        ):
            logged = run(scenario, catalogue, open_log=lambda: writer)
        sizes = {"log_bytes": now.stat().st_size, "log_bytes_before": before.stat().st_size}
    spent = clock.seconds
    system = spent["system"] - spent["before"]
    rest = spent["run"] - spent["system"]
    before_system = system - spent["now"] + spent["before"]
    figures = {
        "log_share": system / (rest + system),
        "log_share_before": before_system / (rest + before_system),
        "log_cpu_s": system,
        "log_cpu_s_before": before_system,
        "run_cpu_s": rest + system,
        "first_run_without_log_cpu_s": spent["run without a log"],
        "sim_time_s": logged.sim_time_s,
        **{f"{name}_cpu_s": seconds for name, seconds in spent.items() if name.startswith("write_")},
        **sizes,
        "same_digest": digest(logged) == digest(silent),
    }
    settings = {"seed": options.seed, "labels": options.labels}
    write_json(options.out, {"settings": settings, **made_with(), "figures": figures})
    for name, value in figures.items():
        print(f"{name:24} {value}")


if __name__ == "__main__":
    main()
