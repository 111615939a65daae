"""Files that are whole or not there."""

from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file, text as UTF-8, through a temporary one beside it, so that nobody ever sees half of it.

    Raises OSError where the folder cannot be written.
    """
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_bytes(content.encode() if isinstance(content, str) else content)
    temporary.replace(path)
