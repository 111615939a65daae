"""Whether data that was read from JSON has the shape that it should."""

import math
import types
import typing
from typing import Any

from sum_drake.assets import InputError


def check_shape(value: Any, kind: Any, where: str) -> None:
    """Raises InputError, naming the place, for data that is not of a kind.

    kind: a type, a union of a type and None, [kind of a row], {field: kind} or {str: kind of every entry}; fields that
    are not named are let through. A float is a finite number, an int no bool. where: what stands before the name.
    """
    if isinstance(kind, list):
        if not isinstance(value, list):
            raise InputError(f"{where}: {type(value).__name__}; expected a list")
        for i, item in enumerate(value):
            check_shape(item, kind[0], f"{where}[{i}]")
    elif isinstance(kind, dict):
        if not isinstance(value, dict):
            raise InputError(f"{where}: {type(value).__name__}; expected an object")
        for name, item in kind.items():
            if name is str:
                for key, entry in value.items():
                    check_shape(entry, item, f"{where}.{key}")
            elif name not in value:
                raise InputError(f"{where}.{name}: missing; expected {_name(item)}")
            else:
                check_shape(value[name], item, f"{where}.{name}")
    elif isinstance(kind, types.UnionType):
        if value is not None:
            check_shape(value, typing.get_args(kind)[0], where)
    elif kind is float:
        if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
            raise InputError(f"{where}: {value!r}; expected a finite number")
    elif not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"{where}: {value!r}; expected {_name(kind)}")


def _name(kind: Any) -> str:
    if isinstance(kind, list | dict):
        return "a list" if isinstance(kind, list) else "an object"
    return str(getattr(kind, "__name__", kind))
