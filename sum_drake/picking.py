"""How to take an object from the table and put it somewhere: grasp, inverse kinematics, paths, timing.

A pick is approach (around everything, to a pose short of the grasp), reach (straight along the hand's approach axis),
close, lift (straight up). A place is transport (around everything, with the object in the hand), open (as wide as
object and place allow, so that what sits tighter than was believed comes loose too), retreat (straight back along the
approach axis, so that nothing stays hooked over a finger), return (around everything, to the viewing pose). What is
set down on the table, rather than let go over a bin, is first lowered straight from a little above its place.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence

import numpy as np

from sum_drake import timing
from sum_drake.geometry import apply, inverse, rotation_from_vector, shifted
from sum_drake.grasp_ranking import DEFAULT_MASS, RankedGrasps
from sum_drake.grasping import half_turn, surface
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.motion import NoPath, cartesian_path, plan_path, seconds
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import PhaseScenes, opening, timed
from sum_drake.planning_scene import SPACE, PlanningScene, Solid, solid_of
from sum_drake.robot import HAND, VIEW
from sum_drake.types import Array, Grasp, Immutable, Load, Motion, Region, Segment, Trajectory, readonly

REASONS = (
    "no_grasp", "start_in_collision", "out_of_reach", "ik", "grasp_collision", "reach", "lift", "no_place",
    "place_out_of_reach", "place_ik", "place_collision", "no_path_to_pregrasp", "no_path_to_place", "no_path_home",
)  # fmt: skip
"""Why nothing can be done, and, but for the first two, how far a grasp got, in the order of the tests:

no_grasp: no candidate came out of the ranking; start_in_collision: the arm, where it is, touches something;
out_of_reach: the arm is too short; ik: it is not, but cannot put the hand there; grasp_collision: something other than
the object is in the way at the grasp; reach: no straight free way from short of the grasp to it; lift: no straight free
way up; no_place: no spot of the table's region is free; place_out_of_reach, place_ik, place_collision: the arm cannot
hold the object over the region, or something is in the way; no_path_to_pregrasp, no_path_to_place, no_path_home: the
search for a free path was given up. start_in_collision, grasp_collision, reach, lift and place_collision are counted as
CAUSE_BODY, the body that is met, where there is one.
"""


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


@dataclasses.dataclass(frozen=True, eq=False)
class Infeasible(Immutable):
    """Nothing was found."""

    reason: str
    """One of REASONS: the furthest that any grasp got."""
    grasp_candidates: int
    rejected_by: tuple[tuple[str, int], ...]


@dataclasses.dataclass(frozen=True, eq=False)
class _Pick:
    """Joint paths of one way to pick."""

    X_WG: Array
    reach: Array
    """(k, 8) from short of the grasp to it."""
    lift: Array
    """(k, 8) from the grasp upwards."""
    held: PlanningScene
    """With the object in the hand."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Place:
    """One way to let go."""

    X_WG: Array
    X_WO: Array
    gap: float
    """Distance between the fingers once they have let go."""
    retreat: Array
    """(k, 8) from the release backwards."""
    lower: Array | None
    """(k, 8) from above the place to it; None where the object is let go above it."""

    @property
    def first(self) -> Array:
        """(8,): where the arm must bring the object."""
        return np.asarray(self.retreat[0] if self.lower is None else self.lower[0])


