"""A run that is killed, whenever that is: what it left can be reported, and read by others."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from sum_drake.report import write_report
from sum_drake.runlog_reader import read_what_there_is

PATIENCE = 900.0
"""Seconds that a run may take until it has logged so much, on a machine that has other things to do."""


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "sum_drake", *words]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3])
def test_a_real_run_that_is_killed_can_be_reported(tmp_path: Path, seed: int) -> None:
    """At a moment that is drawn: so many bytes of log, and a little while into whatever comes then."""
    rng = np.random.default_rng(seed)
    enough, wait = int(rng.integers(1, 250_000)), float(rng.uniform(0.0, 5.0))  # a look makes some 300 kB
    log, folder = tmp_path / "run" / "run.mcap", tmp_path / "run"
    text = "{objects: {labels: [sugar]}}"
    sort = command("sort", "--seed", "5", "--scenario-text", text, "--out", str(folder), "--workers", "1", "--quiet")
    with (tmp_path / "said").open("w") as said:
        run = subprocess.Popen(sort, stdout=said, stderr=said)
        try:
            end = time.monotonic() + PATIENCE
            while not log.is_file() or log.stat().st_size < enough:
                assert run.poll() is None and time.monotonic() < end, (tmp_path / "said").read_text()
                time.sleep(0.05)
            time.sleep(wait)
        finally:
            run.send_signal(signal.SIGKILL)
            run.wait()
    assert run.returncode == -signal.SIGKILL and not (folder / "summary.json").exists()
    record = read_what_there_is(log)
    assert record.problem is not None and "is cut off" in record.problem
    assert record.metadata["seed"] == "5" and record.perceptions
    # No record is there in part: each look has all that belongs to it.
    topics = Counter(topics_of(log))
    looks = len(record.perceptions)
    for topic in ("/head_camera/detections", "/associations", "/belief", "/scene", "/particles", "/perception"):
        assert topics[topic] == looks
    for topic in ("/head_camera/color", "/head_camera/depth"):  # which come first, and may fill a chunk
        assert looks <= topics[topic] <= looks + 1
    report = subprocess.run(command("report", str(folder)), capture_output=True, text=True, check=False)
    assert report.returncode == 0, report.stderr
    page = (folder / "report.html").read_text()
    assert "did not finish" in page and "is cut off" in page and page.count("<img") >= looks


def topics_of(path: Path) -> list[str]:
    """Topic of each message, as the mcap package reads a file from its start."""
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader

    found = []
    with path.open("rb") as stream, pytest.raises(EndOfFile):
        for _, channel, _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            found.append(channel.topic)
    return found


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
