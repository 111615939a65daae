"""Python values on Drake's abstract ports and in abstract state."""

from typing import Any

from pydrake.common.value import Value

from sum_drake.types import Immutable


class _Nothing(Immutable):
    """Stands for None, which Drake's Value does not carry since its bindings are nanobind's."""


_NOTHING = _Nothing()


def pack(value: Any) -> Any:
    """What a Value may hold in the place of `value`."""
    return _NOTHING if value is None else value


def unpack(held: Any) -> Any:
    """The inverse of `pack`."""
    return None if isinstance(held, _Nothing) else held


def abstract(value: Any = None) -> Value[object]:
    """A Value that holds any Python object, None too."""
    return Value[object](pack(value))
