"""Frame folders: one RGB-D picture with its camera and, if there are any, boxes. What cannot be used is refused.

color.png        8 bits a channel
depth.png        16 bits, z-depth, 0 where it is missing
camera.json      fx, fy, cx, cy, width, height, depth_scale; X_WC and noise if known
detections.json  boxes with labels, optional
"""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError, one_line
from sum_drake.detection.picture import read_depth, read_picture
from sum_drake.geometry import transform
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.types import Array, Box, Camera, Frame, Immutable, readonly

LARGEST = 1e6
"""No number of a frame is larger: pixels, or pixels a unit."""
FAR_OUT = 4.0
"""Sizes of the picture that its principal point is from its corner at most."""
NEAREST, FARTHEST = 0.05, 20.0
"""Metres: what the middle of a depth picture's values lies between, if they are in the unit that is said."""


@dataclasses.dataclass(frozen=True)
class LabelledBox(Immutable):
    """A box that is said to hold an object."""

    label: str
    box: Box
    score: float
    """Probability of it, p(b | z) p(o | b, z)."""


@dataclasses.dataclass(frozen=True, eq=False)
class FrameFolder(Immutable):
    """What a frame folder holds."""

    frame: Frame
    """X_WC is the identity where the folder says nothing of it."""
    boxes: tuple[LabelledBox, ...] | None
    """None: there is no detections.json."""
    noise: DepthNoiseConfig | None
    """Of the depth sensor; None: nothing is said of it."""


def read_frame(folder: Path) -> FrameFolder:
    """Reads a frame folder. Raises InputError for anything in it that cannot be used."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected one with color.png, depth.png and camera.json")
    about = _object(_read_json(folder / "camera.json"), folder / "camera.json")
    camera, scale = _camera(about, folder / "camera.json"), _number(about, "depth_scale", folder / "camera.json", 0.0)
    color = read_picture(folder / "color.png")
    size = camera.height, camera.width
    if color.shape[:2] != size:
        raise InputError(
            f"{folder / 'color.png'}: is {color.shape[1]} x {color.shape[0]} pixels; "
            f"expected camera.json's {camera.width} x {camera.height}"
        )
    depth = read_depth(folder / "depth.png", size, scale=scale)
    _check_unit(depth, folder / "depth.png")
    X_WC = _pose(about["X_WC"], folder / "camera.json") if "X_WC" in about else np.eye(4)
    noise = _noise(about["noise"], folder / "camera.json") if "noise" in about else None
    boxes = folder / "detections.json"
    return FrameFolder(
        Frame(0, readonly(color, np.uint8), readonly(depth, np.float32), camera, readonly(X_WC)),
        _boxes(_read_json(boxes), boxes) if boxes.is_file() else None,
        noise,
    )


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; expected a frame folder's {path.name}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected JSON") from error


def _object(data: Any, path: Path) -> Mapping[str, Any]:
    if not isinstance(data, dict):
        raise InputError(f"{path}: is no object; expected {{fx, fy, cx, cy, width, height, depth_scale}}")
    return data


def _number(data: Mapping[str, Any], key: str, path: Path, over: float | None = None) -> float:
    value: Any = data.get(key)
    expected = f"a finite number{'' if over is None else f' over {over:g}'}, at most {LARGEST:g}"
    if not _is_number(value) or (over is not None and value <= over):
        said = f"is {value!r}" if key in data else "is missing"
        raise InputError(f"{path}: {key} {said}; expected {expected}")
    return float(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(-LARGEST <= value <= LARGEST)


def _camera(about: Mapping[str, Any], path: Path) -> Camera:
    width, height = (_number(about, key, path, 0) for key in ("width", "height"))
    fx, fy = (_number(about, key, path, 0.0) for key in ("fx", "fy"))
    if min(fx, fy) < 1:
        raise InputError(f"{path}: fx, fy are {fx:g}, {fy:g}; expected pixels, at least 1")
    cx, cy = _number(about, "cx", path), _number(about, "cy", path)
    if abs(cx) > FAR_OUT * width or abs(cy) > FAR_OUT * height:
        raise InputError(f"{path}: cx, cy are {cx:g}, {cy:g}; expected pixels, in or near {width:g} x {height:g}")
    return Camera(round(width), round(height), fx, fy, cx, cy)


def _pose(value: Any, path: Path) -> Array:
    try:
        X = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        X = np.zeros(0)
    rigid = X.shape == (4, 4) and (np.abs(X) <= 10 * LARGEST).all() and np.allclose(X[3], [0, 0, 0, 1])
    if not rigid or not np.allclose(X[:3, :3] @ X[:3, :3].T, np.eye(3), atol=1e-3) or np.linalg.det(X[:3, :3]) < 0:
        raise InputError(f"{path}: X_WC is no rigid motion; expected 4 x 4 numbers, metres")
    # A rotation written with few digits is not quite one.
    u, _, vt = np.linalg.svd(X[:3, :3])
    return transform(u @ vt, X[:3, 3])


def _noise(value: Any, path: Path) -> DepthNoiseConfig:
    known = [field.name for field in dataclasses.fields(DepthNoiseConfig)]
    for key in _object(value, path):
        if key not in known:
            raise InputError(f"{path}: noise has an unknown key '{key}'; expected one of {', '.join(known)}")
    try:
        return DepthNoiseConfig(**value)
    except TypeError as error:
        raise InputError(f"{path}: noise: {one_line(error)}; expected numbers") from error


def _check_unit(depth: NDArray[np.float32], path: Path) -> None:
    seen = depth[depth > 0]
    middle = float(np.median(seen)) if len(seen) else 1.0
    if not NEAREST <= middle <= FARTHEST:
        raise InputError(
            f"{path}: half of it is {'nearer' if middle < NEAREST else 'farther'} than {middle:.3g} m; expected "
            "camera.json's depth_scale to be metres a unit (0.001 for millimetres)"
        )


def _boxes(data: Any, path: Path) -> tuple[LabelledBox, ...]:
    if not isinstance(data, list):
        raise InputError(f"{path}: is no list; expected [{{label, box: [x, y, w, h], score}}]")
    found = []
    for i, entry in enumerate(data):
        where = f"{path}: entry {i}"
        if not isinstance(entry, dict) or not isinstance(entry.get("label"), str):
            raise InputError(f"{where}: has no label; expected {{label, box: [x, y, w, h], score}}")
        box, score = entry.get("box"), entry.get("score", 1.0)
        if not (isinstance(box, list) and len(box) == 4 and all(map(_is_number, box))):
            raise InputError(f"{where}: box is {box!r}; expected four finite numbers x, y, w, h, at most {LARGEST:g}")
        if not (_is_number(score) and 0 <= score <= 1):
            raise InputError(f"{where}: score is {score!r}; expected a probability")
        x, y, w, h = (float(side) for side in box)
        found.append(LabelledBox(entry["label"], (x, y, w, h), float(score)))
    return tuple(found)
