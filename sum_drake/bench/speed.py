"""`sum-drake bench speed`: what an object's pose costs, where that goes, and what many at once gain."""

import cProfile
import dataclasses
import functools
import math
import multiprocessing
import pstats
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch

from sum_drake.appearance import Appearance, Appearances, RenderedAnew, ViewedFromAllSides
from sum_drake.assets import InputError
from sum_drake.bench.aims import Aims
from sum_drake.bench.pose_scenes import PoseScene, pose_scene
from sum_drake.bench.results import write_results
from sum_drake.bench.speed_report import report_page
from sum_drake.costs import own_memory_mib, peak_memory_mib
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator, PoseRequest
from sum_drake.geometry import inverse, rotation_from_quaternion, rotation_from_vector
from sum_drake.likelihood import Counts, Observation, count, count_picture, observe, paper_likelihood, pixel_rays
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.particles import Particles, poses
from sum_drake.pose_workers import PoseWorkers
from sum_drake.rendering import DepthRenderer, mesh_arrays
from sum_drake.types import Array
from sum_drake.workers import belong_to_parent, give_up, one_thread_each

FILES = ("results.json", "report.html")
PARTICLES, QUICK_PARTICLES = (625, 1250, 2500, 5000), (625, 2500)
TILES = (16, 24, 32, 48, 64)
TRIANGLES = (100, 400, 1000, 2000)
OBJECTS, QUICK_OBJECTS = (1, 2, 4, 8), (1, 4)
TILE = 32
"""The paper preset's."""
EPSILON = filter_config("paper").epsilon
"""The paper's inlier distance, metres."""
SCENE = 500
"""Seed of the scene that is looked at: neither one of the bench of poses nor tuned on."""
AIMS: Aims = {
    "cpu_s_per_object": ("at most", 1.0),
    "atlas_speedup": ("at least", 4.0),
    "run_peak_memory_mib": ("at most", 2048.0),
    "two_worker_speedup": ("at least", 1.7),
    "warm_s_per_model": ("at most", 1.5),
    "memory_mib_per_model": ("at most", 150.0),
}
"""What the figures are to reach."""
PARTS = {
    ("appearance.py", "show"): "what particles show",
    ("likelihood.py", "register"): "registration",
    ("likelihood.py", "count"): "comparison",
    ("rendering.py", "depth"): "exact renders",
}
"""Functions of the estimator whose shares of the time are told, by file and name."""
Row = dict[str, Any]
Progress = Callable[[str, int, int], None]


@dataclasses.dataclass(frozen=True)
class _On:
    """What is measured on."""

    catalogue: Catalogue
    scene: PoseScene
    repeats: int
    device: str


def bench_speed(
    out: Path,
    catalogue: Catalogue,
    *,
    quick: bool = False,
    seed: int = 0,
    device: str = "cpu",
    progress: Progress = lambda what, done, total: None,
) -> dict[str, float]:
    """Measures, writes results.json and report.html into `out`, and returns the figures.

    device: torch's, where points are compared; what is told is CPU seconds all the same.
    Run it on a machine that does nothing else.
    """
    start = time.monotonic()
    torch.set_num_threads(1)
    scene = pose_scene(catalogue, DepthRenderer(catalogue, faces=20_000), SCENE + seed)
    if not scene.instances:
        raise InputError(f"{catalogue.path}: nothing of a scene poured from it can be seen; expected larger objects")
    on = _On(catalogue, scene, 1 if quick else 3, device)
    parts: list[tuple[str, Callable[[], list[Row]]]] = [
        ("particles", lambda: _by_particles(on, QUICK_PARTICLES if quick else PARTICLES)),
        ("shares", lambda: _shares(on)),
        ("renders", lambda: _renders(on, 144 if quick else 1152)),
        ("objects", lambda: _by_objects(on, QUICK_OBJECTS if quick else OBJECTS)),
        ("memory", lambda: _memory(catalogue)),
    ]
    rows: list[Row] = []
    for i, (name, measure) in enumerate(parts):
        progress(name, i, len(parts))
        rows += [{"table": name, **row} for row in measure()]
    progress("done", len(parts), len(parts))
    found = _figures(rows)
    settings = {
        "repeats": on.repeats,
        "catalogue": catalogue.path.name,
        "seed": seed,
        "device": device,
        "wall_s": round(time.monotonic() - start, 1),
    }
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "report.html", report_page(rows, found, AIMS))
    write_results(out, "speed", quick=quick, settings=settings, seeds={"scene": SCENE + seed}, figures=found, rows=rows)
    return found


