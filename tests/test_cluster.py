"""A batch on a Dask cluster: here a scheduler and two workers on the loopback, one of which is killed."""

import contextlib
import json
import shutil
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from test_batch import batch, digests, episodes_of

import sum_drake
from sum_drake.assets import InputError
from sum_drake.cli import main
from sum_drake.cluster import Cluster, _installed, _run_same
from sum_drake.episodes import EpisodeSpec
from sum_drake.systems.scenario import dump_scenario, load_scenario

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
pytestmark = [pytest.mark.cluster, pytest.mark.slow]


@pytest.fixture
def scheduler(request, monkeypatch):
    """Its address, and functions that start a worker and end the scheduler. Parameter: what it may lose with a task."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", str(getattr(request, "param", 3)))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    begun = []

    def start(*arguments):
        command = [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]]
        begun.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return begun[-1]

    whole = start("scheduler", "--host", address, "--no-dashboard")
    yield address, lambda: start("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"), whole.kill
    for process in begun:
        process.kill()
        process.wait()


def test_a_lost_worker_loses_no_episode_and_changes_none(scheduler, tmp_path):
    address, start_worker, _ = scheduler
    first, out = start_worker(), tmp_path / "cluster"
    running = subprocess.Popen([sys.executable, "-m", "sum_drake", *batch(out, "--cluster", address, runs=3)])
    start_worker()
    wait_for(lambda: episodes_of(first.pid), running)
    first.kill()
    assert running.wait(timeout=300) == 0
    alone = tmp_path / "alone"
    assert main(batch(alone, "--workers", "2", runs=3)) == 0
    assert digests(out) == digests(alone) and len(digests(out)) == 3
    rows = [json.loads(path.read_text()) for path in sorted(out.glob("*/episode.json"))]
    assert [row["state"] for row in rows] == ["ended"] * 3


@pytest.mark.parametrize("scheduler", [0], indirect=True)
def test_an_episode_that_takes_its_workers_along_is_a_result(scheduler, tmp_path):
    address, start_worker, _ = scheduler
    first, out = start_worker(), tmp_path / "out"
    running = subprocess.Popen([sys.executable, "-m", "sum_drake", *batch(out, "--cluster", address, runs=1)])
    wait_for(lambda: episodes_of(first.pid), running)
    first.kill()
    start_worker()
    assert running.wait(timeout=300) == 0
    row = json.loads((out / "5" / "episode.json").read_text())
    assert row["state"] == "lost" and "worker" in row["reason"]
    assert json.loads((out / "batch.json").read_text())["causes"] == {"the cluster lost the run": 1}


def test_a_batch_whose_scheduler_goes_away_ends_and_goes_on_elsewhere(scheduler, tmp_path):
    address, start_worker, end = scheduler
    first, out = start_worker(), tmp_path / "out"
    command = [sys.executable, "-m", "sum_drake", *batch(out, "--cluster", address, runs=2)]
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: episodes_of(first.pid), running)
    end()
    _, said = running.communicate(timeout=120)
    assert running.returncode == 1 and "Traceback" not in said
    assert said.splitlines()[-1].endswith("the scheduler is gone; the same command goes on")
    assert main(batch(out, "--workers", "2", runs=2)) == 0
    assert len(digests(out)) == 2


def test_a_worker_that_has_another_program_is_told_of_before_anything_is_run(scheduler, tmp_path, monkeypatch):
    address, start_worker, _ = scheduler
    package = Path(sum_drake.__file__).parent
    shutil.copytree(package, tmp_path / "other" / "sum_drake", ignore=shutil.ignore_patterns("models", "__pycache__"))
    (tmp_path / "other" / "sum_drake" / "models").symlink_to(package / "models")
    with (tmp_path / "other" / "sum_drake" / "geometry.py").open("a") as file:
        file.write("# of another version\n")
    with monkeypatch.context() as patched:
        patched.setenv("PYTHONPATH", str(tmp_path / "other"))
        patched.setenv("PYTHONSAFEPATH", "1")  # the folder that tests are run in is no part of it
        start_worker()
    out = tmp_path / "out"
    command = [sys.executable, "-m", "sum_drake", *batch(out, "--cluster", address, runs=1)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2 and not out.exists()
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"sum-drake: --cluster {address}: worker tcp://127.0.0.1:")
    assert said.endswith(" has another version of the program; expected what is installed here")


def without_sum_drake(folder):
    """A folder that, on PYTHONPATH, makes a Python in which the package is not installed."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text("import sys\nsys.modules['sum_drake'] = None\n")
    return str(folder)


def long_episode():
    """One that takes longer than a test waits for it."""
    return EpisodeSpec(5, dump_scenario(load_scenario(seed=5)), 300.0, 4096)


def test_a_worker_without_the_program_is_told_of_before_anything_is_run(scheduler, tmp_path, monkeypatch):
    address, start_worker, _ = scheduler
    with monkeypatch.context() as patched:
        patched.setenv("PYTHONPATH", without_sum_drake(tmp_path / "bare"))
        bare = start_worker()
    with pytest.raises(InputError, match=r"worker tcp://.* fails: .*sum_drake.*; expected sum-drake as here"):
        Cluster(address).check()
    with pytest.raises(InputError, match="expected sum-drake as here"):
        Cluster(address).check()
    assert bare.poll() is None, "the question ended it"


