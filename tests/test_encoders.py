"""Encoders: what a value becomes in the log, by type and by what the user has said."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.sensors import ImageBgr8U, ImageDepth16U, ImageRgba8U
from test_runlog import make_perception

from sum_drake import encoders
from sum_drake.encoders import encoder_of, frames, joint_states, named, poses, register_encoder
from sum_drake.runlog_reader import _color, frame_transforms
from sum_drake.types import MotionStatus

angles = st.floats(-3.0, 3.0)


def encoded(value, name="port", time=1.5):
    encoder = encoder_of(type(value))
    assert encoder is not None
    return encoder.encode(value, time, name)


@settings(max_examples=50)
@given(st.lists(st.tuples(angles, angles, angles, st.floats(-10, 10)), min_size=1, max_size=3))
def test_poses_come_back(numbers):
    Xs = [RigidTransform(RollPitchYaw(*rpy), [x, -x, 0.5]) for *rpy, x in numbers]
    found = frame_transforms(encoded(Xs).encode())
    assert [(parent, child) for parent, child, _ in found] == [("world", f"port_{i}") for i in range(len(Xs))]
    for (_, _, X), wanted in zip(found, Xs, strict=True):
        np.testing.assert_allclose(X, wanted.GetAsMatrix4(), atol=1e-9)
    one = frame_transforms(poses(Xs[0].GetAsMatrix4(), 0.0, "hand").encode())
    assert [child for _, child, _ in one] == ["hand"]
    np.testing.assert_allclose(one[0][2], Xs[0].GetAsMatrix4(), atol=1e-9)


def test_colours_are_not_mixed_up():
    pixels = np.arange(4 * 3 * 3, dtype=np.uint8).reshape(3, 4, 3)
    rgba, bgr = ImageRgba8U(4, 3), ImageBgr8U(4, 3)
    rgba.mutable_data[..., :3], bgr.mutable_data[:] = pixels, pixels[..., ::-1]
    for image in (rgba, bgr):
        np.testing.assert_array_equal(_color(encoded(image).encode()), pixels)


def test_raw_pictures_keep_their_values():
    depth = ImageDepth16U(4, 3)
    depth.mutable_data[..., 0] = np.arange(12).reshape(3, 4) * 1000
    assert np.arange(0, 12000, 1000, dtype="<u2").tobytes() in encoded(depth).encode()


def test_plain_data():
    assert encoded(MotionStatus(3, "lift", False))["segment"] == "lift"
    assert encoded(np.array([1.0, np.nan])) == {"values": [1.0, None]}
    assert encoded({"a": float("inf")}) == {"a": None}
    assert (
        encoded("words") == {"value": "words"} and encoded(2) == {"value": 2} and encoded([1, 2]) == {"values": [1, 2]}
    )
    assert named(["x", "y"])(np.array([1.0, 2.0]), 0.0, "") == {"x": 1.0, "y": 2.0}


def test_records_of_ours_go_without_their_pictures():
    perception = make_perception(1)
    data = encoded(perception)
    assert data["step"] == 1 and data["frame"]["color"] == []
    np.testing.assert_array_equal(_color(encoded(perception.frame).encode()), perception.frame.color)


def test_wrong_counts_are_told():
    with pytest.raises(ValueError, match=r"has the shape \(3,\); expected positions of 2 joints, or velocities too"):
        joint_states(["a", "b"])(np.zeros(3), 0.0, "")
    with pytest.raises(ValueError):
        frames(["a"])([RigidTransform(), RigidTransform()], 0.0, "")
    with pytest.raises(ValueError, match=r"a pose has the shape \(3, 3\)"):
        poses(np.eye(3), 0.0, "")


class Plain:
    pass


class Special(Plain):
    pass


@dataclasses.dataclass
class Record:
    x: int


def test_the_nearest_base_class_decides_and_the_user_has_the_last_word(monkeypatch):
    monkeypatch.setattr(encoders, "_ENCODERS", dict(encoders._ENCODERS))
    assert encoder_of(Plain) is None and encoder_of(Special) is None
    register_encoder(Plain, lambda value, time, name: {"said": "plain"})
    assert encoded(Special()) == {"said": "plain"}
    register_encoder(Special, lambda value, time, name: {"said": f"{name} at {time}"})
    assert encoded(Special()) == {"said": "port at 1.5"} and encoded(Plain()) == {"said": "plain"}
    assert encoded(Record(1)) == {"x": 1}
    register_encoder(Record, lambda value, time, name: {"x": "one"})
    register_encoder(RigidTransform, lambda value, time, name: {"at": value.translation().tolist()})
    assert encoded(Record(1)) == {"x": "one"} and encoded(RigidTransform()) == {"at": [0.0, 0.0, 0.0]}
