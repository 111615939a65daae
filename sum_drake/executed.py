"""How much of its limits the robot used in what it did: positions, speeds and efforts as they were measured."""

import dataclasses

import numpy as np

from sum_drake.robot import ACCELERATION, ARM_JOINTS, JOINTS, STATE_JOINTS
from sum_drake.types import Array, Immutable, readonly

KINDS = ("position", "speed", "effort")
"""Of limits that can be violated."""
POSITION_SLACK = 1e-3
"""Radians or metres: stops give way by less."""
SPEED_SLACK = 0.02
"""Share of a speed limit by which a joint may swing over a plan that keeps within it."""
FULL = 0.999
"""Share of a drive's effort from which on it counts as giving all it has."""

_ORDER = np.array([STATE_JOINTS.index(joint) for joint in JOINTS])
"""Where each of JOINTS stands in the measured state."""
_LOWER, _UPPER = np.array([joint.lower for joint in JOINTS]), np.array([joint.upper for joint in JOINTS])
_SPEED, _EFFORT = np.array([joint.velocity for joint in JOINTS]), np.array([joint.effort for joint in JOINTS])
_MIDDLE = np.array([0.0 if joint.kind == "continuous" else (joint.lower + joint.upper) / 2 for joint in JOINTS])
_ARM = len(ARM_JOINTS)


@dataclasses.dataclass(frozen=True, eq=False)
class LimitUse(Immutable):
    """Of all samples so far; shares of a limit, 1 is at the limit, each (12,) over `robot.JOINTS`."""

    samples: int = 0
    position: Array = dataclasses.field(default_factory=lambda: readonly(np.zeros(len(JOINTS))))
    """Largest distance from the middle of a joint's range, by half of it; 0 for joints that turn without end."""
    speed: Array = dataclasses.field(default_factory=lambda: readonly(np.zeros(len(JOINTS))))
    acceleration: Array = dataclasses.field(default_factory=lambda: readonly(np.zeros(_ARM)))
    """(8,), of ARM_JOINTS: by differences of measured speeds, so that whatever is met shows."""
    effort: Array = dataclasses.field(default_factory=lambda: readonly(np.zeros(len(JOINTS))))
    at_full_effort: Array = dataclasses.field(default_factory=lambda: readonly(np.zeros(len(JOINTS))))
    """Share of the samples in which a drive gave all it has: as fingers that hold something are meant to."""
    violations: tuple[tuple[str, int], ...] = tuple((kind, 0) for kind in KINDS)
    """Samples in which some joint was beyond a limit, by kind of limit."""

    @property
    def violated(self) -> int:
        """Violations of all kinds."""
        return sum(count for _, count in self.violations)


def measured(use: LimitUse, state: Array, effort: Array, before: Array | None = None, step: float = 0.0) -> LimitUse:
    """What was used with one more sample.

    state: the station's measured state (24,); effort: measured (12,). before: the last sample's state, `step` seconds
    ago; without it there is no acceleration.
    """
    n = len(JOINTS)
    q, v = state[:n][_ORDER], state[n:][_ORDER]
    with np.errstate(invalid="ignore"):  # no middle between infinities
        position = np.nan_to_num(np.abs(q - _MIDDLE) / ((_UPPER - _LOWER) / 2))
    speed, pushed = np.abs(v) / _SPEED, np.abs(effort) / _EFFORT
    acceleration = use.acceleration
    if before is not None and step > 0.0:
        acceleration = np.abs(state[n : n + _ARM] - before[n : n + _ARM]) / step / ACCELERATION
    beyond = {
        "position": bool(((q < _LOWER - POSITION_SLACK) | (q > _UPPER + POSITION_SLACK)).any()),
        "speed": bool((speed > 1.0 + SPEED_SLACK).any()),
        "effort": bool((pushed > 1.0 + 1e-6).any()),
    }
    share = 1.0 / (use.samples + 1)
    return LimitUse(
        samples=use.samples + 1,
        position=np.maximum(use.position, position),
        speed=np.maximum(use.speed, speed),
        acceleration=np.maximum(use.acceleration, acceleration),
        effort=np.maximum(use.effort, pushed),
        at_full_effort=use.at_full_effort + share * ((pushed > FULL) - use.at_full_effort),
        violations=tuple((kind, count + beyond[kind]) for kind, count in use.violations),
    )
