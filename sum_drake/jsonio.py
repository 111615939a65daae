"""The values of `types.py` as plain JSON data, and back."""

import dataclasses
import json
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.files import write_whole
from sum_drake.types import readonly


def encode(value: Any, real: Callable[[float], Any] = float) -> Any:
    """Dataclasses as objects, tuples and arrays as lists; `real` says how a floating-point number is written.

    Fields that are marked `types.APART` are left out.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = (field.name for field in dataclasses.fields(value) if not field.metadata.get("apart"))
        return {name: encode(getattr(value, name), real) for name in fields}
    if isinstance(value, Mapping):
        return {str(key): encode(item, real) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return encode(value.tolist(), real)
    if isinstance(value, list | tuple):
        return [encode(item, real) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        return real(float(value))
    if isinstance(value, int | np.integer):
        return int(value)
    if value is None or isinstance(value, str):
        return value
    raise TypeError(f"cannot encode {type(value).__name__} as JSON")


def decode(kind: Any, data: Any) -> Any:
    """The inverse of `encode` for a type of `types.py`. Raises ValueError, TypeError or KeyError for other data.

    Fields that have a default may be missing: a log written before they existed stays readable.
    """
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if hasattr(origin, "__value__"):  # a `type` statement, as which numpy defines NDArray on Python 3.12
        return decode(origin.__value__[args], data)
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        values = {f.name: decode(hints[f.name], data[f.name]) for f in dataclasses.fields(kind) if f.name in data}
        return typing.cast(Any, kind)(**values)
    if origin is np.ndarray:
        return readonly(data, typing.get_args(args[1])[0])
    if origin is tuple:
        items = args[:1] * len(data) if args[1:] == (Ellipsis,) else args
        return tuple(decode(item, entry) for item, entry in zip(items, data, strict=True))
    if origin is list:
        return [decode(args[0], entry) for entry in data]
    if origin in (types.UnionType, typing.Union):
        return None if data is None else decode(next(arg for arg in args if arg is not type(None)), data)
    if kind is float:
        return float(data)
    if not isinstance(data, kind):
        raise TypeError(f"got {type(data).__name__}, expected {kind.__name__}")
    return data


def canonical(value: Any) -> str:
    """JSON text that is equal exactly when the value is: sorted keys, no spaces, numbers as `float.hex`."""
    return json.dumps(encode(value, float.hex), sort_keys=True, separators=(",", ":"), allow_nan=False)


def write_json(path: Path, data: Any) -> None:
    """Plain data as indented JSON, whole or not at all."""
    write_whole(path, json.dumps(encode(data), indent=1, allow_nan=False) + "\n")
