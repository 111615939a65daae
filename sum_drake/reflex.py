"""When the arm breaks a motion off by itself, and how: by what its drives and fingers feel, without a picture.

In free motion the drives give what inverse dynamics asks for, to 2 % of what they can give, and to 7 % with an object
in the hand, as measured in runs while this was written; what they give beyond that is the resistance of something that
was not believed to be there. The arm then brakes, and goes back a little on the way that it came, which was free.
A hand that empties while it carries only brakes: what it held is gone.
"""

import dataclasses

import numpy as np

from sum_drake.action_model import holds
from sum_drake.dynamics import ArmDynamics
from sum_drake.playback import desired, running_segment, segment_ends
from sum_drake.robot import ACCELERATION, ARM_JOINTS, arm_positions, arm_velocities, finger_gap, squeeze
from sum_drake.types import Array, Immutable, Motion

CAUSES = {
    "unexpected_effort": "a drive of the arm gave more or less than its motion asks for",
    "tracking_error": "a joint was not where it was to be",
    "empty_hand": "the hand held nothing any more",
}
"""Why a motion is broken off."""
WATCHED = ("approach", "reach", "lift", "transport", "lower", "retreat", "return", "shake")
"""Segments in which the arm moves."""
CARRYING = ("lift", "transport", "lower")
"""Segments in which the hand is to hold something."""
FREE, LOADED = 0.2, 0.3
"""Share of a drive's largest effort by which it may differ from what is expected, with empty hands and while carrying:
ten and four times what it does in free motion. At the hand, stretched out, about 10 N sideways and 25 N downwards."""
ASTRAY = np.array([0.01, *[0.03] * 7])
"""How far a joint may be from where it is to be, metres and radians."""
IN_A_ROW, EMPTY_IN_A_ROW = 2, 4
"""Looks that must agree before the arm reacts."""
BRAKE = 5.0
"""Braking from full speed may take this many times the acceleration that motions are planned with."""
BACK = 0.15
"""So much of its motion the arm goes back before where it met something, seconds."""


@dataclasses.dataclass(frozen=True)
class Strikes(Immutable):
    """For how many looks in a row something has been amiss, by CAUSES."""

    counts: tuple[int, ...] = (0, 0, 0)

    @property
    def cause(self) -> str:
        """What the arm is to be stopped for, or ""."""
        for cause, count, limit in zip(CAUSES, self.counts, (IN_A_ROW, IN_A_ROW, EMPTY_IN_A_ROW), strict=True):
            if count >= limit:
                return cause
        return ""


def look(
    motion: Motion, elapsed: float, gap_start: float, state: Array, effort: Array, before: Strikes, arm: ArmDynamics
) -> Strikes:
    """The strikes after another look at the joints, `elapsed` seconds into a motion.

    state, effort: the station's, measured, (24,) and (12,).
    """
    running = running_segment(motion, elapsed)
    if running is None or motion.segments[running].name not in WATCHED:
        return Strikes()
    load = motion.load if motion.segments[running].name in CARRYING else None
    q, _, _ = desired(motion, elapsed, gap_start)
    expected = arm.efforts(
        arm_positions(state),
        arm_velocities(state),
        _acceleration(motion, elapsed),
        0.0 if load is None else load.mass,
    )
    share = (FREE if load is None else LOADED) * motion.insistence
    limit = share * np.array([joint.effort for joint in ARM_JOINTS])
    amiss = (
        (np.abs(effort[: len(ARM_JOINTS)] - expected) > limit).any(),
        (np.abs(arm_positions(state) - q) > ASTRAY * motion.insistence).any(),
        load is not None and not holds(finger_gap(state), squeeze(effort), load.width),
    )
    return Strikes(tuple(count + 1 if is_so else 0 for count, is_so in zip(before.counts, amiss, strict=True)))


def _acceleration(motion: Motion, elapsed: float, step: float = 0.004) -> Array:
    """(8,): that a motion asks for."""
    return np.asarray((desired(motion, elapsed + step)[1] - desired(motion, max(elapsed - step, 0.0))[1]) / (2 * step))


@dataclasses.dataclass(frozen=True)
class Stop(Immutable):
    """How a motion is broken off: its clock slows down to a halt, and may then run back."""

    cause: str
    elapsed: float
    """What the motion's clock showed when it was decided."""
    braking: float
    """Seconds until the clock stands still."""
    furthest: float
    """What it then shows."""
    back_to: float
    """What it shows in the end."""

    @property
    def going_back(self) -> float:
        """Seconds from standstill to the end: at no more than half the speed, softly."""
        way = self.furthest - self.back_to
        return max(4.0 * way, 0.4) if way > 0.0 else 0.0

    @property
    def duration(self) -> float:
        """Seconds until the arm is at rest for good."""
        return self.braking + self.going_back

    def clock(self, since: float) -> tuple[float, float]:
        """What the motion's clock shows `since` seconds after the decision, and how fast it runs: 1 is usual."""
        if since < self.braking:
            shown = self.elapsed + since - since**2 / (2 * self.braking)
            return (shown, 1.0 - since / self.braking) if shown < self.furthest else (self.furthest, 0.0)
        way = self.back_to - self.furthest
        if self.going_back == 0.0 or since >= self.duration:
            return self.back_to, 0.0
        s = (since - self.braking) / self.going_back
        return self.furthest + way * s**2 * (3 - 2 * s), way * 6 * s * (1 - s) / self.going_back


def stop(motion: Motion, elapsed: float, cause: str) -> Stop:
    """How to break a motion off, `elapsed` seconds into it."""
    running = running_segment(motion, elapsed)
    ends = segment_ends(motion)
    index = len(ends) - 1 if running is None else running
    begin = ends[index] - motion.segments[index].trajectory.times[-1]
    _, v, _ = desired(motion, elapsed)
    braking = max(float((np.abs(v) / (BRAKE * ACCELERATION)).max()), 0.02)
    # No further than the end of the segment, where the arm would rest and the fingers do something else.
    furthest = min(elapsed + braking / 2, float(ends[index]) - 1e-6)
    back_to = furthest if cause == "empty_hand" else max(elapsed - BACK, float(begin))
    return Stop(cause, elapsed, braking, furthest, back_to)


def desired_after(motion: Motion, stopped: Stop, since: float, gap_start: float) -> tuple[Array, Array, float]:
    """As `playback.desired`, `since` seconds after a motion was to be broken off; the fingers stay as they were."""
    shown, rate = stopped.clock(since)
    q, v, _ = desired(motion, shown, gap_start)
    _, _, gap = desired(motion, stopped.elapsed, gap_start)
    return q, v * rate, gap
