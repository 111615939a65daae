"""The one system that sees the truth, and that nothing reads."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.systems.ports import abstract
from sum_drake.types import Array, Immutable, MotionStatus, readonly


@dataclasses.dataclass(frozen=True, eq=False)
class TruthSample(Immutable):
    """Where everything truly was at a moment."""

    time: float
    observations: int
    """The `observe` counter."""
    motion: int
    segment: str
    X_WOs: tuple[tuple[str, Array], ...]
    """Label and (4, 4) of each object."""
    X_WG: Array
    """(4, 4) of the hand."""


class Referee(LeafSystem):
    """Samples the true poses for the score that is made after the run. It has no output port.

    .. pydrake_system::

        name: Referee
        input_ports:
        - body_poses
        - observe
        - motion_status
    """

    def __init__(self, *, objects: Mapping[str, int], hand: int, period: float) -> None:
        """objects: label -> index of its body in body_poses; hand: that of gripper_link; period: seconds a sample."""
        super().__init__()
        self._objects, self._hand = dict(objects), hand
        self._body_poses = self.DeclareAbstractInputPort("body_poses", Value[list[RigidTransform]]())
        self._observe = self.DeclareVectorInputPort("observe", BasicVector(1))
        self._status = self.DeclareAbstractInputPort("motion_status", abstract())
        self._samples = self.DeclareAbstractState(abstract(()))
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def samples(self, context: Context) -> tuple[TruthSample, ...]:
        """Everything sampled so far; `context` is the referee's own."""
        samples: tuple[TruthSample, ...] = context.get_abstract_state(self._samples).get_value()
        return samples

    def _update(self, context: Context, state: State) -> EventStatus:
        samples = (*self.samples(context), self._sample(context))
        state.get_mutable_abstract_state(self._samples).set_value(samples)
        return EventStatus.Succeeded()

    def _sample(self, context: Context) -> TruthSample:
        X_WBs = self._body_poses.Eval(context)
        status: MotionStatus = self._status.Eval(context)
        return TruthSample(
            time=context.get_time(),
            observations=round(self._observe.Eval(context)[0]),
            motion=status.motion,
            segment=status.segment,
            X_WOs=tuple((label, readonly(X_WBs[index].GetAsMatrix4())) for label, index in self._objects.items()),
            X_WG=readonly(X_WBs[self._hand].GetAsMatrix4()),
        )


def transport_slip(samples: Sequence[TruthSample], label: str, *, since: str = "transport") -> float | None:
    """How far the object moved in the hand between the lift and the release, metres; None if it was not carried.

    samples: of one attempt. since: "close" counts from when the hand had closed.
    """
    held = [s for s in samples if s.segment == "transport"]
    begun = held[:1] if since == "transport" else [s for s in samples if s.segment == since][-1:]
    if not held or not begun:
        return None
    p_GOs = [np.linalg.solve(s.X_WG, dict(s.X_WOs)[label])[:3, 3] for s in (begun[0], held[-1])]
    return float(np.linalg.norm(p_GOs[1] - p_GOs[0]))
