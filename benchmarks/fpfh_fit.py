"""Tunes the baseline of `sum-drake bench pose`, FPFH with ICP, on the scenes that the pose filter was tuned on.

    pip install -e '.[bench]'
    python benchmarks/fpfh_fit.py

One parameter after the other is tried at other values, and the best is kept, by the share of estimates within 2 cm and
20 degrees. Scenes and meshes are the tuning's (`bench.pose_scenes`, seeds from 0).
"""

import argparse
import dataclasses
import json
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.bench.pose_scenes import other_meshes, pose_scene
from sum_drake.bench.results import made_with
from sum_drake.files import write_whole
from sum_drake.geometry import pose_error
from sum_drake.modes import RIGHT
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.registration import FpfhConfig, FpfhEstimator
from sum_drake.rendering import DepthRenderer
from sum_drake.workers import belong_to_parent, one_thread_each

RESULT = Path(__file__).parent / "results" / "fpfh_fit.json"
START = FpfhConfig(voxel=0.005, feature_radius=0.03)
"""What was used before."""
TRIED: dict[str, tuple[Any, ...]] = {
    "support": (True, False),
    "voxel": (0.004, 0.007),
    "feature_radius": (0.02, 0.045),
    "inlier": (0.005, 0.01),
    "normal_radius": (0.008, 0.018),
    "iterations": (400_000,),
}


def hits(config: FpfhConfig, told: Catalogue, scenes: range) -> tuple[int, int, float]:
    """Estimates within the bound, estimates, and their CPU seconds."""
    catalogue = load_catalogue()
    renderer, estimator = DepthRenderer(catalogue, faces=20_000), FpfhEstimator(told, config)
    right, count, seconds = 0, 0, 0.0
    for seed in scenes:
        scene = pose_scene(catalogue, renderer, seed)
        for i, one in enumerate(scene.instances):
            if one.wrong_box:
                continue
            estimator.warm(one.label)
            begun = time.process_time()
            X_WO = estimator.estimate(scene.frame, one.box, one.label, seed=100 * seed + i)
            seconds += time.process_time() - begun
            count += 1
            if X_WO is not None:
                shift, angle = pose_error(X_WO, one.X_WO, catalogue[one.label].symmetry)
                right += bool(shift < RIGHT[0] and angle < np.radians(RIGHT[1]))
    return right, count, seconds


def _ready() -> None:
    """Nothing: a process starts with its first task."""


def main() -> None:
    """Tries, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=12, metavar="N", help="tuning scenes (default: 12)")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        told = other_meshes(load_catalogue(), Path(folder), 0)
        with ProcessPoolExecutor(options.workers, get_context("spawn"), belong_to_parent) as pool:
            with one_thread_each():
                begun = [pool.submit(_ready) for _ in range(options.workers)]
            for one in begun:
                one.result()

            def share(config: FpfhConfig) -> float:
                parts = [range(k, options.scenes, options.workers) for k in range(options.workers)]
                done = list(pool.map(hits, [config] * len(parts), [told] * len(parts), parts))
                right, count, seconds = (sum(column) for column in zip(*done, strict=True))
                row = dataclasses.asdict(config) | {"within_2cm_20deg": right / count, "cpu_s": seconds / count}
                rows.append(row)
                print(row, file=sys.stderr)
                return float(right / count)

            best = START
            reached = share(best)
            for name, values in TRIED.items():
                for value in values:
                    other = dataclasses.replace(best, **{name: value})
                    if other != best and (found := share(other)) > reached:
                        best, reached = other, found
    result = {"scenes": options.scenes, "best": dataclasses.asdict(best), "within_2cm_20deg": reached, "tried": rows}
    write_whole(RESULT, json.dumps(result | made_with(), indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
