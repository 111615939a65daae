"""Whether the robot keeps within its limits in what it does, not only in what it plans."""

import dataclasses

import numpy as np
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.executed import LimitUse, measured
from sum_drake.robot import JOINTS, STATE_JOINTS
from sum_drake.systems.ports import abstract
from sum_drake.types import Array, Immutable, readonly


@dataclasses.dataclass(frozen=True, eq=False)
class _Watched(Immutable):
    """What was used, and the last sample."""

    use: LimitUse = dataclasses.field(default_factory=LimitUse)
    state: Array | None = None


class LimitWatch(LeafSystem):
    """Keeps account of positions, speeds and efforts against the limits. It has no output port.

    .. pydrake_system::

        name: LimitWatch
        input_ports:
        - robot_state
        - effort
    """

    def __init__(self, *, period: float) -> None:
        """period: seconds between samples; the plant's time step misses nothing."""
        super().__init__()
        self._robot_state = self.DeclareVectorInputPort("robot_state", BasicVector(2 * len(STATE_JOINTS)))
        self._effort = self.DeclareVectorInputPort("effort", BasicVector(len(JOINTS)))
        self._watched = self.DeclareAbstractState(abstract(_Watched()))
        self._period = period
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def use(self, context: Context) -> LimitUse:
        """Of everything so far; `context` is the watch's own."""
        held: _Watched = context.get_abstract_state(self._watched).get_value()
        return held.use

    def _update(self, context: Context, state: State) -> EventStatus:
        held: _Watched = context.get_abstract_state(self._watched).get_value()
        now = readonly(self._robot_state.Eval(context))
        use = measured(held.use, now, np.asarray(self._effort.Eval(context)), held.state, self._period)
        state.get_mutable_abstract_state(self._watched).set_value(_Watched(use, now))
        return EventStatus.Succeeded()