class _GivenUp(Exception):
    """A grasp fell through: `stage` is one of REASONS, `cause` what it is counted as."""

    def __init__(self, stage: str, cause: str | None = None) -> None:
        super().__init__(stage)
        self.stage, self.cause = stage, cause or stage


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
    points_W: Array | None = None,
    seed: int,
    config: PickConfig,
    fill: float = 0.0,
    spots: Sequence[Array] | None = None,
) -> PickPlan | Infeasible:
    """The first of the ranked grasps that can be picked, carried to the region and let go, with its motions.

    scene: robot and furniture. X_WO: (4, 4), of the object to move. q_now: (8,). obstacles: the other believed objects
    and their poses. points_W: (m, 3) depth points that are not of the object. fill: how high the region is known to be
    filled, metres above its floor. spots: (4, 4) poses to set the object down at, instead of letting it go anywhere
    over the region. A function of its arguments; 2 to 3 CPU seconds.

    The hand was tested against points_W when the grasps were ranked, so close to the grasp only furniture and the
    hulls of other objects count; everything counts while the arm goes around things.
    """
    target = solid_of(model, X_WO)
    others = [solid_of(other, X) for other, X in obstacles]
    points = np.empty((0, 3)) if points_W is None else points_W
    scenes = PhaseScenes.make(scene, target, others, points, config)
    rng = np.random.default_rng(seed)
    candidates = len(ranked.grasps) + sum(count for _, count in ranked.rejected_by)
    rejected: Counter[str] = Counter()

    def counts() -> tuple[tuple[str, int], ...]:
        return (*ranked.rejected_by, *sorted(rejected.items()))

    if not scenes.around.is_free(q_now):
        rejected["start_in_collision" + _met(scenes.around, q_now[None])] += len(ranked.grasps)
        return Infeasible("start_in_collision", candidates, counts())
    if spots is not None and not len(spots) and ranked.grasps:
        rejected["no_place"] += len(ranked.grasps)
        return Infeasible("no_place", candidates, counts())
    furthest, searches = "no_grasp", 0
    for i in _examined(len(ranked.grasps), config.grasps):
        grasp, gap = ranked.grasps[i], float(ranked.gaps[i])
        try:
            pick = _find_pick(arm, scenes, target, ranked.X_WGs[i], gap, grasp.width, q_now)
            searches += 1
            release = release_gap(model, inverse(pick.X_WG) @ X_WO, gap, config.release_clearance)
            openings = (release, min(release, gap + config.release))
            if spots is None:
                places = _find_places(arm, scenes, pick, target, region, fill, openings, rng)
            else:
                places = _find_spots(arm, scenes, pick, target, spots, openings)
            motions = _connect(scenes, pick, places, target, q_now, gap, int(rng.integers(2**31)))
        except _GivenUp as given_up:
            rejected[given_up.cause] += 1
            furthest = max(furthest, given_up.stage, key=REASONS.index)
            if searches >= config.searches:
                break
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
        )
    return Infeasible(furthest, candidates, counts())


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
) -> _Pick:
    """Reach and lift of one grasp, in the first arm configuration that allows both."""
    config = scenes.config
    around, close, gripped = scenes.around.with_gap(gap), scenes.close.with_gap(gap), scenes.close.with_gap(width)
    if not arm.reaches(X_WG):
        raise _GivenUp("out_of_reach")
    found = _GivenUp("ik")
    for X in (X_WG, half_turn(X_WG)):
        qs = arm.solutions(X, near=q_now, count=12)
        if not len(qs):
            continue
        free = close.free_many(qs)
        if not free.any() and found.stage == "ik":
            found = _GivenUp("grasp_collision", "grasp_collision" + _met(close, qs))
        held = None
        for q in qs[free][:3]:
            ways = cartesian_path(arm, X, X @ _along_x(-config.approach), q)
            reach = _first_free(close, ways, around)
            if reach is None:
                if REASONS.index(found.stage) < REASONS.index("reach"):
                    met = (_met(close, ways[0]) or _met(around, ways[0][-1:])) if len(ways) else ""
                    found = _GivenUp("reach", "reach" + met)
                continue
            if found.stage != "lift":
                found = _GivenUp("lift")
            held = held or scenes.cleared.holding(target.hulls, inverse(X) @ target.X_WS).with_gap(width)
            for height in config.lifts:
                for lift in cartesian_path(arm, X, shifted(X, np.array([0, 0, height])), q, count=2):
                    if _clears(held, lift) and gripped.path_free(lift, 0.01):
                        return _Pick(X, reach[::-1], lift, held)
                    if found.cause == "lift":
                        found = _GivenUp("lift", "lift" + (_met(held, lift[:0:-1]) or _met(gripped, lift)))
    raise found


def _met(scene: PlanningScene, qs: Array) -> str:
    """_BODY, of the first thing that is touched in qs (n, 8); "" where none is."""
    pairs = next((pairs for pairs in map(scene.colliding_pairs, qs) if pairs), ())
    return f"_{pairs[0][1]}" if pairs else ""


