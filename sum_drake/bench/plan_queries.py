"""Paths that picks from poured tables ask for: to short of a grasp, with the object to its bin, and home.

The ends are found by inverse kinematics and checked to be free, whether or not a path joins them: so a set of queries
favours no planner. What is committed under models/problems/table.json was written by `build_problems.py` there.
"""

import dataclasses
import itertools
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from sum_drake import timing
from sum_drake.assets import InputError, one_line
from sum_drake.bench.poured_tables import TABLE_TOP
from sum_drake.bench.sequences import BIN
from sum_drake.detection.arrangement import pour
from sum_drake.detection.scene_rendering import body_of, station_ground
from sum_drake.files import write_whole
from sum_drake.geometry import apply, inverse, rotation_from_vector, shifted, transform
from sum_drake.grasp_ranking import rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.motion import NoPath, cartesian_path, plan_path
from sum_drake.objects import Catalogue, sample_surface
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import padded, timed
from sum_drake.planning_scene import PlanningScene, solid_of
from sum_drake.robot import HAND, VIEW
from sum_drake.seeds import derive
from sum_drake.types import Array, Immutable, PoseBelief, readonly

KINDS = ("approach", "transport", "return")
_GRASPS, _GOALS, _POINTS = 20, 6, 3000
"""Grasps of an object that are looked at; goals of a transport; surface points of the others."""
_HEIGHT = 0.24
"""Of an object's middle above a bin's when it is let go, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Query(Immutable):
    """A path that is asked for, among objects at their true poses."""

    request: str
    """KIND_NUMBER."""
    objects: tuple[tuple[str, Array], ...]
    """Labels and poses X_WO (4, 4) of all that were poured."""
    taken: str
    """Label of the object that the pick is about; empty while it still stands in the way."""
    X_GO: Array | None
    """(4, 4): of the taken object, where the hand holds it."""
    gap: float
    """Between the fingers, metres."""
    start: Array
    """(8,)."""
    goals: Array
    """(m, 8): any will do."""

    @property
    def kind(self) -> str:
        """Of KINDS."""
        return self.request.split("_")[0]


def query_scene(query: Query, catalogue: Catalogue, base: PlanningScene, config: PickConfig) -> PlanningScene:
    """The scene of a query, with the distances that picks keep."""
    solids = [solid_of(catalogue[label], X_WO) for label, X_WO in query.objects]
    scene = padded(base.with_solids(solids), config)
    if query.taken:
        scene = scene.ignoring(query.taken)
    if query.X_GO is not None:
        scene = scene.holding(solid_of(catalogue[query.taken], np.eye(4)).hulls, query.X_GO)
    return scene.with_gap(query.gap)


# Making queries.


def make_queries(catalogue: Catalogue, *, pours: int, seed: int) -> list[Query]:
    """Up to three of each of so many poured tables of 3 to 10 objects: approach, transport and return of one pick."""
    arm, base, config = Arm(), PlanningScene(), PickConfig()
    found: list[Query] = []
    for i in range(pours):
        rng = np.random.default_rng([derive(seed, "queries"), i])
        labels = [catalogue.labels[k] for k in rng.permutation(len(catalogue))[: rng.integers(3, 11)]]
        poses = pour([body_of(catalogue[label]) for label in labels], station_ground(len(labels)), rng, duration=1.5)
        objects = tuple(
            (label, _rounded(X)) for label, X in zip(labels, poses, strict=True)
            if X is not None and TABLE_TOP.holds(X[:3, 3])
        )  # fmt: skip
        for label, _ in objects:
            queries = _of_pick(f"{i:04d}", label, objects, catalogue, arm, base, config, rng)
            if queries:
                found += queries
                break
    return found


def _of_pick(
    number: str, label: str, objects: Sequence[tuple[str, Array]], catalogue: Catalogue, arm: Arm, base: PlanningScene,
    config: PickConfig, rng: np.random.Generator,
) -> list[Query]:  # fmt: skip
    """The queries of picking one object, empty where no grasp has free ends."""
    model, X_WO = catalogue[label], dict(objects)[label]
    others = [(catalogue[other], X) for other, X in objects if other != label]
    share = _POINTS // max(len(others), 1)
    points = [apply(X, sample_surface(other, share, np.random.default_rng(0))[0]) for other, X in others]
    ranked = rank_grasps(
        grasp_candidates(model, config=GraspConfig(), seed=0),
        model=model,
        X_WO=X_WO,
        belief=PoseBelief(readonly(X_WO[None]), readonly([1.0])),
        points_W=np.concatenate([np.zeros((0, 3)), *points]),
        table_height=TABLE_TOP.floor_height,
        config=GraspConfig(),
    )
    full = padded(base.with_solids([solid_of(catalogue[other], X) for other, X in objects]), config)
    for grasp, X_WG, gap in list(zip(ranked.grasps, ranked.X_WGs, ranked.gaps, strict=True))[:_GRASPS]:
        around, X_GO = full.with_gap(float(gap)), inverse(X_WG) @ X_WO
        held = full.ignoring(label).holding(solid_of(model, np.eye(4)).hulls, X_GO).with_gap(grasp.width)
        for q in arm.solutions(X_WG, near=VIEW, count=6):
            back = cartesian_path(arm, X_WG, X_WG @ shifted(np.eye(4), np.array([-config.approach, 0, 0])), q)
            before = [path[-1] for path in back if around.is_free(path[-1])]
            lifts = cartesian_path(arm, X_WG, shifted(X_WG, np.array([0, 0, config.lifts[0]])), q)
            lifted = [path[-1] for path in lifts if held.is_free(path[-1])]
            if not before or not lifted:
                continue
            over = _over_bin(arm, held, lifted[0], X_GO, model.label, rng)
            cleared = full.ignoring(label).with_gap(HAND.gap_max)
            let_go = [q for q in over if cleared.is_free(q)]
            made = [
                Query(f"approach_{number}", tuple(objects), "", None, float(gap), VIEW, np.array(before)),
                Query(f"transport_{number}", tuple(objects), label, X_GO, grasp.width, lifted[0], np.array(over)),
            ]
            if let_go:
                home = nearest_turns(VIEW, let_go[0])[None]
                made.append(Query(f"return_{number}", tuple(objects), label, None, HAND.gap_max, let_go[0], home))
            if over:
                return [query for query in map(_rounded_query, made) if _ends_free(query, catalogue, base, config)]
    return []


def _over_bin(
    arm: Arm, held: PlanningScene, q: Array, X_GO: Array, label: str, rng: np.random.Generator
) -> list[Array]:
    """Free configurations (8,) with the held object over a bin, turned about the vertical anyhow."""
    X_WO = arm.forward(q) @ X_GO
    side = BIN * [1, rng.choice([-1, 1]), 1]
    found: list[Array] = []
    for yaw in rng.uniform(0, 2 * np.pi) + np.arange(12) * np.pi / 6:
        R_WO = rotation_from_vector(np.array([0, 0, yaw])) @ X_WO[:3, :3]
        X_WG = transform(R_WO, side + np.array([0, 0, _HEIGHT])) @ inverse(X_GO)
        found += [q for q in arm.solutions(X_WG, near=q, count=2, thorough=False) if held.is_free(q)]
    return found[:_GOALS]


def _ends_free(query: Query, catalogue: Catalogue, base: PlanningScene, config: PickConfig) -> bool:
    scene = query_scene(query, catalogue, base, config)
    return bool(scene.is_free(query.start) and scene.free_many(query.goals).all())


# Files.


def write_queries(path: Path, queries: Sequence[Query]) -> None:
    """One query a line. Poses are x, y, z and a quaternion x, y, z, w."""
    rows = [
        {
            "request": query.request,
            "objects": {label: _seven(X_WO) for label, X_WO in query.objects},
            "taken": query.taken,
            "X_GO": None if query.X_GO is None else _seven(query.X_GO),
            "gap": query.gap,
            "start": query.start.tolist(),
            "goals": query.goals.tolist(),
        }
        for query in queries
    ]
    write_whole(path, "[\n" + ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows) + "\n]\n")


def load_queries(path: Path) -> tuple[Query, ...]:
    """Reads what `write_queries` wrote. Raises InputError for anything else."""
    try:
        return tuple(
            Query(
                row["request"],
                tuple((label, _pose(seven)) for label, seven in row["objects"].items()),
                row["taken"],
                None if row["X_GO"] is None else _pose(row["X_GO"]),
                row["gap"],
                np.array(row["start"]),
                np.array(row["goals"]),
            )
            for row in json.loads(path.read_text())
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected queries as build_problems.py writes them") from error


def _seven(X: Array) -> list[float]:
    quaternion = Rotation.from_matrix(X[:3, :3]).as_quat(canonical=True)
    return [round(float(v), 5) for v in (*X[:3, 3], *quaternion)]


def _pose(seven: Sequence[float]) -> Array:
    return transform(Rotation.from_quat(seven[3:]).as_matrix(), np.array(seven[:3]))


def _rounded(X: Array) -> Array:
    return _pose(_seven(X))


def _rounded_query(query: Query) -> Query:
    """As it will be read from its file."""
    X_GO = None if query.X_GO is None else _rounded(query.X_GO)
    gap, start, goals = round(query.gap, 5), np.round(query.start, 5), np.round(query.goals, 5)
    return dataclasses.replace(query, X_GO=X_GO, gap=gap, start=start, goals=goals)


# Measuring.


@dataclasses.dataclass(frozen=True)
class QueryMeasured:
    """What came of a query."""

    request: str
    kind: str
    objects: int
    solved: bool
    reason: str
    """Why there is no path; empty where there is one."""
    cpu_s: float
    """Of planning, the scene being known."""
    checks: int
    duration_s: float
    """Of the timed trajectory; 0 where there is none."""
    length_rad: float
    """Sum over joints of how far each goes, the torso in metres."""
    free: bool
    """Whether Drake alone finds the path, and the trajectory with its rounded corners, free every .005 rad."""
    limit_use: float
    """Largest share of a limit of speed, acceleration or jerk that the trajectory uses."""


def measure_query(
    query: Query,
    catalogue: Catalogue,
    base: PlanningScene,
    *,
    seed: int,
    plan: Callable[..., Any] = plan_path,
) -> QueryMeasured:
    """Plans a query as a pick does. plan: another planner with the arguments of `motion.plan_path`, to compare."""
    config = PickConfig()
    scene = query_scene(query, catalogue, base, config)
    begun = time.process_time()
    found = plan(scene, query.start, query.goals, seed=derive(seed, query.request), budget=config.budget)
    spent = time.process_time() - begun
    told = query.request, query.kind, len(query.objects)
    if isinstance(found, NoPath):
        return QueryMeasured(*told, False, found.reason, spent, found.checks, 0.0, 0.0, True, 0.0)
    trajectory = timed(scene, found.qs, config.speed)
    fine = timing.sample(trajectory, 0.01)
    free = scene.confirmed(found.qs) and all(scene.confirmed(np.stack(pair)) for pair in itertools.pairwise(fine))
    return QueryMeasured(
        *told, True, "", spent, found.checks, float(trajectory.times[-1]),
        float(np.abs(np.diff(found.qs, axis=0)).sum()), free, max(timing.limit_use(trajectory)),
    )  # fmt: skip
