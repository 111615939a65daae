"""Episodes on a Dask cluster that exists: the same runs through the same interface as on this machine's processes."""

import dataclasses
from collections.abc import Generator, Sequence
from pathlib import Path

from sum_drake.assets import InputError, one_line
from sum_drake.episodes import Episode, EpisodeSpec, lost, run_episode

RETRIES = 3
"""Workers that may be lost with an episode before it is given up."""
CONNECT_S = 20.0
"""How long the scheduler may take to answer, seconds."""


@dataclasses.dataclass(frozen=True)
class Cluster:
    """A scheduler's address, such as tcp://127.0.0.1:8786. Its workers have sum-drake of the same version installed.

    A worker runs as many episodes at a time as it has threads: each in a process of its own, so `--nthreads` of
    `dask worker` is the number of cores that it is to use.
    """

    address: str

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[Episode, None, None]:
        """As `batch.Executor.run`; files come back over the network. Raises InputError where nobody answers."""
        try:
            from distributed import Client, as_completed
        except ImportError:
            raise InputError("--cluster: distributed is missing; expected: pip install sum-drake[cluster]") from None
        try:
            client = Client(self.address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"--cluster {self.address}: {one_line(error)}; expected a Dask scheduler") from None
        with client:
            futures = {
                client.submit(run_episode, spec, pure=False, retries=RETRIES, key=f"episode-{spec.seed}"): spec
                for spec in specs
            }
            for future in as_completed(list(futures)):
                broken = future.exception()
                yield future.result() if broken is None else lost(futures[future], one_line(broken))
                future.release()  # or its files stay in the memory of workers
                del futures[future]