def _figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    def one(table: str, **keys: object) -> Mapping[str, Any]:
        return next(row for row in rows if row["table"] == table and keys.items() <= row.items())

    alone, atlas = one("renders", kind="alone", size=TILE), one("renders", kind="tile", size=TILE)
    most = max(row["objects"] for row in rows if row["table"] == "objects")
    memory = one("memory")
    return {
        "cpu_s_per_object": one("particles", particles=filter_config().particles)["cpu_s"],
        "atlas_speedup": alone["cpu_ms"] / atlas["cpu_ms"],
        "atlas_error": atlas["error"],
        "atlas_ms_per_particle": atlas["cpu_ms"],
        "two_worker_speedup": one("objects", objects=most, processes=1)["wall_s"]
        / one("objects", objects=most, processes=2)["wall_s"],
        "warm_s_per_model": memory["warm_s"],
        "memory_mib_per_model": memory["mib_per_model"],
        "run_peak_memory_mib": memory["peak_mib"],
    }


def _requests(scene: PoseScene, count: int, seed: int) -> list[PoseRequest]:
    """As many as asked for: the scene's instances again and again."""
    chosen = [scene.instances[i % len(scene.instances)] for i in range(count)]
    return [PoseRequest(one.label, one.box, np.random.default_rng([seed, i])) for i, one in enumerate(chosen)]


def _by_particles(on: _On, counts: Sequence[int]) -> list[Row]:
    """CPU seconds an object against the number of particles at the start."""
    appearances = Appearances(on.catalogue, filter_config().render, device=on.device)
    rows = []
    for particles in counts:
        config = dataclasses.replace(filter_config(), particles=particles)
        estimator = PoseEstimator(on.catalogue, config, appearances=appearances)
        cpu_s = _steady(estimator, on.scene, on.repeats)
        rows.append({"particles": particles, "cpu_s": round(cpu_s, 4)})
    return rows


def _steady(estimator: PoseEstimator, scene: PoseScene, repeats: int) -> float:
    """CPU seconds an object, once everything is warm."""
    objects = len(scene.instances)
    estimator.estimate_all(scene.frame, _requests(scene, objects, 0))
    begun = time.process_time()
    for k in range(repeats):
        estimator.estimate_all(scene.frame, _requests(scene, objects, 1 + k))
    return (time.process_time() - begun) / (repeats * objects)


def _shares(on: _On) -> list[Row]:
    """What of an estimate goes into looking up what particles show, registering, comparing, and exact renders."""
    estimator = PoseEstimator(on.catalogue, filter_config(), device=on.device)
    _steady(estimator, on.scene, 1)
    profile = cProfile.Profile(time.process_time)
    with profile:
        for k in range(on.repeats):
            estimator.estimate_all(on.scene.frame, _requests(on.scene, len(on.scene.instances), 1 + k))
    stats: Any = pstats.Stats(profile)
    seconds = dict.fromkeys(PARTS.values(), 0.0)
    for (path, _, name), (_, _, _, inside, _) in stats.stats.items():
        if (Path(path).name, name) in PARTS:
            part = PARTS[Path(path).name, name]
            seconds[part] = max(seconds[part], inside)  # of two that are called alike one calls the other
    seconds["everything else"] = max(stats.total_tt - sum(seconds.values()), 0.0)
    return [{"part": words, "share": round(value / stats.total_tt, 4)} for words, value in seconds.items()]


