"""Worker processes end with whoever started them."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from sum_drake.workers import ONE_THREAD, one_thread_each

START = """
import multiprocessing, os, sys, time
from concurrent.futures import ProcessPoolExecutor
from sum_drake.workers import belong_to_parent

if __name__ == "__main__":
    pool = ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), belong_to_parent)
    list(pool.map(time.sleep, [0.2, 0.2]))
    print(*pool._processes, flush=True)
    time.sleep(60)
"""


HELD = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"


def test_processes_that_are_started_have_one_thread_each(monkeypatch):
    """And whoever starts them is as before."""
    for name in ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    ask = (
        "import os, numba, torch; print(torch.get_num_threads(), numba.get_num_threads(), os.getenv('LP_NUM_THREADS'))"
    )
    with one_thread_each():
        told = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True).stdout
    assert told == "1 1 0\n"
    assert not ONE_THREAD.keys() & os.environ.keys()


def test_ctrl_c_is_for_the_one_who_started_them_from_their_start_on(tmp_path):
    """While they still import what they need, too: what they had to say of it would be pages."""
    script = tmp_path / "start.py"
    pool = START.index("    pool =")
    script.write_text(
        START[:pool].replace("belong_to_parent", "belong_to_parent, give_up, one_thread_each") + "    import signal\n"
        "    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that starts tests with & ignores it\n"
        "    pool = ProcessPoolExecutor(2, multiprocessing.get_context('spawn'), belong_to_parent)\n"
        "    try:\n"
        "        with one_thread_each():\n"
        "            found = pool.map(time.sleep, [60.0, 60.0])\n"
        "            print(*pool._processes, flush=True)\n"
        "        list(found)\n"
        "    except KeyboardInterrupt:\n"
        "        give_up(pool)\n"
        "        print('given up', flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    workers = [int(pid) for pid in process.stdout.readline().split()]
    # Not at the very moment at which it begins to wait: Python then takes notice of a signal when the wait is over.
    time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
    out, err = process.communicate(timeout=50)
    assert (out, err, process.returncode) == ("given up\n", "", 0)
    assert len(workers) == 2 and not any(map(is_running, workers))


@pytest.mark.parametrize("number", HELD)
def test_an_interrupt_waits_until_processes_are_started_whichever_thread_it_reaches(number):
    """Libraries keep threads, which have no part in this one's mask; a process started half shows its own traceback."""
    stop, said = threading.Event(), []
    library = threading.Thread(target=stop.wait)
    library.start()
    before = {number: signal.signal(number, signal.default_int_handler) for number in HELD}
    try:
        with pytest.raises(KeyboardInterrupt), one_thread_each():
            os.kill(os.getpid(), number)
            time.sleep(0.1)
            said.append("started")
        assert said == ["started"]
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        stop.set()
        library.join()


def test_workers_do_not_outlive_one_who_is_killed(tmp_path):
    script = tmp_path / "start.py"
    script.write_text(START)
    process = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    workers = [int(pid) for pid in process.stdout.readline().split()]
    assert len(workers) == 2 and all(map(is_running, workers))
    process.send_signal(signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 20.0
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, workers))
