"""Looks, decides, acts, and looks again."""

import dataclasses
from collections.abc import Callable, Sequence

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.action_model import holds
from sum_drake.picking import PickPlan
from sum_drake.robot import JOINTS, STATE_JOINTS, arm_positions, finger_gap, squeeze
from sum_drake.systems.ports import abstract, pack, unpack
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import Array, Attempt, Immutable, Motion, MotionStatus, Perception, PickPlace

Decide = Callable[[Perception, Sequence[Attempt], int, Array], Pick | Look | Stop]
"""`task.SortingTask.decide`."""
Retreat = Callable[[Perception, Array, int], Motion]
"""`task.SortingTask.retreat`."""


@dataclasses.dataclass(frozen=True)
class Feel(Immutable):
    """What the hand feels."""

    gap: float = 0.0
    """Between the fingers, metres."""
    squeeze: float = 0.0
    """Force that closes them, newtons."""

    def holds(self, width: float) -> bool:
        """Whether that is an object of this width."""
        return holds(self.gap, self.squeeze, width)


@dataclasses.dataclass(frozen=True, eq=False)
class _Sorting(Immutable):
    """Where the planner is in its loop."""

    phase: str = "settle"
    """settle, look, pick, place, retreat, done."""
    since: float = 0.0
    """When the phase began, seconds."""
    observations: int = 0
    """The `observe` counter."""
    looks: int = 0
    """Observations in a row that led to nothing."""
    pick: Pick | None = None
    motion: Motion | None = None
    at_lift: Feel = Feel()
    at_place: Feel = Feel()
    action: PickPlace | None = None
    attempts: tuple[Attempt, ...] = ()
    outcome: str = ""


