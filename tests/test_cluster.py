"""A batch on a Dask cluster: here a scheduler and two workers on the loopback, one of which is killed."""

import json
import socket
import subprocess
import sys
import time

import pytest
from refusals import refused
from test_batch import SHORT, batch, digests

from sum_drake.cli import main
from sum_drake.cluster import _run_same
from sum_drake.episodes import EpisodeSpec

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
pytestmark = [pytest.mark.cluster, pytest.mark.slow]


@pytest.fixture
def scheduler():
    """Its address, and a function that starts a worker."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    begun = []

    def start(*arguments):
        command = [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]]
        begun.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return begun[-1]

    start("scheduler", "--host", address, "--no-dashboard")
    yield address, lambda: start("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    for process in begun:
        process.kill()
        process.wait()


def test_a_lost_worker_loses_no_episode_and_changes_none(scheduler, tmp_path):
    address, start_worker = scheduler
    first, out = start_worker(), tmp_path / "cluster"
    command = [sys.executable, "-m", "sum_drake", *batch(out, "--cluster", address, runs=3)]
    running = subprocess.Popen(command)
    while not list(out.glob("*/episode.json")):
        assert running.poll() is None, "it ended before a worker was killed"
        time.sleep(0.05)
    first.kill()  # at its second episode
    start_worker()
    assert running.wait(timeout=300) == 0
    alone = tmp_path / "alone"
    assert main(batch(alone, "--workers", "2", runs=3)) == 0
    assert digests(out) == digests(alone) and len(digests(out)) == 3
    rows = [json.loads(path.read_text()) for path in sorted(out.glob("*/episode.json"))]
    assert [row["state"] for row in rows] == ["ended"] * 3


def test_where_nobody_answers_it_is_said(tmp_path, capsys):
    line = refused(capsys, *batch(tmp_path / "out", "--cluster", "tcp://127.0.0.1:9", text=SHORT))
    assert "--cluster tcp://127.0.0.1:9" in line and "expected a Dask scheduler" in line


def test_a_worker_of_another_version_runs_nothing():
    with pytest.raises(RuntimeError, match="another version than the batch's"):
        _run_same(EpisodeSpec(5, "", 1.0, 512), "0" * 16)