def _clears(held: PlanningScene, lift: Array) -> bool:
    """Whether a held object, which at first touches what it stood on, comes clear of everything and stays clear."""
    free = held.free_many(lift)
    return bool(free[-1] and free[free.argmax() :].all())


def _first_free(along: PlanningScene, paths: Array, at_end: PlanningScene) -> Array | None:
    """The first of paths (n, k, 8) that is free on its way and, in another scene, at its end."""
    return next((path for path in paths if at_end.is_free(path[-1]) and along.path_free(path, 0.01)), None)


def _find_places(
    arm: Arm, scenes: PhaseScenes, pick: _Pick, target: Solid, region: Region, fill: float, gaps: Sequence[float],
    rng: np.random.Generator,
) -> list[_Place]:  # fmt: skip
    """Up to three ways to let go of the object over the region, at the lowest height where there is one.

    gaps: to open the fingers to; the first that the place allows is taken.
    """
    config = scenes.config
    p_OQs, q_lift = np.concatenate(target.hulls), pick.lift[-1]
    X_GO = inverse(pick.X_WG) @ target.X_WS
    # Turned as if the arm carried the object around the shoulder, and by multiples of 30 degrees from there.
    X_WO_lift = arm.forward(q_lift) @ X_GO
    turn = np.arctan2(region.p_W[1], region.p_W[0]) - np.arctan2(X_WO_lift[1, 3], X_WO_lift[0, 3])
    spots = np.array([(x, y) for x in (-0.7, 0.0, 0.7) for y in (-0.7, 0.0, 0.7)])[rng.permutation(9)][:3]
    stage = cause = "place_out_of_reach"
    for height in config.release_heights:
        options: list[tuple[float, Array, Array, Array]] = []
        for yaw in turn + np.arange(-5, 7) * np.pi / 6:
            R_WO = rotation_from_vector(np.array([0, 0, yaw])) @ X_WO_lift[:3, :3]
            corners = p_OQs @ R_WO.T
            low, high = corners.min(0), corners.max(0)
            room = np.maximum(region.half_extents - (high - low) / 2 - 0.02, 0.0)
            for spot in spots:
                X_WO = np.eye(4)
                X_WO[:3, :3] = R_WO
                X_WO[:2, 3] = region.p_W[:2] + spot * room[:2] - (low + high)[:2] / 2
                X_WO[2, 3] = region.floor_height + fill + height - low[2]
                X_WG = X_WO @ inverse(X_GO)
                if not arm.reaches(X_WG):
                    continue
                if stage == "place_out_of_reach":
                    stage = cause = "place_ik"
                options += _ways_to_hold(arm, X_WG, X_WO, q_lift)
        options.sort(key=lambda option: option[0])
        if not options:
            continue
        qs = np.array([q for _, q, _, _ in options[:60]])
        free = pick.held.free_many(qs)
        if stage != "place_collision":
            stage, cause = "place_collision", "place_collision" + _met(pick.held, qs[np.flatnonzero(~free)[:1]])
        places: list[_Place] = []
        for k in np.flatnonzero(free):
            _, q, X_WG, X_WO = options[k]
            place = _let_go(arm, scenes, X_WG, X_WO, q, gaps)
            if place is not None:
                places.append(place)
            if len(places) == 3:
                break
        if places:
            return places
    raise _GivenUp(stage, cause)


def _ways_to_hold(arm: Arm, X_WG: Array, X_WO: Array, q_lift: Array) -> list[tuple[float, Array, Array, Array]]:
    """Up to two (seconds on the way there and home, q, X_WG, X_WO)."""
    qs = arm.solutions(X_WG, near=q_lift, count=2, thorough=False)
    return [(seconds(np.stack([q_lift, q, nearest_turns(VIEW, q)]), SPACE), q, X_WG, X_WO) for q in qs]


