"""`sum-drake estimate`: poses in a real or rendered RGB-D frame."""

import argparse
import contextlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    Commands,
    Counting,
    add_catalogue,
    add_command,
    add_parallel,
    add_quiet,
    check_count,
    check_device,
    check_free,
)
from sum_drake.files import write_whole

if TYPE_CHECKING:
    from sum_drake.frame_folder import FrameFolder, LabelledBox
    from sum_drake.objects import Catalogue

SCHEMA = "sum-drake/estimates/1"
FILES = ("estimates.json", "overlay.png")


def add(commands: Commands) -> None:
    """Declares the command."""
    text = "poses of the objects in an RGB-D frame of your own"
    one = add_command(commands, "estimate", _estimate, text, "estimate my_frame --catalogue my_objects.yaml")
    one.add_argument(
        "frame", type=Path, metavar="FRAME", help="folder: color.png, depth.png, camera.json, perhaps detections.json"
    )
    add_catalogue(one)
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of the particles (default: 0)")
    one.add_argument("--filter", metavar="NAME", default="default", help="default, or paper: the filter as published")
    one.add_argument("--weights", type=Path, metavar="FILE", help="detector, where there is no detections.json")
    one.add_argument("--out", type=Path, metavar="DIR", help="where to (default: out/estimates/FRAME)")
    one.add_argument("--force", action="store_true", help="replace the estimates that are in the folder")
    one.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    add_parallel(one, "--workers", "processes")
    add_quiet(one)


def _estimate(options: argparse.Namespace) -> None:
    import cv2

    from sum_drake.doctor import require_rendering, versions
    from sum_drake.estimates import draw_estimates, estimate_frame, estimates_table
    from sum_drake.filter_config import filter_config
    from sum_drake.filtering import PoseEstimator
    from sum_drake.frame_folder import read_frame
    from sum_drake.jsonio import write_json
    from sum_drake.objects import load_catalogue
    from sum_drake.pose_workers import PoseWorkers

    started = time.monotonic()
    out = options.out if options.out is not None else Path("out/estimates") / options.frame.resolve().name
    check_free(out, FILES, force=options.force, what="estimate")
    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    check_device(options.device)
    config = filter_config(options.filter)
    catalogue = load_catalogue(options.catalogue)
    read = read_frame(options.frame)
    boxes = read.boxes if read.boxes is not None else _detect(read, catalogue, options.weights)
    require_rendering()
    tell = Counting(quiet=options.quiet)
    workers = min(options.workers, len(boxes))
    cpu = [0.0]

    def count(seconds: float) -> None:
        cpu[0] += seconds

    with contextlib.ExitStack() as stack:
        estimator: Any = PoseEstimator(catalogue, config, noise=read.noise, device=options.device)
        if workers > 1:
            estimator = stack.enter_context(
                PoseWorkers(catalogue, config, workers, noise=read.noise, device=options.device, on_cpu=count)
            )
        labels = list(dict.fromkeys(one.label for one in boxes if one.label in catalogue))
        tell("looking at meshes", 0, len(labels))
        estimator.warm_all(labels)
        tell("looking at meshes", len(labels), len(labels))
        warm, begun, own = cpu[0], time.monotonic(), time.process_time()
        found = estimate_frame(read.frame, boxes, catalogue, estimator, seed=options.seed)
        cpu_s = cpu[0] - warm + time.process_time() - own
    timing = {"start_s": begun - started, "cpu_s": cpu_s, "wall_s": time.monotonic() - begun}
    out.mkdir(parents=True, exist_ok=True)
    data = {"schema": SCHEMA, "estimates": found, "timing": timing, "seed": options.seed, "versions": versions()}
    write_json(out / "estimates.json", data)
    _, png = cv2.imencode(".png", cv2.cvtColor(draw_estimates(read.frame, found, catalogue), cv2.COLOR_RGB2BGR))
    write_whole(out / "overlay.png", png.tobytes())
    print(estimates_table(found))
    print(out / "overlay.png")


def _detect(read: "FrameFolder", catalogue: "Catalogue", weights: Path | None) -> "Sequence[LabelledBox]":
    """Boxes of the trained detector, each with its likeliest label."""
    from sum_drake.detection.inference import load_detector
    from sum_drake.frame_folder import LabelledBox

    try:
        detector = load_detector(weights, labels=catalogue.labels)
    except InputError as error:
        raise InputError(f"no detections.json in the frame, and {error}") from error
    detections = detector(read.frame.color, read.frame.depth)
    return [LabelledBox(one.p_labels[0][0], one.box, one.p_box * one.p_labels[0][1]) for one in detections]
