"""Any ports of any diagram, into a log that Foxglove opens: abstract ones too, which Drake's own loggers pass over."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    EventStatus,
    InputPort,
    LeafSystem,
    OutputPort,
    PortDataType,
)

from sum_drake.assets import InputError
from sum_drake.encoders import Encode, Encoder, encoder_of
from sum_drake.mcap_log import McapLog
from sum_drake.systems.ports import unpack


@dataclasses.dataclass(frozen=True)
class LoggedPort:
    """One port that is logged."""

    name: str
    """Of the log's input port; of the frame, where the value is a pose or a picture."""
    topic: str
    model: Any
    """What the port carries: a number of elements for a vector, else an AbstractValue as the port allocates it."""
    encoder: Encode | None = None
    """How its values are written; None: as `encoders.register_encoder` has been told of their type."""


class PortLog(LeafSystem):
    """Writes the values of its input ports, each when it changes.

    .. pydrake_system::

        name: PortLog
        input_ports:
        - (the name of each logged port)

    Only publish events: nothing in the context changes, and what has been written is known by the log, so a value that
    stays, a forced publish or a context that is replayed write nothing twice. A port that holds None is passed over.
    """

    def __init__(self, *, log: McapLog, ports: Sequence[LoggedPort], period: float | None = None) -> None:
        """period: how often ports are looked at, seconds; None: after every step of the simulator.

        Raises InputError for a topic or a name that is used twice, and for a port of a type that has no encoder. What
        a `Value[object]` holds, only its values tell: there the first one raises it.
        """
        super().__init__()
        _check_names(ports)
        self._log, self._ports = log, tuple(ports)
        self._inputs: list[InputPort] = []
        for port in self._ports:
            if isinstance(port.model, int):
                self._inputs.append(self.DeclareVectorInputPort(port.name, BasicVector(port.model)))
            else:
                _check(port)
                self._inputs.append(self.DeclareAbstractInputPort(port.name, port.model))
        for port in self._ports:
            log.claim(port.topic)
        if period is None:
            self.DeclarePerStepPublishEvent(self._write)
        else:
            self.DeclarePeriodicPublishEvent(period, 0.0, self._write)
        self.DeclareForcedPublishEvent(self._write)

    def _write(self, context: Context) -> EventStatus:
        for port, source in zip(self._ports, self._inputs, strict=True):
            value = unpack(source.Eval(context))
            if value is not None:
                self._log.write_change(port.topic, context.get_time(), value, _encoder(port, type(value)), port.name)
        return EventStatus.Succeeded()


def log_ports(
    builder: DiagramBuilder,
    log: McapLog,
    ports: Mapping[str, OutputPort],
    *,
    encoders: Mapping[str, Encode] | None = None,
    period: float | None = None,
    name: str = "port_log",
) -> PortLog:
    """Adds a `PortLog` to a diagram and connects it: topic -> output port. encoders: topic -> encoder, where needed.

    The port of topic "/camera/color" is called "camera.color", and that of "/camera.color" would be, too. Raises
    InputError as `PortLog` does.
    """
    logged = [
        LoggedPort(
            topic.strip("/").replace("/", "."),
            topic,
            port.size() if port.get_data_type() == PortDataType.kVectorValued else port.Allocate(),
            (encoders or {}).get(topic),
        )
        for topic, port in ports.items()
    ]
    for topic in encoders or {}:
        if topic not in ports:
            raise InputError(f"encoders: topic {topic} is not logged; expected one of {', '.join(ports)}")
    system: PortLog = builder.AddNamedSystem(name, PortLog(log=log, ports=logged, period=period))
    for one, port in zip(logged, ports.values(), strict=True):
        builder.Connect(port, system.GetInputPort(one.name))
    return system


def _check_names(ports: Sequence[LoggedPort]) -> None:
    """Raises InputError for a port without a name, for which Drake ends the process, and for one with another's."""
    topics: dict[str, str] = {}
    for port in ports:
        if not port.name:
            raise InputError(f"topic {port.topic!r}: gives its port no name; expected one such as /camera/color")
        if port.name in topics:
            raise InputError(
                f"topic {port.topic}: its port is called {port.name}, as is that of {topics[port.name]}; expected a"
                " name of its own for each port"
            )
        topics[port.name] = port.topic


def _encoder(port: LoggedPort, kind: type) -> Encoder:
    encoder = Encoder(port.encoder) if port.encoder else encoder_of(kind)
    if encoder is None:
        raise InputError(
            f"port {port.name}: holds a {kind.__module__}.{kind.__qualname__}, which has no encoder; expected one told"
            " to register_encoder, or given with the port"
        )
    return encoder


def _check(port: LoggedPort) -> None:
    """Raises InputError for a port whose type is known and has no encoder."""
    if type(port.model) is not Value[object]:
        _encoder(port, type(port.model.get_value()))
