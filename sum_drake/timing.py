"""From paths to trajectories within the limits of speed, acceleration and jerk.

Along a straight line in joint space Ruckig times the one parameter that moves, which keeps all joints on the line and
within their limits. Neighbouring lines overlap in time, so that the arm rounds corners instead of stopping at them:
q(t) is the sum of the lines' displacements, each on its own clock. Such a sum is piecewise cubic, so a Trajectory
sampled where the pieces meet is exact under Hermite interpolation.
"""

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np
from ruckig import InputParameter, Result, Ruckig
from ruckig import Trajectory as RuckigTrajectory

from sum_drake import robot
from sum_drake.types import Array, Immutable, Trajectory, readonly


@dataclasses.dataclass(frozen=True, eq=False)
class Limits(Immutable):
    """Largest speed, acceleration and jerk of each of ARM_JOINTS, (8,) each."""

    velocity: Array
    acceleration: Array
    jerk: Array

    def scaled(self, speed: float) -> "Limits":
        """Limits under which every motion takes 1 / speed times as long."""
        return Limits(self.velocity * speed, self.acceleration * speed**2, self.jerk * speed**3)


LIMITS = Limits(readonly(robot.velocity_limits()), robot.ACCELERATION, robot.JERK)
MARGIN = 0.98
"""Share of the limits that is used, so that rounding never crosses them."""


def evaluate(trajectory: Trajectory, t: float) -> tuple[Array, Array]:
    """Positions and velocities (8,) at t seconds, by cubic Hermite segments; at rest outside the trajectory's times."""
    times = trajectory.times
    if t <= times[0] or len(times) == 1:
        return trajectory.positions[0].copy(), np.zeros(trajectory.positions.shape[1])
    if t >= times[-1]:
        return trajectory.positions[-1].copy(), np.zeros(trajectory.positions.shape[1])
    i = int(np.searchsorted(times, t, side="right")) - 1
    h = times[i + 1] - times[i]
    s = (t - times[i]) / h
    q0, q1 = trajectory.positions[i], trajectory.positions[i + 1]
    v0, v1 = trajectory.velocities[i] * h, trajectory.velocities[i + 1] * h
    c2, c3 = 3 * (q1 - q0) - 2 * v0 - v1, 2 * (q0 - q1) + v0 + v1
    return q0 + s * (v0 + s * (c2 + s * c3)), (v0 + s * (2 * c2 + s * 3 * c3)) / h


def sample(trajectory: Trajectory, dt: float) -> Array:
    """Positions (k, 8) every dt seconds or less, both ends among them."""
    times = np.linspace(0, trajectory.times[-1], max(2, int(np.ceil(trajectory.times[-1] / dt)) + 1))
    return np.array([evaluate(trajectory, float(t))[0] for t in times])


def rest(q: Array, duration: float) -> Trajectory:
    """Standing still at q (8,) for `duration` seconds."""
    return Trajectory(readonly([0.0, duration]), readonly([q, q]), readonly(np.zeros((2, len(q)))))


def limit_use(trajectory: Trajectory, limits: Limits = LIMITS) -> tuple[float, float, float]:
    """The largest share of the speed, acceleration and jerk limits that a trajectory uses; 1 is at the limit."""
    h = np.diff(trajectory.times)[:, None]
    if not len(h):
        return 0.0, 0.0, 0.0
    dq = np.diff(trajectory.positions, axis=0)
    v0, v1 = trajectory.velocities[:-1], trajectory.velocities[1:]
    a0, a1 = (6 * dq / h - 4 * v0 - 2 * v1) / h, (-6 * dq / h + 2 * v0 + 4 * v1) / h
    jerk = (a1 - a0) / h
    # A cubic's speed peaks at its ends or where its acceleration crosses zero.
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.clip(np.nan_to_num(-a0 / (a1 - a0)), 0, 1)
    middle = v0 + h * s * (a0 + s * (a1 - a0) / 2)
    return (
        float((np.abs([v0, v1, middle]) / limits.velocity).max()),
        float((np.abs([a0, a1]) / limits.acceleration).max()),
        float((np.abs(jerk) / limits.jerk).max()),
    )


def time_path(
    path: Array, limits: Limits = LIMITS, *, is_free: Callable[[Array], bool] | None = None, speed: float = 1.0
) -> Trajectory:
    """The polyline path (k, 8) as a trajectory from rest to rest, corners rounded where limits and `is_free` allow.

    `is_free` takes positions (n, 8) along a rounded corner; without it no corner is rounded, and the path is followed
    exactly. `speed` in (0, 1] slows the whole motion down.
    """
    limits = limits.scaled(speed * MARGIN)
    path = np.asarray(path, dtype=float)
    path = path[np.concatenate([[True], np.abs(np.diff(path, axis=0)).max(1) > 1e-6])]
    if len(path) == 1:
        return rest(path[0], 0.0)
    lines = [_Line.timed(q0, q1, limits) for q0, q1 in itertools.pairwise(path)]
    starts = np.concatenate([[0.0], np.cumsum([line.duration for line in lines[:-1]])])
    for i in range(1, len(lines)):
        if is_free is None:
            break
        # Speeding up may begin once the line before slows down; never while an earlier corner is still being rounded.
        before = lines[i - 1]
        longest = min(before.ramp, lines[i].ramp)
        if i > 1:
            longest = min(longest, starts[i] - (starts[i - 2] + lines[i - 2].duration))
        for share in (1.0, 0.75, 0.5, 0.25):
            overlap = share * longest
            if overlap < 0.02:
                break
            tried = starts.copy()
            tried[i:] -= overlap
            corner = _sum(lines[i - 1 : i + 1], tried[i - 1 : i + 1] - tried[i - 1], path[i - 1])
            during = np.linspace(tried[i] - tried[i - 1], before.duration, 12)
            if max(limit_use(corner, limits)) <= 1.0 + 1e-6 and is_free(
                np.array([evaluate(corner, float(t))[0] for t in during])
            ):
                starts = tried
                break
    return _sum(lines, starts, path[0])


