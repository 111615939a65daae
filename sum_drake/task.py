"""What to do next: the sorting task over the belief, as data about goals and regions.

Accepted objects are tried in the order of a policy, until a motion is found for one; of those that it holds to be worth
trying, those last whose neighbours lean on them so near to an edge that they might fall off the table. Where there is
none for any, an object that is in the way is moved to a free place on the table, or one that cannot be brought to its
place as it is held is set down elsewhere to be grasped anew. Where that helps nothing either, what lies under another
is pulled out, once nothing that stands there is left unexplained. Every object that is not attempted is told with what
its grasps met.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

from sum_drake.attempting import Attempting, Now
from sum_drake.existence import LIKELY
from sum_drake.explaining import parted
from sum_drake.lifting import LEANS
from sum_drake.making_way import MOVE, TO_PLACE, blockers, moves, nearest, worn_out
from sum_drake.picking import PickPlan
from sum_drake.placing import is_area
from sum_drake.prospects import Prospect, in_order, passed_over, surest, why
from sum_drake.standing import table_shown
from sum_drake.task_config import TaskConfig
from sum_drake.types import LEAVE, Array, Attempt, Perception, Region, Track

BELOW = 0.03
"""What lies this much below the table's top has fallen off, metres."""
SHOWN = 0.5
"""Share of the table that must be seen with depth before it counts as clear."""


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


