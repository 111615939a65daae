"""OMPL's planners side by side: on paths that picks ask for, and on shelves, cages and under tables.

    python benchmarks/planners.py --out benchmarks/results/planners.json

Every planner gets the same edges, rooms, shortcuts and confirmation (`motion.plan_path`), with budgets that grow until
2 CPU seconds are over for a pick's path, 10 for a hard one. Prints the share solved, the median of all CPU seconds
(what was not found counts whole), and how long the paths found would take. With --every N every N-th question only.
"""

import argparse
import functools
import logging
import time
from pathlib import Path

import numpy as np

from sum_drake.assets import asset
from sum_drake.bench.plan_queries import load_queries, query_scene
from sum_drake.bench.plan_sets import KINDS, fetch_robot
from sum_drake.bench.plan_solve import BUDGET, warm_up
from sum_drake.bench.results import made_with
from sum_drake.checked_scene import CheckedScene
from sum_drake.jsonio import write_json
from sum_drake.motion import PLANNERS, plan_path, seconds
from sum_drake.motion import Path as FoundPath
from sum_drake.objects import load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.planning_problems import load_problems
from sum_drake.planning_scene import PlanningScene
from sum_drake.robot_scene import RobotScene
from sum_drake.seeds import derive
from sum_drake.types import Array

Question = tuple[str, float, CheckedScene, Array, Array]


def questions(every: int) -> list[Question]:
    """Kind, seconds allowed, scene, start and goals."""
    catalogue, base, config = load_catalogue(), PlanningScene(), PickConfig()
    found: list[Question] = [
        ("pick", 2.0, query_scene(query, catalogue, base, config), query.start, query.goals)
        for query in load_queries(asset("package://sum_drake/problems/table.json"))[::every]
    ]
    robot = fetch_robot()
    for kind in KINDS:
        for problem in load_problems(asset(f"package://sum_drake/problems/{kind}.json"), robot)[::every]:
            found.append((kind, 10.0, RobotScene.of(robot, problem), problem.start, problem.goal[None]))
    return found


def main() -> None:
    """Prints a line for each planner and kind; writes them all where --out says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--planners", nargs="+", choices=list(PLANNERS), default=list(PLANNERS))
    parser.add_argument("--every", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    logging.getLogger("drake").setLevel(logging.WARNING)
    warm_up()
    asked, rows = questions(options.every), []
    for name in options.planners:
        for kind in ("pick", *KINDS):
            spent, lengths = [], []
            for i, (of, limit, scene, start, goals) in enumerate(asked):
                if of != kind:
                    continue
                begun = time.process_time()
                over = functools.partial(lambda begun, limit: time.process_time() - begun > limit, begun, limit)
                budget, found = BUDGET, None
                while not isinstance(found, FoundPath) and not over():
                    seed = derive(options.seed, f"{i} {budget}")
                    found = plan_path(scene, start, goals, seed=seed, budget=budget, planner=name, stop=over)
                    budget += budget // 2
                spent.append(time.process_time() - begun)
                lengths += [seconds(found.qs, scene.space)] if isinstance(found, FoundPath) else []
            row = {
                "planner": name,
                "kind": kind,
                "asked": len(spent),
                "solved": len(lengths) / len(spent),
                "median_cpu_s": float(np.median(spent)),
                "median_path_s": float(np.median(lengths)) if lengths else None,
            }
            print(row, flush=True)
            rows.append(row)
    if options.out:
        write_json(
            options.out, {"every": options.every, "seed": options.seed, "rows": rows, **made_with()},
        )  # fmt: skip


if __name__ == "__main__":
    main()