def test_where_there_is_no_worker_it_is_said_how_to_have_one(scheduler, tmp_path):
    address, start_worker, _ = scheduler
    impatient = Cluster(address, patience_s=2.0)
    with pytest.raises(InputError, match=f"has no worker; expected some: dask worker {address} --nthreads N"):
        impatient.check()
    worker = start_worker()
    Cluster(address).check()
    episodes = impatient.run([long_episode()], tmp_path)
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(list, episodes)
        while not episodes_of(worker.pid):
            assert not running.done()
            time.sleep(0.05)
        with pytest.raises(TimeoutError):
            running.result(timeout=2 * impatient.patience_s)
        worker.kill()
        with pytest.raises(
            RuntimeError, match=r"no worker for 2 s; start one, dask worker .*, and the same command goes on"
        ):
            running.result(timeout=60)


@pytest.mark.parametrize("scheduler", [0], indirect=True)
def test_a_worker_that_came_later_and_can_run_nothing_is_told_of_where_one_is_lost(scheduler, tmp_path, monkeypatch):
    address, start_worker, _ = scheduler
    worker = start_worker()
    Cluster(address).check()
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(list, Cluster(address).run([long_episode()], tmp_path))
        while not episodes_of(worker.pid):
            assert not running.done()
            time.sleep(0.05)
        with monkeypatch.context() as patched:
            patched.setenv("PYTHONPATH", without_sum_drake(tmp_path / "bare"))
            start_worker()
        with pytest.raises(InputError, match="expected sum-drake as here"):
            while True:
                Cluster(address).check()
        worker.kill()
        with pytest.raises(RuntimeError, match=r"worker tcp://.* fails: .*; expected sum-drake as here"):
            running.result(timeout=60)


def wait_for(condition, running):
    while not condition():
        assert running.poll() is None, "the batch ended before"
        time.sleep(0.05)


@pytest.mark.parametrize(
    "address",
    ["foo", "", "tcp://127.0.0.1:port", "tcp://127.0.0.1:99999", "http://127.0.0.1:8786", "tcp://127.0.0.1:9"],
)
def test_where_nobody_answers_it_is_said_and_nothing_written(address, tmp_path):
    """In a process of its own: what a client leaves behind is said when that ends."""
    call = [sys.executable, "-m", "sum_drake", *batch(tmp_path / "out", "--cluster", address)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=100, check=False)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and line.startswith(f"sum-drake: --cluster {address}: ") and "expected a Dask" in line
    assert not (tmp_path / "out").exists()


def test_a_scheduler_that_is_spoken_to_in_secret_needs_certificates():
    with pytest.raises(InputError, match="no certificates; expected them in Dask's settings"):
        Cluster("tls://127.0.0.1:8786").check()


def test_a_worker_on_which_something_else_is_installed_runs_nothing():
    spec, here = EpisodeSpec(5, "", 1.0, 512), _installed(None)
    for part, words in {"code": "another version of the program", "models": "other models"}.items():
        with pytest.raises(RuntimeError, match=words):
            _run_same(spec, None, {**here, part: "0" * 16})
    with pytest.raises(RuntimeError, match=f"drake {here['drake']} and not 1.0"):
        _run_same(spec, None, {**here, "drake": "1.0"})


def test_a_worker_that_cannot_render_runs_nothing(scheduler, monkeypatch):
    monkeypatch.setattr("sum_drake.cluster._problem", lambda: "cannot render: no EGL")
    with pytest.raises(RuntimeError, match="cannot render: no EGL"):
        _run_same(EpisodeSpec(5, "", 1.0, 512), None, _installed(None))
    address, start_worker, _ = scheduler
    with monkeypatch.context() as patched:
        patched.setenv("LD_LIBRARY_PATH", "/nowhere")
        patched.setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nowhere")
        start_worker()
    with pytest.raises(InputError, match=r"worker tcp://.* cannot render: .*; expected EGL"):
        Cluster(address).check()


@pytest.mark.parametrize("words", ["", "HTTP/1.1 400 Bad Request\r\n", "no"])
def test_who_is_no_scheduler_is_told_of_at_once(words, monkeypatch):
    """A dashboard, whose port is one higher, says nothing until it is asked; a client would wait for ever."""
    monkeypatch.setattr("sum_drake.cluster.CONNECT_S", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as pool:

        def answer():
            there, _ = server.accept()
            with there:
                there.sendall(words.encode())
                there.settimeout(10.0)
                with contextlib.suppress(ConnectionResetError):  # it went without reading all
                    assert words == "no" or not there.recv(1), "whoever asked has gone"

        answered = pool.submit(answer)
        with pytest.raises(InputError, match=r"(no word in 2 s|something else answers); expected a Dask scheduler"):
            Cluster(f"tcp://127.0.0.1:{server.getsockname()[1]}").check()
        answered.result(timeout=20)
