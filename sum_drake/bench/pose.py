"""`sum-drake bench pose`: how near the estimates of an object's pose come, and at what cost, beside other methods.

The scenes are described in `bench.pose_scenes`, those of the paper's own experiment in `bench.pose_trials`; none is
among those that anything was tuned on. What is done is kept in rows.jsonl as it grows: called again with the same
settings, the bench goes on.
"""

import dataclasses
import functools
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sum_drake import page
from sum_drake.appearance import Appearances
from sum_drake.assets import InputError
from sum_drake.bench import pose_trials
from sum_drake.bench.pose_figures import PoseRow, errors, figures
from sum_drake.bench.pose_methods import ABOUT, METHODS, OWN_SENSOR, PAPER_METHODS, filter_configs
from sum_drake.bench.pose_report import report_page
from sum_drake.bench.pose_scenes import FIRST_SCENE, SENSORS, Instance, PoseScene, other_meshes, pose_scene
from sum_drake.bench.pose_trials_report import corrected_sheet
from sum_drake.bench.results import write_results
from sum_drake.bench.resumed import Progress, RowLog, Task, run_tasks
from sum_drake.bench.watching import Tables
from sum_drake.detection.inference import Detector, load_detector
from sum_drake.estimates import pose_probability
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.fingerprint import code_and_meshes
from sum_drake.objects import Catalogue
from sum_drake.registration import FpfhConfig, FpfhEstimator
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Array

FILES = ("results.json", "report.html", "corrected.jpg", "rows.jsonl")
SCENES, QUICK_SCENES = 40, 4
SEEDS, QUICK_SEEDS = 2, 1
"""Estimates of each instance, from seeds of their own."""
WRONG = 1e3
"""Errors of a method that gives no estimate, metres and degrees."""


def bench_pose(
    out: Path,
    catalogue: Catalogue,
    *,
    quick: bool = False,
    scenes: int | None = None,
    seed: int = 0,
    methods: Sequence[str] = tuple(METHODS),
    workers: int = 2,
    device: str = "cpu",
    anew: bool = False,
    progress: Progress = lambda what, done, total: None,
) -> dict[str, float]:
    """Measures, writes rows.jsonl as it goes and results.json and report.html at the end, and returns the figures.

    corrected.jpg are the page's pictures of corrected false positives; it is not written where there are none.
    scenes: how many; default: 40, or 4 if quick. The paper's experiment has at most ten, and is left out where the
    detector does not know the catalogue's labels. methods: of `pose_methods.ABOUT`. anew: what is in `out` is replaced,
    once it is sure that this can run. Raises InputError for a method that is unknown or cannot run here, and for rows
    of other settings in `out`.
    """
    start = time.monotonic()
    known = tuple(ABOUT)
    unknown = [name for name in methods if name not in known]
    if unknown:
        raise InputError(f"method '{unknown[0]}' is unknown; expected some of {', '.join(known)}")
    if any(name.startswith("fpfh") for name in methods):
        FpfhEstimator(catalogue, FpfhConfig()).warm(catalogue.labels[0])  # refused here rather than in a worker
    settings = {"quick": quick, "seed": seed, "device": device} | code_and_meshes(catalogue)
    count = scenes or (QUICK_SCENES if quick else SCENES)
    seeds = range(FIRST_SCENE + 100 * seed, FIRST_SCENE + 100 * seed + count)
    if anew:
        for name in FILES:
            (out / name).unlink(missing_ok=True)
    log = RowLog(out, settings, list[PoseRow])
    tasks: list[Task] = [("box", scene, 0, method) for scene in seeds for method in methods]
    compared = [method for method in methods if method in PAPER_METHODS]
    detector, why_not = _detector(catalogue) if compared else (None, "")
    clutter, trials = (range(0), 0) if detector is None else _paper_size(seed, count, quick=quick)
    tasks += [("trial", scene, trial, method) for scene in clutter for trial in range(trials) for method in compared]
    with tempfile.TemporaryDirectory(prefix="sum-drake-") as scratch:
        told = other_meshes(catalogue, Path(scratch), FIRST_SCENE + seed)  # not those of tuning
        done = run_tasks(
            tasks,
            log,
            functools.partial(_measure, QUICK_SEEDS if quick else SEEDS),
            workers=workers,
            begin=_start_worker,
            arguments=(catalogue, told, device),
            progress=progress,
        )
        rows = [row for rows in done for row in rows]
        rows.sort(key=lambda row: (row.detected, known.index(row.method), row.scene, row.label, row.seed))
        found = figures(rows)
        looks: list[pose_trials.Corrected] = []
        if detector is not None:
            tables = Tables(catalogue, told, detector, filter_config())
            for look in pose_trials.looks(tables, clutter):
                looks.append(look)
                progress("looking at the paper's scenes", len(looks), len(clutter))
        found |= pose_trials.corrected(looks)
        html = report_page(rows, found, functools.partial(_scene_again, catalogue), catalogue, looks, why_not)
    sheet = corrected_sheet(looks, catalogue)
    if sheet is None:
        (out / "corrected.jpg").unlink(missing_ok=True)
    else:
        write_whole(out / "corrected.jpg", page.jpeg(sheet))
    write_whole(out / "report.html", html)
    write_results(
        out,
        "pose",
        quick=quick,
        settings=settings | {"scenes": count, "methods": list(methods), "wall_s": time.monotonic() - start},
        seeds={"scenes": seeds.start, "paper_scenes": pose_trials.FIRST + 100 * seed, "meshes": FIRST_SCENE + seed},
        figures=found,
        rows=[{"table": "estimate", **dataclasses.asdict(row)} for row in rows],
    )
    return found


