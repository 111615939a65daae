"""Compares the project's Edge Boxes with those of OpenCV's contrib build, on the same edge maps.

    sum-drake dataset --out data
    python -m venv contrib && contrib/bin/pip install opencv-contrib-python-headless
    python benchmarks/edge_boxes_contrib.py data --python contrib/bin/python

opencv-python-headless and its contrib build exclude each other, so the other one runs in an environment of its own:
edge maps go there as .npz, boxes come back the same way. Nothing of that build is needed to use the project.
"""

import argparse
import dataclasses
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.bench.results import made_with
from sum_drake.detection.dataset import AnnotatedImage, ImageSet, is_scored
from sum_drake.detection.edge_boxes import EdgeBoxesConfig, edge_boxes
from sum_drake.detection.edges import Edges, EdgesConfig, find_edges
from sum_drake.files import write_whole
from sum_drake.geometry import iou

RESULT = Path(__file__).parent / "results" / "edge_boxes_contrib.json"
TOP = (10, 50, 300)
OVERLAPS = (0.9, 0.8, 0.7)

CONTRIB = """
import json, sys, time
import cv2, numpy as np
cv2.setNumThreads(1)
settings = json.loads(sys.argv[3])
maker = cv2.ximgproc.createEdgeBoxes(**settings)
maps, answers = np.load(sys.argv[1]), {}
for i in range(len(maps.files) // 2):
    start = time.process_time()
    boxes, scores = maker.getBoundingBoxes(maps[f"magnitude_{i}"], maps[f"orientation_{i}"])
    answers[f"seconds_{i}"] = time.process_time() - start
    answers[f"boxes_{i}"] = np.array(boxes, float).reshape(-1, 4)
np.savez(sys.argv[2], version=cv2.__version__, **answers)
"""


def contrib_boxes(edges: Sequence[Edges], config: EdgeBoxesConfig, python: str) -> tuple[list[Any], list[float], str]:
    """For each edge map, contrib's boxes (n, 4) in its pixels, best first, and CPU seconds; and OpenCV's version."""
    settings = {
        "alpha": config.alpha, "beta": config.beta, "eta": config.eta, "minScore": config.min_score,
        "maxBoxes": config.max_boxes, "edgeMinMag": config.edge_min_magnitude, "edgeMergeThr": config.group_bend,
        "clusterMinMag": config.group_min_magnitude, "maxAspectRatio": config.max_aspect_ratio,
        "minBoxArea": config.min_box_area * edges[0].scale ** 2, "gamma": config.gamma, "kappa": config.kappa,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        maps, answers = Path(folder) / "maps.npz", Path(folder) / "answers.npz"
        arrays = {}
        for i, e in enumerate(edges):
            arrays |= {f"magnitude_{i}": e.magnitude, f"orientation_{i}": e.orientation}
        np.savez(maps, **arrays)
        subprocess.run([python, "-c", CONTRIB, str(maps), str(answers), json.dumps(settings)], check=True)
        with np.load(answers) as loaded:
            boxes = [loaded[f"boxes_{i}"] for i in range(len(edges))]
            return boxes, [float(loaded[f"seconds_{i}"]) for i in range(len(edges))], str(loaded["version"])


def compare(images: Sequence[AnnotatedImage], scale: float, depth: bool, python: str) -> dict[str, Any]:
    """Agreement, recall with 300 boxes and CPU seconds of both, on the edges of the same images."""
    config, edges_config = EdgeBoxesConfig(), EdgesConfig(scale=scale)
    start = time.process_time()
    edges = [find_edges(image.color, image.depth if depth else None, edges_config) for image in images]
    edges_seconds = (time.process_time() - start) / len(images)
    theirs, their_seconds, version = contrib_boxes(edges, config, python)
    edge_boxes(edges[0], config)  # compiles
    ours, our_seconds = [], []
    for e in edges:
        start = time.process_time()
        ours.append(edge_boxes(e, config).boxes)
        our_seconds.append(time.process_time() - start)
    row: dict[str, Any] = {"scale": scale, "depth": depth, "images": len(images), "opencv": version}
    row["edges_cpu_s"] = round(edges_seconds, 4)
    # Contrib's x, y, w, h is the scored box's a pixel further; ours is what lies inside its border.
    inside = [(boxes - [0, 0, 1, 1]) / scale for boxes in theirs]
    # It refines down to 3 pixels: to see whether the two agree, so does ours.
    alike = [edge_boxes(e, dataclasses.replace(config, finest_step=3)).boxes for e in edges]
    for top in TOP:
        # Theirs among all of ours: what is asked is whether anything of theirs is lost.
        best = np.concatenate([iou(b[:top], a).max(1, initial=0) for a, b in zip(alike, inside, strict=True)])
        row |= {f"contrib_top_{top}_found_{overlap}": round(float(np.mean(best >= overlap)), 4) for overlap in OVERLAPS}
    as_returned = [boxes / scale for boxes in theirs]
    for name, boxes, seconds in (("ours", ours, our_seconds), ("contrib", as_returned, their_seconds)):
        truths = [[o.box for o in image.objects if is_scored(o)] for image in images]
        best = np.concatenate([iou(t, b[:300]).max(1, initial=0) for t, b in zip(truths, boxes, strict=True)])
        row |= {f"{name}.recall{round(100 * t)}_300": round(float(np.mean(best >= t)), 4) for t in (0.5, 0.7)}
        row |= {f"{name}.boxes": float(np.mean([len(b) for b in boxes])), f"{name}.cpu_s": float(np.median(seconds))}
    return row


def main() -> None:
    """Compares, prints and writes the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="what `sum-drake dataset` wrote")
    parser.add_argument("--python", required=True, help="interpreter with opencv-contrib-python-headless")
    parser.add_argument("--split", default="validation")
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--out", type=Path, default=RESULT)
    options = parser.parse_args()
    every = ImageSet(options.folder, options.split)
    images = [every[i] for i in np.linspace(0, len(every) - 1, min(options.images, len(every))).astype(int)]
    rows = []
    for scale, depth in ((1.0, True), (0.75, True), (0.5, True), (1.0, False)):
        rows.append(compare(images, scale, depth, options.python))
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    result = {
        "split": options.split, "objects": sum(is_scored(o) for image in images for o in image.objects),
        "search": dataclasses.asdict(EdgeBoxesConfig()), "edges": dataclasses.asdict(EdgesConfig()), "rows": rows,
    }  # fmt: skip
    options.out.parent.mkdir(exist_ok=True)
    write_whole(options.out, json.dumps(result | made_with(), indent=2) + "\n")


if __name__ == "__main__":
    main()
