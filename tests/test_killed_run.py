"""A run that is killed, whenever that is: what it left can be reported, and read by others."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from sum_drake.assets import InputError
from sum_drake.objects import load_catalogue
from sum_drake.report import write_report
from sum_drake.runlog_reader import read_what_there_is

PATIENCE = 900.0
"""Seconds that a run may take until it has logged so much, on a machine that has other things to do."""
MOMENTS = (("/event", 1), ("/perception", 1), ("/plan", 1), ("/plan", 2))
"""So many messages on a topic are waited for: a look is asked for, and taken; an object is reached for, and held."""
WITH_A_LOOK = ("/head_camera/detections", "/associations", "/belief", "/scene", "/particles", "/perception")
CUTS = 15
"""Of each kind."""


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "sum_drake", *words]


@pytest.mark.slow
def test_a_real_run_that_is_killed_can_be_reported_whenever_that_was(tmp_path: Path) -> None:
    """Stopped at several moments, told by what it has logged, each time with its folder as a kill would leave it.

    At the last of them it is killed. What it left then is cut at places that are drawn as well: a log only grows, so
    its beginnings are what any other kill would have left.
    """
    folder, catalogue = tmp_path / "run", load_catalogue()
    text = "{objects: {labels: [sugar]}}"
    sort = command("sort", "--seed", "5", "--scenario-text", text, "--out", str(folder), "--workers", "1", "--quiet")
    left = []
    with (tmp_path / "said").open("w") as said:
        run = subprocess.Popen(sort, stdout=said, stderr=said)
        try:
            end = time.monotonic() + PATIENCE
            for topic, count in MOMENTS:
                while topics_of(folder / "run.mcap").count(topic) < count:
                    assert run.poll() is None and time.monotonic() < end, (tmp_path / "said").read_text()
                    time.sleep(0.5)
                run.send_signal(signal.SIGSTOP)
                left.append(shutil.copytree(folder, tmp_path / f"left_{len(left)}"))
                run.send_signal(signal.SIGCONT)
        finally:
            run.send_signal(signal.SIGKILL)
            run.wait()
    assert run.returncode == -signal.SIGKILL and not (folder / "summary.json").exists()
    for one in (*left, folder):
        looks = check_what_was_left(one / "run.mcap")
        page = write_report(one, catalogue).read_text()
        assert "did not finish" in page and "is cut off" in page and page.count("<img") >= looks
    whole = (folder / "run.mcap").read_bytes()
    topics, records = topics_of(folder / "run.mcap"), list(records_of(whole))
    marked, cut = records[1][0], tmp_path / "cut.mcap"
    for at in moments(np.random.default_rng(0), [end for end, _ in records], len(whole)):
        cut.write_bytes(whole[:at])
        assert topics_of(cut) == topics[: max((count for end, count in records if end <= at), default=0)]
        if at < marked:  # a run writes so much at once, and nobody could tell whose log it is
            with pytest.raises(InputError, match="is no log of a run"):
                read_what_there_is(cut)
        else:
            check_what_was_left(cut)
    again = command("report", str(folder), "--force")
    done = subprocess.run(again, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def check_what_was_left(log: Path) -> int:
    """That it reads as cut off, and no record is there in part: each look has all that belongs to it. How many."""
    record = read_what_there_is(log)
    assert record.problem is not None and "is cut off" in record.problem and record.metadata["seed"] == "5"
    topics = Counter(topics_of(log))
    looks = len(record.perceptions)
    assert [topics[topic] for topic in WITH_A_LOOK] == [looks] * len(WITH_A_LOOK)
    for topic in ("/head_camera/color", "/head_camera/depth"):  # which come first, and may fill a chunk
        assert looks <= topics[topic] <= looks + 1
    return looks


def topics_of(path: Path) -> list[str]:
    """Topic of each message, as the mcap package reads a file from its start up to where it ends; none for none."""
    found: list[str] = []
    if not path.is_file():
        return found
    # Of a record of which a part is there the package says by the way it fails only.
    with path.open("rb") as stream, contextlib.suppress(Exception):
        for _, channel, _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            found.append(channel.topic)
    return found


def records_of(data: bytes) -> Iterator[tuple[int, int]]:
    """Where each record of a log ends that is cut off, and how many messages there are up to there."""
    stream, count = BytesIO(data), 0
    with contextlib.suppress(Exception):
        for record in StreamReader(stream, emit_chunks=True, validate_crcs=True).records:
            if isinstance(record, Chunk):
                count += sum(isinstance(one, Message) for one in breakup_chunk(record))
            yield stream.tell(), count


def moments(rng: np.random.Generator, ends: list[int], size: int) -> list[int]:
    """Sizes to which a log is cut: anywhere; where a record ends; and within one, of which most are small."""
    inside = [int(rng.integers(begin + 1, end)) for begin, end in zip([8, *ends], ends, strict=False)]
    return [*rng.integers(size, size=CUTS), *rng.choice(ends, CUTS), *rng.choice(inside, CUTS)]


def test_a_run_that_is_killed_before_it_has_seen_anything_can_be_reported(tmp_path: Path) -> None:
    """What it is a log of is in the file from the first moment on."""
    script = (
        "import os, signal, sys; from pathlib import Path; from sum_drake.runlog import RunLogWriter\n"
        "writer = RunLogWriter(Path(sys.argv[1]), metadata={'seed': '5'})\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", script, os.fspath(tmp_path / "run.mcap")], check=False)
    assert done.returncode == -signal.SIGKILL
    record = read_what_there_is(tmp_path / "run.mcap")
    assert record.metadata["seed"] == "5" and record.perceptions == () and record.problem is not None
    assert write_report(tmp_path).is_file()
