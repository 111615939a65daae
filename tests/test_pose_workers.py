import multiprocessing
import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import observe, standing

from sum_drake import pose_workers
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator, PoseRequest
from sum_drake.objects import load_catalogue
from sum_drake.pose_workers import PoseWorkers

CATALOGUE = load_catalogue()
FAST = FilterConfig(particles=400, particles_last=60, iterations=3, warmup=1, candidates=2)


@pytest.fixture(scope="module")
def seen():
    places = {"soup_can": (0.55, -0.12), "tide": (0.6, 0.1), "mug": (0.5, 0.0)}
    return observe(CATALOGUE, {label: standing(CATALOGUE, label, *place) for label, place in places.items()})


def requests(boxes):
    return [PoseRequest(label, box, np.random.default_rng([5, i])) for i, (label, box) in enumerate(boxes.items())]


def test_it_does_not_matter_where_a_pose_is_estimated(seen):
    frame, boxes = seen
    seconds = []
    here = PoseEstimator(CATALOGUE, FAST).estimate_all(frame, requests(boxes))
    with PoseWorkers(CATALOGUE, FAST, 2, on_cpu=seconds.append) as workers:
        workers.warm_all(["mug"])
        there = workers.estimate_all(frame, requests(boxes))
        assert workers.estimate_all(frame, []) == []
    for one, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(one.X_WO, other.X_WO)
        np.testing.assert_array_equal(one.belief.weights, other.belief.weights)
        assert one.features == other.features
    assert len(seconds) == 1 + len(boxes), "one mesh, and then each pose"
    assert min(seconds) >= 0
    assert sum(seconds[1:]) > 0.1, "what the processes took is told"


def _die(*arguments):
    os._exit(1)


def test_a_process_that_dies_is_an_error_and_no_hang(seen, monkeypatch):
    frame, boxes = seen
    with PoseWorkers(CATALOGUE, FAST, 1) as workers:
        monkeypatch.setattr(pose_workers, "_estimate", _die)
        with pytest.raises(RuntimeError, match="died"):
            workers.estimate_all(frame, requests(boxes))


def _dawdle(frame, request):
    time.sleep(60.0 if request.label == "mug" else 0.0)
    return None, 0.0


def test_after_an_interrupt_nobody_waits_for_what_processes_are_at(seen, monkeypatch):
    frame, boxes = seen
    monkeypatch.setattr(pose_workers, "_estimate", _dawdle)

    def interrupt(seconds):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), PoseWorkers(CATALOGUE, FAST, 2, on_cpu=interrupt) as workers:
        processes = workers._processes
        assert len(processes) == 2
        begun = time.monotonic()
        workers.estimate_all(frame, requests(boxes))
    assert time.monotonic() - begun < 50.0
    assert not any(process.is_alive() for process in processes)


def test_an_interrupt_while_processes_are_started_leaves_none(monkeypatch):
    others, begun, submit = multiprocessing.active_children(), time.monotonic(), ProcessPoolExecutor.submit

    def interrupted(pool, *task):
        os.kill(os.getpid(), signal.SIGINT)
        return submit(pool, *task)

    monkeypatch.setattr(ProcessPoolExecutor, "submit", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            PoseWorkers(CATALOGUE, FAST, 2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert [process for process in multiprocessing.active_children() if process not in others] == []
    assert time.monotonic() - begun < 50.0


@given(st.lists(st.lists(st.sampled_from(CATALOGUE.labels), max_size=10), min_size=1, max_size=4), st.integers(1, 4))
def test_work_is_shared_out_evenly_and_goes_where_a_label_is_known(rounds, count):
    workers = PoseWorkers.__new__(PoseWorkers)
    workers._pools = [None] * count
    workers._known = [set() for _ in range(count)]
    for labels in rounds:
        known = [set(one) for one in workers._known]
        shares = workers._share_out(labels)
        assert sorted(i for share in shares for i in share) == list(range(len(labels)))
        new = [[labels[i] for n, i in enumerate(share) if labels[i] not in known[k] | {labels[j] for j in share[:n]}]
               for k, share in enumerate(shares)]  # fmt: skip
        work = [len(share) + pose_workers.WARMING * len(unknown) for share, unknown in zip(shares, new, strict=True)]
        assert max(work) - min(work) <= 1.0 + pose_workers.WARMING
