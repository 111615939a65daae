"""The detector's data set on disk: pictures with exact boxes, in four splits that share no scene.

    DIR/dataset.json             schema, seed, labels, scenes and views of each split, hash of the catalogue
    DIR/SPLIT/SCENE/VIEW.jpg     colour, as a camera would deliver it
    DIR/SPLIT/SCENE/VIEW_depth.png    16 bit, z-depth in units of `DEPTH_SCALE`, with the sensor's noise, 0 = missing
    DIR/SPLIT/SCENE/scene.json   cameras and objects of each view

A scene's folder is complete or absent. What the pictures show is made by `dataset_scenes.py`.
"""

import dataclasses
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError, one_line
from sum_drake.jsonio import decode, encode
from sum_drake.seeds import derive
from sum_drake.types import Box, Camera, Immutable, readonly

SCHEMA = "sum-drake/dataset/1"
SPLITS = ("train", "validation", "test", "shift")
DEPTH_SCALE = 1e-4
"""Metres a unit of the depth files."""
MIN_PIXELS, MIN_SHARE = 150, 0.25
"""An object with fewer pixels, or less of it visible, is not asked for: see `is_scored`."""
_END = b"\xff\xd9"
"""Of a JPEG."""


@dataclasses.dataclass(frozen=True)
class AnnotatedObject(Immutable):
    """One object of the catalogue that a picture shows at least a pixel of."""

    label: str
    box: Box
    """Of its visible pixels, exact."""
    visible_share: float
    """Visible pixels over those it would have if nothing stood before it and the picture were larger: what the
    border cuts off counts as hidden."""
    pixels: int
    """Visible pixels."""


@dataclasses.dataclass(frozen=True, eq=False)
class AnnotatedImage(Immutable):
    """A picture with what is on it."""

    name: str
    """Split, scene, view: "test/00012/3"."""
    color: NDArray[np.uint8]
    """(h, w, 3), RGB."""
    depth: NDArray[np.float32]
    """(h, w), z-depth in metres with the sensor's noise, 0 where it returned nothing."""
    camera: Camera
    objects: tuple[AnnotatedObject, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class EncodedImage(Immutable):
    """A picture as it lies on disk."""

    jpeg: bytes
    depth_png: bytes
    camera: Camera
    objects: tuple[AnnotatedObject, ...]

    def decode(self, name: str) -> AnnotatedImage:
        """The picture. Raises ValueError for damaged data."""
        # OpenCV fills up a JPEG that was cut off, and does not accept nothing.
        bgr = cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR) if self.jpeg[-2:] == _END else None
        depth = cv2.imdecode(np.frombuffer(self.depth_png, np.uint8), cv2.IMREAD_UNCHANGED) if self.depth_png else None
        shape = self.camera.height, self.camera.width
        if bgr is None or bgr.shape[:2] != shape:
            raise ValueError(f"the picture is damaged; expected a JPEG of {shape[1]} x {shape[0]} pixels")
        if depth is None or depth.shape != shape or depth.dtype != np.uint16:
            raise ValueError(f"the depth is damaged; expected a PNG of {shape[1]} x {shape[0]} pixels, 16 bit")
        metres = (depth * np.float64(DEPTH_SCALE)).astype(np.float32)
        return AnnotatedImage(
            name, readonly(bgr[..., ::-1], np.uint8), readonly(metres, np.float32), self.camera, self.objects
        )


def is_scored(o: AnnotatedObject) -> bool:
    """Whether an object is large and visible enough to be asked for; others are neither right nor wrong to find."""
    return o.pixels >= MIN_PIXELS and o.visible_share >= MIN_SHARE


def scene_entropy(seed: int, split: str, scene: int) -> tuple[int, int, int]:
    """Entropy of a scene's random numbers; no two scenes of any splits share it. Raises InputError."""
    if split not in SPLITS:
        raise InputError(f"split '{split}': expected one of {', '.join(SPLITS)}")
    return derive(seed, f"dataset {split}"), SPLITS.index(split), scene


def encode_depth(depth: NDArray[np.floating]) -> bytes:
    """Depth (h, w) in metres as a 16 bit PNG in units of `DEPTH_SCALE`; what is beyond its range is missing."""
    units = np.rint(np.asarray(depth, dtype=np.float64) / DEPTH_SCALE)
    png = cv2.imencode(
        ".png",
        np.where(units <= np.iinfo(np.uint16).max, units, 0).astype(np.uint16),
        [cv2.IMWRITE_PNG_COMPRESSION, 1],
    )[1]
    return bytes(png.tobytes())


