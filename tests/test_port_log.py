"""The PortLog system: somebody else's ports, each value once, and a line for what cannot be logged."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import ContactResults
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from sum_drake.assets import InputError
from sum_drake.encoders import named
from sum_drake.mcap_log import McapLog
from sum_drake.runlog import RunLogWriter
from sum_drake.runlog_reader import frame_transforms, read_run_log
from sum_drake.systems.port_log import LoggedPort, PortLog, log_ports
from sum_drake.systems.ports import abstract, pack
from sum_drake.types import MotionStatus

LOGGING = (Path(__file__).parents[1] / "docs" / "logging.md").read_text()


class Things(LeafSystem):
    """A vector that changes twice a second, a pose that does not, a picture, and a value of a type of ours."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareVectorOutputPort("vector", BasicVector(2), self._vector)
        self.DeclareAbstractOutputPort("pose", Value[RigidTransform], self._pose)
        self.DeclareAbstractOutputPort("depth", lambda: Value(ImageDepth32F(4, 3)), self._depth)
        self.DeclareAbstractOutputPort("color", lambda: Value(ImageRgba8U(4, 3)), self._color)
        self.DeclareAbstractOutputPort("status", abstract, self._status)

    def _vector(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([np.floor(2 * context.get_time()), np.inf])

    def _pose(self, context: Context, output: Value[RigidTransform]) -> None:
        output.set_value(RigidTransform(RollPitchYaw(0.0, 0.0, np.pi / 2), [1.0, 2.0, 3.0]))

    def _depth(self, context: Context, output: Value[ImageDepth32F]) -> None:
        output.get_mutable_value().mutable_data[:] = np.floor(context.get_time())

    def _color(self, context: Context, output: Value[ImageRgba8U]) -> None:
        output.get_mutable_value().mutable_data[:] = [200, 100, 50, 255]

    def _status(self, context: Context, output: Value[object]) -> None:
        time = context.get_time()
        output.set_value(pack(None if time < 1 else MotionStatus(int(time), "lift", False)))


PORTS = ("vector", "pose", "depth", "color", "status")


def make_diagram(log: McapLog, period: float | None = None) -> Diagram:
    builder = DiagramBuilder()
    things = builder.AddNamedSystem("things", Things())
    log_ports(builder, log, {f"/things/{port}": things.GetOutputPort(port) for port in PORTS}, period=period)
    if period is None:  # without discrete or continuous state a step takes all the time there is
        builder.AddSystem(Clockwork())
    return builder.Build()


class Clockwork(LeafSystem):
    """Makes the simulator step ten times a second."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(0.1, 0.0, lambda context, state: None)


def messages(path: Path) -> dict[str, list[tuple[str, float, bytes]]]:
    """Topic -> (schema, time, data) of each message, as the mcap package reads them."""
    from mcap.reader import make_reader

    found: dict[str, list[tuple[str, float, bytes]]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            found.setdefault(channel.topic, []).append((schema.name, message.log_time * 1e-9, message.data))
    return found


@pytest.mark.parametrize("steps", [[2.2], [0.25, 0.7, 0.7, 1.5, 2.2]])
@pytest.mark.parametrize("period", [0.1, None])
def test_each_value_once_when_it_changes(tmp_path: Path, steps: list[float], period: float | None) -> None:
    """However time is cut, with forced publishes in between, and with a context that is replayed."""
    with McapLog(tmp_path / "log.mcap") as log:
        diagram = make_diagram(log, period)
        simulator = Simulator(diagram)
        for time in steps:
            simulator.AdvanceTo(time)
            diagram.ForcedPublish(simulator.get_context())
        Simulator(diagram).AdvanceTo(1.7)
    found = messages(tmp_path / "log.mcap")
    vectors = [json.loads(data) for _, _, data in found["/things/vector"]]
    assert vectors == [{"values": [float(i), None]} for i in range(5)]
    np.testing.assert_allclose([time for _, time, _ in found["/things/vector"]], [0, 0.5, 1, 1.5, 2], atol=0.11)
    assert [json.loads(data) for _, _, data in found["/things/status"]] == [
        {"motion": motion, "segment": "lift", "done": False, "stopped": ""} for motion in (1, 2)
    ]
    assert [len(found[f"/things/{port}"]) for port in ("pose", "depth", "color")] == [1, 3, 1]


def test_foxgloves_schemas_for_drakes_types(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        diagram = make_diagram(log, 0.1)
        diagram.ForcedPublish(diagram.CreateDefaultContext())
    found = messages(tmp_path / "log.mcap")
    assert {topic: of[0][0] for topic, of in found.items()} == {
        "/things/vector": "ndarray",
        "/things/pose": "foxglove.FrameTransforms",
        "/things/depth": "foxglove.RawImage",
        "/things/color": "foxglove.CompressedImage",
    }
    ((parent, child, X_WF),) = frame_transforms(found["/things/pose"][0][2])
    assert (parent, child) == ("world", "things.pose")
    np.testing.assert_allclose(X_WF, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-12)


def test_ports_stand_beside_a_runs_own_topics(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        builder = DiagramBuilder()
        source = builder.AddSystem(ConstantVectorSource([1.0, 2.0]))
        log_ports(
            builder, writer.file, {"/wind": source.get_output_port()}, encoders={"/wind": named(["x", "y"])}, period=0.1
        )
        Simulator(builder.Build()).Initialize()
    assert json.loads(messages(tmp_path / "run.mcap")["/wind"][0][2]) == {"x": 1.0, "y": 2.0}
    assert read_run_log(tmp_path / "run.mcap").perceptions == ()


def make_log(log: McapLog, *sources: LeafSystem, **options: Any) -> Diagram:
    builder = DiagramBuilder()
    ports = {f"/p{i}": builder.AddSystem(source).get_output_port() for i, source in enumerate(sources)}
    log_ports(builder, log, ports, **options)
    return builder.Build()


class Foreign:
    """A type that nobody has told of."""


def test_a_type_without_an_encoder_is_named_with_its_port(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        with pytest.raises(InputError, match=r"port p0: holds a .*ContactResults, which has no encoder; expected"):
            make_log(log, ConstantValueSource(Value(ContactResults())))
        # What hides behind `object` is only known when it comes.
        diagram = make_log(log, ConstantValueSource(Value[object](Foreign())))
        with pytest.raises(InputError, match=r"port p0: holds a test_port_log.Foreign, which has no encoder"):
            Simulator(diagram).Initialize()


@dataclasses.dataclass(frozen=True)
class Holder:
    """Can be encoded as far as it is a dataclass, but not what it holds."""

    held: Any


def test_a_value_that_cannot_be_encoded_is_one_line(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        diagram = make_log(log, ConstantValueSource(Value[object](Holder(Foreign()))))
        with pytest.raises(
            InputError, match=r"^port p0: its Holder cannot be encoded \(cannot encode Foreign as JSON\)$"
        ):
            Simulator(diagram).Initialize()


def test_a_topic_that_is_used_twice_is_refused(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        ports = [LoggedPort("a", "/same", 1), LoggedPort("b", "/same", 1)]
        with pytest.raises(InputError, match="topic /same: is logged already"):
            PortLog(log=log, ports=ports)
        make_log(log, ConstantVectorSource([1.0]))
        with pytest.raises(InputError, match="topic /p0: is logged already"):
            make_log(log, ConstantVectorSource([1.0]))
    with RunLogWriter(tmp_path / "run.mcap") as writer, pytest.raises(InputError, match="topic /tf: is logged already"):
        PortLog(log=writer.file, ports=[LoggedPort("tf", "/tf", 1)])


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        (
            ["/a/b", "/a.b"],
            "topic /a.b: its port is called a.b, as is that of /a/b; expected a name of its own for each",
        ),
        (["/a", "a/"], "topic a/: its port is called a, as is that of /a; expected a name of its own"),
        (["/a", "/"], "topic '/': gives its port no name; expected one such as /camera/color"),
    ],
)
def test_topics_whose_ports_cannot_be_told_apart_are_refused(tmp_path: Path, topics: list[str], said: str) -> None:
    """And leave their topics to others, as `/a/b` and `/a/c` are."""
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource([1.0])).get_output_port()
    with McapLog(tmp_path / "log.mcap") as log:
        with pytest.raises(InputError) as refused:
            log_ports(builder, log, dict.fromkeys(topics, source))
        log_ports(builder, log, dict.fromkeys([topics[0], "/a/c"], source), period=0.1)
        Simulator(builder.Build()).Initialize()
    assert said in str(refused.value) and "\n" not in str(refused.value)
    assert set(messages(tmp_path / "log.mcap")) == {topics[0], "/a/c"}


def test_an_encoder_for_a_topic_that_is_not_there(tmp_path: Path) -> None:
    with (
        McapLog(tmp_path / "log.mcap") as log,
        pytest.raises(InputError, match="topic /q is not logged; expected one of /p0"),
    ):
        make_log(log, ConstantVectorSource([1.0]), encoders={"/q": named(["x"])})


def test_the_page_works_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # Drake's own parser refuses even local files where it may not load others; none is loaded here.
    monkeypatch.delenv("DRAKE_ALLOW_NETWORK", raising=False)
    example, own = re.findall(r"```python\n(.*?)```", LOGGING, re.DOTALL)
    assert len(example.splitlines()) < 30
    exec(example, {})
    found = messages(tmp_path / "acrobot.mcap")
    assert {topic: of[0][0] for topic, of in found.items()} == {
        "/joint_states": "foxglove.JointStates", "/tf": "foxglove.FrameTransforms"
    }  # fmt: skip
    assert [len(of) for of in found.values()] == [51, 51]
    moved = [{child: X for _, child, X in frame_transforms(data)} for _, _, data in found["/tf"]]
    assert not np.allclose(moved[0]["lower_link"], moved[-1]["lower_link"])
    names: dict[str, Any] = {}
    exec(own, names)
    with McapLog(tmp_path / "own.mcap") as log:
        Simulator(make_log(log, ConstantValueSource(Value[object](names["Wind"](3.0))), period=0.1)).AdvanceTo(1.0)
    assert [(schema, b"3.0 m/s" in data) for schema, _, data in messages(tmp_path / "own.mcap")["/p0"]] == [
        ("foxglove.Log", True)
    ]
