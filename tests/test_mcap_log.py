"""A log of anybody's topics: each value when it changes, readable up to the last one, and the same bytes each time."""

import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

from sum_drake.assets import InputError
from sum_drake.encoders import Encoder, named, poses, raw_image
from sum_drake.mcap_log import McapLog, nanoseconds

JSON, POSE = Encoder(lambda value, time, name: {"x": value}), Encoder(poses)

changes = st.lists(st.tuples(st.sampled_from(["/a", "/b/c"]), st.integers(0, 5), st.integers(0, 2)), max_size=12)
"""(topic, time in seconds, value)."""


def write(log: McapLog, given: Sequence[tuple[str, int, int]]) -> list[bool]:
    return [log.write_change(topic, float(time), value, JSON, topic) for topic, time, value in given]


def told(given: Sequence[tuple[str, int, int]]) -> list[bool]:
    """Whether each is to be written, by what `write_change` promises."""
    last: dict[str, tuple[int, int]] = {}
    written = []
    for topic, time, value in given:
        held = last.get(topic)
        written.append(held is None or (time >= held[0] and value != held[1]))
        if written[-1]:
            last[topic] = time, value
    return written


def found(data: bytes, *, whole: bool) -> list[tuple[str, float, Any]]:
    """(topic, time, value) of each message in the order of the file, as the mcap package reads it from its start."""
    messages = []
    reader = NonSeekingReader(BytesIO(data), validate_crcs=True).iter_messages(log_time_order=False)
    try:
        for _, channel, message in reader:
            messages.append((channel.topic, message.log_time * 1e-9, json.loads(message.data)["x"]))
    except EndOfFile:
        assert not whole
    else:
        assert whole
    return messages


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes)
def test_each_value_when_it_changes_and_never_back_in_time(tmp_path: Path, given: list[tuple[str, int, int]]) -> None:
    """After each one the file can be read up to it; what was written is what was said to be; and all of it again."""
    path, expected = tmp_path / "log.mcap", told(given)
    with McapLog(path) as log:
        for i, one in enumerate(given):
            assert write(log, [one]) == [expected[i]]
            until_now = [one for one, was in zip(given[: i + 1], expected, strict=False) if was]
            assert found(path.read_bytes(), whole=False) == until_now
    data = path.read_bytes()
    written = [one for one, was in zip(given, expected, strict=True) if was]
    assert found(data, whole=True) == written
    for topic in {topic for topic, _, _ in written}:
        times = [time for other, time, _ in written if other == topic]
        assert times == sorted(times)
    with McapLog(path) as log:  # over the one that is there
        write(log, given)
    assert path.read_bytes() == data


