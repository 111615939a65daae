"""The RunLog system: each record and event once, joints at 10 Hz, and nothing that a replay could double."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, EventStatus, LeafSystem, State
from pydrake.systems.primitives import ConstantVectorSource
from test_runlog import make_attempt, make_motion, make_perception

from sum_drake.geometry import transform
from sum_drake.runlog import RunLogWriter
from sum_drake.runlog_reader import read_run_log
from sum_drake.systems.ports import abstract, pack
from sum_drake.systems.run_log import RunLog
from sum_drake.types import Array, MotionStatus

JOINTS = ("torso", "pan")


class Source(LeafSystem):
    """Raises a counter every second; its records are a function of it, held between rises."""

    def __init__(self) -> None:
        super().__init__()
        self._count = self.DeclareAbstractState(abstract(0))
        self.DeclareAbstractOutputPort("perception", abstract, self._calc_perception)
        self.DeclareAbstractOutputPort("attempts", lambda: abstract(()), self._calc_attempts)
        self.DeclareVectorOutputPort("observe", BasicVector(1), self._calc_observe)
        self.DeclareAbstractOutputPort("motion_status", abstract, self._calc_status)
        self.DeclareAbstractOutputPort("outcome", lambda: abstract(""), self._calc_outcome)
        self.DeclareAbstractOutputPort("motion", abstract, self._calc_motion)
        self.DeclarePeriodicUnrestrictedUpdateEvent(1.0, 0.5, self._update)

    def _held(self, context: Context) -> int:
        count: int = context.get_abstract_state(self._count).get_value()
        return count

    def _update(self, context: Context, state: State) -> EventStatus:
        state.get_mutable_abstract_state(self._count).set_value(self._held(context) + 1)
        return EventStatus.Succeeded()

    def _calc_perception(self, context: Context, output: Value[object]) -> None:
        count = self._held(context)
        output.set_value(pack(make_perception(count - 1) if count else None))

    def _calc_attempts(self, context: Context, output: Value[object]) -> None:
        # Two attempts follow each observation: an object given up and one tried.
        output.set_value(tuple(make_attempt(i // 2) for i in range(2 * self._held(context))))

    def _calc_observe(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, self._held(context))

    def _calc_status(self, context: Context, output: Value[object]) -> None:
        # From the first observation on, a motion of two segments a second.
        motion, into = divmod(context.get_time() - 0.55, 1.0)
        segment = "" if into > 0.6 or motion < 0 else "lift" if into > 0.3 else "reach"
        output.set_value(MotionStatus(max(int(motion), -1), segment, not segment))

    def _calc_motion(self, context: Context, output: Value[object]) -> None:
        output.set_value(pack(make_motion(self._held(context) - 1) if self._held(context) else None))

    def _calc_outcome(self, context: Context, output: Value[object]) -> None:
        output.set_value("cleared" if self._held(context) == 3 else "")


def hand(positions: Array) -> Array:
    """Where a hand would be."""
    return transform(np.eye(3), np.array([*positions, 0.5]))


def make_diagram(writer: RunLogWriter) -> Diagram:
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", Source())
    run_log = builder.AddNamedSystem("run_log", RunLog(writer=writer, joint_names=JOINTS, hand=hand))
    joints = builder.AddNamedSystem("joints", ConstantVectorSource([0.3, 1.0, 0.0, 0.0]))
    for port in ("perception", "attempts", "observe", "motion_status", "outcome", "motion"):
        builder.Connect(source.GetOutputPort(port), run_log.GetInputPort(port))
    builder.Connect(joints.get_output_port(), run_log.GetInputPort("joint_state"))
    return builder.Build()


def test_ports(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        system = RunLog(writer=writer, joint_names=JOINTS)
    names = [system.get_input_port(i).get_name() for i in range(system.num_input_ports())]
    assert names == ["perception", "attempts", "joint_state", "observe", "motion_status", "outcome", "motion"]
    assert system.num_output_ports() == 0
    assert system.GetInputPort("joint_state").size() == 4


def test_before_the_first_observation_nothing_is_written(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        system = RunLog(writer=writer, joint_names=JOINTS)
        context = system.CreateDefaultContext()
        system.GetInputPort("perception").FixValue(context, abstract())
        system.GetInputPort("attempts").FixValue(context, abstract(()))
        system.GetInputPort("joint_state").FixValue(context, np.zeros(4))
        system.GetInputPort("observe").FixValue(context, [0.0])
        system.GetInputPort("motion_status").FixValue(context, abstract(MotionStatus(-1, "", True)))
        system.GetInputPort("outcome").FixValue(context, abstract(""))
        system.GetInputPort("motion").FixValue(context, abstract())
        system.ForcedPublish(context)
    record = read_run_log(tmp_path / "run.mcap")
    assert record.perceptions == () and record.attempts == () and record.events == ()


def test_a_motion_that_is_broken_off_is_told_once_with_its_cause(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        system = RunLog(writer=writer, joint_names=JOINTS)
        context = system.CreateDefaultContext()
        system.GetInputPort("perception").FixValue(context, abstract())
        system.GetInputPort("attempts").FixValue(context, abstract(()))
        system.GetInputPort("joint_state").FixValue(context, np.zeros(4))
        system.GetInputPort("observe").FixValue(context, [0.0])
        system.GetInputPort("outcome").FixValue(context, abstract(""))
        system.GetInputPort("motion").FixValue(context, abstract())
        for status in (
            MotionStatus(0, "reach", False),
            MotionStatus(0, "reach", False, "unexpected_effort"),
            MotionStatus(0, "", True, "unexpected_effort"),
            MotionStatus(1, "retreat", False),
        ):
            system.GetInputPort("motion_status").FixValue(context, abstract(status))
            system.ForcedPublish(context)
    events = [(event["name"], event["detail"]) for event in read_run_log(tmp_path / "run.mcap").events]
    assert events == [
        ("segment_begun", {"motion": 0, "segment": "reach"}),
        ("motion_stopped", {"motion": 0, "cause": "unexpected_effort"}),
        ("segment_begun", {"motion": 1, "segment": "retreat"}),
    ]


@pytest.mark.parametrize("steps", [[3.0], [0.25, 0.5, 1.0, 1.0, 1.5, 2.5, 3.0]])
def test_each_record_once(tmp_path: Path, steps: list[float]) -> None:
    """However the time is cut into AdvanceTo calls, and with forced publishes in between."""
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        diagram = make_diagram(writer)
        simulator = Simulator(diagram)
        for time in steps:
            simulator.AdvanceTo(time)
            diagram.ForcedPublish(simulator.get_context())
        simulator.AdvancePendingEvents()
    record = read_run_log(tmp_path / "run.mcap")
    assert [perception.step for perception in record.perceptions] == [0, 1, 2]
    assert [attempt.step for _, attempt in record.attempts] == [0, 0, 1, 1, 2, 2]
    np.testing.assert_allclose([time for time, _ in record.attempts][::2], [0.5, 1.5, 2.5], atol=0.11)
    np.testing.assert_allclose(record.joint_times, np.arange(31) * 0.1, atol=1e-9)
    np.testing.assert_array_equal(record.joint_positions, [[0.3, 1.0]] * 31)
    np.testing.assert_allclose(record.hand_times, record.joint_times, atol=1e-9)
    np.testing.assert_allclose(record.X_WGs, [hand(np.array([0.3, 1.0]))] * 31, atol=1e-12)
    assert [motion.id for _, motion in record.motions] == [0, 1, 2]


@pytest.mark.parametrize("steps", [[3.0], [0.25, 0.7, 0.7, 1.5, 2.7, 3.0]])
def test_each_event_once_and_in_order(tmp_path: Path, steps: list[float]) -> None:
    """What the robot asked for, set out to do and finished, however time is cut, and after a look back in time."""
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        diagram = make_diagram(writer)
        simulator = Simulator(diagram)
        for time in steps:
            simulator.AdvanceTo(time)
            diagram.ForcedPublish(simulator.get_context())
        simulator.AdvancePendingEvents()
        again = Simulator(diagram)
        again.AdvanceTo(2.0)
    record = read_run_log(tmp_path / "run.mcap")
    events = record.events
    assert len(record.motions) == 3 and len(record.joint_times) == len(record.hand_times) == 31, "nothing twice"
    given_up = [event for event in events if event["name"] == "given_up"]
    assert [event["detail"]["said"] for event in given_up] == [
        "no grasp; 40 grasps considered: 30 within reach, but no way to hold the arm, 10 too near the table"
    ] * 6
    assert given_up[0]["detail"].items() >= {"label": "sugar", "region": "left", "reason": "no_grasp"}.items()
    told = [(event["name"], *event["detail"].values()) for event in events if event["name"] != "given_up"]
    assert told == [
        ("observation_asked_for", 0),
        ("segment_begun", 0, "reach"), ("segment_begun", 0, "lift"), ("motion_done", 0),
        ("observation_asked_for", 1),
        ("segment_begun", 1, "reach"), ("segment_begun", 1, "lift"), ("motion_done", 1),
        ("observation_asked_for", 2),
        ("run_ended", "cleared"), ("segment_begun", 2, "reach"), ("segment_begun", 2, "lift"),
    ]  # fmt: skip
    times = [event["time"] for event in events]
    assert times == sorted(times)
    np.testing.assert_allclose(times[3:6], [0.6, 0.9, 1.2], atol=0.11)


def test_what_came_last_is_logged_when_the_monitor_ends_the_run(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        diagram = make_diagram(writer)
        simulator = Simulator(diagram)
        source = diagram.GetSubsystemByName("source")
        attempts = source.GetOutputPort("attempts")

        def monitor(root: Context) -> EventStatus:
            done = len(attempts.Eval(source.GetMyContextFromRoot(root))) == 4
            return EventStatus.ReachedTermination(diagram, "done") if done else EventStatus.Succeeded()

        simulator.set_monitor(monitor)
        simulator.AdvanceTo(10.0)
    assert len(read_run_log(tmp_path / "run.mcap").attempts) == 4
