"""Plans picks and places of a can by random grasps among random obstacles, and checks every motion densely.

    python benchmarks/picks_quick.py --scenes 20

Prints the share of scenes with a plan, CPU seconds, durations, and the share of motions that are free every .005 rad
and within all limits, which must be 1.
"""

import argparse
import time
from collections import Counter

import numpy as np

from sum_drake import robot, timing
from sum_drake.geometry import inverse, rotation_from_vector, transform
from sum_drake.grasp_ranking import RankedGrasps
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue, ObjectModel, load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.picking import PickPlan, plan_pick_place
from sum_drake.planning_scene import PlanningScene, solid_of
from sum_drake.types import Array, Grasp, Region

BINS = tuple(
    Region(name, np.array([0.12, y, 0.47]), np.array([0.18, 0.18, 0.18]))
    for name, y in (("cleaning_bin", -0.62), ("non_cleaning_bin", 0.62))
)
TABLE = 0.70


def standing(model: ObjectModel, p_W: Array, yaw: float) -> Array:
    """X_WO (4, 4) of an object that stands on the table at p_W (2,)."""
    R_WO = rotation_from_vector(np.array([0.0, 0.0, yaw]))
    return transform(R_WO, np.array([*p_W, TABLE + model.dimensions[2] / 2]))


def random_scene(catalogue: Catalogue, rng: np.random.Generator) -> tuple[Array, list[tuple[ObjectModel, Array]]]:
    """Pose of the can, and three obstacles at least 13 cm from it and from each other."""
    spots = [rng.uniform([0.45, -0.25], [0.75, 0.25])]
    while len(spots) < 4:
        spot = rng.uniform([0.45, -0.3], [0.9, 0.3])
        if min(np.linalg.norm(spot - other) for other in spots) > 0.13:
            spots.append(spot)
    labels = rng.choice(["sugar", "shampoo", "mug", "ranch", "tea"], 3, replace=False)
    obstacles = [
        (catalogue[label], standing(catalogue[label], spot, rng.uniform(-np.pi, np.pi)))
        for label, spot in zip(labels, spots[1:], strict=True)
    ]
    return standing(catalogue["soup_can"], spots[0], 0.0), obstacles


def random_grasps(model: ObjectModel, X_WO: Array, rng: np.random.Generator, count: int = 12) -> RankedGrasps:
    """Half from above at any yaw, half tilted by up to 60 degrees, as if they had been ranked."""
    width = model.dimensions[0]
    X_WGs = []
    for i in range(count):
        tilt = 0.0 if i < count // 2 else rng.uniform(0.2, np.pi / 3)
        down = np.column_stack([[0, 0, -1.0], [0, 1.0, 0], [1.0, 0, 0]])
        turn = rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        R_WG = turn @ rotation_from_vector(np.array([0.0, -tilt, 0.0])) @ down
        X_WGs.append(transform(R_WG, X_WO[:3, 3] + np.array([0, 0, model.dimensions[2] / 2 - 0.03])))
    grasps = tuple(Grasp(model.label, inverse(X_WO) @ X_WG, width, 1.0) for X_WG in X_WGs)
    return RankedGrasps(grasps, np.array(X_WGs), np.full(count, 0.1), np.ones(count), ())


def is_sound(
    scene: PlanningScene, plan: PickPlan, target: ObjectModel, X_WO: Array, obstacles: list[tuple[ObjectModel, Array]]
) -> bool:
    """Whether every segment keeps the limits and is free every .005 rad, by scenes made for this question."""
    others = tuple(solid_of(model, X) for model, X in obstacles)
    empty = scene.with_solids(others)
    judges = {
        "approach": scene.with_solids((*others, solid_of(target, X_WO, "target"))),
        "transport": empty.holding(solid_of(target, X_WO).hulls, inverse(plan.X_WG) @ X_WO),
    }
    for segment in plan.pick.segments + plan.place.segments:
        dt = 0.005 / np.abs(segment.trajectory.velocities).max().clip(0.1)
        gap = segment.gap if segment.gap > 0 else plan.grasp.width
        judge = judges.get(segment.name, empty).with_gap(gap)
        if max(timing.limit_use(segment.trajectory)) > 1.0 + 1e-6:
            return False
        if not judge.free_many(timing.sample(segment.trajectory, dt)).all():
            return False
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first scene")
    arguments = parser.parse_args()
    catalogue, arm, scene = load_catalogue(), Arm(), PlanningScene()
    target = catalogue["soup_can"]
    cpu, durations, sound, reasons = [], [], [], Counter[str]()
    for seed in range(arguments.seed, arguments.seed + arguments.scenes):
        rng = np.random.default_rng(seed)
        X_WO, obstacles = random_scene(catalogue, rng)
        ranked = random_grasps(target, X_WO, rng)
        start = time.process_time()
        plan = plan_pick_place(
            arm=arm, scene=scene, ranked=ranked, X_WO=X_WO, model=target, region=BINS[seed % 2], q_now=robot.VIEW,
            obstacles=obstacles, seed=seed, config=PickConfig(),
        )  # fmt: skip
        cpu.append(time.process_time() - start)
        if isinstance(plan, PickPlan):
            durations.append(plan.pick.duration + plan.place.duration)
            sound.append(is_sound(scene, plan, target, X_WO, obstacles))
        reasons["planned" if isinstance(plan, PickPlan) else plan.reason] += 1
        print(seed, f"{cpu[-1]:.2f} s", "planned" if isinstance(plan, PickPlan) else (plan.reason, plan.rejected_by))
    print(f"planned {reasons['planned']} of {arguments.scenes}: {dict(reasons)}")
    print(f"CPU seconds: median {np.median(cpu):.2f}, largest {max(cpu):.2f}")
    print(f"duration: median {np.median(durations):.1f} s, largest {max(durations):.1f} s")
    print(f"free and within limits: {np.mean(sound):.3f}")


if __name__ == "__main__":
    main()
