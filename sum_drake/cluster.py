"""Episodes on a Dask cluster that exists: the same runs through the same interface as on this machine's processes."""

import dataclasses
import socket
from collections.abc import Generator, Sequence
from concurrent.futures import CancelledError
from pathlib import Path

from sum_drake.assets import InputError, one_line
from sum_drake.episodes import Episode, EpisodeSpec, lost, run_episode
from sum_drake.fingerprint import code

CONNECT_S = 20.0
"""How long the scheduler may take to answer, seconds."""


@dataclasses.dataclass(frozen=True)
class Cluster:
    """A scheduler's address, such as tcp://127.0.0.1:8786. Its workers have sum-drake of the same version installed.

    A worker runs as many episodes at a time as it has threads: each in a process of its own, so `--nthreads` of
    `dask worker` is the number of cores that it is to use. How many workers may be lost with an episode before it is
    given up is the scheduler's to know (`distributed.scheduler.allowed-failures`).
    """

    address: str

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[Episode, None, None]:
        """As `batch.Executor.run`; files come back over the network.

        Raises InputError where nobody answers, RuntimeError for a worker that cannot run what it is sent, and where
        the scheduler goes away: what is the cluster's fault is no episode's result.
        """
        try:
            from distributed import Client, KilledWorker, as_completed
        except ImportError:
            raise InputError("--cluster: distributed is missing; expected: pip install sum-drake[cluster]") from None
        try:
            client = Client(self.address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"--cluster {self.address}: {one_line(error)}; expected a Dask scheduler") from None
        with client:
            version = code()
            # Keys are the scheduler's, for all its clients: two batches may have runs of the same seed.
            futures = {client.submit(_run_same, spec, version, pure=False): spec for spec in specs}
            for future in as_completed(list(futures), loop=client.loop):
                try:
                    episode = future.result()
                except KilledWorker as error:
                    episode = lost(futures[future], one_line(error))
                except CancelledError:
                    raise RuntimeError(f"{self.address}: the scheduler is gone; the same command goes on") from None
                except Exception as error:
                    raise RuntimeError(f"{self.address}: a worker failed: {one_line(error)}") from None
                yield episode
                future.release()  # or its files stay in the memory of workers
                del futures[future]


def _run_same(spec: EpisodeSpec, version: str) -> Episode:
    """On a worker. Raises RuntimeError for a batch of another version of the program than is installed there."""
    if code() != version:
        raise RuntimeError(f"sum-drake on {socket.gethostname()} is of another version than the batch's")
    return run_episode(spec)
