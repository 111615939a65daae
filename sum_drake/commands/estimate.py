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
    anew_if_interrupted,
    check_count,
    check_device,
    check_free,
)
from sum_drake.files import write_whole

if TYPE_CHECKING:
    from sum_drake.filtering import PoseEstimate, PoseEstimator, PoseRequest
    from sum_drake.frame_folder import FrameFolder, LabelledBox
    from sum_drake.objects import Catalogue
    from sum_drake.types import Frame

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
    tell = Counting(quiet=options.quiet)
    with anew_if_interrupted(out, quiet=options.quiet), contextlib.ExitStack() as stack:
        boxes = read.boxes if read.boxes is not None else _detect(read, catalogue, options.weights, tell)
        require_rendering()
        steps, workers = _Steps(tell), min(options.workers, len(boxes))
        estimator: Any = _OneByOne(PoseEstimator(catalogue, config, noise=read.noise, device=options.device), steps)
        if workers > 1:
            estimator = stack.enter_context(
                PoseWorkers(catalogue, config, workers, noise=read.noise, device=options.device, on_cpu=steps.took)
            )
        labels = list(dict.fromkeys(one.label for one in boxes if one.label in catalogue))
        steps.begin("looking at meshes", len(labels))
        estimator.warm_all(labels)
        warm, begun, own = steps.cpu_s, time.monotonic(), time.process_time()
        steps.begin("estimating poses", len(boxes))
        found = estimate_frame(read.frame, boxes, catalogue, estimator, seed=options.seed)
        steps.end()
        cpu_s = steps.cpu_s - warm + time.process_time() - own
    timing = {"start_s": begun - started, "cpu_s": cpu_s, "wall_s": time.monotonic() - begun}
    out.mkdir(parents=True, exist_ok=True)
    data = {"schema": SCHEMA, "estimates": found, "timing": timing, "seed": options.seed, "versions": versions()}
    write_json(out / "estimates.json", data)
    _, png = cv2.imencode(".png", cv2.cvtColor(draw_estimates(read.frame, found, catalogue), cv2.COLOR_RGB2BGR))
    write_whole(out / "overlay.png", png.tobytes())
    print(estimates_table(found))
    print(out / "overlay.png")


class _Steps:
    """How many of what is being done are, and the CPU seconds that other processes took."""

    def __init__(self, tell: Counting) -> None:
        self.cpu_s = 0.0
        self._tell, self._what, self._done, self._of = tell, "", 0, 0

    def begin(self, what: str, of: int) -> None:
        """So many of something else."""
        self._what, self._done, self._of = what, 0, of
        self._tell(what, 0, of)

    def took(self, cpu_s: float) -> None:
        """Another one is done, by another process."""
        self.cpu_s += cpu_s
        self._done += 1
        self._tell(self._what, self._done, self._of)

    def end(self) -> None:
        """All are done; of some there was nothing to do."""
        if self._done < self._of:
            self._tell(self._what, self._of, self._of)


class _OneByOne:
    """An estimator in this process whose steps are told."""

    def __init__(self, estimator: "PoseEstimator", steps: _Steps) -> None:
        self._estimator, self._steps = estimator, steps

    def warm_all(self, labels: "Sequence[str]") -> None:
        for label in labels:
            self._estimator.warm(label)
            self._steps.took(0.0)

    def estimate_all(self, frame: "Frame", requests: "Sequence[PoseRequest]") -> "list[PoseEstimate]":
        found = []
        for request in requests:
            found += self._estimator.estimate_all(frame, [request])
            self._steps.took(0.0)
        return found


def _detect(
    read: "FrameFolder", catalogue: "Catalogue", weights: Path | None, tell: Counting
) -> "Sequence[LabelledBox]":
    """Boxes of the trained detector, each with its likeliest label."""
    from sum_drake.detection.inference import load_detector
    from sum_drake.frame_folder import LabelledBox

    try:
        detector = load_detector(weights, labels=catalogue.labels)
    except InputError as error:
        raise InputError(f"no detections.json in the frame, and {error}") from error
    tell("detecting", 0, 1)
    detections = detector(read.frame.color, read.frame.depth)
    tell("detecting", 1, 1)
    return [LabelledBox(one.p_labels[0][0], one.box, one.p_box * one.p_labels[0][1]) for one in detections]
