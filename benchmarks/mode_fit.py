"""Fits the weights of the pose likelihood on poured scenes, and tells how far the belief's confidence can be trusted.

    python benchmarks/mode_fit.py

Every object of the bench's tuning scenes (`bench.pose_scenes`, seeds from 0; the bench's own begin at 1000) is
estimated, and each rival mode at the end is right or wrong, within 2 cm and 20 degrees. A conditional logit then says
how much each of `likelihood.TERMS` is worth in choosing a right one. Scenes are left out in turn to see what the fitted
choice is worth on others. The power of the likelihood that beliefs follow is fitted on the same scenes; how often
estimates are right, by what share of the belief is near them, is told of as many further ones.
"""

import argparse
import dataclasses
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize, minimize_scalar
from scipy.special import logsumexp

from sum_drake.bench.pose_scenes import other_meshes, pose_scene
from sum_drake.bench.results import made_with
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.likelihood import BELIEF, TERMS, WEIGHTS
from sum_drake.modes import RIGHT
from sum_drake.objects import load_catalogue
from sum_drake.reliability import reliability as trust
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "mode_fit.json"
FOLDS = 7
PENALTY = 2e-4
"""Of the squared weights: a few modes that nothing tells apart must not drive them anywhere."""


@dataclasses.dataclass(frozen=True)
class Found:
    """What was made of one object."""

    scene: int
    terms: Array
    """(m, 4), of the modes."""
    right: Array
    """(m,): which modes are."""
    near: Array
    """(m,): which modes are that near to the estimate."""
    estimate_right: bool
    stated: float
    """The share of the belief that is near the estimate."""


def estimates(scenes: int) -> list[Found]:
    """Of every object that is in its box."""
    catalogue = load_catalogue()
    renderer = DepthRenderer(catalogue, faces=20_000)
    found: list[Found] = []
    with tempfile.TemporaryDirectory() as folder:
        estimator = PoseEstimator(other_meshes(catalogue, Path(folder), 0), filter_config())
        for seed in range(scenes):
            scene = pose_scene(catalogue, renderer, seed)
            for i, one in enumerate(scene.instances):
                if one.wrong_box:
                    continue
                rng = np.random.default_rng([seed, i])
                estimate = estimator.estimate(scene.frame, one.box, one.label, rng=rng)

                def near(X_WOs: Array, X_WO: Array, label: str = one.label) -> Array:
                    shift, angle = pose_error(X_WOs, X_WO, catalogue[label].symmetry)
                    return np.asarray((shift < RIGHT[0]) & (angle < np.radians(RIGHT[1])))

                found.append(
                    Found(
                        scene=seed,
                        terms=estimate.modes.terms,
                        right=near(estimate.modes.X_WOs, one.X_WO),
                        near=near(estimate.modes.X_WOs, estimate.X_WO),
                        estimate_right=bool(near(estimate.X_WO, one.X_WO)),
                        stated=dict(estimate.features)["near_share"],
                    )
                )
            print(f"scene {seed + 1} of {scenes}: {len(found)} objects", file=sys.stderr)
    return found


def fit(rows: list[Found]) -> Array:
    """Weights (4,) of the terms under which right modes are likeliest among their rivals."""
    told = [row for row in rows if np.any(row.right)]

    def loss(weights: Array) -> float:
        logs = [row.terms @ weights for row in told]
        of_right = [logsumexp(z[row.right]) - logsumexp(z) for z, row in zip(logs, told, strict=True)]
        return float(-np.mean(of_right) + PENALTY * (weights**2).sum())

    return np.asarray(minimize(loss, np.array(WEIGHTS) / 2, method="L-BFGS-B").x)


def chosen_right(rows: list[Found], weights: Array) -> Array:
    """Whether the likeliest mode is right, (n,)."""
    return np.array([row.right[np.argmax(row.terms @ weights)] for row in rows])


def fit_power(rows: list[Found]) -> float:
    """The power of the likelihood under which what the modes say of estimates is likeliest."""
    right = np.array([row.estimate_right for row in rows])

    def loss(power: float) -> float:
        logs = [power * (row.terms @ np.array(WEIGHTS)) for row in rows]
        p = np.array([np.exp(z - logsumexp(z))[row.near].sum() for z, row in zip(logs, rows, strict=True)])
        p = np.clip(p, 1e-3, 1 - 1e-3)
        return float(-np.mean(np.where(right, np.log(p), np.log(1 - p))))

    return float(minimize_scalar(loss, bounds=(0.1, 20.0), method="bounded").x)


def reliability(rows: list[Found]) -> dict[str, object]:
    """How far the belief's share near estimates can be trusted."""
    stated, right = np.array([row.stated for row in rows]), np.array([row.estimate_right for row in rows])
    found = trust(stated, right)
    bins = zip(found.stated, found.observed, found.counts, strict=True)
    return {
        "objects": len(rows),
        "estimate_right": float(right.mean()),
        "stated_mean": float(stated.mean()),
        "calibration_error": found.error,
        "brier": float(np.mean((stated - right) ** 2)),
        "brier_of_the_mean": float(right.mean() * (1 - right.mean())),
        "bins": [{"stated": float(p), "right": float(share), "objects": int(n)} for p, share, n in bins],
    }


def main() -> None:
    """Estimates, fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--scenes", type=int, default=28, metavar="N", help="tuning scenes; as many again are judged (default: 28)"
    )
    options = parser.parse_args()
    torch.set_num_threads(1)
    found = estimates(2 * options.scenes)
    rows = [row for row in found if row.scene < options.scenes]
    others = [row for row in found if row.scene >= options.scenes]
    folds = np.array([row.scene % FOLDS for row in rows])
    left_out = np.zeros(len(rows), dtype=bool)
    for k in np.unique(folds):
        weights = fit([row for row, fold in zip(rows, folds, strict=True) if fold != k])
        left_out[folds == k] = chosen_right([row for row, fold in zip(rows, folds, strict=True) if fold == k], weights)
    result = {
        "scenes": options.scenes,
        "objects": len(rows),
        "any_mode_right": float(np.mean([np.any(row.right) for row in rows])),
        "fitted_weights": dict(zip(TERMS, fit(rows).round(2).tolist(), strict=True)),
        "fitted_choice_right_on_scenes_left_out": float(left_out.mean()),
        "weights": dict(zip(TERMS, WEIGHTS, strict=True)),
        "likeliest_mode_right": float(chosen_right(rows, np.array(WEIGHTS)).mean()),
        "likeliest_mode_right_on_further_scenes": float(chosen_right(others, np.array(WEIGHTS)).mean()),
        "fitted_choice_right_on_further_scenes": float(chosen_right(others, fit(rows)).mean()),
        "fitted_power": fit_power(rows),
        "power": BELIEF,
        "reliability": reliability(rows),
        "reliability_on_further_scenes": reliability(others),
    }
    write_whole(RESULT, json.dumps(result | made_with(), indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
