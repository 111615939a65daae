"""How to take an object from the table and put it somewhere: grasp, inverse kinematics, paths, timing.

A pick is approach (around everything, to a pose short of the grasp), reach (straight along the hand's approach axis),
close, lift (straight up). A place is transport (around everything, with the object in the hand), open (as wide as
object and place allow, so that what sits tighter than was believed comes loose too), retreat (straight back along the
approach axis, so that nothing stays hooked over a finger), return (around everything, to the viewing pose). What is
set down on the table, rather than let go over a bin, is first lowered straight from a little above its place.
"""

import dataclasses
import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from sum_drake import timing
from sum_drake.action_model import STILL
from sum_drake.geometry import inverse, shifted
from sum_drake.grasp_ranking import DEFAULT_MASS, RankedGrasps
from sum_drake.grasping import half_turn
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.letting_go import PlaceWay, places_at, places_over, release_gap
from sum_drake.motion import NoPath, cartesian_path, plan_path
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import (
    REASONS,
    GivenUp,
    PhaseScenes,
    PickWay,
    along_x,
    first_free,
    met,
    opening,
    timed,
)
from sum_drake.planning_scene import PlanningScene, Solid, solid_of
from sum_drake.robot import VIEW
from sum_drake.types import (
    Array,
    Grasp,
    GraspCandidates,
    Immutable,
    Load,
    Motion,
    Region,
    Segment,
    Trajectory,
    readonly,
)

NEAR = ("grasp_collision", "reach", "lift")
"""Those that may be for want of room beside neighbours."""


@dataclasses.dataclass(frozen=True, eq=False)
class PickPlan(Immutable):
    """A free, timed motion that brings the object into the region."""

    grasp: Grasp
    X_WG: Array
    """(4, 4): the hand at the grasp."""
    pick: Motion
    """approach, reach, close, lift."""
    place: Motion
    """transport, lower (on the table only), open, retreat, return; starts where `pick` ends."""
    X_WG_place: Array
    """(4, 4)."""
    X_WO_place: Array
    """(4, 4): the object when it is let go."""
    grasp_candidates: int
    """Grasps that were ranked, kept or dropped."""
    rejected_by: tuple[tuple[str, int], ...]
    """Grasps dropped before this one, by cause: grasp_ranking.CAUSES, then REASONS."""
    candidates: GraspCandidates | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Infeasible(Immutable):
    """Nothing was found."""

    reason: str
    """One of REASONS: the furthest that any grasp got."""
    grasp_candidates: int
    rejected_by: tuple[tuple[str, int], ...]
    candidates: GraspCandidates | None = None


def plan_pick_place(
    *,
    arm: Arm,
    scene: PlanningScene,
    ranked: RankedGrasps,
    X_WO: Array,
    model: ObjectModel,
    region: Region,
    q_now: Array,
    obstacles: Sequence[tuple[ObjectModel, Array]] = (),
    margins: Sequence[float] = (),
    points_W: Array | None = None,
    seed: int,
    config: PickConfig,
    fill: float = 0.0,
    spots: Sequence[Array] | None = None,
    drags: bool = False,
) -> PickPlan | Infeasible:
    """The first of the ranked grasps that can be picked, carried to the region and let go, with its motions.

    scene: robot and furniture. X_WO: (4, 4), of the object to move. q_now: (8,). obstacles: the other believed objects
    and their poses. margins: how uncertain each of these is, metres: kept from it besides the usual; none where empty.
    points_W: (m, 3) depth points that are not of the object. fill: how high the region is known to be filled, metres
    above its floor. spots: (4, 4) poses to set the object down at, instead of letting it go anywhere over the region.
    drags: whether lifting it may take along what lies or leans on it. A function of its arguments; 2 to 3 CPU seconds.

    The hand was tested against points_W when the grasps were ranked, so close to the grasp only furniture and the
    hulls of other objects count; everything counts while the arm goes around things.
    """
    target = solid_of(model, X_WO)
    kept = margins or [0.0] * len(obstacles)
    others = [solid_of(other, X, margin=margin) for (other, X), margin in zip(obstacles, kept, strict=True)]
    points = np.empty((0, 3)) if points_W is None else points_W
    found: PickPlan | Infeasible | None = None
    for scenes in PhaseScenes.make(scene, target, others, points, config, drags=drags):
        found = _plan(
            arm, scenes, ranked, target, model, region, q_now, fill, spots, np.random.default_rng(seed)
        )  # fmt: skip
        if isinstance(found, PickPlan) or not any(cause.startswith(NEAR) for cause, _ in found.rejected_by):
            break  # there is a way, or closer to neighbours there is none either
    assert found is not None
    return found


