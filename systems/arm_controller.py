"""Plays motions: sampled trajectories of the arm with the fingers' opening."""

import dataclasses

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.playback import desired, running_segment
from sum_drake.robot import HAND, JOINTS, desired_state
from sum_drake.systems.ports import abstract, unpack
from sum_drake.types import Immutable, Motion, MotionStatus


@dataclasses.dataclass(frozen=True, eq=False)
class _Playing(Immutable):
    """The motion under way, when it began and the finger gap it began with."""

    motion: Motion
    start: float
    gap_start: float


class ArmController(LeafSystem):
    """Plays each new motion from the moment it arrives and holds its end; before the first, the viewing pose.

    .. pydrake_system::

        name: ArmController
        input_ports:
        - motion
        output_ports:
        - desired_state
        - motion_status

    `desired_state` holds positions, then velocities of `robot.JOINTS`. The joint drives of the plant follow it.
    """

    def __init__(self, *, period: float) -> None:
        super().__init__()
        self._motion = self.DeclareAbstractInputPort("motion", abstract())
        at_rest = _Playing(Motion(-1, ()), 0.0, HAND.gap_max)
        self._playing = self.DeclareAbstractState(abstract(at_rest))
        prerequisites = {self.time_ticket(), self.abstract_state_ticket(self._playing)}
        self.DeclareVectorOutputPort(
            "desired_state", BasicVector(2 * len(JOINTS)), self._calc_desired_state, prerequisites_of_calc=prerequisites
        )
        self.DeclareAbstractOutputPort(
            "motion_status", abstract, self._calc_status, prerequisites_of_calc=prerequisites
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: State) -> EventStatus:
        motion: Motion | None = unpack(self._motion.Eval(context))
        playing: _Playing = context.get_abstract_state(self._playing).get_value()
        if motion is None or motion.id == playing.motion.id:
            return EventStatus.DidNothing()
        now = context.get_time()
        _, _, gap = desired(playing.motion, now - playing.start, playing.gap_start)
        state.get_mutable_abstract_state(self._playing).set_value(_Playing(motion, now, gap))
        return EventStatus.Succeeded()

    def _calc_desired_state(self, context: Context, output: BasicVector) -> None:
        playing: _Playing = context.get_abstract_state(self._playing).get_value()
        q, v, gap = desired(playing.motion, context.get_time() - playing.start, playing.gap_start)
        output.SetFromVector(desired_state(q, gap, v=v))

    def _calc_status(self, context: Context, output: Value[object]) -> None:
        playing: _Playing = context.get_abstract_state(self._playing).get_value()
        running = running_segment(playing.motion, context.get_time() - playing.start)
        name = "" if running is None else playing.motion.segments[running].name
        output.set_value(MotionStatus(playing.motion.id, name, running is None))
