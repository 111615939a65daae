"""Episodes on a Dask cluster that exists: the same runs through the same interface as on this machine's processes."""

import contextlib
import dataclasses
import functools
import logging
import re
import socket
import time
import warnings
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import TYPE_CHECKING

from sum_drake.assets import InputError, one_line
from sum_drake.doctor import egl_problem, versions
from sum_drake.episodes import EpisodeResult, EpisodeSpec, lost, run_episode
from sum_drake.fingerprint import code_and_meshes, different
from sum_drake.objects import load_catalogue

if TYPE_CHECKING:
    from distributed import Client, Future

ADDRESS = re.compile(r"(tcp|tls)://([^\s:/\[\]]+|\[[0-9a-fA-F:.]+\]):([0-9]{1,5})")
"""Of a scheduler. What is none is not handed to `distributed`, which retries it and ends in a traceback."""
LONGEST_GREETING = 1 << 20
"""Bytes of a scheduler's first message, whose length comes before it: text of another protocol reads as far more."""
CONNECT_S = 20.0
"""How long the scheduler may take to answer, seconds."""
LOOK_S, ASK_S = 0.05, 5.0
"""How often it is looked whether an episode has ended, and asked whether there are workers, seconds."""


@dataclasses.dataclass(frozen=True)
class Cluster:
    """A scheduler's address, such as tcp://127.0.0.1:8786. Its workers have sum-drake of the same version installed.

    A worker runs as many episodes at a time as it has threads: each in a process of its own, so `--nthreads` of
    `dask worker` is the number of cores that it is to use. How many workers may be lost with an episode before it is
    given up is the scheduler's to know (`distributed.scheduler.allowed-failures`).
    """

    address: str
    catalogue: Path | None = None
    """Of the runs; None: the package's. Workers read it at the same path."""
    patience_s: float = 60.0
    """How long there may be no worker."""

    def check(self) -> None:
        """Asks the scheduler, and every worker that is there, whether it can run what it will be sent.

        Raises InputError for what is no address, where nobody answers or no worker comes, where `distributed` is
        missing, and where something else is installed than here.
        """
        with self._client() as client:
            try:
                client.wait_for_workers(1, timeout=self.patience_s)
                unfit = self._unfit(client, _installed(self.catalogue))
            except TimeoutError:
                raise InputError(f"--cluster {self.address}: has no worker; expected some: {self._how()}") from None
            except OSError as error:
                raise InputError(f"--cluster {self.address}: {one_line(error)}; expected a Dask scheduler") from None
            if unfit:
                raise InputError(f"--cluster {self.address}: {unfit}")

    def _how(self) -> str:
        return f"dask worker {self.address} --nthreads N"

    def _unfit(self, client: "Client", here: Mapping[str, str]) -> str:
        """Who of the cluster cannot run what it is sent, and why; "" where all can.

        Asked outside of tasks: a task that a worker cannot unpickle, for want of this package, ends the worker. here:
        what is expected of workers. Raises OSError where the scheduler has gone.
        """
        try:
            program = client.run_on_scheduler(versions)["sum-drake"]  # it reads tasks, too
        except OSError:
            raise
        except Exception as error:
            return f"the scheduler fails: {one_line(error)}; expected sum-drake installed as here"
        if program != here["sum-drake"]:
            return f"the scheduler has sum-drake {program}; expected {here['sum-drake']}, as here"
        for address, there in client.run(_ready, self.catalogue, on_error="return").items():
            if isinstance(there, OSError):  # it has gone since
                continue
            if isinstance(there, Exception):
                need = "sum-drake" if self.catalogue is None else "sum-drake, and the catalogue at the same path,"
                return f"worker {address} fails: {one_line(there)}; expected {need} as here"
            installed, problem = there
            other = different(installed, here)
            if other:
                return f"worker {address} has {other}; expected what is installed here"
            if problem:
                return f"worker {address} {problem}"
        return ""

    @contextlib.contextmanager
    def _client(self) -> "Iterator[Client]":
        try:
            from distributed import Client
            from distributed.versions import VersionMismatchWarning
        except ImportError:
            raise InputError("--cluster: distributed is missing; expected: pip install sum-drake[cluster]") from None
        parts = ADDRESS.fullmatch(self.address)
        if parts is None:
            raise InputError(f"--cluster {self.address}: no address; expected a Dask scheduler's, as tcp://HOST:8786")
        self._check_greeting(*parts.groups())
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what goes wrong is said here, in a line
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", VersionMismatchWarning)  # `check` says what matters of it
                client = Client(self.address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"--cluster {self.address}: {one_line(error)}; expected a Dask scheduler") from None
        with client:
            yield client

    def _check_greeting(self, scheme: str, host: str, port: str) -> None:
        """Raises InputError where who answers is no scheduler: a client waits for ever for what another never sends."""
        expected = "expected a Dask scheduler"
        if scheme == "tls":
            return self._check_certificates()
        try:
            with socket.create_connection((host.strip("[]"), int(port)), timeout=CONNECT_S) as there:
                first = there.recv(8, socket.MSG_WAITALL)
        except TimeoutError:
            raise InputError(f"--cluster {self.address}: no word in {CONNECT_S:g} s; {expected}") from None
        except (socket.gaierror, OverflowError, UnicodeError) as error:
            raise InputError(f"--cluster {self.address}: {one_line(error)}; {expected}") from None
        except OSError:  # nobody is there yet: a client tries again for a while
            return
        if len(first) < 8 or int.from_bytes(first, "little") > LONGEST_GREETING:
            raise InputError(f"--cluster {self.address}: something else answers; {expected}")

    def _check_certificates(self) -> None:
        from distributed.security import Security

        try:
            lacking = Security().get_connection_args("client").get("ssl_context") is None
        except (OSError, ValueError) as error:
            raise InputError(f"--cluster {self.address}: {one_line(error)}; expected certificates") from None
        if lacking:
            raise InputError(
                f"--cluster {self.address}: no certificates; expected them in Dask's settings, distributed.comm.tls"
            )

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[EpisodeResult, None, None]:
        """As `batch.Executor.run`; files come back over the network.

        Raises InputError where the scheduler cannot be reached, RuntimeError for a worker that cannot run what it is
        sent, and where the scheduler or all workers go away: what is the cluster's fault is no episode's result.
        """
        if not specs:
            return
        with self._client() as client:
            from distributed import KilledWorker

            here = _installed(self.catalogue)
            # Keys are the scheduler's, for all its clients: two batches may have runs of the same seed.
            futures = {client.submit(_run_same, spec, self.catalogue, here, pure=False): spec for spec in specs}
            for future in self._as_they_end(client, list(futures)):
                try:
                    episode = future.result()
                except KilledWorker as error:
                    unfit = self._unfit_now(client, here)
                    if unfit:
                        raise RuntimeError(f"{self.address}: {unfit}") from None
                    episode = lost(futures[future], one_line(error))
                except CancelledError:
                    raise RuntimeError(f"{self.address}: the scheduler is gone; the same command goes on") from None
                except Exception as error:
                    raise RuntimeError(f"{self.address}: a worker failed: {one_line(error)}") from None
                yield episode
                future.release()  # or its files stay in the memory of workers
                del futures[future]

    def _unfit_now(self, client: "Client", here: Mapping[str, str]) -> str:
        """As `_unfit`, of a batch under way: who came later may be unfit, and what ended a worker others like it."""
        try:
            return self._unfit(client, here)
        except OSError:
            return "the scheduler is gone; the same command goes on"

    def _as_they_end(self, client: "Client", futures: "Iterable[Future]") -> "Iterator[Future]":
        """Raises RuntimeError where there is no worker for too long: the scheduler waits for ever."""
        from distributed import as_completed

        ending = as_completed(futures, loop=client.loop)
        asked = there = time.monotonic()
        while not ending.is_empty():
            yield from ending.next_batch(block=False)
            if time.monotonic() > asked + min(ASK_S, self.patience_s / 4):
                asked = time.monotonic()
                if self._has_workers(client):
                    there = asked
                elif asked > there + self.patience_s:
                    waited = f"{self.address}: no worker for {self.patience_s:g} s"
                    raise RuntimeError(f"{waited}; start one, {self._how()}, and the same command goes on")
            time.sleep(LOOK_S)

    def _has_workers(self, client: "Client") -> bool:
        try:
            return bool(client.nthreads())
        except OSError:  # where the scheduler has gone, futures are cancelled, which says more
            return True


def _installed(catalogue: Path | None) -> dict[str, str]:
    """What a run depends on but for its scenario: program, packages, weights and models, objects."""
    return {**code_and_meshes(load_catalogue(catalogue), of_runs=True), **versions()}


@functools.cache
def _problem() -> str:
    """Why this process' machine cannot run what is installed; "" if it can."""
    return egl_problem() or ""


def _ready(catalogue: Path | None) -> tuple[dict[str, str], str]:
    """Of a worker: `_installed` and `_problem`."""
    return _installed(catalogue), _problem()


def _run_same(spec: EpisodeSpec, catalogue: Path | None, expected: Mapping[str, str]) -> EpisodeResult:
    """On a worker. Raises RuntimeError where something else is installed than where the batch was asked for.

    The run's folder is in the worker's own, which whoever starts the next one removes if it was killed.
    """
    from distributed import get_worker

    installed, problem = _ready(catalogue)
    other = different(installed, expected)
    if other:
        raise RuntimeError(f"{socket.gethostname()} has {other}; expected what the batch was begun with")
    if problem:
        raise RuntimeError(f"{socket.gethostname()} {problem}")
    return run_episode(spec, Path(get_worker().local_directory))
