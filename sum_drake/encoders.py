"""How values on ports are written into a log: by their type, as JSON or as a message of Foxglove's.

    from foxglove import messages
    from sum_drake.encoders import register_encoder

    register_encoder(Wind, lambda wind, time, name: {"speed": wind.speed, "from": wind.direction})

An encoder is given the value, the time in seconds and the name of the port, and returns a `foxglove.messages` message
or a mapping of plain JSON data. Which one a type has: that of its nearest base class that has one; else, for a
dataclass, its fields by `jsonio.encode`. Numbers that JSON cannot hold become null.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from sum_drake.jsonio import encode
from sum_drake.types import Array, Frame, Perception

Encode = Callable[[Any, float, str], Any]
"""(value, time in seconds, name of the port) -> a message of `foxglove.messages`, or a mapping of JSON data."""


@dataclasses.dataclass(frozen=True)
class Encoder:
    """How values of a type are written."""

    encode: Encode
    key: Callable[[Any], Hashable] | None = None
    """Equal for values that are equal, so that only changes are written; default: their encoding, which takes longer
    for what is large."""


_ENCODERS: dict[type, Encoder] = {}


def register_encoder(kind: type, encode: Encode, *, key: Callable[[Any], Hashable] | None = None) -> None:
    """Says how values of a type, and of its subclasses, are written from now on; goes over what was said before."""
    _ENCODERS[kind] = Encoder(encode, key)


def encoder_of(kind: type) -> Encoder | None:
    """The encoder of a type, None where there is none."""
    _register_drake_types()
    for base in kind.__mro__:
        if base in _ENCODERS:
            return _ENCODERS[base]
    return Encoder(_plain) if dataclasses.is_dataclass(kind) else None


def joint_states(names: Sequence[str]) -> Encode:
    """An encoder for a vector of joint positions, or of positions and then velocities: foxglove.JointStates."""

    def encode_joints(value: Any, time: float, name: str) -> Any:
        from foxglove import messages

        vector = _array(value)
        if vector.shape not in ((len(names),), (2 * len(names),)):
            raise ValueError(
                f"has the shape {vector.shape}; expected positions of {len(names)} joints, or velocities too"
            )
        velocities = vector[len(names) :].tolist() or [None] * len(names)
        return messages.JointStates(
            timestamp=timestamp(time),
            joints=[
                messages.JointState(name=joint, position=position, velocity=velocity)
                for joint, position, velocity in zip(names, vector[: len(names)].tolist(), velocities, strict=True)
            ],
        )

    return encode_joints


def named(names: Sequence[str]) -> Encode:
    """An encoder for a vector whose elements have names: a JSON object of numbers, to plot each by its name."""
    return lambda value, time, name: dict(zip(names, _plain(value, time, name)["values"], strict=True))


def poses(value: Any, time: float, name: str) -> Any:
    """An encoder for one pose or several in the world, `RigidTransform` or (4, 4): foxglove.FrameTransforms.

    The frame of a single one is called by the port's name, those of several NAME_0, NAME_1, ...
    """
    several = isinstance(value, list | tuple) or np.ndim(value) == 3
    names = [f"{name}_{i}" for i in range(len(value))] if several else [name]
    return frames(names)(value if several else [value], time, name)


def frames(names: Sequence[str]) -> Encode:
    """As `poses`, for several whose frames have these names."""

    def encode_poses(Xs: Any, time: float, name: str) -> Any:
        from foxglove import messages

        if len(Xs) != len(names):
            raise ValueError(f"has {len(Xs)} poses; expected one for each of the {len(names)} names of frames")
        transforms = [transform(_matrix(X), child, time) for X, child in zip(Xs, names, strict=True)]
        return messages.FrameTransforms(transforms=transforms)

    return encode_poses


def color_image(color: Any, time: float, name: str) -> Any:
    """(h, w, 3 or 4) uint8 RGB, without its alpha, as foxglove.CompressedImage: PNG, lossless."""
    from foxglove import messages

    _, png = cv2.imencode(".png", np.ascontiguousarray(color[..., 2::-1]))
    return messages.CompressedImage(timestamp=timestamp(time), frame_id=name, data=png.tobytes(), format="png")


def raw_image(pixels: Any, time: float, name: str) -> Any:
    """(h, w) float32 (metres), uint16, int16 (labels, not negative) or uint8 as foxglove.RawImage."""
    from foxglove import messages

    kinds = {"f4": "32FC1", "u2": "16UC1", "i2": "16UC1", "u1": "8UC1"}
    kind = pixels.dtype.str[1:]
    if pixels.ndim != 2 or kind not in kinds:
        raise ValueError(f"has the shape {pixels.shape} of {pixels.dtype}; expected (h, w) of {', '.join(kinds)}")
    height, width = pixels.shape
    data = np.ascontiguousarray(pixels, dtype=f"<{kind}").tobytes()
    return messages.RawImage(
        timestamp=timestamp(time), frame_id=name, width=width, height=height, encoding=kinds[kind],
        step=len(data) // height, data=data,
    )  # fmt: skip


def timestamp(time: float) -> Any:
    """Seconds as Foxglove's messages hold them."""
    from foxglove import messages

    seconds, nanoseconds = divmod(round(time * 1e9), 1_000_000_000)
    return messages.Timestamp(sec=seconds, nsec=nanoseconds)


