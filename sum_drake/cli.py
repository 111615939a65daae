"""The command `sum-drake`."""

import argparse
import contextlib
import io
import os
import signal
import sys
import threading
import types
from collections.abc import Iterator, Sequence
from typing import NoReturn, TextIO

from sum_drake import __version__
from sum_drake.assets import InputError
from sum_drake.commands import batch, bench, detection, doctor, estimate, objects, replay, report, sort

FAILED, BAD_INPUT = 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Returns 0: done; 1: the run itself failed; 2: bad input, said in one line on stderr."""
    # Perception and planning are single-threaded by design; idle pools of threads only get in each other's way.
    for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    with _somebody_listens():
        return _run(_parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    """The command's exit code."""
    try:
        with _interrupts_between_imports():
            options.command(options)
    except InputError as error:
        print(f"sum-drake: {error}", file=sys.stderr)
        return BAD_INPUT
    except RuntimeError as error:
        print(f"sum-drake: failed: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt as interrupt:
        word = "ended" if _told[-1:] == [signal.SIGTERM] else "interrupted"
        print("; ".join([f"sum-drake: {word}", *map(str, interrupt.args)]), file=sys.stderr)
        return 128 + (_told[-1] if _told else signal.SIGINT)
    except BrokenPipeError:  # whoever read the output has had enough of it
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115
        return 0
    except OSError as error:
        where = "standard output, or a file that was being written" if error.filename is None else error.filename
        print(f"sum-drake: {where}: {error.strerror}; expected files that can be read and written", file=sys.stderr)
        return BAD_INPUT
    return 0


class _Listened(io.TextIOBase):
    """A stream that goes on when whoever listened has gone: what a command says on its way is not what it is for."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            if self._stream is not None:
                self._stream.write(text)
        except BrokenPipeError:
            self._stream = None
        return len(text)

    def flush(self) -> None:
        try:
            if self._stream is not None:
                self._stream.flush()
        except BrokenPipeError:
            self._stream = None

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()

    def fileno(self) -> int:
        if self._stream is None:
            raise OSError("nobody listens")
        return self._stream.fileno()


@contextlib.contextmanager
def _somebody_listens() -> Iterator[None]:
    """Within, standard error may be closed, or a pipe that nobody reads."""
    before = sys.stderr
    sys.stderr = _Listened(before)
    try:
        yield
    finally:
        sys.stderr = before


_told: list[int] = []
"""The signals that asked this command to end."""


@contextlib.contextmanager
def _interrupts_between_imports() -> Iterator[None]:
    """Within, Ctrl-C waits for the end of an import: Drake takes an interrupted one for a broken installation.

    SIGTERM, by which schedulers end what they have started, is taken as Ctrl-C is.
    """
    _told.clear()

    def interrupt(number: int, frame: types.FrameType | None) -> None:
        if number != signal.SIGALRM:
            _told.append(number)
        while frame is not None:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                signal.setitimer(signal.ITIMER_REAL, 0.05)  # and again
                return
            frame = frame.f_back
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)}
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with the arguments."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message}; expected arguments as in {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="sum-drake",
        description="Sequential Scene Understanding and Manipulation with Drake: perceive a poured table and sort it",
        epilog="example: sum-drake sort --seed 1",
    )
    parser.set_defaults(main=main)  # for a command that runs others
    parser.add_argument("--version", action="version", version=f"sum-drake {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    for module in (sort, batch, estimate, objects, detection, bench, report, replay, doctor):
        module.add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
