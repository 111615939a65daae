"""What to do next: the sorting task over the belief, as data about goals and regions.

Accepted objects are tried in the order of a policy, until a motion is found for one. Where there is none for any, an
object that is in the way is moved to a free place on the table, or one that cannot be brought to its place as it is
held is set down elsewhere to be grasped anew. Every object that is not attempted is told with what its grasps met.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sum_drake.carrying import plan_carrying_on
from sum_drake.existence import LIKELY
from sum_drake.explaining import parted
from sum_drake.geometry import apply, rotation_angle, transform
from sum_drake.grasp_ranking import RankedGrasps, rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates
from sum_drake.kinematics import Arm
from sum_drake.lifting import LEANS, dragged
from sum_drake.making_way import MOVE, TO_PLACE, been, blockers, failed, moves, nearest, worn_out
from sum_drake.objects import Catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.picking import Infeasible, PickPlan, plan_pick_place
from sum_drake.placing import PlacingConfig, free_places, is_area
from sum_drake.planning_scene import PlanningScene
from sum_drake.prospects import POLICIES, Prospect, surest, why
from sum_drake.resting import outside
from sum_drake.retreat import plan_retreat
from sum_drake.shaking import plan_shaking
from sum_drake.standing import EXPLAINED, distances, not_of, owners, standing_points, table_shown, thin
from sum_drake.types import LEAVE, Array, Attempt, Immutable, Motion, Perception, Region, Track

MARGIN_SHARE, MARGIN_MAX = 0.75, 0.02
"""From a neighbour the arm keeps as much more as this share of its belief is away from its estimate, at most metres."""
NEIGHBOUR_POINTS = 600
"""On the surface of each believed neighbour, that the hand must not touch."""
BELOW = 0.03
"""What lies this much below the table's top has fallen off, metres."""
SHOWN = 0.5
"""Share of the table that must be seen with depth before it counts as clear."""
ROUND = 0.10
"""Height above the table at which a hand that points straight down must reach a place on it, metres."""


