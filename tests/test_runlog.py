"""The run log: everything a report or a replay needs comes back as it went in."""

import dataclasses
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.assets import InputError
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.jsonio import canonical, decode, encode
from sum_drake.runlog import RunLogWriter, read_run_log, read_what_there_is, thin
from sum_drake.types import (
    Association,
    Attempt,
    Camera,
    Detection,
    Frame,
    Perception,
    PickPlace,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)


def make_perception(observation: int, *, particles: int = 200) -> Perception:
    """A complete record with one accepted and one rejected track."""
    rng = np.random.default_rng(observation)
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    depth = rng.uniform(0.5, 2.0, (48, 64)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0.0
    frame = Frame(
        observation, rng.integers(0, 255, (48, 64, 3), dtype=np.uint8), depth, camera, np.eye(4), time=7.3 * observation
    )
    X_WOs = transform(rotation_from_vector(rng.normal(size=(particles, 3))), rng.normal(size=(particles, 3)))
    weights = rng.random(particles)
    belief = PoseBelief(readonly(X_WOs), readonly(weights / weights.sum()))
    tracks = tuple(
        Track(i, label, (3.0, 4.0, 20.0, 10.5), 0.9, 0.8, belief, readonly(X_WOs[0]), 0.6, 0.7, i == 0, 0, observation,
              (("inliers", 0.5),))
        for i, label in enumerate(("sugar", "tide"))
    )  # fmt: skip
    action = PickPlace(
        observation, "pick_place", 0, "sugar", readonly(np.eye(4)), readonly(X_WOs[1]), "left", 0.04, 0.04, True
    )
    return Perception(
        step=observation,
        frame=frame,
        detections=(Detection((3.0, 4.0, 20.0, 10.5), 0.9, (("sugar", 0.8), ("tide", 0.1))),),
        associations=(Association(0, "sugar", 0, 0.5), Association(0, "tide", None, 0.1)),
        prior=SceneBelief(observation - 1),
        posterior=SceneBelief(observation, tracks, 2),
        action=action if observation else None,
    )


def make_attempt(step: int) -> Attempt:
    return Attempt(step, 0, "sugar", "left", "pick_place", "no_grasp", 40, (("ik", 30), ("table", 10)), None)


def write(path: Path, count: int = 2) -> None:
    with RunLogWriter(path, metadata={"seed": "3"}) as writer:
        for i in range(count):
            writer.write_perception(make_perception(i))
            writer.write_attempt(7.3 * i + 1.0, make_attempt(i))
            writer.write_joint_state(7.3 * i + 1.5, ["torso", "pan"], np.array([0.3 * i, 1.25]))
            writer.write_event(7.3 * i + 2.0, "observe", {"counter": i})


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


def test_same_content_same_bytes(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap")
    write(tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_foxglove_finds_its_schemas(tmp_path: Path) -> None:
    """Another reader than ours sees Foxglove's schema names and simulation time."""
    from mcap.reader import make_reader

    write(tmp_path / "run.mcap", count=1)
    with (tmp_path / "run.mcap").open("rb") as stream:
        messages = list(make_reader(stream).iter_messages())
    schemas = {channel.topic: schema.name for schema, channel, _ in messages if schema is not None}
    assert schemas["/head_camera/color"] == "foxglove.CompressedImage"
    assert schemas["/head_camera/depth"] == "foxglove.RawImage"
    assert schemas["/head_camera/calibration"] == "foxglove.CameraCalibration"
    assert schemas["/head_camera/detections"] == "foxglove.ImageAnnotations"
    assert schemas["/tf"] == "foxglove.FrameTransforms"
    assert schemas["/scene"] == "foxglove.SceneUpdate"
    assert schemas["/joint_states"] == "foxglove.JointStates"
    assert all(message.log_time < 10e9 for _, _, message in messages)


def test_a_killed_process_leaves_what_it_wrote(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    script = textwrap.dedent(
        """
        import os, signal, sys
        from pathlib import Path
        sys.path.insert(0, sys.argv[2])
        from test_runlog import RunLogWriter, make_attempt, make_perception
        writer = RunLogWriter(Path(sys.argv[1]))
        for i in range(3):
            writer.write_perception(make_perception(i))
            writer.write_attempt(7.3 * i, make_attempt(i))
        writer.write_joint_state(30.0, ["pan"], [0.5])
        os.kill(os.getpid(), signal.SIGKILL)
        """
    )
    done = subprocess.run([sys.executable, "-c", script, str(path), os.fspath(Path(__file__).parent)], check=False)
    assert done.returncode == -signal.SIGKILL
    # The chunk that was open has no length yet: joints since the last record.
    record = read_what_there_is(path)
    assert len(record.perceptions) == 3 and len(record.attempts) == 3
    assert record.problem is not None and "cut off" in record.problem
    with pytest.raises(InputError, match=r"run\.mcap is cut off; expected"):
        read_run_log(path)


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


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write the log"):
        RunLogWriter(tmp_path / "missing" / "run.mcap")


def test_thinning_keeps_the_mean() -> None:
    belief = make_perception(0, particles=5000).posterior.tracks[0].belief
    lean = thin(belief, 500)
    assert lean.weights.sum() == pytest.approx(1.0)
    mean = belief.weights @ belief.X_WOs[:, :3, 3]
    np.testing.assert_allclose(lean.weights @ lean.X_WOs[:, :3, 3], mean, atol=0.15)
    assert thin(belief, 5000) is belief


def test_thinning_survives_a_degenerate_belief() -> None:
    belief = PoseBelief(readonly(np.broadcast_to(np.eye(4), (100, 4, 4))), readonly(np.eye(100)[99]))
    assert thin(belief, 10).X_WOs.shape == (10, 4, 4)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4), st.integers(), st.text())
def test_values_survive_json(numbers: list[float], integer: int, text: str) -> None:
    detection = Detection((numbers[0], numbers[1], numbers[2], numbers[3]), numbers[0], ((text, numbers[1]),))
    assert decode(Detection, encode(detection)) == detection
    association = Association(integer, text, None, numbers[0])
    assert decode(Association, encode(association)) == association
    assert canonical(detection) == canonical(decode(Detection, encode(detection)))


def test_decoding_refuses_other_data() -> None:
    data = encode(make_attempt(0))
    with pytest.raises(TypeError, match="got str, expected int"):
        decode(Attempt, {**data, "step": "first"})
    with pytest.raises(TypeError):
        decode(Attempt, {key: value for key, value in data.items() if key != "label"})


def test_canonical_text_tells_the_last_bit() -> None:
    track = make_perception(0).posterior.tracks[0]
    other = dataclasses.replace(track, likelihood=float(np.nextafter(track.likelihood, 1.0)))
    assert canonical(track) != canonical(other)
    assert canonical(track) == canonical(dataclasses.replace(track))
