"""Learns what a look at the place of a believed object says of whether it is there: `existence.PRESENCE`.

    python benchmarks/presence_fit.py

Objects of poured tables (`sum_drake/bench/poured_tables.py`) are looked for where they are, give or take the error of a
belief, and again after they were taken away and the rest came to rest. Tables are left out in turn to see what the
weights are worth on others.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from sum_drake.bench.pose_scenes import SENSORS
from sum_drake.bench.poured_tables import Onlooker, changed, pour_table
from sum_drake.bench.results import made_with
from sum_drake.existence import PRESENCE
from sum_drake.files import write_whole
from sum_drake.geometry import rotation_from_vector
from sum_drake.objects import load_catalogue
from sum_drake.presence import Presence, PresenceCheck
from sum_drake.reliability import reliability
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "presence_fit.json"
FOLDS = 8
PENALTY = 1e-3
SHIFT, TURN = 0.003, 0.05
"""Standard deviation of a belief's error, metres and radians on each axis."""


def gather(tables: int) -> list[tuple[int, Presence, bool]]:
    """Table, what was seen, and whether the object was there."""
    catalogue = load_catalogue()
    checks = {sensor: PresenceCheck(catalogue, noise=SENSORS[sensor]) for sensor in ("structured_light", "stereo")}
    found = []
    for seed in range(tables):
        rng = np.random.default_rng([400, seed])
        table = pour_table(catalogue, rng, objects=int(rng.integers(3, 9)), others=int(rng.integers(0, 3)))
        sensor = ("structured_light", "stereo")[seed % 2]
        onlooker = Onlooker(rng, head=seed % 4 < 2, noise=SENSORS[sensor])
        sight = onlooker.look(table, 0, rng)
        for label, X_WO in table.X_WOs.items():
            X_WB = X_WO.copy()
            X_WB[:3, :3] = rotation_from_vector(rng.normal(0, TURN, 3)) @ X_WB[:3, :3]
            X_WB[:3, 3] += rng.normal(0, SHIFT, 3)
            found.append((seed, checks[sensor].look(sight.frame, label, X_WB), True))
            without = onlooker.look(changed(table, {label: None}), 1, rng)
            found.append((seed, checks[sensor].look(without.frame, label, X_WB), False))
        print(f"table {seed + 1} of {tables}: {len(found)} looks", file=sys.stderr, flush=True)
    return [row for row in found if row[1].pixels > 0]


def fit(X: Array, there: Array) -> Array:
    """Weights (3,) under which what was the case is likeliest, in equal parts; more explained is never worse."""

    def loss(w: Array) -> float:
        t = X @ w
        return float(np.mean(np.logaddexp(0, t) - there * t) + PENALTY * (w**2).sum() / 2)

    bounds = [(None, None), (0, None), (None, 0)]
    return np.asarray(minimize(loss, np.array([0.0, 5.0, -5.0]), method="L-BFGS-B", bounds=bounds).x)


def figures(t: Array, there: Array) -> dict[str, float]:
    """Of log-odds (n,)."""
    p = 1 / (1 + np.exp(-t))
    return {
        "right": float(np.mean((p > 0.5) == there)),
        "brier": float(np.mean((p - there) ** 2)),
        "calibration_error": reliability(p, there).error,
    }


def main() -> None:
    """Gathers, fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=32, metavar="N", help="(default: 32)")
    options = parser.parse_args()
    rows = gather(options.tables)
    X = np.array([[1 - seen.hidden, seen.explained, seen.free] for _, seen, _ in rows])
    there = np.array([was for _, _, was in rows])
    fold = np.array([table % FOLDS for table, _, _ in rows])
    left_out = np.zeros(len(rows))
    for k in np.unique(fold):
        left_out[fold == k] = X[fold == k] @ fit(X[fold != k], there[fold != k])
    result = {
        "tables": options.tables,
        "looks": len(rows),
        "weights": fit(X, there).round(2).tolist(),
        "tables_left_out": figures(left_out, there),
        "as_committed": figures(X @ np.array(PRESENCE), there),
    }
    write_whole(RESULT, json.dumps(result | made_with(), indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
