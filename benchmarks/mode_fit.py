"""Fits the weights of the pose likelihood on poured scenes, and tells how far the belief's confidence can be trusted.

    python benchmarks/mode_fit.py

Every object of the bench's tuning scenes (`bench.pose_scenes`, seeds from 0; the bench's own begin at 1000) is
estimated, and each rival mode at the end is right or wrong, within 2 cm and 20 degrees. A conditional logit then says
how much each of `likelihood.TERMS` is worth in choosing a right one. Scenes are left out in turn to see what the fitted
choice is worth on others. Beside it: how often an estimate is right, by what share of its belief is near it.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import logsumexp

from sum_drake.bench.pose_scenes import other_meshes, pose_scene
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.likelihood import TERMS, WEIGHTS
from sum_drake.modes import RIGHT
from sum_drake.objects import load_catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "mode_fit.json"
FOLDS = 7
PENALTY = 2e-4
"""Of the squared weights: a few modes that nothing tells apart must not drive them anywhere."""
EDGES = (0.0, 0.3, 0.6, 0.8, 0.95, 1.0)
"""Of the bins of what is stated."""


def estimates(scenes: int) -> list[dict[str, object]]:
    """Of every object that is in its box: terms (m, 4) of its modes, which are right (m,), and what was made of it."""
    catalogue = load_catalogue()
    renderer = DepthRenderer(catalogue, faces=20_000)
    found: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        estimator = PoseEstimator(other_meshes(catalogue, Path(folder), 0), filter_config())
        for seed in range(scenes):
            scene = pose_scene(catalogue, renderer, seed)
            for i, one in enumerate(scene.instances):
                if one.wrong_box:
                    continue
                rng = np.random.default_rng([seed, i])
                estimate = estimator.estimate(scene.frame, one.box, one.label, rng=rng)

                def right(X_WOs: Array, X_WO: Array = one.X_WO, label: str = one.label) -> Array:
                    shift, angle = pose_error(X_WOs, X_WO, catalogue[label].symmetry)
                    return np.asarray((shift < RIGHT[0]) & (angle < np.radians(RIGHT[1])))

                found.append(
                    {
                        "scene": seed,
                        "terms": np.array(estimate.modes.terms),
                        "right": right(estimate.modes.X_WOs),
                        "estimate": bool(right(estimate.X_WO)),
                        "stated": dict(estimate.features)["right_pose"],
                    }
                )
            print(f"scene {seed + 1} of {scenes}: {len(found)} objects", file=sys.stderr)
    return found


def fit(rows: list[dict[str, object]]) -> Array:
    """Weights (4,) of the terms under which right modes are likeliest among their rivals."""
    told = [row for row in rows if np.any(row["right"])]

    def loss(weights: Array) -> float:
        logs = [np.asarray(row["terms"]) @ weights for row in told]
        of_right = [logsumexp(z[row["right"]]) - logsumexp(z) for z, row in zip(logs, told, strict=True)]
        return float(-np.mean(of_right) + PENALTY * (weights**2).sum())

    return np.asarray(minimize(loss, np.array(WEIGHTS) / 2, method="L-BFGS-B").x)


def chosen_right(rows: list[dict[str, object]], weights: Array) -> Array:
    """Whether the likeliest mode is right, (n,)."""
    return np.array([np.asarray(row["right"])[np.argmax(np.asarray(row["terms"]) @ weights)] for row in rows])


def main() -> None:
    """Estimates, fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=28, metavar="N", help="tuning scenes (default: 28)")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = estimates(options.scenes)
    folds = np.array([int(str(row["scene"])) % FOLDS for row in rows])
    left_out = np.zeros(len(rows), dtype=bool)
    for k in np.unique(folds):
        weights = fit([row for row, fold in zip(rows, folds, strict=True) if fold != k])
        left_out[folds == k] = chosen_right([row for row, fold in zip(rows, folds, strict=True) if fold == k], weights)
    stated = np.array([float(str(row["stated"])) for row in rows])
    right = np.array([bool(row["estimate"]) for row in rows])
    bins = np.digitize(stated, EDGES[1:-1])
    result = {
        "scenes": options.scenes,
        "objects": len(rows),
        "any_mode_right": float(np.mean([np.any(row["right"]) for row in rows])),
        "fitted_weights": dict(zip(TERMS, fit(rows).round(2).tolist(), strict=True)),
        "fitted_choice_right_on_scenes_left_out": float(left_out.mean()),
        "weights": dict(zip(TERMS, WEIGHTS, strict=True)),
        "likeliest_mode_right": float(chosen_right(rows, np.array(WEIGHTS)).mean()),
        "estimate_right": float(right.mean()),
        "stated_mean": float(stated.mean()),
        "stated_brier": float(np.mean((stated - right) ** 2)),
        "stated_brier_of_the_mean": float(right.mean() * (1 - right.mean())),
        "reliability": [
            {"stated": float(stated[bins == k].mean()), "right": float(right[bins == k].mean()), "objects": int(n)}
            for k, n in enumerate(np.bincount(bins))
            if n
        ],
    }
    write_whole(RESULT, json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