def _plan(
    arm: Arm, scenes: PhaseScenes, ranked: RankedGrasps, target: Solid, model: ObjectModel, region: Region,
    q_now: Array, fill: float, spots: Sequence[Array] | None, rng: np.random.Generator,
) -> PickPlan | Infeasible:  # fmt: skip
    """`plan_pick_place`, at one distance from neighbours."""
    config, X_WO = scenes.config, target.X_WS
    candidates = len(ranked.grasps) + sum(count for _, count in ranked.rejected_by)
    rejected: Counter[str] = Counter()
    fates: dict[int, str] = {}

    def counts() -> tuple[tuple[str, int], ...]:
        return (*ranked.rejected_by, *sorted(rejected.items()))

    if not scenes.around.is_free(q_now):
        cause = "start_in_collision" + met(scenes.around, q_now[None])
        rejected[cause] += len(ranked.grasps)
        considered = _considered(ranked, dict.fromkeys(range(len(ranked.grasps)), cause))
        return Infeasible("start_in_collision", candidates, counts(), considered)
    if spots is not None and not len(spots) and ranked.grasps:
        rejected["no_place"] += len(ranked.grasps)
        considered = _considered(ranked, dict.fromkeys(range(len(ranked.grasps)), "no_place"))
        return Infeasible("no_place", candidates, counts(), considered)
    furthest = "no_grasp"

    def given_up(i: int, why: GivenUp) -> None:
        nonlocal furthest
        rejected[why.cause] += 1
        fates[i] = why.cause
        furthest = max(furthest, why.stage, key=REASONS.index)

    def ways() -> Iterator[tuple[int, PickWay, list[PlaceWay]]]:
        """Index of a grasp, and how to pick with it and let go; at last those that let fall from high above."""
        falling: list[tuple[int, PickWay, list[PlaceWay]]] = []
        sought = 0
        for i in _examined(len(ranked.grasps), config.grasps):
            if sought == config.places:
                break
            gap = float(ranked.gaps[i])
            try:
                pick = _find_pick(arm, scenes, target, ranked.X_WGs[i], gap, ranked.grasps[i].width, q_now)
                sought += 1
                release = release_gap(model, inverse(pick.X_WG) @ X_WO, gap, config.release_clearance)
                openings = (release, min(release, gap + config.release))
                if spots is None:
                    places = places_over(arm, scenes, pick, target, region, fill, openings, rng)
                else:
                    places = places_at(arm, scenes, pick, target, spots, openings)
            except GivenUp as why:
                given_up(i, why)
                continue
            if places[0].fall <= config.gentle:
                yield i, pick, places
            else:
                falling.append((i, pick, places))
        yield from falling

    for i, pick, places in itertools.islice(ways(), config.searches):
        grasp, gap = ranked.grasps[i], float(ranked.gaps[i])
        try:
            motions = _connect(scenes, pick, places, target, q_now, gap, int(rng.integers(2**31)))
        except GivenUp as why:
            given_up(i, why)
            continue
        place, pick_motion, place_motion = motions
        load = Load(grasp.width, DEFAULT_MASS if model.mass is None else model.mass)
        return PickPlan(
            grasp=grasp,
            X_WG=readonly(pick.X_WG),
            pick=dataclasses.replace(pick_motion, load=load),
            place=dataclasses.replace(place_motion, load=load),
            X_WG_place=readonly(place.X_WG),
            X_WO_place=readonly(place.X_WO),
            grasp_candidates=candidates,
            rejected_by=counts(),
            candidates=_considered(ranked, fates | {i: "chosen"}),
        )
    return Infeasible(furthest, candidates, counts(), _considered(ranked, fates))


def _considered(ranked: RankedGrasps, fates: Mapping[int, str]) -> GraspCandidates:
    """What there was to choose from. fates: what became of grasps that were looked at, by their rank."""
    return GraspCandidates(
        X_WGs=readonly(np.concatenate([ranked.X_WGs, ranked.X_WDs])),
        fates=(*(fates.get(i, "") for i in range(len(ranked.grasps))), *ranked.causes),
        scores=ranked.scores,
    )


