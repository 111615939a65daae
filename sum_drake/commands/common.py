"""What several commands share: how they are declared, what they refuse, how they count."""

import argparse
import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeAlias

from sum_drake.assets import InputError
from sum_drake.files import PART

if TYPE_CHECKING:
    from sum_drake.systems.scenario import Scenario

Commands: TypeAlias = "argparse._SubParsersAction[Any]"
"""What `argparse.ArgumentParser.add_subparsers` returns."""
AGAIN = "folder; called again, it goes on until it is done"
"""Help of --out, where a bench keeps what it has done."""


def add_command(
    commands: Commands,
    name: str,
    command: Callable[[argparse.Namespace], None],
    text: str,
    example: str,
) -> argparse.ArgumentParser:
    """The parser of a command of this name, with one line about it and an example, which runs `command`."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text, epilog=f"example: sum-drake {example}"
    )
    parser.set_defaults(command=command)
    return parser


def add_group(commands: Commands, name: str, text: str, what: str, example: str) -> Commands:
    """The commands below a command of this name; `what` they are called in its usage."""
    parser = commands.add_parser(name, help=text, description=text, epilog=f"example: sum-drake {example}")
    below: Commands = parser.add_subparsers(required=True, metavar=what)
    return below


def add_catalogue(parser: argparse.ArgumentParser, default: str = "the package's fifteen") -> None:
    """--catalogue."""
    parser.add_argument("--catalogue", type=Path, metavar="FILE", help=f"objects (default: {default})")


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """--scenario-file, --scenario-name, --scenario-text, --objects and --catalogue: see `scenario_of`."""
    parser.add_argument("--scenario-file", type=Path, metavar="FILE", help="scenarios (default: the package's)")
    parser.add_argument(
        "--scenario-name",
        metavar="NAME",
        help="which of them (default: the first); the package's: sorting, paper, faults",
    )
    parser.add_argument("--scenario-text", metavar="YAML", help="fields that go over the scenario's")
    parser.add_argument("--objects", type=int, metavar="N", help="how many objects are poured, 1 to 15")
    add_catalogue(parser, "the scenario's")


def scenario_of(options: argparse.Namespace, seed: int | None) -> "Scenario":
    """The scenario that `add_scenario`'s options ask for, with a seed, or its own. Raises InputError."""
    from sum_drake.objects import load_catalogue
    from sum_drake.systems.scenario import load_scenario

    return load_scenario(
        options.scenario_file,
        options.scenario_name,
        options.scenario_text,
        seed=seed,
        objects=options.objects,
        catalogue=None if options.catalogue is None else load_catalogue(options.catalogue),
    )


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """--quiet."""
    parser.add_argument("--quiet", action="store_true", help="no progress")


def add_parallel(parser: argparse.ArgumentParser, option: str, what: str) -> None:
    """An option that says how many of something run at a time."""
    parser.add_argument(
        option, type=int, metavar=option[2].upper(), default=os.cpu_count() or 1, help=f"{what} (default: all)"
    )


def check_count(option: str, count: int | None, least: int = 1) -> None:
    """Refuses a count below the least."""
    if count is not None and count < least:
        raise InputError(f"{option} {count}: expected at least {least}")


