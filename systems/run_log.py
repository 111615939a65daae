"""Everything that a run was, into its log."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem

from sum_drake.explaining import given_up
from sum_drake.robot import ARM_JOINTS, STATE_JOINTS
from sum_drake.runlog import RunLogWriter
from sum_drake.systems.ports import abstract, unpack
from sum_drake.types import Array, Attempt, Motion, MotionStatus, Perception

FETCH_STATE = tuple(joint.name for joint in STATE_JOINTS)
PERIOD = 0.02
"""How often the inputs are looked at, seconds: to ask a port costs more than to write what is new on it."""
PLANNED = tuple(joint.name for joint in ARM_JOINTS)


class RunLog(LeafSystem):
    """Writes each perception record, attempt, motion and event once, and the measured joints at a steady rate.

    .. pydrake_system::

        name: RunLog
        input_ports:
        - perception
        - attempts
        - joint_state
        - observe
        - motion_status
        - outcome
        - motion

    `perception` holds the latest `types.Perception`, or None before the first; `attempts` a tuple of all attempts so
    far; `joint_state` positions, then velocities, of `joint_names`. `observe`, `motion_status` and `outcome`, as the
    planner and the controller give them, make events: an observation is asked for, a segment of a motion begins, a
    motion is done or broken off, the run ends. So does an attempt that was given up before the arm set out, with the
    reason in words. `motion` holds the motion planned last, or None.

    Only publish events: nothing in the context changes, and what has been written is known by the writer, so a record
    that stays on its port, a forced publish or a context that is replayed write nothing twice. Whoever ends a
    simulation asks for a forced publish, lest what came since the last look is missing.
    """

    def __init__(
        self,
        *,
        writer: RunLogWriter,
        joint_names: Sequence[str] = FETCH_STATE,
        joint_period: float = 0.1,
        hand: Callable[[Array], Array] | None = None,
    ) -> None:
        """joint_names: of `joint_state`, by default those of the station's `fetch.state`.

        joint_period: how often joints are sampled, seconds. hand: X_WG (4, 4) of such positions, to be logged, too.
        """
        super().__init__()
        self._writer, self._joint_names, self._hand = writer, tuple(joint_names), hand
        self._perception = self.DeclareAbstractInputPort("perception", abstract())
        self._attempts = self.DeclareAbstractInputPort("attempts", abstract(()))
        self._joint_state = self.DeclareVectorInputPort("joint_state", BasicVector(2 * len(self._joint_names)))
        self._observe = self.DeclareVectorInputPort("observe", BasicVector(1))
        self._status = self.DeclareAbstractInputPort("motion_status", abstract())
        self._outcome = self.DeclareAbstractInputPort("outcome", abstract(""))
        self._motion = self.DeclareAbstractInputPort("motion", abstract())
        self.DeclarePeriodicPublishEvent(PERIOD, 0.0, self._write)
        self.DeclarePeriodicPublishEvent(joint_period, 0.0, self._write_joint_state)
        # Of a simulation that ends between two looks: what came last is in the log, too.
        self.DeclareForcedPublishEvent(self._write)

    def _write(self, context: Context) -> EventStatus:
        self._write_records(context)
        for name, detail in self._events(context):
            self._writer.write_change(context.get_time(), name, detail)
        return EventStatus.Succeeded()

    def _write_records(self, context: Context) -> None:
        perception: Perception | None = unpack(self._perception.Eval(context))
        if perception is not None and perception.step > self._writer.last_step:
            self._writer.write_perception(perception)
        attempts: tuple[Attempt, ...] = self._attempts.Eval(context)
        for attempt in attempts[self._writer.attempts :]:
            self._writer.write_attempt(context.get_time(), attempt)
            if attempt.action is None:
                what = {"label": attempt.label, "region": attempt.region, "reason": attempt.reason}
                self._writer.write_event(context.get_time(), "given_up", what | {"said": given_up(attempt)})
        motion: Motion | None = unpack(self._motion.Eval(context))
        if motion is not None:
            self._writer.write_motion(context.get_time(), motion, PLANNED)

    def _events(self, context: Context) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """What the inputs say happened last, by name."""
        observations = round(self._observe.Eval(context)[0])
        if observations > 0:
            yield "observation_asked_for", {"observation": observations - 1}
        status: MotionStatus | None = unpack(self._status.Eval(context))
        if status is not None and status.motion >= 0:
            if status.stopped:
                yield "motion_stopped", {"motion": status.motion, "cause": status.stopped}
            elif status.done:
                yield "motion_done", {"motion": status.motion}
            else:
                yield "segment_begun", {"motion": status.motion, "segment": status.segment}
        outcome: str = self._outcome.Eval(context)
        if outcome:
            yield "run_ended", {"outcome": outcome}

    def _write_joint_state(self, context: Context) -> EventStatus:
        positions = self._joint_state.Eval(context)[: len(self._joint_names)]
        X_WG = None if self._hand is None else self._hand(positions)
        self._writer.write_joint_state(context.get_time(), self._joint_names, positions, X_WG)
        return EventStatus.Succeeded()