def _renders(on: _On, particles: int) -> list[Row]:
    """CPU milliseconds a particle, from its pose to its score, and how far the score is from an exact render's.

    Half of the particles are those that the paper's filter starts from, half are near the truth. Scores are inliers
    over N. "exact" renders at the observation's own pixels, with ten times the triangles; "alone" renders what the
    atlas does, to the same score, in a picture for each particle; "looked up" renders nothing, as the default filter.
    """
    scene = on.scene
    own = [one for one in scene.instances if not one.wrong_box]
    instance = max(own or scene.instances, key=lambda one: one.visible_share)
    observation = observe(scene.frame, instance.box)
    there = observation.to(on.device)
    mesh = mesh_arrays(on.catalogue, instance.label)
    anew = functools.partial(RenderedAnew, *mesh, device=on.device)
    renderer, alone = DepthRenderer(on.catalogue), anew(columns=1)
    p_OM = alone.p_OM

    def exact(part: Particles) -> Array:
        pictures = (renderer.depth(instance.label, X_CO, observation.camera) for X_CO in poses(part, p_OM))
        return np.concatenate([_score(count_picture(observation, z, EPSILON), observation) for z in pictures])

    def shown(appearance: Appearance, part: Particles) -> Array:
        looks = appearance.show(part)
        return _score(count(there, looks.p_CPs, looks.areas, EPSILON), observation)

    ways: list[tuple[str, int, Callable[[Particles], Array]]] = [
        ("exact", 0, exact),
        ("alone", TILE, functools.partial(shown, alone)),
        ("looked up", 0, functools.partial(shown, ViewedFromAllSides(*mesh, device=on.device))),
        *(("tile", size, functools.partial(shown, anew(tile=size))) for size in TILES),
        *(("triangles", size, functools.partial(shown, anew(limit=size))) for size in TRIANGLES),
    ]
    given = _particles(observation, p_OM, inverse(scene.frame.X_WC) @ instance.X_WO, particles)
    truth = exact(given)
    rows: list[Row] = [{"kind": kind, "size": size, "cpu_ms": math.inf} for kind, size, _ in ways]
    for _, _, way in ways:
        way(given[:1])  # what is made once is no part of the cost
    # In turns, and the least of all rounds: what else the machine does falls on some rounds, not on some ways.
    for _ in range(on.repeats):
        for row, (_, _, way) in zip(rows, ways, strict=True):
            begun = time.process_time()
            scores = way(given)
            row["cpu_ms"] = min(row["cpu_ms"], round(1e3 * (time.process_time() - begun) / len(given), 4))
            row["error"] = round(float(np.sqrt(np.mean((scores - truth) ** 2))), 4)
    return rows


def _score(counts: Counts, observation: Observation) -> Array:
    return np.asarray(paper_likelihood(counts, observation.n).cpu())


def _particles(observation: Observation, p_OM: Array, X_CO: Array, n: int) -> Particles:
    """Half from anywhere in the box, turned at random, half within a centimetre and a tenth of a radian of X_CO."""
    rng = np.random.default_rng(0)
    v, u = torch.nonzero(observation.in_box & (observation.depth > 0), as_tuple=True)
    pixel = torch.from_numpy(rng.integers(len(u), size=n // 2))
    u, v = u[pixel], v[pixel]
    anywhere = pixel_rays(observation.camera, u, v) * observation.depth[v, u, None]
    turned = torch.from_numpy(rotation_from_quaternion(rng.normal(size=(n // 2, 4)))).float()
    rest = n - n // 2
    near = torch.from_numpy(X_CO[:3, :3] @ p_OM + X_CO[:3, 3] + rng.normal(0, 0.01, (rest, 3))).float()
    R_COs = torch.from_numpy(rotation_from_vector(rng.normal(0, 0.1, (rest, 3))) @ X_CO[:3, :3]).float()
    return Particles(torch.cat([turned, R_COs]), torch.cat([anywhere, near]))


def _by_objects(on: _On, counts: Sequence[int]) -> list[Row]:
    """Wall seconds for several objects, in one process and in two."""
    rows = []
    for processes in (1, 2):
        with PoseWorkers(on.catalogue, filter_config(), processes, device=on.device) as pool:
            # As many times as there are processes, so that each is ready for each.
            pool.warm_all([one.label for one in on.scene.instances for _ in range(processes)])
            for objects in counts:
                walls = []
                for k in range(on.repeats):
                    begun = time.monotonic()
                    pool.estimate_all(on.scene.frame, _requests(on.scene, objects, 1 + k))
                    walls.append(time.monotonic() - begun)
                rows.append({"objects": objects, "processes": processes, "wall_s": round(float(np.median(walls)), 4)})
    return rows


def _memory(catalogue: Catalogue) -> list[Row]:
    """Of a process that is ready for every label, and what getting ready takes."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, belong_to_parent) as pool:
        try:
            with one_thread_each():
                asked = pool.submit(_warm_all, catalogue.path)
            return [asked.result()]
        except BaseException:
            give_up(pool)
            raise


def _warm_all(path: Path) -> Row:
    catalogue = load_catalogue(path)
    estimator = PoseEstimator(catalogue, filter_config())
    estimator.warm(catalogue.labels[0])  # what the first engine takes, no other does
    before, begun = own_memory_mib(), time.process_time()
    estimator.warm_all(catalogue.labels)
    others = max(len(catalogue) - 1, 1)
    return {
        "models": len(catalogue),
        "warm_s": round((time.process_time() - begun) / others, 4),
        "mib_per_model": round((own_memory_mib() - before) / others, 2),
        "peak_mib": round(peak_memory_mib(), 1),
    }