def _detector(catalogue: Catalogue) -> tuple[Detector | None, str]:
    """The package's detector, or None and why it cannot look at these objects."""
    try:
        return load_detector(None, labels=catalogue.labels), ""
    except InputError as error:
        return None, str(error)


def _paper_size(seed: int, scenes: int, *, quick: bool) -> tuple[range, int]:
    """Seeds of the scenes of the paper's experiment, and how many trials each gets."""
    first = pose_trials.FIRST + 100 * seed
    if quick:
        return range(first, first + min(scenes, pose_trials.QUICK_SCENES)), pose_trials.QUICK_TRIALS
    return range(first, first + min(scenes, pose_trials.SCENES)), pose_trials.TRIALS


def _scene_again(catalogue: Catalogue, seed: int) -> PoseScene:
    return pose_scene(catalogue, DepthRenderer(catalogue, faces=20_000), seed)


# Measuring, in processes of their own.

Answer = tuple[Array | None, float, int]
"""X_WO (4, 4), the probability that it is right, and how many pictures were rendered."""


class _Filter:
    """A filter as a method of the bench. estimators: by sensor."""

    def __init__(self, estimators: Mapping[str, PoseEstimator]) -> None:
        self._estimators = estimators

    def warm(self, scene: PoseScene, label: str) -> None:
        """What is made once for each label is no part of an estimate's cost."""
        self._estimators[scene.sensor].warm(label)

    def estimate(self, scene: PoseScene, instance: Instance, entropy: list[int]) -> Answer:
        """As if a detector had been rather sure of the label."""
        estimator = self._estimators[scene.sensor]
        before = estimator.renders
        found = estimator.estimate(scene.frame, instance.box, instance.label, rng=np.random.default_rng(entropy))
        return found.X_WO, pose_probability(0.9, 0.9, found), estimator.renders - before


class _Fpfh:
    """The baseline as a method of the bench."""

    def __init__(self, estimator: FpfhEstimator) -> None:
        self._estimator = estimator

    def warm(self, scene: PoseScene, label: str) -> None:
        """Describes the label's mesh."""
        self._estimator.warm(label)

    def estimate(self, scene: PoseScene, instance: Instance, entropy: list[int]) -> Answer:
        """Without a probability."""
        seed = int(np.random.default_rng(entropy).integers(2**31))
        return self._estimator.estimate(scene.frame, instance.box, instance.label, seed=seed), float("nan"), 0


class _Worker:
    """One process's scenes and methods."""

    def __init__(self, catalogue: Catalogue, told: Catalogue, device: str) -> None:
        self.catalogue, self._told = catalogue, told
        self._renderer, self._exact = DepthRenderer(self.catalogue, faces=20_000), DepthRenderer(told)
        self.scene = functools.lru_cache(maxsize=2)(self._scene)
        self._detector = functools.cache(functools.partial(load_detector, None, labels=catalogue.labels))
        self.method = functools.cache(self._method)
        self._appearances = functools.cache(functools.partial(Appearances, self._told, device=device))

    def _scene(self, kind: str, seed: int) -> PoseScene:
        if kind == "trial":
            return pose_trials.trial_scene(self.catalogue, self._renderer, self._detector(), seed)
        return pose_scene(self.catalogue, self._renderer, seed)

    def _method(self, name: str) -> _Filter | _Fpfh:
        if name.startswith("fpfh"):
            return _Fpfh(FpfhEstimator(self._told, FpfhConfig(refine=name == "fpfh_icp")))
        config = filter_configs()[name]
        make = functools.partial(
            PoseEstimator, self._told, config, appearances=self._appearances(config.render), renderer=self._exact
        )
        if name == OWN_SENSOR:
            return _Filter({sensor: make(noise=noise) for sensor, noise in SENSORS.items()})
        return _Filter(dict.fromkeys(SENSORS, make()))


_worker: _Worker
"""This process's, in those that measure."""


def _start_worker(catalogue: Catalogue, told: Catalogue, device: str) -> None:
    global _worker
    _worker = _Worker(catalogue, told, device)


def _measure(seeds: int, kind: str, scene_seed: int, trial: int, name: str) -> list[PoseRow]:
    """kind: "box", of which `seeds` estimates are made, or "trial", which is one of its scene's."""
    worker = _worker
    scene, method = worker.scene(kind, scene_seed), worker.method(name)
    rows = []
    for i, instance in enumerate(scene.instances):
        method.warm(scene, instance.label)
        for k in range(seeds) if kind == "box" else (trial,):
            begun = time.process_time()
            X_WO, probability, renders = method.estimate(scene, instance, [scene_seed, i, k])
            cpu_s = time.process_time() - begun
            model = worker.catalogue[instance.label]
            shift, angle, raw, distance = (WRONG,) * 4 if X_WO is None else errors(model, X_WO, instance.X_WO)
            rows.append(
                PoseRow(
                    method=name,
                    scene=scene_seed,
                    label=instance.label,
                    seed=k,
                    sensor=scene.sensor,
                    visible_share=instance.visible_share,
                    wrong_box=instance.wrong_box,
                    translation_m=shift,
                    rotation_deg=angle,
                    raw_rotation_deg=raw,
                    adds_m=distance,
                    probability=probability,
                    cpu_s=cpu_s,
                    renders=renders,
                    X_WO=[] if X_WO is None else X_WO.tolist(),
                    detected=kind == "trial",
                )
            )
    return rows
