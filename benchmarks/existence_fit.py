"""Fits the numbers of `sum_drake/existence.py` on poured scenes, and tests them on scenes held out by seed.

    python benchmarks/existence_fit.py --first-seed 100 --scenes 24

Each scene is poured, looked at once through the simulated detector, and every hypothesis is estimated. Its label is
whether the estimate lies within 2 cm and 20 degrees of the object. Scenes of odd seed are held out.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator
from scipy.optimize import minimize

from sum_drake import existence
from sum_drake.geometry import pose_error
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.sorting import make_sorting, pour_scene
from sum_drake.systems.station import set_home


def hypotheses(seed: int, catalogue: Catalogue) -> list[dict[str, float]]:
    """Every track after the first look at one scene: what the belief says of it, and whether it is right."""
    rng = np.random.default_rng(seed)
    text = "{detector: SimulatedDetector, simulated_detector: {wrong_label_rate: 0.25, false_boxes: 1.5}}"
    scenario = load_scenario(text=text, seed=seed, objects=int(rng.integers(4, 9)), catalogue=catalogue)
    X_WOs = pour_scene(scenario, catalogue)
    diagram = make_sorting(scenario, X_WOs, catalogue)
    simulator = Simulator(diagram)
    set_home(diagram.GetSubsystemByName("station"), simulator.get_mutable_context())
    simulator.AdvanceTo(0.65)  # after the first observation, before the first decision
    estimator = diagram.GetSubsystemByName("scene_estimator")
    perception = estimator.GetOutputPort("perception").Eval(estimator.GetMyContextFromRoot(simulator.get_context()))
    rows = []
    for track in perception.posterior.tracks:
        right = False
        if track.label in X_WOs:
            translation, rotation = pose_error(track.X_WO, X_WOs[track.label], catalogue[track.label].symmetry)
            right = bool(translation < 0.02 and rotation < np.radians(20))
        rows.append(
            {
                "seed": seed, "label": track.label, "right": right, "confidence": track.p_box * track.p_label,
                "likelihood": track.likelihood, **dict(track.features),
            }
        )  # fmt: skip
    return rows


def probability(rows: list[dict[str, float]], parameters: np.ndarray) -> np.ndarray:
    """The model of `existence.track_probability` with other numbers."""
    confidence = np.clip([row["confidence"] for row in rows], 1e-3, 1 - 1e-3)
    likelihood = np.array([row["likelihood"] for row in rows])
    sunk = np.maximum([row["sunk_m"] for row in rows], 0.0)
    logit = parameters[0] + parameters[1] * np.log(confidence / (1 - confidence)) + parameters[2] * likelihood
    p = np.exp(-0.5 * (sunk / existence.SUNK) ** 2) / (1 + np.exp(-logit))
    return np.where(likelihood > 0, p, 0.0)


def main() -> None:
    """Collects (resuming from --rows), fits, and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--rows", type=Path, default=Path("existence_rows.json"), help="hypotheses, kept as they come")
    options = parser.parse_args()
    catalogue = load_catalogue()
    rows = json.loads(options.rows.read_text()) if options.rows.exists() else []
    done = {row["seed"] for row in rows}
    for seed in range(options.first_seed, options.first_seed + options.scenes):
        if seed not in done:
            rows += hypotheses(seed, catalogue)
            options.rows.write_text(json.dumps(rows))
            print(f"seed {seed}: {len(rows)} hypotheses so far", file=sys.stderr, flush=True)
    train = [row for row in rows if row["seed"] % 2 == 0]
    test = [row for row in rows if row["seed"] % 2 == 1]
    right = np.array([row["right"] for row in train])

    def loss(parameters: np.ndarray) -> float:
        p = np.clip(probability(train, parameters), 1e-6, 1 - 1e-6)
        return float(-np.mean(np.where(right, np.log(p), np.log(1 - p))) + 1e-4 * np.sum(parameters**2))

    start = np.array([existence.INTERCEPT, existence.DETECTOR, existence.LIKELIHOOD])
    fitted = minimize(loss, start, method="Nelder-Mead").x
    print(f"INTERCEPT = {fitted[0]:.2f}\nDETECTOR = {fitted[1]:.2f}\nLIKELIHOOD = {fitted[2]:.2f}")
    truth = np.array([row["right"] for row in test])
    base = truth.mean()
    for name, p in (("as committed", probability(test, start)), ("as fitted", probability(test, fitted))):
        skill = 1 - np.mean((p - truth) ** 2) / (base * (1 - base))
        order = np.argsort(p)
        gaps = [abs(p[b].mean() - truth[b].mean()) * len(b) / len(p) for b in np.array_split(order, 10) if len(b)]
        print(
            f"{name}, {len(test)} held-out hypotheses, {base:.2f} right: Brier skill {skill:.2f}, calibration error "
            f"{sum(gaps):.3f}, of right ones accepted {np.mean(p[truth] >= 0.5):.2f}, "
            f"of wrong ones rejected {np.mean(p[~truth] < 0.5):.2f}"
        )


if __name__ == "__main__":
    main()
