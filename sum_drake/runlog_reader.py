"""The log of a run, read back: everything that `runlog.RunLogWriter` wrote and a program goes on from."""

import dataclasses
import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from sum_drake.assets import InputError, one_line
from sum_drake.jsonio import decode
from sum_drake.runlog import CAMERA, HAND_FRAME, SCHEMA, candidates_of
from sum_drake.types import Array, Attempt, GraspCandidates, Motion, Perception, readonly


@dataclasses.dataclass(frozen=True, eq=False)
class RunRecord:
    """What a log holds, in the order it happened."""

    metadata: Mapping[str, str]
    perceptions: tuple[Perception, ...]
    """Complete with pictures; beliefs thinned."""
    attempts: tuple[tuple[float, Attempt], ...]
    """(time, attempt)."""
    events: tuple[Mapping[str, Any], ...]
    """{time, name, detail}."""
    joint_names: tuple[str, ...]
    joint_times: Array
    """(k,), seconds."""
    joint_positions: Array
    """(k, n)."""
    problem: str | None
    """Why reading ended before the log did; None for a whole one."""
    motions: tuple[tuple[float, Motion], ...] = ()
    """(time, motion) as planned, thinned; none in logs of before they were logged."""
    hand_times: Array = dataclasses.field(default_factory=lambda: readonly(np.empty(0)))
    """(h,), seconds."""
    X_WGs: Array = dataclasses.field(default_factory=lambda: readonly(np.empty((0, 4, 4))))
    """(h, 4, 4): where the measured joints had the hand."""


def read_run_log(path: Path | str) -> RunRecord:
    """Reads a whole log. Raises InputError for a file that is missing, foreign, damaged or cut off."""
    record = read_what_there_is(Path(path))
    if record.problem is not None:
        raise InputError(record.problem)
    return record


def read_what_there_is(path: Path) -> RunRecord:
    """As `read_run_log`, but a log that ends early is read as far as it goes, and `problem` says what is wrong.

    Raises InputError where there is nothing to read: a missing file, or a foreign one, of which only the start is read.
    """
    from mcap.records import Header, Metadata

    reading = _Reading()
    problem, damage = None, ""
    try:
        with path.open("rb") as stream:
            for record in _records(stream):
                if reading.metadata.get("schema") != SCHEMA and not isinstance(record, Header | Metadata):
                    break  # logs of ours say what they are before all else
                reading.take(record)
    except OSError as error:
        raise InputError(f"cannot read the log {path}: {error.strerror}; expected an MCAP file") from None
    except _Damage as error:
        damage = str(error)
        whole = "a log that was closed" if damage == CUT_OFF else "one that is as it was written"
        problem = f"the log {path} {damage}; expected {whole}"
    found = reading.metadata.get("schema")
    if found is not None and _is_later(found):
        raise InputError(f"the log {path} is of a later version: {found!r}; expected {SCHEMA!r}")
    if found != SCHEMA:
        kind = damage or ("has no mark of one" if found is None else f"is marked {found!r}")
        raise InputError(f"{path} is no log of a run: it {kind}; expected an MCAP file with the mark {SCHEMA!r}")
    return reading.result(problem)


def _is_later(schema: str) -> bool:
    """Whether a schema is ours with a higher number."""
    kind, number = SCHEMA.rsplit("/", 1)
    found, _, other = schema.rpartition("/")
    return found == kind and other.isdecimal() and int(other) > int(number)


CUT_OFF = "is cut off"
"""What becomes of a log whose process was killed."""


class _Damage(Exception):
    """Reading cannot go on."""


def _records(stream: IO[bytes]) -> Iterator[Any]:
    """The file's records in order. Raises _Damage where it is cut off or broken."""
    from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
    from mcap.stream_reader import StreamReader

    try:
        whole: Any = _Whole(stream)
        yield from StreamReader(whole, validate_crcs=True, record_size_limit=1 << 30).records
    except (EndOfFile, RecordLengthLimitExceeded):
        # The end is missing, or the middle of a record. Logs of writers that seek may end in a chunk without a length.
        raise _Damage(CUT_OFF) from None
    except InvalidMagic:
        raise _Damage("is no MCAP file") from None
    except Exception as error:  # of the container, its checksums, its compression, or a length that no memory holds
        raise _Damage(f"is damaged ({one_line(error)})") from None


