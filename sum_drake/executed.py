"""How much of its limits the robot used in what it did: positions, speeds and efforts as they were measured."""

import dataclasses
from typing import Any

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
"""Share of a drive's effort from which on it counts as giving all it has: more than that no measurement can show."""

_ORDER = np.array([STATE_JOINTS.index(joint) for joint in JOINTS])
"""Where each of JOINTS stands in the measured state."""


@dataclasses.dataclass(frozen=True, eq=False)
class LimitUse(Immutable):
    """Of all samples; shares of a limit, 1 is at the limit, over `robot.JOINTS`."""

    samples: int
    position: Array
    """(12,): largest distance from the middle of a joint's range, by half of it; 0 for joints that turn without end."""
    speed: Array
    """(12,)."""
    acceleration: Array
    """(8,), of ARM_JOINTS: by differences of measured speeds, so that whatever is met shows."""
    effort: Array
    """(12,)."""
    at_full_effort: Array
    """(12,): share of the samples in which a drive gave all it has, as fingers that hold something are meant to."""
    violations: tuple[tuple[str, int], ...]
    """Samples in which some joint was beyond a limit, or a drive of the arm at the limit of its effort, by kind."""
    violated_by: tuple[tuple[str, int], ...]
    """Joints of which that is true, and of how many samples each."""

    def row(self) -> dict[str, Any]:
        """`limits` of summary.json: the most that any joint used; of efforts the arm's, as fingers push with all."""
        return {
            "samples": self.samples,
            "position_use": float(self.position.max()),
            "speed_use": float(self.speed.max()),
            "acceleration_use": float(self.acceleration.max()),
            "effort_use": float(self.effort[: len(ARM_JOINTS)].max()),
            "violations": dict(self.violations),
            "violated_by": dict(self.violated_by),
        }

    @property
    def violated(self) -> int:
        """Violations of all kinds."""
        return sum(count for _, count in self.violations)


def limit_use(states: Array, efforts: Array, step: float) -> LimitUse:
    """What was used, and what was violated.

    No drive gives more than it has, and the measured effort is what it gives: a drive of the arm that gives all of it
    counts as a violation, since its motion may have asked for more. Fingers that squeeze are meant to.
    states: (n, 24) measured states of the station, `step` seconds from one to the next; efforts: (n, 12), measured.
    """
    n = len(JOINTS)
    q, v = states[:, :n][:, _ORDER], states[:, n:][:, _ORDER]
    lower, upper = np.array([joint.lower for joint in JOINTS]), np.array([joint.upper for joint in JOINTS])
    ends = np.array([joint.kind != "continuous" for joint in JOINTS])
    position = np.zeros_like(q)
    position[:, ends] = np.abs(2 * q[:, ends] - lower[ends] - upper[ends]) / (upper - lower)[ends]
    speed = np.abs(v) / np.array([joint.velocity for joint in JOINTS])
    effort = np.abs(efforts) / np.array([joint.effort for joint in JOINTS])
    full = effort >= FULL
    acceleration = np.abs(np.diff(v[:, : len(ARM_JOINTS)], axis=0)) / step / ACCELERATION
    beyond = {
        "position": (q < lower - POSITION_SLACK) | (q > upper + POSITION_SLACK),
        "speed": speed > 1.0 + SPEED_SLACK,
        "effort": full[:, : len(ARM_JOINTS)],
    }
    by_joint = np.pad(beyond["effort"], ((0, 0), (0, n - len(ARM_JOINTS)))) | beyond["position"] | beyond["speed"]
    return LimitUse(
        samples=len(states),
        position=readonly(position.max(0, initial=0.0)),
        speed=readonly(speed.max(0, initial=0.0)),
        acceleration=readonly(acceleration.max(0, initial=0.0)),
        effort=readonly(effort.max(0, initial=0.0)),
        at_full_effort=readonly(full.sum(0) / max(len(full), 1)),
        violations=tuple((kind, int(beyond[kind].any(1).sum())) for kind in KINDS),
        violated_by=tuple((joint.name, int(m)) for joint, m in zip(JOINTS, by_joint.sum(0), strict=True) if m),
    )
