import subprocess
import sys
from pathlib import Path

import pytest

from sum_drake.assets import InputError
from sum_drake.files import alone, write_whole


@pytest.mark.parametrize("content", ["a mug\n", "Löffel\r\n", b"\x89PNG\r\n", ""])
def test_a_file_is_replaced_byte_for_byte_and_nothing_else_stays(tmp_path: Path, content: str | bytes) -> None:
    path = tmp_path / "file"
    path.write_text("what was there before, and longer")
    write_whole(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def fails(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", fails)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text() == "old"


def test_a_write_that_fails_leaves_nothing_in_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "page.html").write_text("old")
    with monkeypatch.context() as patched, pytest.raises(OSError, match="No space"):
        patched.setattr(Path, "replace", full)
        write_whole(tmp_path / "page.html", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert (tmp_path / "page.html").read_text() == "old"


def test_one_process_at_a_time_is_alone_with_a_folder_and_one_that_dies_gives_it_up(tmp_path: Path) -> None:
    hold = (
        "import sys, pathlib; from sum_drake.files import alone\n"
        "with alone(pathlib.Path(sys.argv[1]), 'another run'): print('held', flush=True); sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", hold, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="another run is at it; expected its end"), alone(tmp_path, "another run"):
            pass
        holder.kill()
        holder.wait()
        with alone(tmp_path, "another run"):
            pass
    assert not list(tmp_path.iterdir()), "nothing is left in the folder"
