"""Reading the run log: everything a report or a replay needs comes back as it went in, or as far as it goes."""

from io import SEEK_CUR, BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from test_runlog import hand, make_attempt, make_candidates, make_perception, write

from sum_drake.assets import InputError
from sum_drake.encoders import Encoder
from sum_drake.jsonio import encode
from sum_drake.mcap_log import McapLog
from sum_drake.runlog import SCHEMA, RunLogWriter
from sum_drake.runlog_reader import read_run_log, read_what_there_is


def test_everything_comes_back(tmp_path: Path) -> None:
    write(tmp_path / "run.mcap")
    record = read_run_log(tmp_path / "run.mcap")
    assert record.problem is None
    assert record.metadata["seed"] == "3"
    assert [perception.step for perception in record.perceptions] == [0, 1]
    for observation, perception in enumerate(record.perceptions):
        wrote = make_perception(observation)
        # Lossless: perception can be run again on a log.
        np.testing.assert_array_equal(perception.frame.color, wrote.frame.color)
        np.testing.assert_array_equal(perception.frame.depth, wrote.frame.depth)
        assert perception.frame.camera == wrote.frame.camera
        assert perception.frame.time == wrote.frame.time
        assert perception.detections == wrote.detections
        assert perception.associations == wrote.associations
        for track, wrote_track in zip(perception.posterior.tracks, wrote.posterior.tracks, strict=True):
            np.testing.assert_array_equal(track.X_WO, wrote_track.X_WO)
            assert track.features == wrote_track.features
            assert (track.id, track.label, track.accepted) == (wrote_track.id, wrote_track.label, wrote_track.accepted)
            assert len(track.belief.weights) == 64
    assert record.perceptions[0].action is None
    assert record.perceptions[1].action is not None and record.perceptions[1].action.region == "left"
    assert [time for time, _ in record.attempts] == [1.0, 8.3]
    assert record.attempts[0][1].rejected_by == (("ik", 30), ("table", 10))
    for i, (_, attempt) in enumerate(record.attempts):
        assert attempt.candidates is not None
        assert attempt.candidates.fates == ("ik", "chosen", "", "table", "table")
        np.testing.assert_allclose(attempt.candidates.X_WGs, make_candidates(i).X_WGs, atol=2e-6)
        np.testing.assert_array_equal(attempt.candidates.scores, [0.9, 0.8, 0.1])
    assert [(round(time, 6), motion.id) for time, motion in record.motions] == [(0.5, 0), (7.8, 1)]
    np.testing.assert_allclose(record.X_WGs, [hand(0), hand(1)], atol=1e-12)
    np.testing.assert_allclose(record.hand_times, record.joint_times)
    assert record.joint_names == ("torso", "pan")
    np.testing.assert_array_equal(record.joint_positions, [[0.0, 1.25], [0.3, 1.25]])
    np.testing.assert_allclose(record.joint_times, [1.5, 8.8])
    assert record.events[1] == {"time": 9.3, "name": "observe", "detail": {"counter": 1}}