class SortingPlanner(LeafSystem):
    """The loop of SUM: observe, choose an object, pick, feel, place, and observe whatever happened.

    .. pydrake_system::

        name: SortingPlanner
        input_ports:
        - perception
        - robot_state
        - motion_status
        - effort
        output_ports:
        - observe
        - motion
        - executed_action
        - attempts
        - outcome

    `observe` counts the observations asked for. `outcome` is "" while the run goes on. What the robot knows of an
    attempt is its own commands, and the gap between its fingers with the force that closes them.
    """

    def __init__(self, *, decide: Decide, retreat: Retreat, period: float, settle_time: float) -> None:
        super().__init__()
        self._decide, self._retreat, self._settle_time = decide, retreat, settle_time
        self._perception = self.DeclareAbstractInputPort("perception", abstract())
        self._robot_state = self.DeclareVectorInputPort("robot_state", BasicVector(2 * len(STATE_JOINTS)))
        self._status = self.DeclareAbstractInputPort("motion_status", abstract())
        self._effort = self.DeclareVectorInputPort("effort", BasicVector(len(JOINTS)))
        self._state = self.DeclareAbstractState(abstract(_Sorting()))
        of_state = {self.abstract_state_ticket(self._state)}
        self.DeclareVectorOutputPort("observe", BasicVector(1), self._calc_observe, prerequisites_of_calc=of_state)
        for name, field in (
            ("motion", "motion"),
            ("executed_action", "action"),
            ("attempts", "attempts"),
            ("outcome", "outcome"),
        ):
            self.DeclareAbstractOutputPort(name, abstract, self._output_of(field), prerequisites_of_calc=of_state)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _held(self, context: Context) -> _Sorting:
        state: _Sorting = context.get_abstract_state(self._state).get_value()
        return state

    def _calc_observe(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self._held(context).observations)

    def _output_of(self, field: str) -> Callable[[Context, Value[object]], None]:
        def calc(context: Context, output: Value[object]) -> None:
            output.set_value(pack(getattr(self._held(context), field)))

        return calc

    def _update(self, context: Context, state: State) -> EventStatus:
        held = self._held(context)
        steps = {
            "settle": self._settle,
            "look": self._look,
            "pick": self._follow_pick,
            "place": self._follow_place,
            "retreat": self._follow_retreat,
        }
        if held.phase not in steps:
            return EventStatus.DidNothing()
        following = steps[held.phase](context, held)
        if following is held:
            return EventStatus.DidNothing()
        if following.phase != held.phase:
            following = dataclasses.replace(following, since=context.get_time())
        state.get_mutable_abstract_state(self._state).set_value(following)
        return EventStatus.Succeeded()

    def _settle(self, context: Context, held: _Sorting) -> _Sorting:
        """Asks for an observation once the arm and what it moved have come to rest."""
        if context.get_time() - held.since < self._settle_time:
            return held
        return dataclasses.replace(held, phase="look", observations=held.observations + 1)

    def _look(self, context: Context, held: _Sorting) -> _Sorting:
        """Decides once the observation has been made sense of."""
        perception: Perception | None = unpack(self._perception.Eval(context))
        if perception is None or perception.step != held.observations - 1:
            return held
        choice = self._decide(perception, held.attempts, held.looks, self._arm(context))
        attempts = held.attempts + choice.refused
        if isinstance(choice, Stop):
            return dataclasses.replace(held, phase="done", attempts=attempts, outcome=choice.outcome)
        if isinstance(choice, Look):
            return dataclasses.replace(held, phase="settle", attempts=attempts, looks=held.looks + 1, action=None)
        motion = self._numbered(held, choice.plan.pick)
        return dataclasses.replace(held, phase="pick", attempts=attempts, looks=0, pick=choice, motion=motion)

    def _follow_pick(self, context: Context, held: _Sorting) -> _Sorting:
        """After the lift: goes on if the hand holds something, gives up otherwise."""
        if not self._done(context, held):
            return held
        assert held.pick is not None
        feel = self._feel(context)
        if feel.holds(held.pick.plan.grasp.width):
            motion = self._numbered(held, held.pick.plan.place)
            return dataclasses.replace(held, phase="place", motion=motion, at_lift=feel, at_place=feel)
        assert held.motion is not None
        try:
            motion = self._retreat(self._perception.Eval(context), self._arm(context), held.motion.id + 1)
        except RuntimeError as error:
            stopped = self._record(dataclasses.replace(held, at_lift=feel, at_place=feel), released=False)
            return dataclasses.replace(stopped, phase="done", outcome=f"stopped: {error}")
        return dataclasses.replace(held, phase="retreat", motion=motion, at_lift=feel, at_place=feel)

    def _follow_place(self, context: Context, held: _Sorting) -> _Sorting:
        """Feels the hand until it opens; afterwards the attempt is history."""
        status: MotionStatus = self._status.Eval(context)
        if not self._done(context, held):
            if status.segment in ("transport", "lower"):
                return dataclasses.replace(held, at_place=self._feel(context))
            return held
        return self._record(held, released=True)

    def _follow_retreat(self, context: Context, held: _Sorting) -> _Sorting:
        return self._record(held, released=False) if self._done(context, held) else held

    def unfinished(self, context: Context) -> Attempt | None:
        """The attempt that was under way, for a run that is cut off; `context` is the planner's own."""
        held = self._held(context)
        if held.pick is None:
            return None
        attempt = self._record(held, released=False).attempts[-1]
        return dataclasses.replace(attempt, reason="cut_off")

    def _record(self, held: _Sorting, *, released: bool) -> _Sorting:
        """The executed action and the attempt, as far as the robot knows them."""
        assert held.pick is not None
        plan: PickPlan = held.pick.plan
        track, step = held.pick.track, held.observations - 1
        action = PickPlace(
            step=step,
            kind=held.pick.kind,
            track=track.id,
            label=track.label,
            X_WG_pick=plan.X_WG,
            X_WO_place=plan.X_WO_place,
            region=held.pick.region,
            gap_lift=held.at_lift.gap,
            gap_place=held.at_place.gap,
            released=released,
            squeeze_lift=held.at_lift.squeeze,
            squeeze_place=held.at_place.squeeze,
            held_lift=held.at_lift.holds(plan.grasp.width),
            held_place=held.at_place.holds(plan.grasp.width),
        )
        if not released:
            reason = "empty_hand"
        else:
            reason = "executed" if held.at_place.holds(plan.grasp.width) else "lost_in_transport"
        attempt = Attempt(
            step, track.id, track.label, held.pick.region, held.pick.kind, reason,
            plan.grasp_candidates, plan.rejected_by, action, plan.grasp.X_OG, held.pick.why,
        )  # fmt: skip
        return dataclasses.replace(held, phase="settle", pick=None, action=action, attempts=(*held.attempts, attempt))

    def _feel(self, context: Context) -> Feel:
        return Feel(finger_gap(self._robot_state.Eval(context)), squeeze(self._effort.Eval(context)))

    def _arm(self, context: Context) -> Array:
        return arm_positions(self._robot_state.Eval(context))

    def _done(self, context: Context, held: _Sorting) -> bool:
        status: MotionStatus = self._status.Eval(context)
        return held.motion is not None and status.motion == held.motion.id and status.done

    @staticmethod
    def _numbered(held: _Sorting, motion: Motion) -> Motion:
        return dataclasses.replace(motion, id=0 if held.motion is None else held.motion.id + 1)
