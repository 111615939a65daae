"""What a run costs, by purpose."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class Costs:
    """CPU seconds by purpose."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def of(self, purpose: str) -> Iterator[None]:
        """Adds the CPU time of the block."""
        start = time.process_time()
        try:
            yield
        finally:
            self.add(purpose, time.process_time() - start)

    def add(self, purpose: str, seconds: float) -> None:
        """Adds CPU time, perhaps of another process."""
        self.seconds[purpose] = self.seconds.get(purpose, 0.0) + seconds


def peak_memory_mib() -> float:
    """The most memory that this process has held at any time, MiB."""
    # What getrusage says of a process includes what its parent held when it was started.
    told = _told_mib("VmHWM")
    return _peak_by_getrusage() if told is None else told


def own_memory_mib() -> float:
    """The memory that this process holds of its own, MiB; where the system does not say, the most that it has held.

    Without the files it has mapped, libraries above all: the system drops them when memory is short.
    """
    told = _told_mib("RssAnon")
    return _peak_by_getrusage() if told is None else told


def _told_mib(key: str) -> float | None:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line.split()[1] for line in lines if line.startswith(f"{key}:"))) / 1024
    except (OSError, StopIteration):
        return None


def _peak_by_getrusage() -> float:
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 1024
