"""Files that are whole or not there, and folders that one process writes at a time."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from sum_drake.assets import InputError

PART = ".part"
"""How names end of what is not written whole yet."""


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file, text as UTF-8, through a temporary one beside it, so that nobody ever sees half of it.

    Raises OSError where the folder cannot be written.
    """
    temporary = path.with_name(f".{path.name}{PART}")
    try:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        temporary.replace(path)
    except BaseException:  # a full disk, or Ctrl-C
        temporary.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def alone(folder: Path, what: str) -> Iterator[None]:
    """Within, no other process is alone with the folder. what: that may be at it, such as "another run".

    Raises InputError where one is. Where the file system knows no locks, nothing is refused.
    """
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"--out {folder}: {what} is at it; expected its end, or another folder") from None
        except OSError:
            pass
        yield
    finally:
        os.close(lock)