@dataclasses.dataclass
class TaskConfig:
    """Choices of the task that are not geometry."""

    policy: str = "most_likely"
    """Which accepted object comes first, one of `prospects.POLICIES`; most_likely is the paper's."""
    max_attempts: int = 3
    """Tries at one label before it is left, until another is brought away; twice as many in all."""
    least_sure: float = 0.2
    """By `surest`, an object that promises less is taken only where nothing can be moved for its sake."""
    max_moves: int = 2
    """Times that an object of one label is moved to make way, or to be grasped anew."""
    max_helpers: int = 3
    """Objects for which such a move is planned after one look."""
    max_looks: int = 3
    """Observations in a row that lead to nothing before the run stops."""
    clear_points: int = 150
    """The table counts as clear with fewer depth pixels than this standing on it."""
    clear_height: float = 0.012
    """What stands less than this above the table is not seen as an object, metres."""
    max_obstacle_points: int = 3000
    """Depth points kept as obstacles."""
    fill_per_object: float = 0.05
    """How much higher the robot takes a region to be filled for each object it has let go there, metres."""
    fill_max: float = 0.16
    """The most it takes a region to be filled, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Pick:
    """Try this now."""

    plan: PickPlan
    track: Track
    region: str
    refused: tuple[Attempt, ...]
    """Better objects that could not be attempted, and why."""
    kind: str = "pick_place"
    """pick_place, or move: to a free place on the table, for the sake of what could not be attempted."""
    why: str = ""
    """Why this, in words."""


@dataclasses.dataclass(frozen=True, eq=False)
class Look:
    """Nothing can be done with this belief; look again."""

    refused: tuple[Attempt, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Stop:
    """The run is over."""

    outcome: str
    """"cleared" or "stopped: <reason>"."""
    refused: tuple[Attempt, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class _Now(Immutable):
    """What one decision goes by."""

    perception: Perception
    attempts: Sequence[Attempt]
    q: Array
    """(8,)."""
    points_W: Array
    """(m, 3): what stands on the table."""
    believed: tuple[Track, ...]
    off: Mapping[int, Array]
    """Track id -> (m,): distance of each point from that object."""


class SortingTask:
    """Decides after every observation; holds the robot's own model of itself, of the table and of the bins.

    regions: where things may go, by name; "table" is the workspace. goal: label or category -> region name or
    "leave"; a label's entry goes before its category's. seed: of every random draw in grasping and planning.
    """

    def __init__(
        self,
        *,
        catalogue: Catalogue,
        arm: Arm,
        scene: PlanningScene,
        regions: Mapping[str, Region],
        goal: Mapping[str, str],
        config: TaskConfig,
        grasp_config: GraspConfig,
        pick_config: PickConfig,
        seed: int,
        placing_config: PlacingConfig | None = None,
    ) -> None:
        self._catalogue, self._arm, self._scene = catalogue, arm, scene
        self._regions, self._goal = dict(regions), dict(goal)
        self._config, self._grasp_config, self._pick_config = config, grasp_config, pick_config
        self._placing = PlacingConfig() if placing_config is None else placing_config
        self._seed = seed

    def decide(self, perception: Perception, attempts: Sequence[Attempt], looks: int, q: Array) -> Pick | Look | Stop:
        """The next thing to do after an observation.

        attempts: everything tried before. looks: observations in a row that led to nothing. q: (8,) measured arm.
        """
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        believed = tuple(track for track in perception.posterior.tracks if track.accepted)
        off = {track.id: distances(points_W, self._catalogue[track.label], track.X_WO) for track in believed}
        now = _Now(perception, attempts, q, points_W, believed, off)
        fallen = [track for track in believed if self._has_fallen(track)]
        wanted = [track for track in believed if not self._is_in_place(track) and track not in fallen]
        choice, refused = self._choose(now, wanted)
        if choice is not None:
            return dataclasses.replace(choice, refused=tuple(refused))
        unexplained = np.ones(len(points_W), dtype=bool)
        for track in believed:
            unexplained &= off[track.id] > EXPLAINED
        count = int(unexplained.sum())
        shown = table_shown(perception.frame, self._regions["table"])
        unseen = [track for track in perception.posterior.tracks if track.seen < perception.step]
        hidden = [track.label for track in unseen if self._may_be_hidden(track, believed)]
        if not wanted and not hidden and shown >= SHOWN and count < self._config.clear_points:
            return Stop("cleared", tuple(self._refusal(now, track, "fell_off") for track in fallen))
        if looks + 1 < self._config.max_looks:
            return Look(tuple(refused))
        refused += [self._refusal(now, track, "fell_off") for track in fallen]
        refused += [self._refusal(now, track, "not_seen") for track in unseen if track.label in hidden]
        if wanted:
            ids = {track.id for track in wanted}
            reasons = ", ".join(f"{a.label} {a.reason}" for a in refused if a.track in ids and not a.why)
            return Stop(f"stopped: no object can be attempted ({reasons})", tuple(refused))
        if shown < SHOWN:
            return Stop(f"stopped: the camera shows depth of {100 * shown:.0f} % of the table", tuple(refused))
        if count >= self._config.clear_points:
            said = f"stopped: {count} depth points stand on the table but no object is believed there"
            return Stop(said, tuple(refused))
        return Stop(f"stopped: {', '.join(hidden)} is believed to be there but cannot be seen", tuple(refused))

    def _may_be_hidden(self, track: Track, believed: Sequence[Track]) -> bool:
        """Whether an object that was not detected, and is not accepted, may be there all the same."""
        rivals = any(track.label == other.label for other in believed)
        return not track.accepted and track.probability >= LIKELY and not rivals and not self._is_in_place(track)

    def _has_fallen(self, track: Track) -> bool:
        """Whether an object lies beside the table, below its top, where nobody can sort it."""
        inside = any(region.holds(track.X_WO[:3, 3]) for region in self._regions.values())
        return not inside and track.X_WO[2, 3] < self._regions["table"].floor_height - BELOW

    def _is_in_place(self, track: Track) -> bool:
        """Whether nothing needs to be done with an object: it is to be left alone, or lies where it belongs."""
        goal = region_of(track.label, self._goal, self._catalogue)
        return goal == LEAVE or self._regions[goal].holds(track.X_WO[:3, 3])

    def _choose(self, now: _Now, wanted: Sequence[Track]) -> tuple[Pick | None, list[Attempt]]:
        """What to do with the objects that are to be brought elsewhere, and all that was given up before."""
        policy = self._config.policy
        prospects = sorted(
            (self._prospect(now, track) for track in wanted),
            key=lambda prospect: (-POLICIES[policy](prospect), prospect.track.id),
        )
        refused: list[Attempt] = []
        stuck: list[tuple[Prospect, Attempt | None]] = []
        unsure = {p.track.id: p for p in prospects if policy == "surest" and surest(p) < self._config.least_sure}
        helped: set[tuple[int, bool]] = set()

        def attempt(prospect: Prospect) -> Pick | None:
            region = region_of(prospect.track.label, self._goal, self._catalogue)
            plan = self._try(now, prospect, region)
            if isinstance(plan, PickPlan):
                words = why(policy, prospect) + _in_the_way_of(prospect.track, refused, now.believed)
                return Pick(plan, prospect.track, region, (), "pick_place", words)
            refused.append(plan)
            stuck.append((prospect, plan))
            return None

        surer = (p for p in prospects if p.track.id not in unsure)
        choice = next((made for made in map(attempt, surer) if made is not None), None)
        if choice is None:
            hopes = [*stuck, *((p, None) for p in unsure.values())]
            choice = self._help(now, hopes, refused, helped, unsure, attempt)
        while choice is None and unsure:
            choice = attempt(unsure.pop(next(iter(unsure))))
        if choice is None:
            choice = self._help(now, stuck, refused, helped, unsure, attempt)
        return choice or self._drag(now, stuck), refused

    def _drag(self, now: _Now, stuck: Sequence[tuple[Prospect, Attempt | None]]) -> Pick | None:
        """Takes what lies under another, where nothing else can be done: what is dragged along is found again.

        The first is the one whose neighbours are likeliest to stay: rather what lies on top than what lies below.
        """
        for prospect, given_up in sorted(stuck, key=lambda one: -one[0].stay):
            if given_up is not None and any(parted(cause)[0] == "lift" for cause, _ in given_up.rejected_by):
                plan = self._try(now, prospect, given_up.region, drags=True)
                if isinstance(plan, PickPlan):
                    words = why(self._config.policy, prospect) + "; as nothing else can be, with what lies on it"
                    return Pick(plan, prospect.track, given_up.region, (), "pick_place", words)
        return None

    def _help(
        self,
        now: _Now,
        stuck: Sequence[tuple[Prospect, Attempt | None]],
        refused: list[Attempt],
        helped: set[tuple[int, bool]],
        untried: dict[int, Prospect],
        attempt: Callable[[Prospect], Pick | None],
    ) -> Pick | None:
        """Moves something for the sake of what cannot, or can hardly, be taken; adds to `refused` what cannot be moved.

        stuck: those objects, best first, and the attempt that was given up, None for those not tried yet. helped: moves
        that were planned before, which are not planned again. untried: objects that, rather than be moved, are brought
        to where they belong, if that works: by `attempt`.
        """
        for prospect, given_up in tuple(stuck):
            for track, words in self._helpers(now, prospect, given_up):
                itself = track.id == prospect.track.id
                if track.id in untried and not itself:
                    choice = attempt(untried.pop(track.id))
                    if choice is not None:
                        return dataclasses.replace(choice, why=f"{choice.why}; {words}")
                if (track.id, itself) in helped or not self._may_move(now, track):
                    continue
                if len(helped) == self._config.max_helpers:
                    return None
                helped.add((track.id, itself))
                region = self._put_aside_in(track)
                for_whom = None if itself else prospect.track
                plan = self._try(now, self._prospect(now, track), region, move=True, for_whom=for_whom)
                if isinstance(plan, PickPlan):
                    return Pick(plan, track, region, (), MOVE, words)
                refused.append(dataclasses.replace(plan, why=words))
        return None

    def _helpers(self, now: _Now, prospect: Prospect, given_up: Attempt | None) -> list[tuple[Track, str]]:
        """What could be moved for the sake of an object, and why: the most promising first."""
        track, found = prospect.track, []
        if given_up is not None and given_up.reason in TO_PLACE:
            said = f"cannot be brought to {given_up.region} as it lies: it is set down to be grasped anew"
            found.append((track, said))
        counts = prospect.ranked.rejected_by if given_up is None else given_up.rejected_by
        met = [
            (t, f"in the way of {count} grasps at {track.label}") for t, count in blockers(track, now.believed, counts)
        ]
        on_it = [nearest(label, track, now.believed) for label, share in prospect.dragged if share <= LEANS]
        leaning = {t.id: f"lies or leans on {track.label}" for t in on_it}
        # What leans on it first; of both, both is told.
        found += [(t, ", ".join([leaning[t.id], *(words for o, words in met if o.id == t.id)])) for t in on_it]
        return found + [(t, words) for t, words in met if t.id not in leaning]

    def _may_move(self, now: _Now, track: Track) -> bool:
        """Whether an object may be moved to make way: not one that is to be left alone, and not too often."""
        leave = region_of(track.label, self._goal, self._catalogue) == LEAVE
        often = len(moves(track.label, now.attempts)) >= self._config.max_moves
        return not (leave or often or worn_out(track.label, now.attempts, self._config.max_attempts))

    def _put_aside_in(self, track: Track) -> str:
        """The region on the table that an object may be set down in for the time being: its own, if it lies there."""
        own = region_of(track.label, self._goal, self._catalogue)
        table = self._regions["table"]
        return own if own != LEAVE and is_area(self._regions[own], table) and self._is_in_place(track) else "table"

    def _refusal(self, now: _Now, track: Track, reason: str) -> Attempt:
        """An attempt given up before a grasp was looked at."""
        region = region_of(track.label, self._goal, self._catalogue)
        return Attempt(now.perception.step, track.id, track.label, region, "none", reason, 0, (), None)

    def _prospect(self, now: _Now, track: Track) -> Prospect:
        """What is known of taking one object, worked out when it is asked for."""
        model = self._catalogue[track.label]
        others = [t for t in now.believed if t.id != track.id]
        kept = thin(np.flatnonzero(now.off[track.id] > EXPLAINED), self._config.max_obstacle_points)
        tried = failed(track.label, now.attempts)

        def rank() -> RankedGrasps:
            every = grasp_candidates(model, config=self._grasp_config, seed=self._seed)
            # Of neighbours the camera shows one side; the hand may be between the others.
            hidden = [(t.label, thin(self._surface(t), NEIGHBOUR_POINTS)) for t in others]
            if worn_out(track.label, now.attempts, self._config.max_attempts):
                every = ()
            return rank_grasps(
                [g for g in every if not any(a.X_OG is not None and _same_grasp(g.X_OG, a.X_OG) for a in tried)],
                model=model,
                X_WO=track.X_WO,
                belief=track.belief,
                points_W=np.concatenate([now.points_W[kept], *(points_W for _, points_W in hidden)]),
                table_height=self._regions["table"].floor_height,
                config=self._grasp_config,
                owners=[
                    *owners(others, [now.off[t.id][kept] for t in others], len(kept)),
                    *(label for label, points_W in hidden for _ in points_W),
                ],
            )

        def drag() -> tuple[tuple[str, float], ...]:
            return dragged(model, track.X_WO, [(self._catalogue[t.label], t.X_WO) for t in others])

        return Prospect(track, now.points_W[kept], rank, drag)

    def _try(
        self,
        now: _Now,
        prospect: Prospect,
        region: str,
        *,
        move: bool = False,
        for_whom: Track | None = None,
        drags: bool = False,
    ) -> PickPlan | Attempt:
        """A plan for one object, or the attempt given up before anything moved.

        move: to set it down where it has not been, out of the way of `for_whom`. drags: as for `plan_pick_place`.
        """
        track, step = prospect.track, now.perception.step
        if worn_out(track.label, now.attempts, self._config.max_attempts):
            return self._refusal(now, track, "too_many_failures")
        model = self._catalogue[track.label]
        others = [t for t in now.believed if t.id != track.id]
        plan = plan_pick_place(
            arm=self._arm,
            scene=self._scene,
            ranked=prospect.ranked,
            X_WO=track.X_WO,
            model=model,
            region=self._regions[region],
            q_now=now.q,
            obstacles=[(self._catalogue[t.label], t.X_WO) for t in others],
            margins=[_margin(t) for t in others],
            points_W=prospect.obstacles_W,
            seed=int(np.random.SeedSequence([self._seed, track.id, step]).generate_state(1)[0]),
            config=self._pick_config,
            fill=self._fill(region, now.attempts),
            spots=self._spots(now, prospect, region, move, for_whom),
            drags=drags,
        )
        if isinstance(plan, Infeasible):
            counts = plan.grasp_candidates, plan.rejected_by
            return Attempt(step, track.id, track.label, region, "none", plan.reason, *counts, None)
        return plan

    def _spots(
        self, now: _Now, prospect: Prospect, region: str, move: bool, for_whom: Track | None
    ) -> tuple[Array, ...] | None:
        """Where an object can be set down in a region of the table; None for one that is a bin."""
        table, track = self._regions["table"], prospect.track
        if region != "table" and not is_area(self._regions[region], table):
            return None
        if not prospect.ranked.grasps:
            return ()  # nobody asks where to
        others = [self._surface(t) for t in now.believed if t.id != track.id]
        own = region_of(track.label, self._goal, self._catalogue)
        areas = (name for name, r in self._regions.items() if name not in ("table", own, region) and is_area(r, table))
        return free_places(
            self._catalogue[track.label],
            track.X_WO,
            region=self._regions[region],
            table=table,
            taken_W=np.concatenate([prospect.obstacles_W, *others]),
            config=self._placing,
            aside_of_W=None if for_whom is None else self._surface(for_whom),
            avoid=[self._regions[name] for name in areas],
            been_W=[track.X_WO[:3, 3], *been(track.label, now.attempts)] if move else [],
            within_reach=self._within_reach,
        )

    def _surface(self, track: Track) -> Array:
        return apply(track.X_WO, outside(self._catalogue[track.label]))

    def _within_reach(self, X_WO: Array) -> bool:
        """Whether the hand, pointing down, reaches a place on the table."""
        down = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
        height = self._regions["table"].floor_height + ROUND
        return self._arm.reaches(transform(down, np.array([*X_WO[:2, 3], height])))

    def _fill(self, region: str, attempts: Sequence[Attempt]) -> float:
        """How high a bin must be taken to be filled: nobody looks into it."""
        actions = [a.action for a in attempts if a.action is not None and a.region == region]
        placed = sum(action.released and not action.hangs for action in actions)
        return min(placed * self._config.fill_per_object, self._config.fill_max)

    def retreat(self, perception: Perception, q: Array, motion: int) -> Motion:
        """From where the arm is, (8,), back to the viewing pose with an open hand, under the given motion id.

        Goes around what was last seen. What was pushed about since then may be anywhere, the hand itself may stand
        where something was: where that leaves no way, only table, bins and robot count. Raises RuntimeError where even
        then there is none.
        """
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        seen = [(self._catalogue[t.label], t.X_WO) for t in perception.posterior.tracks if t.accepted]
        plan = functools.partial(
            plan_retreat,
            arm=self._arm,
            scene=self._scene,
            q_now=q,
            motion_id=motion,
            seed=int(np.random.SeedSequence([self._seed, motion]).generate_state(1)[0]),
            config=self._pick_config,
        )
        try:
            return plan(obstacles=seen, points_W=thin(points_W, self._config.max_obstacle_points))
        except RuntimeError:
            return plan()

    def carry_on(self, perception: Perception, pick: Pick, q: Array, motion: int) -> Motion:
        """From where the arm was stopped, (8,), with the object of `pick` in its hand, to where it is let go.

        Raises RuntimeError where there is no free way.
        """
        model = self._catalogue[pick.track.label]
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        points_W = not_of(points_W, model, pick.track.X_WO)
        others = [t for t in perception.posterior.tracks if t.accepted and t.id != pick.track.id]
        return plan_carrying_on(
            arm=self._arm,
            scene=self._scene,
            plan=pick.plan,
            X_WO=pick.track.X_WO,
            model=model,
            q_now=q,
            motion_id=motion,
            seed=int(np.random.SeedSequence([self._seed, motion]).generate_state(1)[0]),
            config=self._pick_config,
            obstacles=[(self._catalogue[t.label], t.X_WO) for t in others],
            points_W=thin(points_W, self._config.max_obstacle_points),
        )

    def shake(self, perception: Perception, pick: Pick, q: Array, motion: int, times: int) -> Motion:
        """From where the arm is, (8,), with the object of `pick` on its opened hand, to where it was to be, and back.

        times: how often that was tried before. Raises RuntimeError where there is no free way.
        """
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        points_W = not_of(points_W, self._catalogue[pick.track.label], pick.track.X_WO)
        others = [t for t in perception.posterior.tracks if t.accepted and t.id != pick.track.id]
        return plan_shaking(
            arm=self._arm,
            scene=self._scene,
            plan=pick.plan,
            q_now=q,
            motion_id=motion,
            times=times,
            seed=int(np.random.SeedSequence([self._seed, motion]).generate_state(1)[0]),
            config=self._pick_config,
            obstacles=[(self._catalogue[t.label], t.X_WO) for t in others],
            points_W=thin(points_W, self._config.max_obstacle_points),
        )


def region_of(label: str, goal: Mapping[str, str], catalogue: Catalogue) -> str:
    """Name of the region a label belongs in: by label, else by category, "leave" where the goal has neither."""
    return goal.get(label, goal.get(catalogue[label].category, LEAVE))


def _margin(track: Track) -> float:
    """How far off its estimate an object may be, metres."""
    off = np.linalg.norm(track.belief.X_WOs[:, :3, 3] - track.X_WO[:3, 3], axis=1)
    order = np.argsort(off)
    share = np.cumsum(track.belief.weights[order])
    return min(float(off[order][min(np.searchsorted(share, MARGIN_SHARE), len(off) - 1)]), MARGIN_MAX)


def _in_the_way_of(track: Track, refused: Sequence[Attempt], believed: Sequence[Track]) -> str:
    """Whom it is in the way of, among those that were refused before it, in words; "" if of nobody."""
    found = []
    for given_up in refused:
        wanted = next(t for t in believed if t.id == given_up.track)
        met = blockers(wanted, believed, given_up.rejected_by)
        found += [f"{count} grasps at {wanted.label}" for blocker, count in met if blocker.id == track.id]
    return f"; it is in the way of {', '.join(found)}" if found else ""


def _same_grasp(X_OG: Array, X_OF: Array) -> bool:
    """Whether two grasps are so alike that if one slipped the other will."""
    near = np.linalg.norm(X_OG[:3, 3] - X_OF[:3, 3]) < 0.015
    return bool(near and rotation_angle(X_OG[:3, :3].T @ X_OF[:3, :3]) < np.radians(25))