def check_free(out: Path, names: Sequence[str], *, force: bool, what: str = "run") -> None:
    """Refuses a folder that holds anything, unless it is a run, or what else, to be replaced: files of these names."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: a file; expected a folder or a new name")
    if not out.is_dir() or not any(out.iterdir()):
        return
    if not force:
        raise InputError(
            f"--out {out}: exists and is not empty; expected a new folder, or --force to replace the {what}"
        )
    parts = tuple(f".{name}{PART}" for name in names)  # of a process that was killed while it wrote
    foreign = sorted(path.name for path in out.iterdir() if path.name not in (*names, *parts))
    if foreign:
        raise InputError(f"--out {out}: holds {foreign[0]!r}, which is no part of a {what}; expected a {what} folder")


def check_device(name: str) -> None:
    """Refuses a device that torch does not have."""
    import torch

    try:
        kind = torch.device(name).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda"):
        raise InputError(f"--device {name}: unknown; expected cpu or cuda")
    if kind == "cuda" and not torch.cuda.is_available():
        raise InputError(f"--device {name}: torch finds no CUDA device; expected cpu")


def check_writable(file: Path) -> None:
    """Refuses a file in a folder that is not there."""
    if file.is_dir() or not file.parent.is_dir():
        raise InputError(f"{file}: cannot be written; expected a file in a folder that exists")


def check_makeable(folder: Path) -> None:
    """Refuses a folder that cannot be made where it is asked for. Nothing is made."""
    above = next(parent for parent in folder.absolute().parents if parent.exists())
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"--out {folder}: cannot be made in {above}; expected a folder that can be written")


def redrawn(stream: TextIO) -> bool:
    """Whether a line on it can be redrawn in place: a terminal that knows how."""
    return stream.isatty() and os.environ.get("TERM", "") not in ("", "dumb")


def fitted(line: str) -> str:
    """A line cut so that a terminal does not break it: what is broken cannot be redrawn."""
    return line[: max(shutil.get_terminal_size().columns - 1, 8)]


class Counting:
    """How many of how many, and the time left: a line redrawn on a terminal, else one each half minute."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._terminal = quiet, redrawn(sys.stderr)
        self._told, self._of = float("-inf"), (-1, -1)

    def __call__(self, what: str, done: int, total: int) -> None:
        """what: that is being done; done: of `total`, from 0 or 1 on."""
        now = time.monotonic()
        if self._of[1] != total or done < self._of[0]:
            self._begun, self._from, self._told = now, done, float("-inf")
        self._of = (done, total)
        if self._quiet or not (self._terminal or done == total or now - self._told > 30):
            return
        self._told = now
        left = (now - self._begun) / (done - self._from) * (total - done) if done > self._from else None
        line = f"{what}: {done} of {total}" + ("" if left is None else f", {_duration(left)} left")
        end = "" if self._terminal and done < total else "\n"
        print(f"\r\033[K{fitted(line)}" if self._terminal else line, end=end, file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def check_free_or_begun(options: argparse.Namespace, files: Sequence[str]) -> None:
    """Refuses a folder in use, unless what is in it is to go on. files: what a bench leaves, its results first."""
    begun = (options.out / "rows.jsonl").is_file() and not (options.out / files[0]).is_file()
    if options.force or not begun:
        check_free(options.out, files, force=options.force, what="bench")


@contextlib.contextmanager
def if_interrupted(say: Callable[[], str], *, quiet: bool) -> Iterator[None]:
    """Within, an interrupt says what `say` then does: what is kept, and how to go on. quiet: no progress was shown."""
    try:
        yield
    except KeyboardInterrupt:
        if redrawn(sys.stderr) and not quiet:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
        raise KeyboardInterrupt(say()) from None


@contextlib.contextmanager
def kept_if_interrupted(options: argparse.Namespace) -> Iterator[None]:
    """Within, an interrupt says what a bench has kept in --out and how it goes on, and no other bench is at that."""
    from sum_drake.files import alone

    def say() -> str:
        rows = options.out / "rows.jsonl"
        if not rows.is_file():
            return "nothing was written"
        same = "the same command without --force" if options.force else "the same command"
        return f"{rows} keeps what was done: {same} goes on"

    new = not options.out.exists()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        with alone(options.out, "another bench"), if_interrupted(say, quiet=options.quiet):
            yield
    finally:
        if new and not any(options.out.iterdir()):  # what the bench itself has refused
            options.out.rmdir()


def anew_if_interrupted(out: Path | None, *, quiet: bool) -> contextlib.AbstractContextManager[None]:
    """Within, an interrupt says that nothing was written to `out` yet, and that the same command begins anew."""

    def say() -> str:
        kept = "nothing was written" if out is None or not out.exists() else f"{out} is as it was"
        return f"{kept}; the same command begins anew"

    return if_interrupted(say, quiet=quiet)
