"""What a motion asks of the joints at a moment."""

import numpy as np

from sum_drake.robot import FINGERS, HAND, VIEW
from sum_drake.timing import evaluate
from sum_drake.types import Array, Motion

GAP_SPEED = 2 * FINGERS[0].velocity
"""How fast the commanded gap changes, m/s: both fingers at their speed limit."""


def segment_ends(motion: Motion) -> Array:
    """When each segment ends, seconds from the motion's start, (n,)."""
    return np.cumsum([segment.trajectory.times[-1] for segment in motion.segments])


def running_segment(motion: Motion, elapsed: float) -> int | None:
    """Index of the segment that runs `elapsed` seconds into the motion; None once it is done."""
    index = int(np.searchsorted(segment_ends(motion), elapsed, side="right"))
    return index if index < len(motion.segments) else None


def desired(motion: Motion, elapsed: float, gap_start: float = HAND.gap_max) -> tuple[Array, Array, float]:
    """Arm positions (8,), velocities (8,) and finger gap, `elapsed` seconds into a motion that began at `gap_start`.

    After its end: its last position, at rest. A motion without segments is the viewing pose with open fingers. The
    gap goes from one segment's value to the next at the fingers' speed.
    """
    if not motion.segments:
        return np.array(VIEW), np.zeros(len(VIEW)), HAND.gap_max
    ends = segment_ends(motion)
    running = running_segment(motion, elapsed)
    index = len(motion.segments) - 1 if running is None else running
    segment = motion.segments[index]
    into = elapsed - (ends[index] - segment.trajectory.times[-1])
    q, v = evaluate(segment.trajectory, into)
    before = motion.segments[index - 1].gap if index > 0 else gap_start
    step = GAP_SPEED * into
    gap = before + float(np.clip(segment.gap - before, -step, step))
    return q, v, gap
