import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.assets import InputError
from sum_drake.detection.dataset import (
    SCHEMA,
    SPLITS,
    AnnotatedObject,
    EncodedImage,
    ImageSet,
    encode_depth,
    is_scored,
    read_settings,
    scene_entropy,
    scene_folder,
    write_scene,
)
from sum_drake.types import Camera

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def picture(value: int, label: str = "mug") -> EncodedImage:
    """A grey picture with one object, at a depth that says which it is."""
    color = np.full((48, 64, 3), value, np.uint8)
    jpeg = cv2.imencode(".jpg", color)[1].tobytes()
    depth = np.full((48, 64), value / 100, np.float32)
    return EncodedImage(jpeg, encode_depth(depth), CAMERA, (AnnotatedObject(label, (1.0, 2.0, 30.0, 20.0), 0.5, 400),))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three validation scenes of two views each, of which the middle one is not there yet."""
    settings = {"schema": SCHEMA, "seed": 0, "labels": ["mug", "tide"], "scenes": {"validation": 3}, "views": {}}
    (tmp_path / "dataset.json").write_text(json.dumps(settings))
    write_scene(scene_folder(tmp_path, "validation", 0), [picture(50), picture(60)])
    write_scene(scene_folder(tmp_path, "validation", 2), [picture(70), picture(80, "tide")])
    return tmp_path


# --- seeds -----------------------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**63), scenes=st.lists(st.integers(0, 10_000), min_size=2, max_size=2))
def test_no_two_splits_share_a_scene(seed: int, scenes: list[int]) -> None:
    drawn = {split: {scene_entropy(seed, split, scene) for scene in scenes} for split in SPLITS}
    for a in SPLITS:
        assert len(drawn[a]) == len(set(scenes))
        for b in SPLITS:
            assert a == b or not drawn[a] & drawn[b]


def test_scenes_of_the_default_sizes_draw_different_numbers() -> None:
    first = [
        tuple(np.random.default_rng([*scene_entropy(0, split, scene), 0]).integers(0, 2**63, 2).tolist())
        for split in SPLITS
        for scene in range(560)
    ]
    assert len(set(first)) == len(first)


def test_an_unknown_split_is_refused() -> None:
    with pytest.raises(InputError, match="split 'dev': expected one of train, validation, test, shift"):
        scene_entropy(0, "dev", 0)


# --- pictures --------------------------------------------------------------------------------------------------------


@given(st.lists(st.floats(0, 6.5, width=32), min_size=4, max_size=4))
def test_depth_comes_back_to_half_a_tenth_of_a_millimetre(values: list[float]) -> None:
    camera = Camera(2, 2, 1.0, 1.0, 0.5, 0.5)
    depth = np.array(values, np.float32).reshape(2, 2)
    jpeg = cv2.imencode(".jpg", np.zeros((2, 2, 3), np.uint8))[1].tobytes()
    decoded = EncodedImage(jpeg, encode_depth(depth), camera, ()).decode("a")
    assert decoded.depth.dtype == np.float32
    np.testing.assert_allclose(decoded.depth, depth, atol=0.51e-4)


def test_depth_beyond_the_format_is_missing_rather_than_wrapped() -> None:
    png = encode_depth(np.array([[6.5536, 7.0, 100.0, 1.0]]))
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(png, np.uint8), -1), [[0, 0, 0, 10_000]])


def test_colours_come_back_as_rgb() -> None:
    color = np.zeros((48, 64, 3), np.uint8)
    color[..., 2] = 255  # red, as OpenCV orders it
    image = EncodedImage(cv2.imencode(".jpg", color)[1].tobytes(), picture(1).depth_png, CAMERA, ()).decode("a")
    assert image.color[10, 10, 0] > 240 and image.color[10, 10, 2] < 15


@pytest.mark.parametrize(
    ("pixels", "share", "scored"), [(150, 0.25, True), (149, 1.0, False), (5000, 0.249, False), (5000, 1.0, True)]
)
def test_small_and_hidden_objects_are_not_scored(pixels: int, share: float, scored: bool) -> None:
    assert is_scored(AnnotatedObject("mug", (0.0, 0.0, 9.0, 9.0), share, pixels)) is scored


# --- folders ---------------------------------------------------------------------------------------------------------


def test_pictures_come_in_the_order_of_scenes_and_views(folder: Path) -> None:
    images = ImageSet(folder, "validation")
    assert images.names == ("validation/00000/0", "validation/00000/1", "validation/00002/0", "validation/00002/1")
    assert [image.name for image in images] == list(images.names)
    assert [round(float(image.depth[0, 0]), 4) for image in images] == [0.5, 0.6, 0.7, 0.8]
    assert images[3].color[20, 20].tolist() == [80, 80, 80] and images[3].camera == CAMERA
    assert images[-1].objects == images.objects(3) == (AnnotatedObject("tide", (1.0, 2.0, 30.0, 20.0), 0.5, 400),)
    assert [image.name for image in images[1:3]] == list(images.names[1:3])
    with pytest.raises(IndexError):
        images[4]


def test_pictures_cannot_be_written_to(folder: Path) -> None:
    image = ImageSet(folder, "validation")[0]
    for array in (image.color, image.depth):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 0


def test_scenes_that_are_not_there_yet_are_left_out_and_it_says_so(folder: Path) -> None:
    assert not ImageSet(folder, "validation").complete
    write_scene(scene_folder(folder, "validation", 1), [picture(90)])
    images = ImageSet(folder, "validation")
    assert images.complete and len(images) == 5


def test_what_an_interrupted_write_left_is_no_scene_and_does_not_stop_the_next(folder: Path) -> None:
    part = folder / "validation" / ".00001.part"
    part.mkdir()
    (part / "7.jpg").write_bytes(b"half of a picture")
    assert len(ImageSet(folder, "validation")) == 4
    write_scene(scene_folder(folder, "validation", 1), [picture(90)])
    assert sorted(p.name for p in (folder / "validation" / "00001").iterdir()) == ["0.jpg", "0_depth.png", "scene.json"]
    assert not part.exists()


def test_a_folder_that_is_no_data_set_is_refused_in_one_line(tmp_path: Path) -> None:
    for make in (lambda: None, lambda: (tmp_path / "dataset.json").write_text("{]")):
        make()
        with pytest.raises(InputError, match=r"no data set .*expected a folder that sum-drake dataset wrote") as error:
            ImageSet(tmp_path, "train")
        assert "\n" not in str(error.value)
    (tmp_path / "dataset.json").write_text('{"schema": "sum-drake/run/1"}')
    with pytest.raises(InputError, match="expected schema sum-drake/dataset/1"):
        read_settings(tmp_path)


def test_splits_that_are_unknown_or_not_there_are_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="split 'dev': expected one of"):
        ImageSet(folder, "dev")
    with pytest.raises(InputError, match="expected labels, and scenes of each split"):
        ImageSet(folder, "train")
    settings = json.loads((folder / "dataset.json").read_text())
    settings["scenes"]["train"] = 4
    (folder / "dataset.json").write_text(json.dumps(settings))
    with pytest.raises(InputError, match="has no scene of the split 'train'"):
        ImageSet(folder, "train")


@pytest.mark.parametrize(
    ("file", "content", "what"),
    [
        ("0.jpg", b"no picture", "the picture is damaged"),
        ("0.jpg", b"", "the picture is damaged"),
        ("0.jpg", picture(50).jpeg[:-40], "the picture is damaged"),
        ("0.jpg", None, "No such file"),
        ("0_depth.png", b"", "the depth is damaged"),
        ("0_depth.png", b"\x89PNG", "the depth is damaged"),
        ("0_depth.png", cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes(), "16 bit"),
        ("0_depth.png", cv2.imencode(".png", np.zeros((4, 6), np.uint16))[1].tobytes(), "expected a PNG of 64 x 48"),
    ],
)
def test_a_damaged_picture_is_one_line_that_names_it(folder: Path, file: str, content: bytes | None, what: str) -> None:
    path = folder / "validation" / "00000" / file
    path.unlink() if content is None else path.write_bytes(content)
    images = ImageSet(folder, "validation")
    with pytest.raises(InputError, match=what) as error:
        images[0]
    assert "validation/00000/0" in str(error.value) and "\n" not in str(error.value)
    assert images[1].name == "validation/00000/1"


@pytest.mark.parametrize("content", ["", "[]", '{"views": [{"camera": {}, "objects": []}]}', '{"views": [7]}'])
def test_a_damaged_annotation_is_one_line_that_names_it(folder: Path, content: str) -> None:
    (folder / "validation" / "00002" / "scene.json").write_text(content)
    with pytest.raises(InputError, match=r"validation/00002/scene.json: damaged .*delete the scene's folder"):
        ImageSet(folder, "validation")
