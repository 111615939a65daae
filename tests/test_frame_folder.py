import json

import cv2
import numpy as np
import pytest

from sum_drake.assets import InputError
from sum_drake.frame_folder import LabelledBox, read_frame
from sum_drake.geometry import rotation_from_vector, transform

CAMERA = {"fx": 500.0, "fy": 501.0, "cx": 160.0, "cy": 100, "width": 320, "height": 200, "depth_scale": 0.001}
BOX = {"label": "mug", "box": [10, 20, 30.5, 40], "score": 0.8}


@pytest.fixture
def folder(tmp_path):
    cv2.imwrite(str(tmp_path / "color.png"), np.full((200, 320, 3), (10, 20, 30), np.uint8))
    cv2.imwrite(str(tmp_path / "depth.png"), np.full((200, 320), 800, np.uint16))
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    return tmp_path


def test_what_is_there_is_read(folder):
    (folder / "detections.json").write_text(json.dumps([BOX, {"label": "toy", "box": [0, 0, 1, 1]}]))
    found = read_frame(folder)
    frame = found.frame
    assert (frame.camera.fx, frame.camera.cy, frame.camera.width) == (500.0, 100.0, 320)
    assert frame.depth[0, 0] == np.float32(0.8)
    assert frame.color[0, 0].tolist() == [30, 20, 10], "RGB"
    np.testing.assert_array_equal(frame.X_WC, np.eye(4))
    assert found.boxes == (
        LabelledBox("mug", (10.0, 20.0, 30.5, 40.0), 0.8),
        LabelledBox("toy", (0.0, 0.0, 1.0, 1.0), 1.0),
    )
    assert found.noise is None


def test_pose_noise_and_missing_boxes(folder):
    X_WC = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
    (folder / "camera.json").write_text(json.dumps(CAMERA | {"X_WC": X_WC, "noise": {"axial_constant": 0.003}}))
    found = read_frame(folder)
    np.testing.assert_allclose(found.frame.X_WC, X_WC, atol=1e-12)
    assert found.noise is not None
    assert found.noise.axial_constant == 0.003
    assert found.boxes is None


def test_a_rotation_of_few_digits_becomes_one(folder):
    R = np.round(rotation_from_vector(np.array([0.3, -0.2, 1.0])), 4)
    assert np.abs(R @ R.T - np.eye(3)).max() > 1e-5
    (folder / "camera.json").write_text(json.dumps(CAMERA | {"X_WC": transform(R, np.ones(3)).tolist()}))
    found = read_frame(folder).frame.X_WC[:3, :3]
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found, R, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fx": 0}, "fx is 0; expected a finite number over 0"),
        ({"fy": float("nan")}, "fy is nan"),
        ({"cx": None}, "cx is None; expected a finite number"),
        ({"cy": 10**400}, "cy is 1000.*; expected a finite number"),
        ({"cx": 1e7}, r"cx is 10000000.0; expected a finite number, at most 1e\+06"),
        ({"fx": 1e-310}, "fx, fy are 1e-310, 501; expected pixels, at least 1"),
        ({"X_WC": transform(np.eye(3), np.full(3, 1e300)).tolist()}, "X_WC is no rigid motion"),
        ({"noise": {"axial_constant": 1e300}}, r"axial_constant is 1e\+300, expected a number from 0 to"),
        ({"cx": 1e5}, "cx, cy are 100000, 100; expected pixels, in or near 320 x 200"),
        ({"width": "wide"}, "width is 'wide'"),
        ({"height": 100}, "expected camera.json's 320 x 100"),
        ({"depth_scale": -1}, "depth_scale is -1"),
        ({"depth_scale": 1.0}, r"farther than 800 m; expected camera.json's depth_scale"),
        ({"depth_scale": 1e-6}, "nearer than"),
        ({"X_WC": [[1, 2], [3, 4]]}, "X_WC is no rigid motion"),
        ({"X_WC": (2 * np.eye(4)).tolist()}, "X_WC is no rigid motion"),
        ({"X_WC": np.diag([1, 1, -1, 1]).tolist()}, "X_WC is no rigid motion"),
        ({"noise": {"grain": 1}}, "unknown key 'grain'"),
        ({"noise": {"axial_constant": "much"}}, "expected"),
        ({"noise": {"enabled": "abc"}}, "enabled is 'abc', expected true or false"),
        ({"noise": {"shadows": 1}}, "shadows is 1, expected true or false"),
        ({"noise": 3}, "is no object"),
    ],
)
def test_cameras_that_cannot_be_used(folder, change, words):
    (folder / "camera.json").write_text(json.dumps(CAMERA | change))
    with pytest.raises(InputError, match=words) as caught:
        read_frame(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("all", "is no list"),
        ([3], "entry 0: has no label"),
        ([BOX, {"label": "mug"}], "entry 1: box is None"),
        ([BOX | {"box": [1, 2, 3]}], "expected four finite numbers"),
        ([BOX | {"box": [1, 2, 3, float("nan")]}], "expected four finite numbers"),
        ([BOX | {"score": 2}], "score is 2; expected a probability"),
    ],
)
def test_boxes_that_cannot_be_used(folder, entry, words):
    (folder / "detections.json").write_text(json.dumps(entry))
    with pytest.raises(InputError, match=words):
        read_frame(folder)


def test_files_that_are_missing_or_no_such_thing(folder, tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        read_frame(tmp_path / "nowhere")
    (folder / "detections.json").write_text("{")
    with pytest.raises(InputError, match="expected JSON"):
        read_frame(folder)
    (folder / "detections.json").unlink()
    cv2.imwrite(str(folder / "depth.png"), np.full((200, 321), 800, np.uint16))
    with pytest.raises(InputError, match="its picture's 320 x 200"):
        read_frame(folder)
    (folder / "camera.json").unlink()
    with pytest.raises(InputError, match=r"camera\.json"):
        read_frame(folder)


def test_a_picture_without_any_depth_is_a_frame_in_which_nothing_is_seen(folder):
    cv2.imwrite(str(folder / "depth.png"), np.zeros((200, 320), np.uint16))
    assert not read_frame(folder).frame.depth.any()