class _Whole:
    """A file of which as much is read as was asked for, or nothing: a record that is there in part is cut off."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream

    def read(self, size: int) -> bytes:
        from mcap.exceptions import EndOfFile

        data = self._stream.read(size)
        if len(data) < size:
            raise EndOfFile
        return data


class _Reading:
    """Gathers what the records say."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] = {}
        self._topics: dict[int, str] = {}
        self._color: bytes = b""
        self._depth: bytes = b""
        self._perceptions: list[Perception] = []
        self._attempts: list[tuple[float, Attempt]] = []
        self._candidates: GraspCandidates | None = None
        self._motions: list[tuple[float, Motion]] = []
        self._hands: list[tuple[float, Array]] = []
        self._events: list[Mapping[str, Any]] = []
        self._names: tuple[str, ...] = ()
        self._times: list[float] = []
        self._positions: list[list[float]] = []

    def take(self, record: Any) -> None:
        """One MCAP record. Raises _Damage for a message that cannot be decoded."""
        from mcap.records import Channel, Message, Metadata

        if isinstance(record, Metadata) and record.name == "sum-drake":
            self.metadata = dict(record.metadata)
        elif isinstance(record, Channel):
            self._topics[record.id] = record.topic
        elif isinstance(record, Message):
            topic = self._topics.get(record.channel_id)
            if topic is None:
                raise _Damage(f"holds a message on channel {record.channel_id}, which it does not declare")
            try:
                self._take_message(topic, record.log_time * 1e-9, record.data)
            except (ValueError, TypeError, KeyError, IndexError, struct.error) as error:
                lacks = f"lacks {error}" if isinstance(error, KeyError) else one_line(error)
                raise _Damage(f"holds a message on {topic} that cannot be decoded ({lacks})") from None

    def _take_message(self, topic: str, time: float, data: bytes) -> None:
        if topic == f"/{CAMERA}/color":
            self._color = data
        elif topic == f"/{CAMERA}/depth":
            self._depth = data
        elif topic == "/perception":
            bare: Perception = decode(Perception, json.loads(data))
            frame = dataclasses.replace(bare.frame, color=_color(self._color), depth=_depth(self._depth))
            self._perceptions.append(dataclasses.replace(bare, frame=frame))
        elif topic == "/grasps":
            self._candidates = candidates_of(json.loads(data))
        elif topic == "/attempt":
            attempt: Attempt = decode(Attempt, json.loads(data))
            self._attempts.append((time, dataclasses.replace(attempt, candidates=self._candidates)))
            self._candidates = None
        elif topic == "/plan":
            self._motions.append((time, decode(Motion, json.loads(data))))
        elif topic == "/tf":
            hands = [X for _, child, X in frame_transforms(data) if child == HAND_FRAME]
            self._hands += [(time, X_WG) for X_WG in hands]
        elif topic == "/event":
            event = json.loads(data)
            if not isinstance(event, dict):
                raise ValueError(f"a {type(event).__name__}, and no object")
            self._events.append(event)
        elif topic == "/joint_states":
            joints = [_fields(joint) for joint in _fields(data)[2]]
            names = tuple(_text(joint[1][0]) for joint in joints)
            if self._times and names != self._names:
                raise ValueError(f"joints {', '.join(names)} after {', '.join(self._names)}")
            self._names = names
            self._times.append(time)
            self._positions.append([_double(joint[2][0]) for joint in joints])

    def result(self, problem: str | None) -> RunRecord:
        return RunRecord(
            metadata=self.metadata,
            perceptions=tuple(self._perceptions),
            attempts=tuple(self._attempts),
            events=tuple(self._events),
            joint_names=self._names,
            joint_times=readonly(self._times),
            joint_positions=readonly(np.reshape(self._positions, (len(self._times), len(self._names)))),
            problem=problem,
            motions=tuple(self._motions),
            hand_times=readonly([time for time, _ in self._hands]),
            X_WGs=readonly(np.reshape([X_WG for _, X_WG in self._hands], (len(self._hands), 4, 4))),
        )


def _fields(data: bytes) -> dict[int, list[Any]]:
    """The fields of a protobuf message by number: bytes, 8 or 4 raw bytes, or an integer, as they are on the wire.

    Foxglove's messages are read here in a few lines rather than through a protobuf library and generated code.
    """
    fields: dict[int, list[Any]] = {}
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(data):
        number, wire = divmod(varint(), 8)
        if wire == 0:
            fields.setdefault(number, []).append(varint())
            continue
        if wire not in (1, 2, 5):
            raise ValueError(f"wire type {wire} in a protobuf message")
        length = varint() if wire == 2 else {1: 8, 5: 4}[wire]
        fields.setdefault(number, []).append(data[at : at + length])
        at += length
    return fields


def _text(data: Any) -> str:
    if not isinstance(data, bytes):
        raise ValueError(f"{data!r} where text was expected")
    return data.decode()


def _double(data: bytes) -> float:
    return float(struct.unpack("<d", data)[0])


def frame_transforms(message: bytes) -> tuple[tuple[str, str, Array], ...]:
    """(parent frame, child frame, (4, 4) pose of the child in the parent) of each of a foxglove.FrameTransforms."""
    return tuple(_frame_transform(_fields(data)) for data in _fields(message).get(1, []))


def _frame_transform(fields: dict[int, list[Any]]) -> tuple[str, str, Array]:
    p, q = (
        [_double(part[axis][0]) if axis in part else 0.0 for axis in axes]  # zeros are not on the wire
        for part, axes in ((_fields(fields[4][0]), (1, 2, 3)), (_fields(fields[5][0]), (1, 2, 3, 4)))
    )
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_quat(q).as_matrix(), p
    return _text(fields[2][0]), _text(fields[3][0]), readonly(X)


def _color(message: bytes) -> Any:
    """(h, w, 3) uint8 RGB of a foxglove.CompressedImage."""
    png = _fields(message)[2][0]
    # One that is cut off is not decoded at all: OpenCV would make something of it, and warn past our one line.
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR) if png[-8:-4] == b"IEND" else None
    if image is None:
        raise ValueError("broken PNG")
    return readonly(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


def _depth(message: bytes) -> Any:
    """(h, w) float32 of a foxglove.RawImage in 32FC1."""
    fields = _fields(message)
    (width,), (height,) = (struct.unpack("<I", fields[number][0]) for number in (2, 3))
    return readonly(np.frombuffer(fields[6][0], "<f4").reshape(height, width), np.float32)
