"""Reading the run log: everything a report or a replay needs comes back as it went in, or as far as it goes."""

from pathlib import Path

import numpy as np
import pytest
from test_runlog import make_perception, write

from sum_drake.assets import InputError
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
        assert record.problem is not None and "\n" not in record.problem
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
    with pytest.raises(InputError, match="is no log of a run"):
        read_run_log(tmp_path / "empty.mcap")