class SortingTask:
    """Decides after every observation.

    attempting: the robot's planner of single picks. regions: where things may go, by name; "table" is the workspace.
    """

    def __init__(self, attempting: Attempting, *, regions: Mapping[str, Region], config: TaskConfig) -> None:
        self._attempting, self._regions, self._config = attempting, dict(regions), config

    def decide(self, perception: Perception, attempts: Sequence[Attempt], looks: int, q: Array) -> Pick | Look | Stop:
        """The next thing to do after an observation.

        attempts: everything tried before. looks: observations in a row that led to nothing. q: (8,) measured arm.
        """
        now = self._attempting.now(perception, attempts, q)
        believed = now.believed
        fallen = [track for track in believed if self._has_fallen(track)]
        wanted = [track for track in believed if not self._is_in_place(track) and track not in fallen]
        choice, refused, stuck = self._choose(now, wanted)
        count, may_look = int(now.loose.sum()), looks + 1 < self._config.max_looks
        if choice is None and not (may_look and count >= self._config.clear_points):
            # What is not believed yet, and may be on top, would be dragged along.
            choice = self._drag(now, stuck)
        if choice is not None:
            return dataclasses.replace(choice, refused=tuple(refused))
        shown = table_shown(perception.frame, self._regions["table"])
        unseen = [track for track in perception.posterior.tracks if track.seen < perception.step]
        hidden = [track.label for track in unseen if self._may_be_hidden(track, believed)]
        if not wanted and not hidden and shown >= SHOWN and count < self._config.clear_points:
            return Stop("cleared", tuple(self._attempting.refusal(now, track, "fell_off") for track in fallen))
        if may_look:
            return Look(tuple(refused))
        refused += [self._attempting.refusal(now, track, "fell_off") for track in fallen]
        refused += [self._attempting.refusal(now, track, "not_seen") for track in unseen if track.label in hidden]
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
        goal = self._attempting.goal_of(track.label)
        return goal == LEAVE or self._regions[goal].holds(track.X_WO[:3, 3])

    def _choose(
        self, now: Now, wanted: Sequence[Track]
    ) -> tuple[Pick | None, list[Attempt], list[tuple[Prospect, Attempt | None]]]:
        """What to do with the objects that are to be brought elsewhere, all that was given up before, and for which."""
        policy = self._config.policy
        promised = (self._attempting.prospect(now, track) for track in wanted)
        prospects = in_order(promised, policy, spare_neighbours=self._config.spare_neighbours)
        refused: list[Attempt] = []
        stuck: list[tuple[Prospect, Attempt | None]] = []
        unsure = {p.track.id: p for p in prospects if policy == "surest" and surest(p) < self._config.least_sure}
        helped: set[tuple[int, bool]] = set()

        def attempt(prospect: Prospect) -> Pick | None:
            region = self._attempting.goal_of(prospect.track.label)
            plan = self._attempting.plan(now, prospect, region)
            if isinstance(plan, PickPlan):
                words = why(policy, prospect) + _in_the_way_of(prospect.track, refused, now.believed)
                tried = {one.track.id for one, _ in stuck}
                words += passed_over(prospect, [one for one in prospects if one.track.id not in tried], policy)
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
        return choice, refused, stuck

    def _drag(self, now: Now, stuck: Sequence[tuple[Prospect, Attempt | None]]) -> Pick | None:
        """Takes what lies under another, where nothing else can be done: what is dragged along is found again.

        It is set down elsewhere on the table, if that can be done: what it drags along stays there, too, rather than to
        end in a bin or beside it. The first is the one whose neighbours are likeliest to stay: rather what lies on top
        than what lies below.
        """
        under = [
            (prospect, given_up)
            for prospect, given_up in sorted(stuck, key=lambda one: -one[0].stay)
            if given_up is not None and any(parted(cause)[0] == "lift" for cause, _ in given_up.rejected_by)
        ]
        aside = [(one, self._put_aside_in(one.track), MOVE) for one, _ in under if self._may_move(now, one.track)]
        away = [(one, given_up.region, "pick_place") for one, given_up in under]
        for prospect, region, kind in (*aside, *away):
            plan = self._attempting.plan(now, prospect, region, move=kind == MOVE, drags=True)
            if isinstance(plan, PickPlan):
                words = why(self._config.policy, prospect) + "; as nothing else can be, with what lies on it"
                return Pick(plan, prospect.track, region, (), kind, words)
        return None

    def _help(
        self,
        now: Now,
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
                plan = self._attempting.plan(
                    now, self._attempting.prospect(now, track), region, move=True, for_whom=for_whom
                )
                if isinstance(plan, PickPlan):
                    return Pick(plan, track, region, (), MOVE, words)
                refused.append(dataclasses.replace(plan, why=words))
        return None

    def _helpers(self, now: Now, prospect: Prospect, given_up: Attempt | None) -> list[tuple[Track, str]]:
        """What could be moved for the sake of an object, and why: the most promising first."""
        track, found = prospect.track, []
        if given_up is not None and given_up.reason in TO_PLACE:
            said = f"cannot be brought to {given_up.region} as it lies: it is set down to be grasped anew"
            found.append((track, said))
        counts = prospect.ranked.rejected_by if given_up is None else given_up.rejected_by
        met = [
            (t, f"in the way of {count} grasps at {track.label}") for t, count in blockers(track, now.believed, counts)
        ]
        on_it = [nearest(one.label, track, now.believed) for one in prospect.dragged if one.stays <= LEANS]
        leaning = {t.id: f"lies or leans on {track.label}" for t in on_it}
        # What leans on it first; of both, both is told.
        found += [(t, ", ".join([leaning[t.id], *(words for o, words in met if o.id == t.id)])) for t in on_it]
        return found + [(t, words) for t, words in met if t.id not in leaning]

    def _may_move(self, now: Now, track: Track) -> bool:
        """Whether an object may be moved to make way: not one that is to be left alone, and not too often."""
        leave = self._attempting.goal_of(track.label) == LEAVE
        often = len(moves(track.label, now.attempts)) >= self._config.max_moves
        return not (leave or often or worn_out(track.label, now.attempts, self._config.max_attempts))

    def _put_aside_in(self, track: Track) -> str:
        """The region on the table that an object may be set down in for the time being: its own, if it lies there."""
        own = self._attempting.goal_of(track.label)
        table = self._regions["table"]
        return own if own != LEAVE and is_area(self._regions[own], table) and self._is_in_place(track) else "table"


def _in_the_way_of(track: Track, refused: Sequence[Attempt], believed: Sequence[Track]) -> str:
    """Whom it is in the way of, among those that were refused before it, in words; "" if of nobody."""
    found = []
    for given_up in refused:
        wanted = next(t for t in believed if t.id == given_up.track)
        met = blockers(wanted, believed, given_up.rejected_by)
        found += [f"{count} grasps at {wanted.label}" for blocker, count in met if blocker.id == track.id]
    return f"; it is in the way of {', '.join(found)}" if found else ""
