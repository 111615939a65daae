"""Learns the weights of `sum_drake/existence.py` on poured tables, and tells on others how far they can be trusted.

    python benchmarks/existence_fit.py

Every table (`sum_drake/bench/hypotheses.py`; seeds from 0, those of the bench begin at 1000) is looked at once. What
becomes of each hypothesis is right or wrong: within 2 cm and 20 degrees of an object of its label, or not. The weights
are learned on all these tables; how well that goes is told of each table by weights that were learned without it.
"""

import argparse
import dataclasses
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize

from sum_drake import existence
from sum_drake.bench.hypotheses import Judged, first_look
from sum_drake.bench.pose_scenes import other_meshes
from sum_drake.bench.results import made_with
from sum_drake.bench.watching import Tables, setting
from sum_drake.detection.inference import load_detector
from sum_drake.existence import EVIDENCE, SIGNS, evidence
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.objects import load_catalogue
from sum_drake.reliability import reliability
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "existence_fit.json"
FOLDS = 10
PENALTY = 1e-2
"""Of the squared weights of evidence of unit variance."""


def gather(tables: int, rows: Path) -> list[Judged]:
    """Every hypothesis of every table; kept in a file as they come, a line a table."""
    done = [json.loads(line) for line in rows.read_text().splitlines()] if rows.exists() else []
    catalogue = load_catalogue()
    detector = load_detector(None, labels=catalogue.labels)
    with tempfile.TemporaryDirectory() as folder:
        looks = Tables(catalogue, other_meshes(catalogue, Path(folder), 0), detector, filter_config())
        for seed in range(len(done), tables):
            done.append([dataclasses.asdict(one) for one in first_look(looks, setting(seed)).judged])
            with rows.open("a") as file:
                file.write(json.dumps(done[-1]) + "\n")
            print(f"table {seed + 1} of {tables}: {sum(map(len, done))} hypotheses", file=sys.stderr, flush=True)
    return [Judged(**row) for table in done[:tables] for row in table]


def fit(X: Array, near: Array, right: Array) -> Array:
    """Intercept and weights (1 + 8,) under which what came true is likeliest, signs as allowed.

    X (n, 8): evidence; near (n,): the belief's share near the estimate, by which the logistic function is multiplied.
    """
    middle, scale = X.mean(axis=0), X.std(axis=0) + 1e-9
    Z = (X - middle) / scale

    def loss(w: Array) -> tuple[float, Array]:
        there = 1 / (1 + np.exp(-(w[0] + Z @ w[1:])))
        wrong = 1 - near * there
        slope = np.where(right, there - 1, near * there * (1 - there) / np.maximum(wrong, 1e-9))
        gradient = np.r_[slope.mean(), Z.T @ slope / len(Z) + PENALTY * w[1:]]
        log = np.where(right, np.log(np.maximum(there, 1e-12)), np.log(np.maximum(wrong, 1e-12)))
        return float(-log.mean() + PENALTY * (w[1:] ** 2).sum() / 2), gradient

    bounds = [(None, None), *((0, None) if sign > 0 else (None, 0) for sign in SIGNS)]
    w = minimize(loss, np.zeros(1 + X.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x
    return np.r_[w[0] - (w[1:] * middle / scale).sum(), w[1:] / scale]


def stated(w: Array, X: Array, near: Array) -> Array:
    """Probabilities (n,)."""
    return np.asarray(near / (1 + np.exp(-(w[0] + X @ w[1:]))))


def figures(p: Array, right: Array) -> dict[str, Any]:
    """What probabilities (n,) are worth: calibration, and how many wrong ones go where nearly all right ones stay."""
    base, brier = float(right.mean()), float(np.mean((p - right) ** 2))
    return {
        "hypotheses": len(p),
        "right": base,
        "calibration_error": reliability(p, right).error,
        "brier": brier,
        "brier_skill": 1 - brier / (base * (1 - base)),
        "false_rejected_at_95_kept": float(np.mean(p[~right] < np.quantile(p[right], 0.05))),
        "true_kept_at_half": float(np.mean(p[right] >= 0.5)),
        "false_rejected_at_half": float(np.mean(p[~right] < 0.5)),
        "stated_where_wrong": float(p[~right].mean()),
    }


def main() -> None:
    """Gathers (resuming from --rows), fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=300, metavar="N", help="(default: 300)")
    parser.add_argument("--rows", type=Path, default=Path("existence_rows.jsonl"), help="hypotheses, kept as they come")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = [row for row in gather(options.tables, options.rows) if row.likelihood > 0]
    X = np.stack([evidence(row.p_box, row.p_label, row.likelihood, dict(row.features)) for row in rows])
    near = np.array([dict(row.features)["near_share"] for row in rows])
    right, trained = np.array([row.right for row in rows]), np.array([row.trained for row in rows])
    # Two tables of a pair are looked at by one detector each, so that both are in every fold.
    fold = np.array([row.table // 2 % FOLDS for row in rows])
    left_out = np.zeros(len(rows))
    for k in range(FOLDS):
        left_out[fold == k] = stated(
            fit(X[fold != k], near[fold != k], right[fold != k]), X[fold == k], near[fold == k]
        )
    fitted = fit(X, near, right)
    committed = stated(np.r_[existence.INTERCEPT, existence.WEIGHTS], X, near)
    confidence = np.array([row.p_box * row.p_label for row in rows])
    explained = np.array([dict(row.features)["inliers"] / max(dict(row.features)["observed"], 1) for row in rows])
    result = {
        "tables": options.tables,
        "intercept": round(float(fitted[0]), 2),
        "weights": dict(zip(EVIDENCE, fitted[1:].round(2).tolist(), strict=True)),
        "tables_left_out": figures(left_out, right),
        "of_the_trained_detector": figures(left_out[trained], right[trained]),
        "of_the_simulated_detector": figures(left_out[~trained], right[~trained]),
        "as_committed": figures(committed, right),
        "detector_alone": figures(confidence, right),
        "inliers_over_n": figures(np.clip(explained, 0, 1), right),
    }
    write_whole(RESULT, json.dumps(result | made_with(), indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