def test_readers_that_look_for_an_index_read_a_log_that_was_closed(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        write(log, [("/a", 0, 1), ("/b/c", 1, 2), ("/a", 2, 3)])
    with (tmp_path / "log.mcap").open("rb") as stream:
        messages = list(make_reader(stream).iter_messages())
    assert [(channel.topic, message.log_time) for _, channel, message in messages] == [
        ("/a", 0), ("/b/c", 10**9), ("/a", 2 * 10**9)
    ]  # fmt: skip


def test_whose_log_it_is_comes_before_all_else_and_at_once(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with McapLog(path, metadata={"seed": "3"}) as log:
        log.flush()
        for _ in range(2):
            records = StreamReader(BytesIO(path.read_bytes())).records
            next(records)  # the header
            first = next(records)
            assert isinstance(first, Metadata) and (first.name, first.metadata) == ("sum-drake", {"seed": "3"})
            write(log, [("/a", 0, 1)])


def test_what_was_logged_through_a_channel_is_in_the_file_once_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with McapLog(path) as log:
        channel = log.json_channel("/said", {"title": "Said"})
        for i in range(3):
            channel.log({"x": i}, log_time=nanoseconds(0.5 * i))
        log.flush()
        assert found(path.read_bytes(), whole=False) == [("/said", 0.0, 0), ("/said", 0.5, 1), ("/said", 1.0, 2)]
        channel.log({"x": 3}, log_time=nanoseconds(1.5))
    assert found(path.read_bytes(), whole=True)[-1] == ("/said", 1.5, 3)


def test_an_error_within_ends_the_file_all_the_same(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), McapLog(tmp_path / "log.mcap") as log:
        write(log, [("/a", 0, 1)])
        _ = 1 / 0
    assert found((tmp_path / "log.mcap").read_bytes(), whole=True) == [("/a", 0.0, 1)]


def test_a_topic_is_claimed_once(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        assert log.claim("/a") == "/a"
        log.json_channel("/b", {"title": "B"})
        for topic in ("/a", "/b"):
            with pytest.raises(InputError, match=f"^topic {topic}: is logged already; expected a topic of its own"):
                log.claim(topic)
            with pytest.raises(InputError, match=f"^topic {topic}: is logged already"):
                log.json_channel(topic, {"title": "Again"})


def test_one_schema_a_topic(tmp_path: Path) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        assert log.write_change("/a", 0.0, 1, JSON, "a") and log.write_change("/b", 0.0, np.eye(4), POSE, "b")
        with pytest.raises(InputError, match=r"^topic /a: was JSON and is now foxglove.FrameTransforms; expected one"):
            log.write_change("/a", 1.0, np.eye(4), POSE, "a")
        with pytest.raises(InputError, match=r"^topic /b: was foxglove.FrameTransforms and is now JSON; expected one"):
            log.write_change("/b", 1.0, 1, JSON, "b")
        assert log.write_change("/a", 1.0, 2, JSON, "a"), "what was refused left no trace"
    with (tmp_path / "log.mcap").open("rb") as stream:
        messages = [(channel.topic, message.log_time) for _, channel, message in make_reader(stream).iter_messages()]
    assert messages == [("/a", 0), ("/b", 0), ("/a", 10**9)]


@pytest.mark.parametrize(
    ("encoder", "value", "words"),
    [
        (Encoder(named(["x"])), 1.0, "port p: its float cannot be encoded"),
        (Encoder(raw_image), np.zeros((0, 0), np.float32), "port p: its ndarray cannot be encoded"),
        (JSON, float("nan"), "port p: its float cannot be encoded"),
        (Encoder(lambda value, time, name: value), "words", "port p: its str cannot be encoded"),
        (Encoder(lambda value, time, name: 1 / 0), 1, "port p: its int cannot be encoded (division by zero)"),
        (Encoder(lambda value, time, name: {}, key=lambda value: value.size), 1, "port p: its int cannot be encoded"),
    ],
)
def test_whatever_an_encoder_raises_is_one_line_and_nothing_is_written(
    tmp_path: Path, encoder: Encoder, value: Any, words: str
) -> None:
    with McapLog(tmp_path / "log.mcap") as log:
        with pytest.raises(InputError) as refused:
            log.write_change("/p", 0.0, value, encoder, "p")
        assert write(log, [("/p", 0, 1)]) == [True], "others are written on"
    assert str(refused.value).startswith(words) and "\n" not in str(refused.value)
    assert found((tmp_path / "log.mcap").read_bytes(), whole=True) == [("/p", 0.0, 1)]


def test_a_key_decides_alone_even_where_it_is_none(tmp_path: Path) -> None:
    keyed = Encoder(lambda value, time, name: {"value": value}, key=lambda value: None)
    with McapLog(tmp_path / "log.mcap") as log:
        assert log.write_change("/keyed", 0.0, 1.0, keyed, "keyed")
        assert not log.write_change("/keyed", 1.0, 2.0, keyed, "keyed")


def test_a_message_that_tells_its_time_is_no_change_for_that(tmp_path: Path) -> None:
    """Foxglove's hold a time stamp: of a pose that stays, it is not to make a message at each look."""
    with McapLog(tmp_path / "log.mcap") as log:
        assert log.write_change("/X", 0.0, np.eye(4), POSE, "X")
        assert not log.write_change("/X", 1.0, np.eye(4), POSE, "X")
        assert log.write_change("/X", 2.0, np.diag([-1.0, -1.0, 1.0, 1.0]), POSE, "X")


def test_a_file_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    for path in (tmp_path / "missing" / "log.mcap", tmp_path / "file" / "log.mcap", tmp_path):
        with pytest.raises(InputError, match=r"^cannot write the log .*; expected a folder that can be written$"):
            McapLog(path)