def reverse(trajectory: Trajectory) -> Trajectory:
    """The same way from its end to its start, as fast: within the same limits."""
    times = trajectory.times[-1] - trajectory.times[::-1]
    return Trajectory(
        readonly(times), readonly(trajectory.positions[::-1]), readonly(-np.asarray(trajectory.velocities[::-1]))
    )


def time_curve(path: Array, limits: Limits = LIMITS, *, speed: float = 1.0, dt: float = 0.02) -> Trajectory:
    """Dense waypoints path (k, 8) of a smooth curve as a trajectory from rest to rest that does not stop at them.

    A cubic spline runs through the waypoints at even parameters; Ruckig times the parameter, and the whole is slowed
    down until every limit holds. Sampled every `dt` seconds or less.
    """
    from scipy.interpolate import CubicSpline

    limits = limits.scaled(speed * MARGIN)
    path = np.asarray(path, dtype=float)
    if len(path) == 2:
        return time_path(path, limits)
    if np.abs(path - path[0]).max() < 1e-9:
        return rest(path[0], 0.0)
    s = np.linspace(0.0, 1.0, len(path))
    curve = CubicSpline(s, path)
    fine = np.linspace(0.0, 1.0, 20 * len(path))
    slope = np.abs(curve(fine, 1)).max(0) + 1e-12
    along = _Line.timed(
        np.zeros(1),
        np.ones(1),
        Limits(*(np.array([(bound / slope).min()]) for bound in (limits.velocity, limits.acceleration, limits.jerk))),
    )
    clock = _sum([along], np.zeros(1), np.zeros(1))
    count = max(int(np.ceil(along.duration / dt)) + 1, 8)
    times = np.linspace(0.0, along.duration, count)
    states = [evaluate(clock, float(t)) for t in times]
    u, du = (np.array([state[k][0] for state in states]) for k in (0, 1))
    positions, velocities = curve(u), curve(u, 1) * du[:, None]
    made = Trajectory(times, positions, velocities)
    use = limit_use(made, limits)
    slower = max(1.0, use[0], use[1] ** (1 / 2), use[2] ** (1 / 3))
    return Trajectory(readonly(times * slower), readonly(positions), readonly(velocities / slower))


@dataclasses.dataclass(frozen=True, eq=False)
class _Line:
    """A straight displacement (8,) from rest to rest, with constant jerk between `knots` (m,) seconds."""

    displacement: Array
    knots: Array
    s: Array
    """(m,) share of the displacement at the knots; `ds`, `dds` its derivatives just after them."""
    ds: Array
    dds: Array
    jerk: Array
    """(m - 1,)."""

    @property
    def duration(self) -> float:
        return float(self.knots[-1])

    @property
    def ramp(self) -> float:
        """Seconds from rest to full speed, and back."""
        return float(self.knots[3])

    @staticmethod
    def timed(q0: Array, q1: Array, limits: Limits) -> "_Line":
        displacement = q1 - q0
        size = np.abs(displacement) + 1e-12
        wanted = InputParameter(1)
        wanted.current_position = wanted.current_velocity = wanted.current_acceleration = [0.0]
        wanted.target_position = [1.0]
        wanted.max_velocity = [float((limits.velocity / size).min())]
        wanted.max_acceleration = [float((limits.acceleration / size).min())]
        wanted.max_jerk = [float((limits.jerk / size).min())]
        timed = RuckigTrajectory(1)
        result = Ruckig(1).calculate(wanted, timed)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"Ruckig cannot time a line of displacement {displacement}: {result}")
        profile = timed.profiles[0][0]
        lengths, jerks = np.array(profile.t), np.array(profile.j)
        knots = np.concatenate([[0.0], np.cumsum(lengths)])
        s, ds, dds = np.zeros(8), np.zeros(8), np.zeros(8)
        for i, (h, j) in enumerate(zip(lengths, jerks, strict=True)):
            s[i + 1] = s[i] + h * (ds[i] + h * (dds[i] / 2 + h * j / 6))
            ds[i + 1] = ds[i] + h * (dds[i] + h * j / 2)
            dds[i + 1] = dds[i] + h * j
        return _Line(displacement, knots, s, ds, dds, jerks)

    def at(self, t: Array) -> tuple[Array, Array]:
        """Displacement and velocity (n, 8) at seconds t (n,)."""
        t = np.clip(t, 0.0, self.knots[-1])
        i = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.jerk) - 1)
        h = t - self.knots[i]
        s = self.s[i] + h * (self.ds[i] + h * (self.dds[i] / 2 + h * self.jerk[i] / 6))
        ds = self.ds[i] + h * (self.dds[i] + h * self.jerk[i] / 2)
        ds[(t <= 0.0) | (t >= self.knots[-1])] = 0.0
        return s[:, None] * self.displacement, ds[:, None] * self.displacement


def _sum(lines: list[_Line], starts: Array, q_start: Array) -> Trajectory:
    """The sum of lines that begin at `starts`, sampled at every knot of any of them."""
    times = np.unique(np.concatenate([start + line.knots for line, start in zip(lines, starts, strict=True)]))
    times = times[np.concatenate([[True], np.diff(times) > 1e-9])]
    moved = [line.at(times - start) for line, start in zip(lines, starts, strict=True)]
    positions = q_start + sum(displacement for displacement, _ in moved)
    return Trajectory(readonly(times), readonly(positions), readonly(sum(velocity for _, velocity in moved)))
