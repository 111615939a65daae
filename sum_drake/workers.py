"""What worker processes have in common: one thread each, and whoever started them ends them."""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "LP_NUM_THREADS": "0",
}
"""Of numerical libraries and of Mesa's renderer, which count them when a process starts."""


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes that are spawned in the block have one thread each, and take no notice of Ctrl-C from their start on.

    In this process it, and SIGTERM, wait until the block is left: a process whose start is broken off complains of it.
    So nothing is waited for in the block, and pools are made before it: one starts a process that unblocks signals.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    with _interrupts_wait():
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which they inherit
        os.environ.update(ONE_THREAD)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def _interrupts_wait() -> Iterator[None]:
    """A mask does not do: the kernel hands a signal to any other thread, and Python to this one, which alone answers.

    A block that ends by an exception ends by that one, and what has waited is dropped.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, frame: waiting.append(number))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)  # the last: Ctrl-C once more, `cli`
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if waiting:
        signal.raise_signal(waiting[0])


def give_up(pool: ProcessPoolExecutor) -> None:
    """Ends a pool, and what its processes are at, which is lost."""
    for process in multiprocessing.active_children():
        process.terminate()
    pool.shutdown(cancel_futures=True)


def belong_to_parent() -> None:
    """For the start of a worker: Ctrl-C is for whoever started it, and with that one, however it is killed, it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def end_with_it() -> None:
            multiprocessing.connection.wait([parent.sentinel])
            os._exit(1)

        threading.Thread(target=end_with_it, daemon=True).start()
