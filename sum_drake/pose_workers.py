"""Poses of several objects at once: the paper's objects are independent, so each is estimated in a process of its own.

A process keeps what it has rendered of a label for as long as it lives, so a label goes where it is known, unless
others wait there. Results do not depend on where they were computed.
"""

import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np

from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimate, PoseEstimator, PoseRequest
from sum_drake.objects import Catalogue
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.types import Frame
from sum_drake.workers import belong_to_parent, one_thread_each

T = TypeVar("T")
WARMING = 2.0
"""Estimates that take as long as making ready for a label."""


class PoseWorkers:
    """`filtering.PoseEstimator` in `workers` processes that stay; a context manager that ends them.

    noise, device: as of `PoseEstimator`. on_cpu: told the CPU seconds that a process took for a label to be made
    ready for, or a pose estimated, which the caller's clock does not see, each once it is done. Raises RuntimeError
    where a process dies.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        config: FilterConfig,
        workers: int,
        *,
        noise: DepthNoiseConfig | None = None,
        device: str = "cpu",
        on_cpu: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        self._on_cpu = on_cpu
        context = multiprocessing.get_context("spawn")
        self._pools = [
            ProcessPoolExecutor(1, context, _begin, (catalogue, config, noise, device)) for _ in range(workers)
        ]
        self._known: list[set[str]] = [set() for _ in range(workers)]
        self._asked: Sequence[Future[Any]] = ()
        self._processes: Sequence[BaseProcess] = ()
        others = multiprocessing.active_children()
        try:
            with one_thread_each():
                self._asked = [pool.submit(_ready) for pool in self._pools]
                self._processes = [process for process in multiprocessing.active_children() if process not in others]
        except BaseException:
            self.close()  # which nobody else can yet
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the processes; what they are at, after an error or an interrupt here, is lost, and not waited for."""
        if any(not future.done() for future in self._asked):
            for process in self._processes:
                process.terminate()
        for pool in self._pools:
            # A pool that still winds up as the interpreter ends may be woken by a pipe that it has just closed.
            pool.shutdown(cancel_futures=True)

    def warm_all(self, labels: Sequence[str]) -> None:
        """Makes ready for labels, shared out among the processes."""
        to_do = zip(self._pools, self._share_out(labels), strict=True)
        self._gather([pool.submit(_warm, labels[i]) for pool, share in to_do for i in share])

    def estimate_all(self, frame: Frame, requests: Sequence[PoseRequest]) -> list[PoseEstimate]:
        """`PoseEstimator.estimate_all`, shared out among the processes."""
        shares = self._share_out([one.label for one in requests])
        to_do = zip(self._pools, shares, strict=True)
        found = self._gather([pool.submit(_estimate, frame, requests[i]) for pool, share in to_do for i in share])
        order = [i for share in shares for i in share]
        return [found[k] for k in np.argsort(order)]

    def _gather(self, futures: Sequence[Future[tuple[T, float]]]) -> list[T]:
        self._asked = futures
        try:
            for future in as_completed(futures):
                self._on_cpu(future.result()[1])
        except BrokenProcessPool as error:
            raise RuntimeError("a process that estimates poses died, perhaps for lack of memory") from error
        return [future.result()[0] for future in futures]

    def _share_out(self, labels: Sequence[str]) -> list[list[int]]:
        """Which requests each process takes: each goes where it will be done first."""
        shares: list[list[int]] = [[] for _ in self._pools]
        work = [0.0 for _ in self._pools]
        for i, label in enumerate(labels):
            cost = [1.0 if label in known else 1.0 + WARMING for known in self._known]
            best = min(range(len(work)), key=lambda k: (work[k] + cost[k], k))
            shares[best].append(i)
            work[best] += cost[best]
            self._known[best].add(label)
        return shares


_estimator: PoseEstimator | None = None


def _begin(catalogue: Catalogue, config: FilterConfig, noise: DepthNoiseConfig | None, device: str) -> None:
    global _estimator
    belong_to_parent()
    _estimator = PoseEstimator(catalogue, config, noise=noise, device=device)


def _ready() -> None:
    """Nothing: a process starts with its first task."""


def _warm(label: str) -> tuple[None, float]:
    assert _estimator is not None
    start = time.process_time()
    _estimator.warm(label)
    return None, time.process_time() - start


def _estimate(frame: Frame, request: PoseRequest) -> tuple[PoseEstimate, float]:
    """The estimate, and the CPU seconds that it took."""
    assert _estimator is not None
    start = time.process_time()
    (found,) = _estimator.estimate_all(frame, [request])
    return found, time.process_time() - start
