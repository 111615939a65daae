"""Compares the proposers on pictures of the validation split: recall of the boxes, and what the detector makes of them.

    sum-drake dataset --out data/detect
    python benchmarks/proposers.py data/detect

The one that wins here is the default. Calibration is fitted anew for each, on the same pictures. The network learned
from its own proposals, boxes about the objects and boxes anywhere, and from nobody else's.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from sum_drake.bench.results import made_with
from sum_drake.detection import metrics
from sum_drake.detection.dataset import AnnotatedImage, ImageSet
from sum_drake.detection.evaluation import calibrated, evaluate, figures
from sum_drake.detection.inference import MAX_PROPOSALS, WORKING_SIZE, Detector
from sum_drake.detection.proposers import LEARNED, PROPOSERS
from sum_drake.detection.weights import load_weights
from sum_drake.files import write_whole

RESULT = Path(__file__).parent / "results" / "proposers.json"
COUNTS = (10, 50, 100, 300)


def measure(name: str, images: Sequence[AnnotatedImage]) -> dict[str, Any]:
    """Recall of a proposer's first boxes, figures of the detector that is fed by it, CPU seconds of both."""
    detector = Detector(calibrated(load_weights(), images, proposer=name, report=lambda _: None), proposer=name)
    proposer = PROPOSERS[name]() if name != LEARNED else lambda color, depth: detector.proposals(color, COUNTS[-1])
    proposer(images[0].color, images[0].depth)  # compiles
    start = time.process_time()
    boxes = [proposer(image.color, image.depth).boxes for image in images]
    proposing = time.process_time() - start
    overlaps = np.concatenate([metrics.proposal_overlaps(b, i, COUNTS) for b, i in zip(boxes, images, strict=True)])
    row: dict[str, Any] = {"proposer": name, "classified": MAX_PROPOSALS.get(name, 300)}
    for percent in (50, 70):
        recall = metrics.proposal_recall(overlaps, percent / 100)
        row |= {f"recall{percent}_{count}": float(share) for count, share in zip(COUNTS, recall, strict=True)}
    row |= figures(evaluate(detector, images))
    start = time.process_time()
    for image in images:
        detector.detect(image.color, image.depth)
    row["detecting_cpu_s"] = (time.process_time() - start) / len(images)
    row["boxes"] = float(np.mean([len(b) for b in boxes]))
    if name != LEARNED:  # the learned ones come with the network's one look, which every detection takes
        row["proposing_cpu_s"] = proposing / len(images)
    return {key: round(value, 4) if isinstance(value, float) else value for key, value in row.items()}


def main() -> None:
    """Measures, prints and writes the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="what `sum-drake dataset` wrote")
    parser.add_argument("--images", type=int, default=120)
    parser.add_argument("--out", type=Path, default=RESULT)
    options = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    every = ImageSet(options.folder, "validation")
    images = [every[i] for i in np.linspace(0, len(every) - 1, min(options.images, len(every))).astype(int)]
    rows = []
    for name in (LEARNED, *PROPOSERS):
        rows.append(measure(name, images))
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    options.out.parent.mkdir(exist_ok=True)
    result = {"split": "validation", "images": len(images), "working_size": WORKING_SIZE, "rows": rows}
    write_whole(options.out, json.dumps(result | made_with(), indent=2) + "\n")


if __name__ == "__main__":
    main()
