"""One run of a batch: in a fresh process, with a limit of time and of memory, and whatever happens a result."""

import contextlib
import dataclasses
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from sum_drake.assets import InputError, one_line
from sum_drake.files import PART
from sum_drake.jsonio import encode
from sum_drake.summary_schema import FAILED, validate_summary
from sum_drake.types import Immutable
from sum_drake.workers import ONE_THREAD

SCHEMA = "sum-drake/episode/1"
STATES = {
    "ended": "the run came to its own end",
    "failed": "the run failed, and said why",
    "crashed": "its process died",
    "timed_out": "it took longer than it may, and was killed",
    "lost": "the cluster lost it, again and again",
}
"""How an episode ended."""
ROOM = 1 << 24
"""Bytes that have to be free where a run writes: with less, what went wrong is the disk's fault, and no result."""
LOG_TAIL = 4000
"""Characters kept of what a run said last."""


@dataclasses.dataclass(frozen=True)
class EpisodeSpec:
    """What is to be run."""

    seed: int
    scenario: str
    """As `scenario.dump_scenario` writes it."""
    time_limit_s: float
    """Of wall time: what hangs is killed."""
    memory_mib: int
    """What the process may allocate."""


@dataclasses.dataclass(frozen=True, eq=False)
class EpisodeResult(Immutable):
    """What came of it."""

    seed: int
    state: str
    """One of STATES."""
    reason: str
    """Of what did not end by itself, in words; "" otherwise."""
    summary: Mapping[str, Any] | None
    """summary.json, where there is one."""
    files: Mapping[str, bytes]
    """The run folder by name: what there is of it."""
    log: str
    """What the run said last."""
    cpu_s: float
    wall_s: float
    peak_memory_mib: float

    def row(self) -> dict[str, Any]:
        """episode.json: all but the files, and of the summary what figures are made of."""
        told = {} if self.summary is None else {key: self.summary[key] for key in KEPT if key in self.summary}
        return {
            "schema": SCHEMA,
            "seed": self.seed,
            "state": self.state,
            "reason": self.reason,
            "log": self.log if self.reason else "",
            "cpu_s": self.cpu_s,
            "wall_s": self.wall_s,
            "peak_memory_mib": self.peak_memory_mib,
            **encode(told),
        }


KEPT = (
    "outcome", "objects_total", "objects_sorted", "objects_missorted", "missorted_by", "manipulation_trials",
    "manipulation_errors", "objects", "attempts", "timing", "limits", "faults", "digest", "versions", "device",
)  # fmt: skip
"""Fields of a summary that are told of an episode."""


class Running:
    """The processes of episodes that are under way, to be ended together; from then on, none is begun."""

    def __init__(self) -> None:
        self._lock, self._over = threading.Lock(), False
        self.processes: set[subprocess.Popen[bytes]] = set()

    def begin(self, command: Sequence[str], log: TextIO) -> "subprocess.Popen[bytes]":
        """A process of its own. Raises RuntimeError where all were ended."""
        with self._lock:
            if self._over:
                raise RuntimeError("the episodes were ended")
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **ONE_THREAD},
                start_new_session=True,  # Ctrl-C is for whoever started it.
            )
            self.processes.add(process)
        return process

    def done(self, process: "subprocess.Popen[bytes]") -> None:
        """That one has ended."""
        with self._lock:
            self.processes.discard(process)

    def end(self) -> None:
        """Ends them."""
        with self._lock:
            self._over = True
            for process in self.processes:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)


def run_episode(spec: EpisodeSpec, folder: Path | None = None, running: Running | None = None) -> EpisodeResult:
    """Runs it in a process of its own, in a temporary folder, by default the system's, that is gone afterwards.

    running: through which it may be ended. Raises OSError where it did not end well and there is no room left.
    """
    running = Running() if running is None else running
    with tempfile.TemporaryDirectory(dir=folder, prefix=f"{spec.seed}.") as temporary:
        scenario, run = Path(temporary, "scenario.yaml"), Path(temporary, "run")
        scenario.write_text(spec.scenario)
        with Path(temporary, "log.txt").open("w") as log:
            command = [sys.executable, "-m", "sum_drake.worker", str(spec.memory_mib), "sort"]
            command += ["--scenario-file", str(scenario), "--seed", str(spec.seed), "--out", str(run)]
            process = running.begin([*command, "--workers", "1"], log)
            try:
                done = _wait(process, spec.time_limit_s)
            finally:
                running.done(process)
        said = _tail(Path(temporary, "log.txt")).replace(f"{temporary}{os.sep}", "")
        if done.status != 0 and shutil.disk_usage(temporary).free < ROOM:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(Path(temporary).parent))
        return _judge(spec, done, said, run)


@dataclasses.dataclass(frozen=True)
class _Done:
    status: int
    """Exit status; less than nothing: the signal that ended it."""
    timed_out: bool
    cpu_s: float
    wall_s: float
    peak_memory_mib: float


def _wait(process: "subprocess.Popen[bytes]", limit: float) -> _Done:
    """Waits until a process has ended, or ends it."""
    start, late = time.monotonic(), threading.Event()

    def kill() -> None:
        late.set()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(limit, kill)
    timer.daemon = True
    timer.start()
    try:
        _, status, usage = os.wait4(process.pid, 0)
    finally:
        timer.cancel()
        if process.stdin is not None:
            process.stdin.close()
    process.returncode = os.waitstatus_to_exitcode(status)
    memory = usage.ru_maxrss / 1024  # kibibytes on Linux
    cpu = usage.ru_utime + usage.ru_stime
    return _Done(process.returncode, late.is_set(), cpu, time.monotonic() - start, memory)


def _tail(log: Path) -> str:
    """What a log ends with, however much a run that hung has said."""
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - 4 * LOG_TAIL))  # a character is up to four bytes
        return file.read().decode(errors="replace")[-LOG_TAIL:]


def _judge(spec: EpisodeSpec, done: _Done, said: str, run: Path) -> EpisodeResult:
    kept = [path for path in sorted(run.iterdir()) if path.is_file() and path.suffix != PART] if run.is_dir() else []
    files = {path.name: path.read_bytes() for path in kept}
    summary, problem = None, ""
    try:
        summary = json.loads(files["summary.json"])
        validate_summary(summary)
    except KeyError:
        problem = "no summary.json"
    except (ValueError, InputError) as error:
        summary, problem = None, one_line(error)
    last = said.strip().splitlines()[-1] if said.strip() else "nothing was said"
    if done.timed_out:
        state, reason = "timed_out", f"not done after {spec.time_limit_s:g} s; last: {last}"
    elif done.status < 0:
        held = f"held {done.peak_memory_mib:.0f} MiB, {spec.memory_mib} allowed"
        state, reason = "crashed", f"ended by {_signal(-done.status)}; {held}; last: {last}"
    elif summary is None:
        state, reason = "crashed", f"exit status {done.status}, {problem}; last: {last}"
    elif done.status != 0:
        outcome = str(summary["outcome"])  # of a run that went well, if its report failed
        state, reason = "failed", outcome if outcome.startswith(FAILED) else f"exit status {done.status}; last: {last}"
    else:
        state, reason = "ended", ""
    used = done.cpu_s, done.wall_s, done.peak_memory_mib
    return EpisodeResult(spec.seed, state, reason, summary, files, said, *used)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # real-time ones have no name
        return f"signal {number}"


def lost(spec: EpisodeSpec, reason: str) -> EpisodeResult:
    """What is told of an episode that nobody can tell anything of."""
    return EpisodeResult(spec.seed, "lost", reason, None, {}, "", 0.0, 0.0, 0.0)