def _examined(count: int, limit: int) -> list[int]:
    """Which of `count` ranked grasps to look at: the best ones, then some spread over the rest.

    Grasps next to each other in rank are alike, and so are the reasons why they fail.
    """
    if count <= limit:
        return list(range(count))
    best = 2 * limit // 3
    return [*range(best), *np.linspace(best, count - 1, limit - best).round().astype(int).tolist()]


def _find_pick(
    arm: Arm, scenes: PhaseScenes, target: Solid, X_WG: Array, gap: float, width: float, q_now: Array
) -> PickWay:
    """Reach and lift of one grasp, in the first arm configuration that allows both."""
    config = scenes.config
    around, close, gripped = scenes.around.with_gap(gap), scenes.close.with_gap(gap), scenes.close.with_gap(width)
    if not arm.reaches(X_WG):
        raise GivenUp("out_of_reach")
    found = GivenUp("ik")
    for X in (X_WG, half_turn(X_WG)):
        qs = arm.solutions(X, near=q_now, count=12)
        if not len(qs):
            continue
        free = close.free_many(qs)
        if not free.any() and found.stage == "ik":
            found = GivenUp("grasp_collision", "grasp_collision" + met(close, qs))
        held = None
        for q in qs[free][:3]:
            ways = cartesian_path(arm, X, X @ along_x(-config.approach), q)
            reach = first_free(close, ways, around)
            if reach is None:
                if REASONS.index(found.stage) < REASONS.index("reach"):
                    body = (met(close, ways[0]) or met(around, ways[0][-1:])) if len(ways) else ""
                    found = GivenUp("reach", "reach" + body)
                continue
            if found.stage != "lift":
                found = GivenUp("lift")
            held = held or scenes.cleared.holding(target.hulls, inverse(X) @ target.X_WS).with_gap(width)
            for height in config.lifts:
                for lift in cartesian_path(arm, X, shifted(X, np.array([0, 0, height])), q, count=2):
                    if scenes.lifts(held, lift) and gripped.path_free(lift, 0.01):
                        return PickWay(X, reach[::-1], lift, held)
                    if found.cause == "lift":
                        found = GivenUp("lift", "lift" + (met(held, lift[:0:-1]) or met(gripped, lift)))
    raise found


def _connect(
    scenes: PhaseScenes, pick: PickWay, places: Sequence[PlaceWay], target: Solid, q_now: Array, gap: float, seed: int
) -> tuple[PlaceWay, Motion, Motion]:
    """Searches the three paths around things, and times everything."""
    config = scenes.config
    around = scenes.around.with_gap(gap)
    approach = plan_path(around, q_now, pick.reach[:1], seed=seed, budget=config.budget)
    if isinstance(approach, NoPath):
        raise GivenUp("no_path_to_pregrasp")
    releases = np.array([place.first for place in places])
    transport = plan_path(pick.held, pick.lift[-1], releases, seed=seed, budget=config.budget)
    if isinstance(transport, NoPath):
        raise GivenUp("no_path_to_place")
    place = places[transport.goal]
    cleared = scenes.cleared if place.lower is None else scenes.moved(dataclasses.replace(target, X_WS=place.X_WO))
    cleared = cleared.with_gap(place.gap)
    home = nearest_turns(VIEW, place.retreat[-1])
    back = plan_path(cleared, place.retreat[-1], home[None], seed=seed, budget=config.budget)
    if isinstance(back, NoPath):
        raise GivenUp("no_path_home")

    def straight(qs: Array) -> Trajectory:
        return timing.time_curve(qs, speed=config.straight_speed)

    picking = (
        Segment("approach", timed(around, approach.qs, config.speed), gap),
        Segment("reach", straight(pick.reach), gap),
        Segment("close", timing.rest(pick.reach[-1], config.close_time), 0.0),
        Segment("lift", straight(pick.lift), 0.0),
    )
    lowering = () if place.lower is None else (Segment("lower", straight(place.lower), 0.0),)
    placing = (
        Segment("transport", timed(pick.held, transport.qs, config.speed), 0.0),
        *lowering,
        opening(place.retreat[0], place.gap, config),
        Segment("retreat", straight(place.retreat), place.gap),
        Segment("weigh", timing.rest(place.retreat[-1], 2 * STILL), place.gap),
        Segment("return", timed(cleared, back.qs, config.speed), place.gap),
    )
    return place, Motion(0, picking), Motion(1, placing)
