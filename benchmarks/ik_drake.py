"""Compares the closed-form inverse kinematics with Drake's InverseKinematics (SNOPT, restarts) on the same poses.

    python benchmarks/ik_drake.py

Poses are reachable by construction (`sum_drake/bench/plan_ik.py`). Drake's program has nothing but the hand's pose and
the joint limits in it. Its first start is the viewing pose, as the closed form's reference is, the others are random;
it is given far wider tolerances than the closed form's, and judged by twice those.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import SnoptSolver

from sum_drake import robot
from sum_drake.bench.plan_ik import ANGLE, POSITION, errors, random_positions
from sum_drake.bench.results import made_with
from sum_drake.files import write_whole
from sum_drake.kinematics import Arm
from sum_drake.parsing import make_parser
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "ik_drake.json"
DRAKE_POSITION, DRAKE_ANGLE = 1e-4, 1e-3
"""The tolerances of Drake's program, metres and radians."""
SLACK = 1e-6
"""By which a solver that iterates may be over a joint limit."""


class DrakeIk:
    """InverseKinematics of the URDF's arm, from several starts."""

    def __init__(self) -> None:
        self._plant = MultibodyPlant(0.0)
        make_parser(self._plant).AddModels(url=robot.FETCH_URDF)
        self._plant.WeldFrames(self._plant.world_frame(), self._plant.GetFrameByName("base_link"))
        self._plant.Finalize()
        self._order = [self._plant.GetJointByName(joint.name).position_start() for joint in robot.ARM_JOINTS]
        self._hand = self._plant.GetFrameByName("gripper_link")
        self._solver = SnoptSolver()

    def solve(self, X_WG: Array, rng: np.random.Generator, starts: int = 8) -> Array:
        """(1, 8), or (0, 8): none was found."""
        ik = InverseKinematics(self._plant)
        X = RigidTransform(X_WG)
        p, W = X.translation(), self._plant.world_frame()
        ik.AddPositionConstraint(self._hand, np.zeros(3), W, p - DRAKE_POSITION, p + DRAKE_POSITION)
        ik.AddOrientationConstraint(W, X.rotation(), self._hand, RotationMatrix(), DRAKE_ANGLE)
        for start in (robot.VIEW, *random_positions(starts - 1, rng)):
            positions = np.zeros(self._plant.num_positions())
            positions[self._order] = start
            result = self._solver.Solve(ik.prog(), positions, None)
            if result.is_success():
                return np.asarray(result.GetSolution(ik.q())[self._order])[None]
        return np.empty((0, 8))


def measure(
    solve: Callable[[Array], Array], X_WGs: Array, position: float = POSITION, angle: float = ANGLE
) -> dict[str, Any]:
    """Share of poses solved within limits and tolerances, and CPU milliseconds each.

    solve: X_WG (4, 4) -> (n, 8), none if n = 0.
    """
    arm, seconds, solved = Arm(), [], 0
    lower, upper = robot.limits()
    for X_WG in X_WGs:
        begun = time.process_time()
        qs = solve(X_WG)
        seconds.append(time.process_time() - begun)
        off, turned = errors(arm, qs, X_WG)
        inside = ((qs >= lower - SLACK) & (qs <= upper + SLACK)).all()
        solved += bool(len(qs) and inside and off <= position and turned <= angle)
    return {
        "success": solved / len(X_WGs),
        "median_ms": round(1e3 * float(np.median(seconds)), 4),
        "p95_ms": round(1e3 * float(np.quantile(seconds, 0.95)), 4),
        "tolerance_m": position,
        "tolerance_rad": angle,
    }


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=200, metavar="N", help="(default: 200)")
    options = parser.parse_args()
    arm, drake = Arm(), DrakeIk()
    X_WGs = arm.forward_many(random_positions(options.poses, np.random.default_rng(0)))
    rng = np.random.default_rng(1)
    for X_WG in X_WGs[:3]:  # what is compiled or loaded at the first is no cost of the others
        drake.solve(X_WG, np.random.default_rng(2))
        arm.solutions(X_WG)
    result = {
        "poses": options.poses,
        "closed_form_all_solutions": measure(arm.solutions, X_WGs),
        "closed_form_one_solution": measure(lambda X_WG: arm.solutions(X_WG, count=1), X_WGs),
    }
    for starts in (1, 8):
        result[f"drake_{starts}_starts"] = measure(
            lambda X, starts=starts: drake.solve(X, rng, starts), X_WGs, 2 * DRAKE_POSITION, 2 * DRAKE_ANGLE
        )
    result |= made_with()
    write_whole(RESULT, json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
