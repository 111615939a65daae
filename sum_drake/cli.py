"""The command `sum-drake`."""

import argparse
import contextlib
import os
import signal
import sys
import threading
import types
from collections.abc import Iterator, Sequence
from typing import NoReturn

from sum_drake import __version__
from sum_drake.assets import InputError
from sum_drake.commands import batch, bench, detection, doctor, estimate, objects, report, sort

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Returns 0: done; 1: the run itself failed; 2: bad input, said in one line on stderr."""
    # Perception and planning are single-threaded by design; idle pools of threads only get in each other's way.
    for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    options = _parser().parse_args(arguments)
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
        print("; ".join(["sum-drake: interrupted", *map(str, interrupt.args)]), file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # whoever read the output has had enough of it
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115
        return 0
    except OSError as error:
        print(f"sum-drake: {error.filename}: {error.strerror}; expected a place that can be written", file=sys.stderr)
        return BAD_INPUT
    return 0


@contextlib.contextmanager
def _interrupts_between_imports() -> Iterator[None]:
    """Within, Ctrl-C waits for the end of an import: Drake takes an interrupted one for a broken installation."""

    def interrupt(number: int, frame: types.FrameType | None) -> None:
        while frame is not None:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                signal.setitimer(signal.ITIMER_REAL, 0.05)  # and again
                return
            frame = frame.f_back
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGALRM)}
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
    parser.add_argument("--version", action="version", version=f"sum-drake {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    for module in (sort, batch, estimate, objects, detection, bench, report, doctor):
        module.add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
