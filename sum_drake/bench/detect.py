"""`sum-drake bench detect`: how good the detector is on pictures of scenes it has not seen.

`test` pictures look as those of the training do, `shift` pictures have lights, textures, shapes and a shading that it
never saw (`detection.dataset_scenes`). Each is of a scene of its own. Boxes, labels, threshold and calibration are the
weights' own: nothing here is fitted to the pictures it is measured on, but for `recall_at_1_false_positive`, which says
what another threshold would have given.
"""

import functools
import hashlib
import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from sum_drake.assets import InputError
from sum_drake.bench.detect_figures import COUNTS, SHIFT, TEST, Measured, Proposed, figures, rows
from sum_drake.bench.detect_report import report_page
from sum_drake.bench.results import write_results
from sum_drake.costs import peak_memory_mib
from sum_drake.detection import metrics
from sum_drake.detection.dataset import SPLITS, AnnotatedImage, ImageSet, read_settings
from sum_drake.detection.dataset_job import Plan, render_dataset
from sum_drake.detection.inference import load_detector
from sum_drake.detection.proposals import Proposer
from sum_drake.detection.proposers import LEARNED, PROPOSERS
from sum_drake.detection.weights import DEFAULT
from sum_drake.files import write_whole
from sum_drake.objects import Catalogue
from sum_drake.workers import belong_to_parent, give_up, one_thread_each

FILES = ("results.json", "report.html")
IMAGES, QUICK_IMAGES = 200, 20
"""Pictures of each of the two splits."""
Progress = Callable[[str, int, int], None]
"""Told what is being done, and how many of how many are."""


def bench_detect(
    out: Path,
    catalogue: Catalogue,
    *,
    quick: bool = False,
    seed: int = 0,
    data: Path | None = None,
    weights: Path | None = None,
    device: str = "cpu",
    workers: int = 2,
    progress: Progress = lambda what, done, total: None,
) -> dict[str, float]:
    """Measures, writes results.json and report.html into `out`, and returns the figures.

    Args:
        quick: a tenth of the pictures.
        seed: of the pictures that are rendered.
        data: a data set whose splits test and shift are taken instead: the first view of each scene.
        weights: default: the package's.
        device: where the network runs.
        workers: processes that render and that measure.

    Raises InputError for weights or data that cannot be used.
    """
    start, images = time.monotonic(), QUICK_IMAGES if quick else IMAGES
    detector = load_detector(weights, labels=catalogue.labels)
    with tempfile.TemporaryDirectory(prefix="sum-drake-") as scratch:
        folder = data
        if folder is None:
            folder = Path(scratch)
            render_dataset(catalogue, folder, _plan(images, seed), workers=workers, report=progress)
        sets = {split: _image_set(folder, split, detector.labels) for split in (TEST, SHIFT)}
        tasks = [(split, index) for split, pictures in sets.items() for index in _one_of_each_scene(pictures)[:images]]
        measure = functools.partial(_measure, folder, weights, detector.labels, device)
        measured = list(_measure_all(tasks, measure, workers, progress))
        found = figures(measured, detector.threshold)
        settings = {
            "images": {split: sum(one.split == split for one in measured) for split in sets},
            "data": "rendered" if data is None else "read",
            "weights_sha256": hashlib.sha256((DEFAULT if weights is None else weights).read_bytes()).hexdigest(),
            "threshold": detector.threshold,
            "proposer": LEARNED,
            "seed": seed,
            "device": device,
            "workers": workers,
            "wall_s": time.monotonic() - start,
        }
        seeds = {"dataset": int(read_settings(folder)["seed"])}
        table = rows(measured, detector.labels, detector.threshold)
        html = report_page(measured, found, table, detector.labels, detector.threshold, sets)
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "report.html", html)
    write_results(
        out,
        "detect",
        quick=quick,
        settings=settings,
        seeds=seeds,
        figures=found,
        rows=table,
    )
    return found


