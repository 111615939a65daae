"""Looks, decides, acts, and looks again."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.action_model import HANGS, STILL
from sum_drake.attempted import NOTHING, Feel, attempt_of
from sum_drake.dynamics import ArmDynamics
from sum_drake.reflex import CARRYING
from sum_drake.robot import ARM_JOINTS, JOINTS, STATE_JOINTS, arm_positions, arm_velocities, finger_gap, squeeze
from sum_drake.shaking import SHAKES
from sum_drake.systems.ports import abstract, pack, unpack
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import Array, Attempt, Immutable, Motion, MotionStatus, Perception, PickPlace

Decide = Callable[[Perception, Sequence[Attempt], int, Array], Pick | Look | Stop]
"""`task.SortingTask.decide`."""
Retreat = Callable[[Perception, Array, int, Pick | None], Motion]
"""`recovering.Recovering.retreat`."""
CarryOn = Callable[[Perception, Pick, Array, int], Motion]
"""`recovering.Recovering.carry_on`."""
Shake = Callable[[Perception, Pick, Array, int, int], Motion]
"""`recovering.Recovering.shake`."""
PUSHING = 2.0
"""So much more resistance is put up with by picks of an object whose neighbours were met before, and on ways around
what was met with an object in the hand: it may hang lower than it was taken."""
CARRY_ONS = 2
"""Times that the arm goes on by another way after it was stopped with an object in its hand."""
RESTING = 0.05
"""An arm whose joints are slower than this is at rest, radians (of the torso, metres) a second."""
RETREATS = 3
"""Ways back that are tried after something went wrong: each puts up with twice the resistance of the one before."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Sorting(Immutable):
    """Where the planner is in its loop."""

    phase: str = "settle"
    """settle, look, pick, place, retreat, weigh, shake, done."""
    since: float = 0.0
    """When the phase began, seconds."""
    observations: int = 0
    """The `observe` counter."""
    looks: int = 0
    """Observations in a row that led to nothing."""
    pick: Pick | None = None
    motion: Motion | None = None
    at_lift: Feel = NOTHING
    at_place: Feel = NOTHING
    released: bool = False
    """Whether the hand was opened at the place."""
    stopped: str = ""
    """Why the controller broke the pick or the place off, one of `reflex.CAUSES`."""
    carry_ons: int = 0
    """Times that it was stopped with the object in its hand, and went on from there."""
    retreats: int = 0
    """Ways back begun since then."""
    still_since: float | None = None
    """When the hand came to rest that had let go at the place, seconds."""
    shakes: int = 0
    """Times that it went to shake off what hung on the hand."""
    hung: bool = False
    """Whether an arm at rest, which nothing had stopped, has felt that."""
    hung_there: bool = False
    """Whether that was still on the hand over the place."""
    hangs: bool | None = None
    """Whether something hangs on it still; None: not weighed."""
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
    attempt is its own commands, the gap between its fingers with the force that closes them, what then weighs on the
    opened hand, and whether the controller broke a motion off for what it felt. The arm then goes back to where it
    looks from, and looks again; with an object in its hand it first tries to go on by another way, CARRY_ONS times,
    and then to bring it back to where it was.
    What hangs on the hand after it was opened at the place is no object placed: the arm goes to shake it off there,
    SHAKES times at most, from where it has just let go, where it looks, or where it was stopped; where it was gone
    before it got there, it was lost on the way.
    """

    def __init__(
        self,
        *,
        decide: Decide,
        retreat: Retreat,
        carry_on: CarryOn,
        shake: Shake,
        period: float,
        settle_time: float,
    ) -> None:
        super().__init__()
        self._decide, self._retreat, self._carry_on, self._shake = decide, retreat, carry_on, shake
        self._dynamics = ArmDynamics()
        self._settle_time = settle_time
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
            "weigh": self._weigh,
            "shake": self._follow_shake,
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
        # What was in the hand's way once is met again by another grasp, often: from then on it pushes harder.
        pushed = any(a.label == choice.track.label and a.reason == "unexpected_effort" for a in held.attempts)
        motion = dataclasses.replace(self._numbered(held, choice.plan.pick), insistence=PUSHING if pushed else 1.0)
        # Nothing of the pick before is left but what came of it.
        return _Sorting(
            phase="pick", since=held.since, observations=held.observations, pick=choice, motion=motion,
            action=held.action, attempts=attempts,
        )  # fmt: skip

    def _follow_pick(self, context: Context, held: _Sorting) -> _Sorting:
        """After the lift: goes on if the hand holds something, gives up otherwise, or where the arm was stopped."""
        status: MotionStatus = self._status.Eval(context)
        pick = held.pick
        if pick is None or not self._done(context, held):
            return held
        feel = self._feel_after(context, status)
        held = dataclasses.replace(held, at_lift=feel, at_place=feel)
        if status.stopped:
            return self._go_on_or_back(context, held, status)
        if not feel.holds(pick.plan.grasp.width):
            return self._go_back(context, held)
        motion = self._numbered(held, pick.plan.place)
        return dataclasses.replace(held, phase="place", motion=motion)

    def _follow_place(self, context: Context, held: _Sorting) -> _Sorting:
        """Feels the hand until it opens; once the arm is back, what weighs on it."""
        status: MotionStatus = self._status.Eval(context)
        if not self._done(context, held):
            if held.motion is None or status.motion != held.motion.id or status.stopped:
                return held
            if status.segment in CARRYING:
                return dataclasses.replace(held, at_place=self._feel(context))
            if status.segment == "weigh":
                return self._weigh_there(context, held)
            return held if held.released else dataclasses.replace(held, released=True)
        if not status.stopped:
            return dataclasses.replace(held, phase="weigh", released=True)
        if held.released:
            # What hangs on the hand has met something, perhaps: it is not to be let fall there. What was met may weigh
            # on the hand as well, so that nothing is believed of that.
            held = dataclasses.replace(held, stopped=status.stopped)
            shaking = self._shake_off(context, held) if self._hangs(context) else None
            return shaking or self._go_back(context, held)
        held = dataclasses.replace(held, at_place=self._feel_after(context, status))
        return self._go_on_or_back(context, held, status)

    def _go_on_or_back(self, context: Context, held: _Sorting, status: MotionStatus) -> _Sorting:
        """After a stop: on by another way with what the hand holds, or back with it, or without."""
        assert held.pick is not None and held.motion is not None
        holding = held.at_place.holds(held.pick.plan.grasp.width)
        if holding and held.carry_ons < CARRY_ONS:
            try:
                motion = self._carry_on(
                    self._perception.Eval(context), held.pick, self._arm(context), held.motion.id + 1
                )
            except RuntimeError:  # then it goes back
                pass
            else:
                motion = dataclasses.replace(motion, insistence=PUSHING)
                return dataclasses.replace(held, phase="place", motion=motion, carry_ons=held.carry_ons + 1)
        return self._go_back(context, dataclasses.replace(held, stopped=status.stopped), holding=holding)

    def _follow_retreat(self, context: Context, held: _Sorting) -> _Sorting:
        if not self._done(context, held):
            return held
        status: MotionStatus = self._status.Eval(context)
        if status.stopped:
            return self._go_back(context, held)
        return dataclasses.replace(held, phase="weigh") if held.released else self._record(held)

    def _weigh_there(self, context: Context, held: _Sorting) -> _Sorting:
        """Once the hand that let go has come to rest: what hangs on it is shaken off before it is carried away."""
        now = context.get_time()
        if held.still_since is None:
            return dataclasses.replace(held, still_since=now, released=True)
        if now - held.still_since < STILL or held.hung or not self._hangs(context):
            return held
        held = dataclasses.replace(held, hung=True)
        return self._shake_off(context, held) or held

    def _weigh(self, context: Context, held: _Sorting) -> _Sorting:
        """Once the arm has come to rest: if nothing hangs on the hand, or that cannot be helped, the attempt is over.

        The observation follows at once, as everything has settled meanwhile.
        """
        if context.get_time() - held.since < self._settle_time:
            return held
        hangs = self._hangs(context)
        if not hangs and held.hung and not held.hung_there:
            held = dataclasses.replace(held, at_place=NOTHING)
        held = dataclasses.replace(held, hangs=hangs, hung=held.hung or hangs)
        shaking = self._shake_off(context, held) if hangs else None
        return shaking or dataclasses.replace(self._record(held), phase="look", observations=held.observations + 1)

    def _shake_off(self, context: Context, held: _Sorting) -> _Sorting | None:
        """On its way to shake off what hangs on the hand of the arm, which rests; None: that cannot be done."""
        assert held.pick is not None and held.motion is not None
        if held.shakes == SHAKES:
            return None
        try:
            motion = self._shake(
                self._perception.Eval(context), held.pick, self._arm(context), held.motion.id + 1, held.shakes
            )
        except RuntimeError:
            return None
        return dataclasses.replace(held, phase="shake", motion=motion, shakes=held.shakes + 1, hung_there=False)

    def _follow_shake(self, context: Context, held: _Sorting) -> _Sorting:
        """Feels whether it still hangs there once the arm rests over the place."""
        status: MotionStatus = self._status.Eval(context)
        if not self._done(context, held):
            if held.motion is None or status.motion != held.motion.id or status.segment != "weigh":
                return held
            return dataclasses.replace(held, hung_there=self._hangs(context))
        if not status.stopped:
            return dataclasses.replace(held, phase="weigh")
        # On the way back it would fall where it has no business: once more, from where the arm was stopped.
        shaking = self._shake_off(context, held) if self._hangs(context) else None
        return shaking or self._go_back(context, held)

    def _go_back(self, context: Context, held: _Sorting, *, holding: bool = False) -> _Sorting:
        """Sets out for the viewing pose with an open hand; the run is over where there is no way.

        holding: the object of the pick, which is then brought back first, if that can be done.
        """
        assert held.motion is not None
        if held.retreats == RETREATS:
            said = f"the arm was stopped on {RETREATS} ways back to the viewing pose"
            return dataclasses.replace(self._record(held), phase="done", outcome=f"stopped: {said}")
        try:
            pick = held.pick if holding else None
            motion = self._retreat(self._perception.Eval(context), self._arm(context), held.motion.id + 1, pick)
        except RuntimeError as error:
            return dataclasses.replace(self._record(held), phase="done", outcome=f"stopped: {error}")
        motion = dataclasses.replace(motion, insistence=2.0**held.retreats)
        return dataclasses.replace(held, phase="retreat", motion=motion, retreats=held.retreats + 1)

    def unfinished(self, context: Context) -> Attempt | None:
        """The attempt that was under way, for a run that is cut off; `context` is the planner's own."""
        held = self._held(context)
        if held.pick is None:
            return None
        attempt = self._record(held).attempts[-1]
        return dataclasses.replace(attempt, reason="cut_off")

    def _record(self, held: _Sorting) -> _Sorting:
        """The executed action and the attempt, as far as the robot knows them."""
        assert held.pick is not None
        attempt = attempt_of(
            held.pick,
            held.observations - 1,
            at_lift=held.at_lift,
            at_place=held.at_place,
            released=held.released,
            hangs=held.hangs,
            stopped=held.stopped,
        )
        attempts = (*held.attempts, attempt)
        return dataclasses.replace(held, phase="settle", pick=None, action=attempt.action, attempts=attempts)

    def _feel_after(self, context: Context, status: MotionStatus) -> Feel:
        """What the hand feels once a motion is over; nothing where it was broken off for that, whatever came since."""
        return NOTHING if status.stopped == "empty_hand" else self._feel(context)

    def _feel(self, context: Context) -> Feel:
        return Feel(finger_gap(self._robot_state.Eval(context)), squeeze(self._effort.Eval(context)))

    def _hangs(self, context: Context) -> bool:
        """Whether something weighs on the hand of an arm at rest."""
        efforts = self._effort.Eval(context)[: len(ARM_JOINTS)]
        return self._dynamics.hanging(self._arm(context), efforts) > HANGS

    def _arm(self, context: Context) -> Array:
        return arm_positions(self._robot_state.Eval(context))

    def _done(self, context: Context, held: _Sorting) -> bool:
        """Whether the motion is over; one that was broken off, once the arm no longer swings: it would be felt."""
        status: MotionStatus = self._status.Eval(context)
        over = held.motion is not None and status.motion == held.motion.id and status.done
        if not over or not status.stopped:
            return over
        return float(np.abs(arm_velocities(self._robot_state.Eval(context))).max()) < RESTING

    @staticmethod
    def _numbered(held: _Sorting, motion: Motion) -> Motion:
        return dataclasses.replace(motion, id=0 if held.motion is None else held.motion.id + 1)