def test_any_cut_gives_a_prefix(tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", count=3)
    whole = (tmp_path / "run.mcap").read_bytes()
    counts = []
    for size in np.linspace(len(whole) // 10, len(whole) - 1, 30).astype(int):
        (tmp_path / "cut.mcap").write_bytes(whole[:size])
        record = read_what_there_is(tmp_path / "cut.mcap")
        assert record.problem == f"the log {tmp_path / 'cut.mcap'} is cut off; expected a log that was closed"
        counts.append(len(record.perceptions))
    assert counts == sorted(counts) and counts[-1] == 3


def test_damage_is_one_line(tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", count=2)
    data = bytearray((tmp_path / "run.mcap").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "bad.mcap").write_bytes(bytes(data))
    record = read_what_there_is(tmp_path / "bad.mcap")
    assert record.problem is not None and "\n" not in record.problem
    assert len(record.perceptions) < 2


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the log"):
        read_what_there_is(tmp_path / "missing.mcap")
    (tmp_path / "text.mcap").write_text("not a log at all, but long enough to be read as one")
    with pytest.raises(InputError, match="is no log of a run"):
        read_what_there_is(tmp_path / "text.mcap")
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(InputError, match="is no log of a run: it is cut off"):
        read_run_log(tmp_path / "empty.mcap")


@pytest.mark.parametrize(
    ("schema", "words"),
    [("sum-drake/log/2", "is of a later version: 'sum-drake/log/2'; expected 'sum-drake/log/1'"),
     ("sum-drake/log/x", "is no log of a run: it is marked 'sum-drake/log/x'"),
     ("sum-drake/run/2", "is no log of a run: it is marked 'sum-drake/run/2'"),
     (None, "is no log of a run: it has no mark of one")],
)  # fmt: skip
def test_a_log_of_another_kind_is_one_line(tmp_path: Path, schema: str | None, words: str) -> None:
    with McapLog(tmp_path / "log.mcap", metadata=None if schema is None else {"schema": schema}) as log:
        log.write_change("/event", 0.0, {"x": 1}, Encoder(lambda value, time, name: value), "event")
    with pytest.raises(InputError) as raised:
        read_what_there_is(tmp_path / "log.mcap")
    assert words in str(raised.value) and "\n" not in str(raised.value)


class Counted(BytesIO):
    """Knows how much of it has been read."""

    count = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.count += len(data)
        return data


@pytest.mark.parametrize(
    ("metadata", "words"),
    [
        (None, "is no log of a run: it has no mark of one; expected an MCAP file with the mark"),
        (("theirs", {"schema": SCHEMA}), "is no log of a run: it has no mark of one"),
        (("sum-drake", {"schema": "sum-drake/log/2"}), "is of a later version: 'sum-drake/log/2'; expected"),
    ],
)
@pytest.mark.parametrize("chunks", [True, False])
def test_a_foreign_file_is_not_read_to_its_end_to_be_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    metadata: tuple[str, dict[str, str]] | None,
    words: str,
    chunks: bool,
) -> None:
    """Of many messages, damaged at its end, where it says that it is a log of ours after all."""
    file = Counted()
    writer = Writer(file, chunk_size=10_000, compression=CompressionType.NONE, use_chunking=chunks)
    writer.start()
    if metadata is not None:
        writer.add_metadata(*metadata)
    schema = writer.register_schema("theirs", "jsonschema", b"{}")
    channel = writer.register_channel("/perception", "json", schema)
    for i in range(1000):
        writer.add_message(channel_id=channel, log_time=i, data=b"[" + b"1, " * 300 + b"1]", publish_time=i)
    writer.add_metadata("sum-drake", {"schema": SCHEMA})
    writer.finish()
    file.seek(-2000, SEEK_CUR)
    file.write(bytes(1000))
    file.seek(0)
    with monkeypatch.context() as patched, pytest.raises(InputError) as refused:
        patched.setattr(Path, "open", lambda path, mode: file)
        read_what_there_is(tmp_path / "theirs.mcap")
    assert words in str(refused.value) and "\n" not in str(refused.value)
    assert file.count < 20_000, "of some 900,000 bytes"


def test_a_log_of_before_there_were_grasps_and_plans(tmp_path: Path) -> None:
    """Records of then had none of the later topics, and are read as they were."""
    with McapLog(tmp_path / "old.mcap", metadata={"schema": SCHEMA}) as log:
        channel = log.json_channel("/attempt", {"title": "sum_drake.Attempt"})
        old = {key: value for key, value in encode(make_attempt(0)).items() if key not in ("X_OG", "why")}
        channel.log(old, log_time=2_000_000_000)
    record = read_run_log(tmp_path / "old.mcap")
    ((time, attempt),) = record.attempts
    assert (time, attempt.label, attempt.candidates, attempt.why) == (2.0, "sugar", None, "")
    assert record.motions == () and record.X_WGs.shape == (0, 4, 4)


@pytest.mark.parametrize(
    "said", [{}, {"causes": ["ik"], "fates": [3], "hands": [[0.0] * 7], "scores": []}, {"causes": [], "hands": [[1.0]]}]
)
def test_grasps_that_cannot_be_decoded_are_one_line(tmp_path: Path, said: dict[str, Any]) -> None:
    with McapLog(tmp_path / "bad.mcap", metadata={"schema": SCHEMA}) as log:
        log.json_channel("/grasps", {"title": "sum_drake.GraspCandidates"}).log(said, log_time=0)
    problem = read_what_there_is(tmp_path / "bad.mcap").problem
    assert problem is not None and "holds a message on /grasps that cannot be decoded" in problem
    assert "\n" not in problem


def test_a_message_on_a_channel_that_was_never_declared_is_one_line(tmp_path: Path) -> None:
    with (tmp_path / "bad.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_metadata("sum-drake", {"schema": SCHEMA})
        writer.add_message(channel_id=7, log_time=0, data=b"{}", publish_time=0)
        writer.finish()
    problem = read_what_there_is(tmp_path / "bad.mcap").problem
    assert problem is not None and "holds a message on channel 7, which it does not declare" in problem


def test_events_that_are_no_objects_and_joints_that_change_are_one_line(tmp_path: Path) -> None:
    with McapLog(tmp_path / "event.mcap", metadata={"schema": SCHEMA}) as log:
        log.json_channel("/event", {"title": "sum_drake.Event"}).log(b"[1, 2]", log_time=0)
    assert "message on /event that cannot be decoded" in str(read_what_there_is(tmp_path / "event.mcap").problem)
    with RunLogWriter(tmp_path / "joints.mcap") as writer:
        writer.write_joint_state(0.0, ("shoulder", "elbow"), np.zeros(2))
        writer.write_joint_state(1.0, ("shoulder",), np.zeros(1))
    record = read_what_there_is(tmp_path / "joints.mcap")
    assert "message on /joint_states that cannot be decoded" in str(record.problem)
    assert record.joint_names == ("shoulder", "elbow") and record.joint_times.shape == (1,), "what came before is there"


@given(st.integers(0, 10**6), st.integers(1, 255))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_flipped_byte_is_read_past_or_told(tmp_path: Path, at: int, flip: int) -> None:
    """A log of ours in which one byte is another: never anything but a record, and a line about what is wrong."""
    whole = tmp_path / "whole.mcap"
    if not whole.exists():
        write(whole)
    data = bytearray(whole.read_bytes())
    data[at % len(data)] ^= flip
    (tmp_path / "flipped.mcap").write_bytes(data)
    try:
        problem = read_what_there_is(tmp_path / "flipped.mcap").problem
    except InputError as refused:
        problem = str(refused)
    assert problem is None or "\n" not in problem
