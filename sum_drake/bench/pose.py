"""`sum-drake bench pose`: how near the estimates of an object's pose come, and at what cost, beside other methods.

The scenes are described in `bench.pose_scenes`; those of the bench are not among those that anything was tuned on. What
is done is kept in rows.jsonl as it grows: called again with the same settings, the bench goes on.
"""

import dataclasses
import functools
import hashlib
import json
import multiprocessing
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.appearance import Appearances
from sum_drake.assets import InputError, one_line
from sum_drake.bench.pose_figures import PoseRow, errors, figures
from sum_drake.bench.pose_methods import ABOUT, METHODS, OWN_SENSOR, filter_configs
from sum_drake.bench.pose_report import report_page
from sum_drake.bench.pose_scenes import FIRST_SCENE, SENSORS, Instance, PoseScene, other_meshes, pose_scene
from sum_drake.bench.results import write_results
from sum_drake.estimates import pose_probability
from sum_drake.files import write_whole
from sum_drake.filtering import PoseEstimator
from sum_drake.objects import Catalogue
from sum_drake.registration import FpfhConfig, FpfhEstimator
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Array
from sum_drake.workers import ignore_interrupts, one_thread_each

FILES = ("results.json", "report.html", "rows.jsonl")
SCENES, QUICK_SCENES = 40, 4
SEEDS, QUICK_SEEDS = 2, 1
"""Estimates of each instance, from seeds of their own."""
WRONG = 1e3
"""Errors of a method that gives no estimate, metres and degrees."""
Progress = Callable[[str, int, int], None]


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

    scenes: how many; default: 40, or 4 if quick. methods: of `pose_methods.ABOUT`. anew: what is in `out` is replaced,
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
    settings = {
        "quick": quick,
        "seed": seed,
        "device": device,
        "catalogue": catalogue.path.name,
        "meshes": _digest([catalogue.path, *(catalogue[label].mesh for label in catalogue.labels)]),
        "code": _digest(sorted(Path(__file__).parents[1].rglob("*.py"))),
    }
    count = scenes or (QUICK_SCENES if quick else SCENES)
    seeds = range(FIRST_SCENE + 100 * seed, FIRST_SCENE + 100 * seed + count)
    if anew:
        for name in FILES:
            (out / name).unlink(missing_ok=True)
    log = _Log(out, settings)
    wanted = [(scene, method) for scene in seeds for method in methods]
    tasks = [task for task in wanted if task not in log.done]
    with tempfile.TemporaryDirectory(prefix="sum-drake-") as scratch:
        told = other_meshes(catalogue, Path(scratch), FIRST_SCENE + seed)  # not those of tuning
        measure = functools.partial(_measure, QUICK_SEEDS if quick else SEEDS)
        progress("measuring", len(wanted) - len(tasks), len(wanted))
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, context, _start_worker, (catalogue, told, device)) as pool:
            with one_thread_each():
                futures = {pool.submit(measure, *task): task for task in tasks}
            try:
                for future in as_completed(futures):
                    log.add(*futures[future], future.result())
                    progress("measuring", sum(task in log.done for task in wanted), len(wanted))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in multiprocessing.active_children():
                    process.terminate()  # what they are at takes minutes, and is lost either way
                raise
        rows = [row for row in log.rows if (row.scene, row.method) in wanted]
        rows.sort(key=lambda row: (known.index(row.method), row.scene, row.label, row.seed))
        found = figures(rows)
        html = report_page(rows, found, functools.partial(_scene_again, catalogue), catalogue)
    write_results(
        out,
        "pose",
        quick=quick,
        settings=settings | {"scenes": count, "methods": list(methods), "wall_s": time.monotonic() - start},
        seeds={"scenes": seeds.start, "meshes": FIRST_SCENE + seed},
        figures=found,
        rows=[{"table": "estimate", **dataclasses.asdict(row)} for row in rows],
    )
    write_whole(out / "report.html", html)
    return found


def _scene_again(catalogue: Catalogue, seed: int) -> PoseScene:
    return pose_scene(catalogue, DepthRenderer(catalogue, faces=20_000), seed)


def _digest(files: Sequence[Path]) -> str:
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()[:16]


def _other(begun: Mapping[str, Any], settings: Mapping[str, Any]) -> str:
    """In words, which settings differ; what is told apart by a digest says nothing to a reader."""
    words = {"code": "another version of the program", "meshes": "other meshes"}
    keys = [key for key in settings if begun.get(key) != settings[key]]
    return ", ".join(words.get(key, f"{key} {begun.get(key)} and not {settings[key]}") for key in keys)


class _Log:
    """rows.jsonl: settings in the first line, then one line for each scene and method that are done."""

    def __init__(self, out: Path, settings: Mapping[str, Any]) -> None:
        self._path = out / "rows.jsonl"
        self.rows: list[PoseRow] = []
        self.done: set[tuple[int, str]] = set()
        out.mkdir(parents=True, exist_ok=True)
        text = self._path.read_text() if self._path.is_file() else ""
        if not text.endswith("\n"):  # cut off while it was written
            text = text[: text.rfind("\n") + 1]
            write_whole(self._path, text)
        lines = text.splitlines()
        if not lines:
            self._path.write_text(json.dumps(settings) + "\n")
            return
        try:
            other = _other(json.loads(lines[0]), settings)
            if other:
                raise InputError(f"{self._path}: is of {other}; expected a new --out, or --force")
            for line in lines[1:]:
                entry = json.loads(line)
                self._keep(entry["scene"], entry["method"], [PoseRow(**row) for row in entry["rows"]])
        except (json.JSONDecodeError, KeyError, TypeError) as error:
            raise InputError(f"{self._path}: {one_line(error)}; expected rows of this bench, or a new --out") from error

    def add(self, scene: int, method: str, rows: list[PoseRow]) -> None:
        """What was measured of a scene by a method."""
        entry = {"scene": scene, "method": method, "rows": [dataclasses.asdict(row) for row in rows]}
        with self._path.open("a") as file:
            file.write(json.dumps(entry) + "\n")
        self._keep(scene, method, rows)

    def _keep(self, scene: int, method: str, rows: list[PoseRow]) -> None:
        self.rows += rows
        self.done.add((scene, method))


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
        self.method = functools.cache(self._method)
        self._appearances = functools.cache(functools.partial(Appearances, self._told, device=device))

    def _scene(self, seed: int) -> PoseScene:
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
    import torch

    global _worker
    ignore_interrupts()
    torch.set_num_threads(1)
    _worker = _Worker(catalogue, told, device)


def _measure(seeds: int, scene_seed: int, name: str) -> list[PoseRow]:
    worker = _worker
    scene, method = worker.scene(scene_seed), worker.method(name)
    rows = []
    for i, instance in enumerate(scene.instances):
        method.warm(scene, instance.label)
        for k in range(seeds):
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
                )
            )
    return rows
