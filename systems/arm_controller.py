"""Plays motions: sampled trajectories of the arm with the fingers' opening; breaks them off if something is amiss."""

import dataclasses

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake import reflex
from sum_drake.drives import within_limits
from sum_drake.dynamics import ArmDynamics
from sum_drake.playback import desired, running_segment
from sum_drake.reflex import Stop, Strikes
from sum_drake.robot import HAND, JOINTS, STATE_JOINTS, desired_state
from sum_drake.systems.ports import abstract, unpack
from sum_drake.types import Array, Immutable, Motion, MotionStatus

PERIOD = 0.02
"""How often the joints are felt, seconds."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Playing(Immutable):
    """The motion under way, when it began and the finger gap it began with; how and when it was broken off."""

    motion: Motion
    start: float
    gap_start: float
    strikes: Strikes = dataclasses.field(default_factory=Strikes)
    stop: Stop | None = None

    def at(self, time: float) -> tuple[Array, Array, float]:
        """Positions (8,), velocities (8,) and finger gap that are asked for."""
        elapsed = time - self.start
        if self.stop is None:
            return desired(self.motion, elapsed, self.gap_start)
        return reflex.desired_after(self.motion, self.stop, elapsed - self.stop.elapsed, self.gap_start)

    def status(self, time: float) -> MotionStatus:
        """How far it is."""
        elapsed = time - self.start
        if self.stop is None:
            running, cause = running_segment(self.motion, elapsed), ""
        else:
            over = elapsed - self.stop.elapsed >= self.stop.duration
            running, cause = None if over else running_segment(self.motion, self.stop.elapsed), self.stop.cause
        name = "" if running is None else self.motion.segments[running].name
        return MotionStatus(self.motion.id, name, running is None, cause)


class ArmController(LeafSystem):
    """Plays each new motion from the moment it arrives and holds its end; before the first, the viewing pose.

    What drives and fingers feel on the way may break it off, see `reflex`: the status then says why.

    .. pydrake_system::

        name: ArmController
        input_ports:
        - motion
        - robot_state
        - effort
        output_ports:
        - desired_state
        - motion_status

    `desired_state` holds positions, then velocities of `robot.JOINTS`. The joint drives of the plant follow it; it
    never leads so far that one of the arm's would give all it has, or a finger be too fast, see `drives.within_limits`.
    """

    def __init__(self, *, period: float = PERIOD, step: float) -> None:
        """period: how often a new motion is looked for, and the joints are felt; step: the plant's; seconds."""
        super().__init__()
        self._step = step
        self._dynamics = ArmDynamics()
        self._motion = self.DeclareAbstractInputPort("motion", abstract())
        self._robot_state = self.DeclareVectorInputPort("robot_state", BasicVector(2 * len(STATE_JOINTS)))
        self._effort = self.DeclareVectorInputPort("effort", BasicVector(len(JOINTS)))
        at_rest = _Playing(Motion(-1, ()), 0.0, HAND.gap_max)
        self._playing = self.DeclareAbstractState(abstract(at_rest))
        prerequisites = {self.time_ticket(), self.abstract_state_ticket(self._playing)}
        self.DeclareVectorOutputPort(
            "desired_state",
            BasicVector(2 * len(JOINTS)),
            self._calc_desired_state,
            prerequisites_of_calc=prerequisites | {self._robot_state.ticket()},
        )
        self.DeclareAbstractOutputPort(
            "motion_status", abstract, self._calc_status, prerequisites_of_calc=prerequisites
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _held(self, context: Context) -> _Playing:
        playing: _Playing = context.get_abstract_state(self._playing).get_value()
        return playing

    def _update(self, context: Context, state: State) -> EventStatus:
        motion: Motion | None = unpack(self._motion.Eval(context))
        playing, now = self._held(context), context.get_time()
        if motion is not None and motion.id != playing.motion.id:
            following = _Playing(motion, now, playing.at(now)[2])
        else:
            following = self._felt(context, playing, now)
        if following is playing:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(self._playing).set_value(following)
        return EventStatus.Succeeded()

    def _felt(self, context: Context, playing: _Playing, now: float) -> _Playing:
        elapsed = now - playing.start
        if playing.stop is not None or running_segment(playing.motion, elapsed) is None:
            return playing
        strikes = reflex.look(
            playing.motion,
            elapsed,
            playing.gap_start,
            self._robot_state.Eval(context),
            self._effort.Eval(context),
            playing.strikes,
            self._dynamics,
        )
        if strikes == playing.strikes:
            return playing
        stop = reflex.stop(playing.motion, elapsed, strikes.cause) if strikes.cause else None
        return dataclasses.replace(playing, strikes=strikes, stop=stop)

    def _calc_desired_state(self, context: Context, output: BasicVector) -> None:
        q, v, gap = self._held(context).at(context.get_time())
        output.SetFromVector(within_limits(desired_state(q, gap, v=v), self._robot_state.Eval(context), self._step))

    def _calc_status(self, context: Context, output: Value[object]) -> None:
        output.set_value(self._held(context).status(context.get_time()))