def transform(X_WF: Array, frame: str, time: float) -> Any:
    """The pose (4, 4) of a frame in the world as foxglove.FrameTransform."""
    from foxglove import messages

    return messages.FrameTransform(
        timestamp=timestamp(time), parent_frame_id="world", child_frame_id=frame,
        translation=vector(X_WF[:3, 3]), rotation=quaternion(X_WF),
    )  # fmt: skip


def vector(p: Array) -> Any:
    """(3,) as foxglove.Vector3."""
    from foxglove import messages

    return messages.Vector3(x=float(p[0]), y=float(p[1]), z=float(p[2]))


def quaternion(X: Array) -> Any:
    """The rotation of a pose (4, 4) as foxglove.Quaternion."""
    from foxglove import messages

    x, y, z, w = (float(value) for value in Rotation.from_matrix(X[:3, :3]).as_quat())
    return messages.Quaternion(w=w, x=x, y=y, z=z)


def _plain(value: Any, time: float, name: str) -> Mapping[str, Any]:
    """JSON data of anything `jsonio.encode` takes, as an object: numbers in `values`, a single thing in `value`."""
    data = encode(_array(value) if hasattr(value, "CopyToVector") else value, _finite)
    if isinstance(data, dict):
        return data
    return {"values" if isinstance(data, list) else "value": data}


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _array(value: Any) -> Array:
    """A vector of Drake's, or of anybody's, as an array."""
    return np.asarray(value.CopyToVector() if hasattr(value, "CopyToVector") else value, dtype=np.float64)


def _matrix(X: Any) -> Array:
    """(4, 4) of a RigidTransform or of what is one."""
    matrix: Array = np.asarray(X.GetAsMatrix4() if hasattr(X, "GetAsMatrix4") else X, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise ValueError(f"a pose has the shape {matrix.shape}; expected (4, 4)")
    return matrix


def _list(value: Sequence[Any], time: float, name: str) -> Any:
    is_poses = bool(value) and all(hasattr(item, "GetAsMatrix4") for item in value)
    return poses(value, time, name) if is_poses else _plain(value, time, name)


def _bare(perception: Perception, time: float, name: str) -> Mapping[str, Any]:
    """Without its pictures, which are no good as JSON: log the port of the frame as well."""
    return _plain(dataclasses.replace(perception, frame=without_pictures(perception.frame)), time, name)


def without_pictures(frame: Frame) -> Frame:
    """The same frame with empty pictures."""
    return dataclasses.replace(frame, color=np.zeros((0, 0, 3), np.uint8), depth=np.zeros((0, 0), np.float32))


def _bytes(array: Any) -> Hashable:
    return array.shape, array.tobytes()


_kind: type
for _kind in (str, bool, int, float, dict):
    register_encoder(_kind, _plain)
for _kind in (list, tuple):
    register_encoder(_kind, _list)
register_encoder(np.ndarray, _plain, key=_bytes)
# Of pictures and of what was made of them the observation's number says which they are.
register_encoder(Frame, lambda frame, time, name: color_image(frame.color, time, name), key=lambda f: f.observation)
register_encoder(Perception, _bare, key=lambda perception: perception.step)


@functools.cache
def _register_drake_types() -> None:
    """Once they are asked for: who reads logs need not wait for Drake. What the user has said of them stands."""
    from pydrake.math import RigidTransform
    from pydrake.systems import sensors
    from pydrake.systems.framework import BasicVector

    def color(image: Any, time: float, name: str) -> Any:
        return color_image(image.data, time, name)

    def color_of_bgr(image: Any, time: float, name: str) -> Any:
        return color_image(image.data[..., 2::-1], time, name)

    def raw(image: Any, time: float, name: str) -> Any:
        return raw_image(image.data[..., 0], time, name)

    pictures = {
        color: (sensors.ImageRgb8U, sensors.ImageRgba8U),
        color_of_bgr: (sensors.ImageBgr8U, sensors.ImageBgra8U),
        raw: (sensors.ImageDepth32F, sensors.ImageDepth16U, sensors.ImageLabel16I, sensors.ImageGrey8U),
    }
    for write, kinds in pictures.items():
        for kind in kinds:
            _ENCODERS.setdefault(kind, Encoder(write, lambda image: _bytes(image.data)))
    _ENCODERS.setdefault(RigidTransform, Encoder(poses, lambda X: _bytes(X.GetAsMatrix34())))
    _ENCODERS.setdefault(BasicVector, Encoder(_plain, lambda vector: _bytes(vector.CopyToVector())))
