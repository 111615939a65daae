"""One object at a time: what is known of taking it, and a plan for it or the reason why there is none."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sum_drake.explaining import UNEXPLAINED
from sum_drake.geometry import apply, rotation_angle, transform
from sum_drake.grasp_ranking import RankedGrasps, rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates
from sum_drake.hidden import hidden_between
from sum_drake.kinematics import Arm
from sum_drake.lifting import Dragged, dragged
from sum_drake.making_way import been, failed, worn_out
from sum_drake.objects import Catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import unexplained
from sum_drake.picking import Infeasible, PickPlan, plan_pick_place
from sum_drake.placing import PlacingConfig, free_places, is_area
from sum_drake.planning_scene import PlanningScene, solid_of
from sum_drake.prospects import Prospect
from sum_drake.resting import outside
from sum_drake.standing import EXPLAINED, distances, owners, standing_points, thin
from sum_drake.task_config import TaskConfig
from sum_drake.types import LEAVE, Array, Attempt, Immutable, Perception, Region, Track

MARGIN_SHARE, MARGIN_MAX = 0.75, 0.02
"""From a neighbour the arm keeps as much more as this share of its belief is away from its estimate, at most metres."""
NEIGHBOUR_POINTS = 600
"""On the surface of each believed neighbour, that the hand must not touch."""
ROUND = 0.10
"""Height above the table at which a hand that points straight down must reach a place on it, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Now(Immutable):
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
    loose: NDArray[np.bool_]
    """(m,): which of the points no believed object explains."""
    hidden_W: Array
    """(k, 3): where what nothing explains may run on unseen."""


class Attempting:
    """Plans single picks and places on the robot's own model of itself, of the table and of the bins.

    regions: where things may go, by name; "table" is the workspace. goal: label or category -> region name or "leave";
    a label's entry goes before its category's. seed: of every random draw in grasping and planning.
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
        self._placing, self._seed = placing_config or PlacingConfig(), seed

    def now(self, perception: Perception, attempts: Sequence[Attempt], q: Array) -> Now:
        """What is to be known for one decision. q: (8,) measured arm."""
        points_W = standing_points(perception.frame, self._regions["table"], self._config.clear_height)
        believed = tuple(track for track in perception.posterior.tracks if track.accepted)
        off = {track.id: distances(points_W, self._catalogue[track.label], track.X_WO) for track in believed}
        loose = np.all([np.full(len(points_W), True), *(distance > EXPLAINED for distance in off.values())], axis=0)
        bodies = [solid_of(self._catalogue[track.label], track.X_WO) for track in believed]
        hidden_W = unexplained(hidden_between(perception.frame, points_W[loose]), bodies, EXPLAINED)
        return Now(perception, attempts, q, points_W, believed, off, loose, hidden_W)

    def goal_of(self, label: str) -> str:
        """The region that a label belongs in, or "leave"."""
        return region_of(label, self._goal, self._catalogue)

    def refusal(self, now: Now, track: Track, reason: str) -> Attempt:
        """An attempt given up before a grasp was looked at."""
        region = self.goal_of(track.label)
        return Attempt(now.perception.step, track.id, track.label, region, "none", reason, 0, (), None)

    def prospect(self, now: Now, track: Track) -> Prospect:
        """What is known of taking one object, worked out when it is asked for."""
        model = self._catalogue[track.label]
        others = [t for t in now.believed if t.id != track.id]
        kept = thin(np.flatnonzero(now.off[track.id] > EXPLAINED), self._config.max_obstacle_points)
        around_W = np.concatenate([now.points_W[kept], now.hidden_W])
        tried = failed(track.label, now.attempts) if self._config.remember else []

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
                points_W=np.concatenate([around_W, *(points_W for _, points_W in hidden)]),
                table_height=self._regions["table"].floor_height,
                config=self._grasp_config,
                owners=[
                    *owners(others, [now.off[t.id][kept] for t in others], len(kept)),
                    *[UNEXPLAINED] * len(now.hidden_W),
                    *(label for label, points_W in hidden for _ in points_W),
                ],
                reaches=self._arm.reaches,
            )

        def drag() -> tuple[Dragged, ...]:
            neighbours = [(self._catalogue[t.label], t.X_WO) for t in others]
            return dragged(model, track.X_WO, neighbours, self._regions["table"])

        return Prospect(track, around_W, rank, drag)

    def plan(
        self,
        now: Now,
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
            return self.refusal(now, track, "too_many_failures")
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
            fill=self.fill(region, now.attempts),
            spots=self._spots(now, prospect, region, move, for_whom),
            drags=drags,
        )
        if isinstance(plan, Infeasible):
            counts = plan.grasp_candidates, plan.rejected_by
            return Attempt(
                step, track.id, track.label, region, "none", plan.reason, *counts, None, candidates=plan.candidates
            )
        return plan

    def _spots(
        self, now: Now, prospect: Prospect, region: str, move: bool, for_whom: Track | None
    ) -> tuple[Array, ...] | None:
        """Where an object can be set down in a region of the table; None for one that is a bin."""
        table, track = self._regions["table"], prospect.track
        if region != "table" and not is_area(self._regions[region], table):
            return None
        if not prospect.ranked.grasps:
            return ()  # nobody asks where to
        others = [self._surface(t) for t in now.believed if t.id != track.id]
        own = self.goal_of(track.label)
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

    def fill(self, region: str, attempts: Sequence[Attempt]) -> float:
        """How high a bin must be taken to be filled: nobody looks into it."""
        actions = [a.action for a in attempts if a.action is not None and a.region == region]
        placed = sum(action.released and not action.hangs for action in actions)
        return min(placed * self._config.fill_per_object, self._config.fill_max)


def region_of(label: str, goal: Mapping[str, str], catalogue: Catalogue) -> str:
    """Name of the region a label belongs in: by label, else by category, "leave" where the goal has neither."""
    return goal.get(label, goal.get(catalogue[label].category, LEAVE))


def _margin(track: Track) -> float:
    """How far off its estimate an object may be, metres."""
    off = np.linalg.norm(track.belief.X_WOs[:, :3, 3] - track.X_WO[:3, 3], axis=1)
    order = np.argsort(off)
    share = np.cumsum(track.belief.weights[order])
    return min(float(off[order][min(np.searchsorted(share, MARGIN_SHARE), len(off) - 1)]), MARGIN_MAX)


def _same_grasp(X_OG: Array, X_OF: Array) -> bool:
    """Whether two grasps are so alike that if one slipped the other will."""
    near = np.linalg.norm(X_OG[:3, 3] - X_OF[:3, 3]) < 0.015
    return bool(near and rotation_angle(X_OG[:3, :3].T @ X_OF[:3, :3]) < np.radians(25))
