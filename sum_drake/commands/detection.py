"""`sum-drake dataset`, `train` and `detect`: the detector, from its data to a picture of one's own."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    Commands,
    Counting,
    add_catalogue,
    add_command,
    add_parallel,
    add_quiet,
    anew_if_interrupted,
    check_count,
    check_device,
    check_free,
    if_interrupted,
)
from sum_drake.files import write_whole

if TYPE_CHECKING:
    from sum_drake.detection.dataset_job import Plan
    from sum_drake.detection.metrics import ScoredImage
    from sum_drake.detection.weights import Weights


def add(commands: Commands) -> None:
    """Declares the commands."""
    dataset = add_command(
        commands, "dataset", _dataset, "render the detector's data set; called again, it goes on", "dataset --quick"
    )
    dataset.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("data/detect"), help="where to (default: data/detect)"
    )
    dataset.add_argument(
        "--scenes", type=int, nargs=4, metavar=("TRAIN", "VALIDATION", "TEST", "SHIFT"),
        help="how many of each split (default: 560 60 200 200)",
    )  # fmt: skip
    dataset.add_argument("--seed", type=int, metavar="S", default=0, help="seed of the scenes (default: 0)")
    add_catalogue(dataset)
    dataset.add_argument("--quick", action="store_true", help="a small set, in about a minute")
    add_parallel(dataset, "--workers", "processes")
    add_quiet(dataset)

    train = add_command(commands, "train", _train, "train the detector", "train --data data/detect --out out/train")
    train.add_argument("--data", type=Path, metavar="DIR", help="data set, as sum-drake dataset writes it")
    train.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("out/train"), help="where to (default: out/train)"
    )
    train.add_argument("--seed", type=int, metavar="S", default=0, help="seed of the training (default: 0)")
    train.add_argument("--epochs", type=int, metavar="N", help="times that every picture is seen (default: 6)")
    train.add_argument(
        "--start", choices=("imagenet", "random"), default="imagenet", help="what the backbone begins as"
    )
    train.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    add_parallel(train, "--threads", "of the CPU")
    train.add_argument("--quick", action="store_true", help="the whole path on a small set that is rendered first")
    train.add_argument("--catalogue", type=Path, metavar="FILE", help="objects, with --quick (default: the package's)")
    add_quiet(train)

    detect = add_command(
        commands, "detect", _detect, "the objects in a picture of your own", "detect photo.jpg --out out/photo"
    )
    detect.add_argument(
        "picture", type=Path, metavar="PICTURE", help="in colour: PNG or JPEG, 8 bit, 160 to 4096 pixels a side"
    )
    detect.add_argument(
        "--depth", type=Path, metavar="FILE", help="its depth, PNG of 16 bits, 0 where it is missing; for --proposer"
    )
    detect.add_argument(
        "--depth-scale", type=float, metavar="M", help="metres a unit of the depth (default: 0.001, millimetres)"
    )
    detect.add_argument(
        "--proposer", metavar="NAME", default="learned",
        help="what proposes boxes: learned (default; of the colours alone), edge_boxes, edge_boxes_full, "
        "edge_boxes_and_segments (of depth, too, where given), depth_segments (of depth alone)",
    )  # fmt: skip
    detect.add_argument(
        "--threshold", type=float, metavar="P", help="least probability of a detection (default: the detector's)"
    )
    detect.add_argument("--weights", type=Path, metavar="FILE", help="detector (default: the package's)")
    detect.add_argument("--out", type=Path, metavar="DIR", help="where to (default: out/detected/PICTURE)")
    detect.add_argument("--force", action="store_true", help="replace the detections that are in the folder")
    add_quiet(detect)


def _dataset(options: argparse.Namespace) -> None:
    import dataclasses

    from sum_drake.detection.dataset import SPLITS
    from sum_drake.detection.dataset_job import FULL, QUICK, describe

    plan = dataclasses.replace(QUICK if options.quick else FULL, seed=options.seed)
    if options.scenes is not None:
        if min(options.scenes) < 1:
            raise InputError(f"--scenes {' '.join(map(str, options.scenes))}: expected four counts of at least 1")
        plan = dataclasses.replace(plan, scenes=dict(zip(SPLITS, options.scenes, strict=True)))
    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    _render_dataset(options.catalogue, options.out, plan, workers=options.workers, quiet=options.quiet)
    print(describe(options.out))


def _render_dataset(catalogue: Path | None, out: Path, plan: "Plan", *, workers: int, quiet: bool) -> None:
    from sum_drake.detection.dataset_job import render_dataset
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    def kept() -> str:
        begun = (out / "dataset.json").is_file()
        return f"{out} keeps what was rendered: the same command goes on" if begun else "nothing was written"

    objects = load_catalogue(catalogue)
    require_rendering()
    with if_interrupted(kept, quiet=quiet):
        render_dataset(objects, out, plan, workers=workers, report=Counting(quiet=quiet))


def _train(options: argparse.Namespace) -> None:
    import dataclasses
    import datetime

    import torch

    from sum_drake.detection.dataset import ImageSet, is_scored
    from sum_drake.detection.dataset_job import QUICK
    from sum_drake.detection.evaluation import evaluate
    from sum_drake.detection.inference import Detector
    from sum_drake.detection.training import Recipe, read_log, require_start, train
    from sum_drake.detection.training_report import write_plots, write_results
    from sum_drake.detection.weights import rounded
    from sum_drake.doctor import versions

    check_device(options.device)
    check_count("--seed", options.seed, least=0)
    check_count("--epochs", options.epochs)
    check_count("--threads", options.threads)
    data = options.data
    if data is None and not options.quick:
        raise InputError("--data is missing; expected the folder of a data set (sum-drake dataset), or --quick")
    if data is not None and options.catalogue is not None:
        raise InputError(f"--catalogue {options.catalogue}: --data {data} has labels of its own; expected one of both")
    torch.set_num_threads(options.threads)
    recipe = Recipe(seed=options.seed, start=options.start)
    if options.quick:
        recipe = dataclasses.replace(recipe, warm_up=40, averaging=0.98)
    if options.epochs is not None:
        recipe = dataclasses.replace(recipe, epochs=options.epochs)

    def say(line: str) -> None:
        if not options.quiet:
            print(line, file=sys.stderr, flush=True)

    def kept() -> str:
        if (options.out / "checkpoint.pt").is_file():
            return f"{options.out} keeps what was learned until its last checkpoint: the same command goes on"
        return "there is no checkpoint yet; the same command begins anew"

    require_start(recipe)
    if data is None:
        data = options.out / "data"
        plan = dataclasses.replace(QUICK, seed=options.seed)
        _render_dataset(options.catalogue, data, plan, workers=options.threads, quiet=options.quiet)

    def log() -> list[dict[str, float]]:
        return read_log(options.out / "log.jsonl")

    def draw(weights: "Weights", images: "Sequence[ScoredImage]") -> None:
        write_plots(options.out, log(), images, weights)

    progress = Counting(quiet=options.quiet)
    with if_interrupted(kept, quiet=options.quiet):
        weights = train(data, options.out, recipe, device=options.device, report=say, on_epoch=draw, progress=progress)
        pictures = ImageSet(data, "train")
        file = write_results(
            options.out,
            weights,
            # What is written is rounded to 16 bits: that is what is looked at.
            images=evaluate(Detector(rounded(weights)), ImageSet(data, "validation"), progress),
            log=log(),
            recipe=dataclasses.asdict(recipe),
            data=pictures.settings,
            used={
                "pictures": len(pictures),
                "crops of objects": sum(is_scored(o) for i in range(len(pictures)) for o in pictures.objects(i)),
                "other crops an epoch at least": round(len(pictures) * recipe.boxes * (1 - recipe.object_share)),
            },
            date=datetime.date.today().isoformat(),
            versions=versions(),
        )
    print(file)


def _detect(options: argparse.Namespace) -> None:
    import cv2

    from sum_drake.detection.inference import load_detector
    from sum_drake.detection.listing import detection_rows, detection_table, draw_detections
    from sum_drake.detection.picture import read_depth, read_picture
    from sum_drake.detection.proposers import LEARNED
    from sum_drake.jsonio import write_json

    out = options.out if options.out is not None else Path("out/detected") / options.picture.stem
    names = ("detections.json", "detections.png")
    check_free(out, names, force=options.force, what="detection")
    if options.threshold is not None and not 0 < options.threshold < 1:
        raise InputError(f"--threshold {options.threshold}: expected a probability, between 0 and 1")
    if options.depth is not None and options.proposer == LEARNED:
        print(f"--depth {options.depth}: the {LEARNED} proposer does not use it; others do", file=sys.stderr)
    if options.depth_scale is not None and options.depth is None:
        raise InputError(f"--depth-scale {options.depth_scale}: expected --depth as well")
    color = read_picture(options.picture)
    scale = 0.001 if options.depth_scale is None else options.depth_scale
    depth = read_depth(options.depth, color.shape[:2], scale=scale) if options.depth is not None else None
    detector = load_detector(options.weights, proposer=options.proposer, threshold=options.threshold)
    tell = Counting(quiet=options.quiet)
    with anew_if_interrupted(out, quiet=options.quiet):
        tell("detecting", 0, 1)
        detections = detector(color, depth)
        tell("detecting", 1, 1)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / names[0], detection_rows(detections))
    drawn = draw_detections(color, detections, detector.labels)
    _, png = cv2.imencode(".png", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR))
    write_whole(out / names[1], png.tobytes())
    print(detection_table(detections))
    print(out / names[1])