def _find_spots(
    arm: Arm, scenes: PhaseScenes, pick: _Pick, target: Solid, spots: Sequence[Array], gaps: Sequence[float]
) -> list[_Place]:
    """Up to three ways to set the object down at one of the spots, X_WO (4, 4), of those that are soon reached."""
    config = scenes.config
    X_GO = inverse(pick.X_WG) @ target.X_WS
    # Close to the table, which it is to rest on.
    held = scenes.close.holding(target.hulls, X_GO).with_gap(pick.held.gap)
    X_WGs = [X_WO @ inverse(X_GO) for X_WO in spots]
    stage = "place_ik" if any(map(arm.reaches, X_WGs)) else "place_out_of_reach"
    options = [
        option
        for X_WG, X_WO in zip(X_WGs, spots, strict=True)
        for option in _ways_to_hold(arm, X_WG, X_WO, pick.lift[-1])
    ]
    if not options:
        raise _GivenUp(stage)
    options.sort(key=lambda option: option[0])
    qs = np.array([q for _, q, _, _ in options])
    free = held.free_many(qs)
    places: list[_Place] = []
    for k in np.flatnonzero(free):
        _, q, X_WG, X_WO = options[k]
        above = cartesian_path(arm, X_WG, shifted(X_WG, np.array([0.0, 0.0, config.lower])), q)
        lower = _first_free(held, above, pick.held)
        place = None if lower is None else _let_go(arm, scenes, X_WG, X_WO, q, gaps)
        if lower is not None and place is not None:
            places.append(dataclasses.replace(place, lower=lower[::-1]))
        if len(places) == 3:
            break
    if not places:
        raise _GivenUp("place_collision", "place_collision" + _met(held, qs[np.flatnonzero(~free)[:1]]))
    return places


def _let_go(arm: Arm, scenes: PhaseScenes, X_WG: Array, X_WO: Array, q: Array, gaps: Sequence[float]) -> _Place | None:
    """The widest opening and the longest retreat that are free with the object released at X_WO."""
    config = scenes.config
    retreats = [cartesian_path(arm, X_WG, X_WG @ _along_x(-length), q) for length in config.retreats]
    for gap in dict.fromkeys(gaps):
        opened, cleared = scenes.close.with_gap(gap), scenes.cleared.with_gap(gap)
        for paths in retreats:
            retreat = _first_free(opened, paths, cleared)
            if retreat is not None:
                return _Place(X_WG, X_WO, gap, retreat, None)
    return None


def release_gap(model: ObjectModel, X_GO: Array, gap: float, clearance: float) -> float:
    """How far fingers `gap` apart can open around an object at X_GO (4, 4), then draw back along -x, metres.

    HAND.gap_max, unless parts of the object lie beyond a finger: one inside a mug must not press on the far wall.
    """
    x, y, z = apply(X_GO, surface(model, 0.003).p_OQs).T
    y = np.abs(y)
    beyond = (x < HAND.pad_x[1] + clearance) & (np.abs(z) < HAND.pad_half_width + clearance) & (y > gap / 2)
    room = y[beyond].min(initial=np.inf) - HAND.pad_thickness - clearance
    return float(np.clip(2 * room, gap, HAND.gap_max))


def _connect(
    scenes: PhaseScenes, pick: _Pick, places: Sequence[_Place], target: Solid, q_now: Array, gap: float, seed: int
) -> tuple[_Place, Motion, Motion]:
    """Searches the three paths around things, and times everything."""
    config = scenes.config
    around = scenes.around.with_gap(gap)
    approach = plan_path(around, q_now, pick.reach[:1], seed=seed, budget=config.budget)
    if isinstance(approach, NoPath):
        raise _GivenUp("no_path_to_pregrasp")
    releases = np.array([place.first for place in places])
    transport = plan_path(pick.held, pick.lift[-1], releases, seed=seed, budget=config.budget)
    if isinstance(transport, NoPath):
        raise _GivenUp("no_path_to_place")
    place = places[transport.goal]
    cleared = scenes.cleared if place.lower is None else scenes.moved(dataclasses.replace(target, X_WS=place.X_WO))
    cleared = cleared.with_gap(place.gap)
    home = nearest_turns(VIEW, place.retreat[-1])
    back = plan_path(cleared, place.retreat[-1], home[None], seed=seed, budget=config.budget)
    if isinstance(back, NoPath):
        raise _GivenUp("no_path_home")

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
        Segment("return", timed(cleared, back.qs, config.speed), place.gap),
    )
    return place, Motion(0, picking), Motion(1, placing)


def _along_x(distance: float) -> Array:
    return shifted(np.eye(4), np.array([distance, 0.0, 0.0]))
