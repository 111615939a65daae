"""Fingers that let go for a moment."""

import dataclasses

import numpy as np
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.drives import within_limits
from sum_drake.robot import FINGERS, HAND, JOINTS, STATE_JOINTS
from sum_drake.systems.ports import abstract
from sum_drake.types import Immutable, MotionStatus

DELAYS = {"lift": 0.4, "transport": 0.8}
"""How far into a segment the fingers let go, seconds."""
OPEN = 0.35
"""How long they stay open, seconds."""


@dataclasses.dataclass(frozen=True)
class _Letting(Immutable):
    """The segment under way, since when, and which faults are still to come."""

    motion: int = -1
    segment: str = ""
    since: float = 0.0
    armed: bool = False
    left: tuple[tuple[int, str], ...] = ()


class GripFault(LeafSystem):
    """Passes the arm's desired state on, but opens the fingers for a moment in some segments of its motion.

    .. pydrake_system::

        name: GripFault
        input_ports:
        - desired_state
        - motion_status
        - observe
        - robot_state
        output_ports:
        - faulty_desired_state

    Each fault is an observation and the name of a segment, "lift" or "transport": the first of that name after it.
    Fingers that let go are no faster than others, see `drives.within_limits`; step: the plant's, seconds.
    """

    def __init__(self, *, faults: tuple[tuple[int, str], ...], period: float, step: float) -> None:
        super().__init__()
        self._step = step
        self._desired = self.DeclareVectorInputPort("desired_state", BasicVector(2 * len(JOINTS)))
        self._status = self.DeclareAbstractInputPort("motion_status", abstract())
        self._observe = self.DeclareVectorInputPort("observe", BasicVector(1))
        self._robot_state = self.DeclareVectorInputPort("robot_state", BasicVector(2 * len(STATE_JOINTS)))
        self._letting = self.DeclareAbstractState(abstract(_Letting(left=tuple(faults))))
        self.DeclareVectorOutputPort("faulty_desired_state", BasicVector(2 * len(JOINTS)), self._calc_desired)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: State) -> EventStatus:
        held: _Letting = context.get_abstract_state(self._letting).get_value()
        status: MotionStatus = self._status.Eval(context)
        if (status.motion, status.segment) == (held.motion, held.segment):
            return EventStatus.DidNothing()
        seen = round(self._observe.Eval(context)[0]) - 1
        due = [i for i, (after, name) in enumerate(held.left) if after <= seen and name == status.segment][:1]
        left = tuple(fault for i, fault in enumerate(held.left) if i not in due)
        state.get_mutable_abstract_state(self._letting).set_value(
            _Letting(status.motion, status.segment, context.get_time(), bool(due), left)
        )
        return EventStatus.Succeeded()

    def _calc_desired(self, context: Context, output: BasicVector) -> None:
        held: _Letting = context.get_abstract_state(self._letting).get_value()
        desired = np.array(self._desired.Eval(context))
        into = context.get_time() - held.since - DELAYS.get(held.segment, 0.0)
        if held.armed and 0.0 <= into < OPEN:
            desired[len(JOINTS) - len(FINGERS) : len(JOINTS)] = HAND.gap_max / 2
            desired = within_limits(desired, self._robot_state.Eval(context), self._step)
        output.SetFromVector(desired)
