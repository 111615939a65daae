"""Writing the run log: other programs read it, a kill leaves it readable, and the same run gives the same bytes."""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake import runlog, timing
from sum_drake.assets import InputError
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.jsonio import canonical, decode, encode
from sum_drake.runlog import RunLogWriter, thin
from sum_drake.runlog_reader import frame_transforms, read_run_log, read_what_there_is
from sum_drake.types import (
    Array,
    Association,
    Attempt,
    Camera,
    Detection,
    Frame,
    GraspCandidates,
    Load,
    Motion,
    Perception,
    PickPlace,
    PoseBelief,
    SceneBelief,
    Segment,
    Track,
    Trajectory,
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


def make_candidates(step: int) -> GraspCandidates:
    """Three that were ranked, two that were not."""
    rng = np.random.default_rng(step)
    X_WGs = transform(rotation_from_vector(rng.normal(size=(5, 3))), rng.normal(size=(5, 3)))
    return GraspCandidates(readonly(X_WGs), ("ik", "chosen", "", "table", "table"), readonly([0.9, 0.8, 0.1]))


def make_motion(number: int) -> Motion:
    """Of two segments, the first in very many points."""
    times = np.linspace(0.0, 6.0, 3001)
    positions = np.sin(times)[:, None] * np.arange(8.0)
    long = Trajectory(readonly(times), readonly(positions), readonly(np.cos(times)[:, None] * np.arange(8.0)))
    rest = Trajectory(readonly([0.0, 0.5]), readonly(np.tile(positions[-1], (2, 1))), readonly(np.zeros((2, 8))))
    return Motion(number, (Segment("approach", long, 0.1), Segment("close", rest, 0.0)), Load(0.04, 0.5))


ARM = [f"joint_{i}" for i in range(8)]


def hand(i: int) -> Array:
    """Where the hand is."""
    return transform(rotation_from_vector(np.array([0.1, 0.2, 0.3 * i])), np.array([0.5, 0.0, 0.1 * i]))


def write(path: Path, count: int = 2) -> None:
    with RunLogWriter(path, metadata={"seed": "3"}) as writer:
        for i in range(count):
            writer.write_perception(make_perception(i))
            writer.write_motion(7.3 * i + 0.5, make_motion(i), ARM)
            writer.write_attempt(7.3 * i + 1.0, dataclasses.replace(make_attempt(i), candidates=make_candidates(i)))
            writer.write_joint_state(7.3 * i + 1.5, ["torso", "pan"], np.array([0.3 * i, 1.25]), hand(i))
            writer.write_event(7.3 * i + 2.0, "observe", {"counter": i})


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
    assert schemas["/particles"] == "foxglove.PosesInFrame"
    assert schemas["/grasps/scene"] == "foxglove.SceneUpdate"
    titles = {"/perception": "Perception", "/attempt": "Attempt", "/event": "Event", "/associations": "Associations",
              "/belief": "Belief", "/plan": "Motion", "/grasps": "GraspCandidates"}  # fmt: skip
    assert {topic: schemas[topic] for topic in titles} == {k: f"sum_drake.{title}" for k, title in titles.items()}
    assert runlog.__doc__ is not None
    told = dict(re.findall(r"^ +(/\S+) +(\S+)", runlog.__doc__, re.MULTILINE))
    assert told == schemas, "the log holds what it says, no more, no less"
    counts = Counter(channel.topic for _, channel, _ in messages)
    assert {topic: n for topic, n in counts.items() if n != 1} == {"/tf": 2}
    assert all(message.log_time < 10e9 for _, _, message in messages)
    data = {channel.topic: message.data for _, channel, message in messages if channel.topic != "/tf"}
    assert json.loads(data["/belief"]) == {"sugar_0": 0.7, "tide_1": 0.7}
    assert json.loads(data["/associations"]) == {
        "observation": 0,
        "pairs": [{"detection": 0, "label": "sugar", "track": 0, "score": 0.5},
                  {"detection": 0, "label": "tide", "track": None, "score": 0.1}],
    }  # fmt: skip
    poses = [
        pose for _, channel, message in messages if channel.topic == "/tf" for pose in frame_transforms(message.data)
    ]
    assert [(parent, child) for parent, child, _ in poses] == [
        ("world", "head_camera"), ("world", "track_0_sugar"), ("world", "track_1_tide"), ("world", "hand")
    ]  # fmt: skip
    np.testing.assert_allclose(poses[1][2], make_perception(0).posterior.tracks[0].X_WO, atol=1e-12)
    np.testing.assert_allclose(poses[3][2], hand(0), atol=1e-12)


def test_plans_are_thinned_but_still_the_same_motion(tmp_path: Path) -> None:
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        for number in (0, 0, 1, 0):
            writer.write_motion(float(number), make_motion(number), ARM)
    motions = read_run_log(tmp_path / "run.mcap").motions
    assert [(time, motion.id) for time, motion in motions] == [(0.0, 0), (1.0, 1)], "each once"
    approach, close = motions[0][1].segments
    assert (approach.name, close.name, close.gap, motions[0][1].load) == ("approach", "close", 0.0, Load(0.04, 0.5))
    assert len(approach.trajectory.times) <= 200 and len(close.trajectory.times) == 2
    planned = make_motion(0).segments[0].trajectory
    assert approach.trajectory.times[-1] == planned.times[-1]
    for t in np.linspace(0.0, 6.0, 100):
        now, then = timing.evaluate(approach.trajectory, float(t)), timing.evaluate(planned, float(t))
        np.testing.assert_allclose(now[0], then[0], atol=1e-4)


def test_the_grasps_that_were_considered_change_no_record_and_no_digest() -> None:
    """They stand in a record of their own: the digest of a run is the same with and without them."""
    bare, told = make_attempt(0), dataclasses.replace(make_attempt(0), candidates=make_candidates(0))
    assert canonical(bare) == canonical(told) and encode(bare) == encode(told)


def test_a_killed_process_leaves_what_it_wrote_to_any_reader(tmp_path: Path) -> None:
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader

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
        for i in range(20):
            writer.write_joint_state(30.0 + 0.1 * i, ["pan"], [0.5])
        os.kill(os.getpid(), signal.SIGKILL)
        """
    )
    done = subprocess.run([sys.executable, "-c", script, str(path), os.fspath(Path(__file__).parent)], check=False)
    assert done.returncode == -signal.SIGKILL
    # Other readers find no broken record, just no end. (Joints measured since the last record are not in the file yet.)
    topics = []
    with path.open("rb") as stream, pytest.raises(EndOfFile):
        for _, channel, _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            topics.append(channel.topic)
    assert topics.count("/perception") == topics.count("/head_camera/depth") == topics.count("/attempt") == 3
    assert topics[-1] == "/attempt"
    record = read_what_there_is(path)
    assert len(record.perceptions) == 3 and len(record.attempts) == 3
    assert record.problem is not None and "cut off" in record.problem
    with pytest.raises(InputError, match=r"run\.mcap is cut off; expected"):
        read_run_log(path)


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


@settings(max_examples=50)
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