def _plan(images: int, seed: int) -> Plan:
    """Of a data set with as many scenes in each of the two splits, seen once each."""
    splits = (TEST, SHIFT)
    return Plan({split: images if split in splits else 0 for split in SPLITS}, dict.fromkeys(SPLITS, 1), seed)


def _image_set(folder: Path, split: str, labels: Sequence[str]) -> ImageSet:
    pictures = ImageSet(folder, split)
    if tuple(pictures.labels) != tuple(labels):
        raise InputError(f"{folder}: is of other labels; expected {', '.join(labels)}")
    return pictures


def _one_of_each_scene(pictures: ImageSet) -> list[int]:
    """Index of the first view of each scene."""
    first: dict[str, int] = {}
    for index, name in enumerate(pictures.names):
        first.setdefault(name.rpartition("/")[0], index)
    return list(first.values())


# Measuring, in processes of their own: what one has held by then is what detecting takes.

_WARM_UP = 3
"""Pictures before anything is measured: what is compiled or loaded at the first is no cost of the others."""


class _Worker:
    """One process's detector, proposers and pictures."""

    def __init__(self, folder: Path, weights: Path | None, labels: Sequence[str], device: str) -> None:
        self.sets = {split: ImageSet(folder, split) for split in (TEST, SHIFT)}
        self.detector = load_detector(weights, labels=labels, device=device)
        first = self.sets[TEST][:_WARM_UP]
        for image in first:
            self.detector.detect(image.color, image.depth)
        self.peak_memory_mib = peak_memory_mib()
        self.proposers: dict[str, Proposer] = {
            LEARNED: lambda color, depth: self.detector.proposals(color, COUNTS[-1]),
            **{name: make() for name, make in PROPOSERS.items()},
        }
        for propose in self.proposers.values():
            propose(first[0].color, first[0].depth)

    def measure(self, split: str, index: int) -> Measured:
        """A picture of a split; proposals are measured on `test` alone."""
        image = self.sets[split][index]
        start = time.process_time()
        found = self.detector.detect(image.color, image.depth)
        cpu_s = time.process_time() - start
        true_boxes = np.reshape([one.box for one in image.objects], (-1, 4))
        of_true = self.detector.classify(image.color, true_boxes)
        return Measured(
            split=split,
            index=index,
            scored=metrics.scored_image(image, self.detector.labels, found.boxes, found.probabilities, of_true),
            cpu_s=cpu_s,
            proposals={name: self._propose(name, image) for name in self.proposers} if split == TEST else {},
            peak_memory_mib=self.peak_memory_mib,
        )

    def _propose(self, name: str, image: AnnotatedImage) -> Proposed:
        start = time.process_time()
        found = self.proposers[name](image.color, image.depth)
        cpu_s = time.process_time() - start
        return Proposed(metrics.proposal_overlaps(found.boxes, image, COUNTS), len(found), cpu_s)


@functools.lru_cache(maxsize=1)
def _worker(folder: Path, weights: Path | None, labels: tuple[str, ...], device: str) -> _Worker:
    """The process's own, made at its first picture."""
    import cv2
    import torch

    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    return _Worker(folder, weights, labels, device)


def _measure(
    folder: Path, weights: Path | None, labels: tuple[str, ...], device: str, task: tuple[str, int]
) -> Measured:
    return _worker(folder, weights, labels, device).measure(*task)


def _measure_all(
    tasks: Sequence[tuple[str, int]],
    measure: Callable[[tuple[str, int]], Measured],
    workers: int,
    progress: Progress,
) -> Iterator[Measured]:
    """In the order of the tasks, whatever the number of workers."""
    progress("measuring", 0, len(tasks))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, belong_to_parent) as pool:
        try:
            with one_thread_each():
                found = pool.map(measure, tasks)
            for done, one in enumerate(found, 1):
                progress("measuring", done, len(tasks))
                yield one
        except BaseException:
            give_up(pool)
            raise
