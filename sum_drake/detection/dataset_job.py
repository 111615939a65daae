"""Renders a data set to disk: many scenes, in worker processes, going on where it was cut off."""

import concurrent.futures
import dataclasses
import hashlib
import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from sum_drake.assets import InputError, one_line
from sum_drake.detection.dataset import (
    MIN_PIXELS,
    MIN_SHARE,
    SCHEMA,
    SPLITS,
    ImageSet,
    is_scored,
    read_settings,
    scene_folder,
    write_scene,
)
from sum_drake.jsonio import write_json
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.workers import belong_to_parent, give_up, one_thread_each

ORDER = ("validation", "train", "test", "shift")
"""In which the splits are rendered: training can begin on what is there."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """How large a data set is to be."""

    scenes: Mapping[str, int]
    """Of each split."""
    views: Mapping[str, int]
    """Of each scene, by split."""
    seed: int = 0


FULL = Plan(
    scenes={"train": 560, "validation": 60, "test": 200, "shift": 200},
    views={"train": 6, "validation": 2, "test": 1, "shift": 1},
)
"""3,880 pictures; the training split holds twice the paper's 8,366 object crops and more."""
QUICK = Plan(
    scenes={"train": 16, "validation": 8, "test": 8, "shift": 8},
    views={"train": 3, "validation": 1, "test": 1, "shift": 1},
)
"""72 pictures, in about a minute."""

Report = Callable[[str, int, int], None]
"""What has just been rendered ("train/00012"), pictures done so far by this call, pictures this call has to do.

Before the first: "rendering", 0, pictures to do."""


def render_dataset(catalogue: Catalogue, out: Path, plan: Plan, *, workers: int = 1, report: Report) -> None:
    """Renders what is missing of a data set into `out`. The files are the same whatever the number of workers.

    workers: 1 renders in this process, more start as many of their own.

    Raises InputError for a folder that holds something else or a data set made otherwise, and RuntimeError when a
    scene cannot be rendered or a worker dies; what was finished stays, and another call goes on from there.
    """
    _prepare(catalogue, out, plan)
    jobs = [
        (split, scene)
        for split in ORDER
        for scene in range(plan.scenes[split])
        if not scene_folder(out, split, scene).is_dir()
    ]
    total, done = sum(plan.views[split] for split, _ in jobs), 0
    if jobs:
        report("rendering", done, total)
    for split, scene in _run(catalogue, out, plan, jobs, workers):
        done += plan.views[split]
        report(f"{split}/{scene:05d}", done, total)


def describe(out: Path) -> str:
    """A table of what a data set holds: pictures, objects, and objects large and visible enough to count."""
    labels = [str(label) for label in read_settings(out)["labels"]]
    counts: dict[str, Counter[str]] = {}
    images = {}
    for split in SPLITS:
        if not (out / split).is_dir():
            continue
        pictures = ImageSet(out, split)
        images[split] = len(pictures)
        shown = [o for i in range(len(pictures)) for o in pictures.objects(i)]
        counts[split] = Counter(o.label for o in shown if is_scored(o))
    width = max(len(label) for label in [*labels, "pictures"]) + 2
    lines = ["".join([" " * width, *(f"{split:>12s}" for split in images)])]
    lines.append("".join([f"{'pictures':{width}s}", *(f"{images[split]:12d}" for split in images)]))
    for label in labels:
        lines.append("".join([f"{label:{width}s}", *(f"{counts[split][label]:12d}" for split in images)]))
    lines.append("".join([f"{'objects':{width}s}", *(f"{counts[split].total():12d}" for split in images)]))
    lines.append(f"objects: those of at least {MIN_PIXELS} pixels of which {MIN_SHARE:.0%} or more shows; background")
    lines.append("crops are drawn from the same pictures in training, where proposals overlap none of them")
    return "\n".join(lines)


def catalogue_hash(catalogue: Catalogue) -> str:
    """sha256 over what the objects look like: labels, meshes, and the materials and textures of the same name."""
    digest = hashlib.sha256()
    for model in catalogue.models:
        digest.update(model.label.encode() + b"\0")
        for suffix in dict.fromkeys((model.mesh.suffix, ".mtl", ".png", ".jpg")):
            file = model.mesh.with_suffix(suffix)
            if file.is_file():
                digest.update(suffix.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _prepare(catalogue: Catalogue, out: Path, plan: Plan) -> None:
    """Writes dataset.json, or checks that the one that is there was made alike."""
    settings = {
        "schema": SCHEMA,
        "seed": plan.seed,
        "catalogue": catalogue_hash(catalogue),
        "labels": list(catalogue.labels),
        "views": dict(plan.views),
        "scenes": dict(plan.scenes),
    }
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: a file; expected a folder or a new name")
    if out.is_dir() and any(out.iterdir()):
        old = read_settings(out)
        for key in settings:
            if key != "scenes" and old.get(key) != settings[key]:
                raise InputError(f"--out {out}: was made with another '{key}'; expected the same, or a new folder")
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "dataset.json", settings)


def _run(
    catalogue: Catalogue, out: Path, plan: Plan, jobs: list[tuple[str, int]], workers: int
) -> Iterator[tuple[str, int]]:
    """Renders the jobs and yields each when it is done."""
    if workers <= 1:
        for split, scene in jobs:
            _render(catalogue, out, plan, split, scene)
            yield split, scene
        return
    pool = concurrent.futures.ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), _begin_work, (catalogue.path, out, plan)
    )
    try:
        with one_thread_each():
            futures = {pool.submit(_work, *job): job for job in jobs}
        for future in concurrent.futures.as_completed(futures):
            split, scene = futures[future]
            try:
                future.result()
            except BrokenProcessPool as error:
                raise RuntimeError(
                    "a worker died, perhaps for lack of memory; the same command goes on from there"
                ) from error
            yield split, scene
    except BaseException:
        give_up(pool)  # scenes are written whole, or not at all
        raise
    pool.shutdown()


_worker: tuple[Catalogue, Path, Plan] | None = None


def _begin_work(catalogue: Path, out: Path, plan: Plan) -> None:
    global _worker
    belong_to_parent()
    _worker = load_catalogue(catalogue), out, plan


def _work(split: str, scene: int) -> None:
    assert _worker is not None
    catalogue, out, plan = _worker
    _render(catalogue, out, plan, split, scene)


def _render(catalogue: Catalogue, out: Path, plan: Plan, split: str, scene: int) -> None:
    from sum_drake.detection.dataset_scenes import render_encoded

    try:
        images = render_encoded(catalogue, split, plan.seed, scene, plan.views[split])
    except (ValueError, RuntimeError, SystemExit) as error:  # the last is how a failed DRAKE_DEMAND reaches Python
        raise RuntimeError(f"scene {split}/{scene:05d} cannot be rendered: {one_line(error)}") from error
    write_scene(scene_folder(out, split, scene), images)
