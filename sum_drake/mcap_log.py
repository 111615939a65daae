"""An MCAP file that can be read up to its last record at any time, and that a value goes into when it changes."""

import json
import math
from collections.abc import Hashable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from sum_drake.assets import InputError, one_line
from sum_drake.encoders import Encoder

_NOTHING = object()
"""What the last value of a topic is before its first."""


class McapLog:
    """Writes Foxglove messages and JSON objects; a context manager. Log times are seconds since the start of the run.

    Whole chunks are put into the file, one whenever `flush` is called, and nothing that is there is touched again. So
    what a killed process leaves can be read by any reader that goes through a file from its start.
    """

    def __init__(self, path: Path, *, metadata: Mapping[str, str] | None = None) -> None:
        """path: one that exists is replaced. metadata: words under the name "sum-drake", readable before all else.

        Raises InputError where the file cannot be made.
        """
        import foxglove
        from foxglove.mcap import MCAPWriteOptions

        # A context of its own, kept: channels close when it goes.
        self.context = foxglove.Context()
        # One compression thread: the bytes of a log are a function of what is logged. No seeking: a chunk is put into
        # the file when it is whole. Otherwise its length is filled in afterwards, and of a log that was killed before
        # that, readers other than ours make nothing.
        options = MCAPWriteOptions(chunk_size=1 << 20, compression_threads=0, disable_seeking=True)
        try:
            self._file = foxglove.open_mcap(
                str(path), allow_overwrite=True, context=self.context, writer_options=options
            )
        except (OSError, RuntimeError) as error:
            raise InputError(
                f"cannot write the log {path}: {one_line(error)}; expected a folder that can be written"
            ) from None
        self._file.write_metadata("sum-drake", dict(metadata or {}))
        self._topics: set[str] = set()
        self._channels: dict[str, Any] = {}
        self._last: dict[str, tuple[float, Hashable]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the file; a log without this is readable all the same, and reads as cut off."""
        self._file.close()

    def flush(self) -> None:
        """Puts what was logged into the file."""
        self._file.flush()

    def claim(self, topic: str) -> str:
        """The topic, which nobody else may claim from now on. Raises InputError for one that was."""
        if topic in self._topics:
            raise InputError(f"topic {topic}: is logged already; expected a topic of its own for each port")
        self._topics.add(topic)
        return topic

    def json_channel(self, topic: str, schema: Mapping[str, Any]) -> Any:
        """Claims a topic for JSON objects."""
        import foxglove

        return foxglove.Channel(self.claim(topic), schema={"type": "object", **schema}, context=self.context)

    def write_change(self, topic: str, time: float, value: Any, encoder: Encoder, name: str) -> bool:
        """Writes a value, unless it is the last of its topic once more or the log has passed that time already.

        Whether it was written. name: of what it is a value, for messages that tell, such as poses. Raises InputError
        for a value that the encoder cannot take, or that has another schema than those before it.
        """
        last_time, last_key = self._last.get(topic, (-math.inf, _NOTHING))
        if time < last_time:
            return False
        try:
            key: Hashable = encoder.key(value) if encoder.key else _payload(encoder.encode(value, 0.0, name))[1]
            if key == last_key:
                return False
            schema, data = _payload(encoder.encode(value, time, name))
        except Exception as error:  # an encoder is somebody's own, and may raise anything
            raise InputError(
                f"port {name}: its {type(value).__name__} cannot be encoded ({one_line(error)})"
            ) from error
        self._channel(topic, schema, value).log(data, log_time=nanoseconds(time))
        self.flush()
        self._last[topic] = time, key
        return True

    def _channel(self, topic: str, schema: Any, value: Any) -> Any:
        """The topic's channel, which its first message makes."""
        import foxglove

        channel = self._channels.get(topic)
        if channel is None:
            encoding = "json" if schema is None else schema.encoding
            title = {"type": "object", "title": type(value).__name__}
            channel = foxglove.Channel(
                topic, schema=title if schema is None else schema, message_encoding=encoding, context=self.context
            )
            self._channels[topic] = channel
        held = None if channel.message_encoding == "json" else channel.schema_name()
        if held != (None if schema is None else schema.name):
            raise InputError(
                f"topic {topic}: was {held or 'JSON'} and is now {'JSON' if schema is None else schema.name}; expected"
                " one schema a topic"
            )
        return channel


def _payload(message: Any) -> tuple[Any, bytes]:
    """Schema (None: JSON) and bytes of what an encoder has made."""
    if isinstance(message, Mapping):
        return None, json.dumps(message, allow_nan=False).encode()
    if not hasattr(message, "get_schema"):
        raise TypeError(f"its encoder made a {type(message).__name__}; expected a mapping, or one of foxglove.messages")
    return type(message).get_schema(), message.encode()


def nanoseconds(time: float) -> int:
    """A time in seconds as MCAP holds it."""
    return round(time * 1e9)