# --- scenes on disk --------------------------------------------------------------------------------------------------


def scene_folder(folder: Path, split: str, scene: int) -> Path:
    """Where a scene lies."""
    return folder / split / f"{scene:05d}"


def write_scene(folder: Path, images: Sequence[EncodedImage]) -> None:
    """Writes a scene's folder whole: it takes its name when all is in it."""
    temporary = folder.with_name(f".{folder.name}.part")
    if temporary.exists():
        for left in temporary.iterdir():
            left.unlink()
    temporary.mkdir(parents=True, exist_ok=True)
    for view, image in enumerate(images):
        (temporary / f"{view}.jpg").write_bytes(image.jpeg)
        (temporary / f"{view}_depth.png").write_bytes(image.depth_png)
    views = [{"camera": encode(image.camera), "objects": encode(image.objects)} for image in images]
    (temporary / "scene.json").write_text(json.dumps({"depth_scale": DEPTH_SCALE, "views": views}, indent=1) + "\n")
    temporary.rename(folder)


def read_settings(folder: Path) -> dict[str, Any]:
    """The content of dataset.json. Raises InputError for a folder that holds no data set."""
    file = folder / "dataset.json"
    try:
        settings = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise InputError(
            f"{folder}: no data set ({one_line(error)}); expected a folder that sum-drake dataset wrote"
        ) from error
    if not isinstance(settings, dict) or settings.get("schema") != SCHEMA:
        raise InputError(f"{file}: expected schema {SCHEMA}")
    return settings


class ImageSet(Sequence[AnnotatedImage]):
    """The pictures of one split of a folder, read when asked for, in the order of scenes and views.

    Scenes that are not there yet are left out; `complete` says whether there are any. Raises InputError for a folder
    that holds no data set, for a split it lacks and, when read, for a damaged file.
    """

    def __init__(self, folder: Path, split: str) -> None:
        if split not in SPLITS:
            raise InputError(f"split '{split}': expected one of {', '.join(SPLITS)}")
        self.settings = read_settings(folder)
        """What dataset.json says of how the pictures were made."""
        try:
            expected = int(self.settings["scenes"][split])
            self.labels = tuple(str(label) for label in self.settings["labels"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{folder / 'dataset.json'}: expected labels, and scenes of each split") from error
        self._folder = folder
        scenes = [k for k in range(expected) if scene_folder(folder, split, k).is_dir()]
        if not scenes:
            raise InputError(f"{folder}: has no scene of the split '{split}'; expected sum-drake dataset to be done")
        self.complete = len(scenes) == expected
        """Whether all scenes that were asked for have been rendered."""
        self._views: list[tuple[str, Camera, tuple[AnnotatedObject, ...]]] = []
        for k in scenes:
            for view, (camera, objects) in enumerate(_read_scene(scene_folder(folder, split, k))):
                self._views.append((f"{split}/{k:05d}/{view}", camera, objects))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the pictures, in order."""
        return tuple(name for name, _, _ in self._views)

    def objects(self, index: int) -> tuple[AnnotatedObject, ...]:
        """What is on a picture, without reading the picture."""
        return self._views[index][2]

    def __len__(self) -> int:
        return len(self._views)

    @overload
    def __getitem__(self, index: int) -> AnnotatedImage: ...
    @overload
    def __getitem__(self, index: slice) -> list[AnnotatedImage]: ...
    def __getitem__(self, index: int | slice) -> AnnotatedImage | list[AnnotatedImage]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        name, camera, objects = self._views[index]
        file = self._folder / name
        try:
            jpeg, png = file.with_name(f"{file.name}.jpg"), file.with_name(f"{file.name}_depth.png")
            return EncodedImage(jpeg.read_bytes(), png.read_bytes(), camera, objects).decode(name)
        except (OSError, ValueError, cv2.error) as error:
            raise InputError(f"{file}: {one_line(error)}; render the scene again: delete its folder first") from error

    def __iter__(self) -> Iterator[AnnotatedImage]:
        return (self[i] for i in range(len(self)))


def _read_scene(folder: Path) -> list[tuple[Camera, tuple[AnnotatedObject, ...]]]:
    """Camera and objects of each view."""
    try:
        data = json.loads((folder / "scene.json").read_text())
        return [
            (decode(Camera, view["camera"]), decode(tuple[AnnotatedObject, ...], view["objects"]))
            for view in data["views"]
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{folder / 'scene.json'}: damaged ({one_line(error)}); delete the scene's folder and render it again"
        ) from error
