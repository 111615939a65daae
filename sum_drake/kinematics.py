"""Forward and inverse kinematics of the arm in closed form.

Torso and shoulder pan are the arm's two redundant joints: with both chosen, trigonometry gives the other six
(`closed_form.py`). Inverse kinematics is therefore a sweep over a grid of the two, exact at every point of it; a
straight line of the hand is the same closed form along a line in those two joints, on one of the eight branches.

It stands where Drake's InverseKinematics with restarts could: on the same 200 poses, that (SNOPT, 8 starts) solves
98.5 %, to a tenth of a millimetre, in 4.2 ms; this solves all, exactly, each in up to 32 ways to choose from, in .26 ms
(`benchmarks/ik_drake.py`). Of 40,000 poses as hard as they come (`bench/plan_ik.py`) it misses 4, which can be had only
closer to a limit than the margin.
"""

import dataclasses
import math

import numpy as np

from sum_drake import closed_form, geometry, robot
from sum_drake.compiled import compiled
from sum_drake.types import Array, readonly, shaped

CONTINUOUS = np.array([joint.kind == "continuous" for joint in robot.ARM_JOINTS])
"""(8,) which of ARM_JOINTS turn without end."""

LINKS = closed_form.Links(
    shoulder=tuple(np.add(robot.TORSO.origin, robot.ARM[0].origin).tolist()),
    lift=robot.ARM[1].origin,
    upper_arm=robot.ARM[2].origin[0] + robot.ARM[3].origin[0],
    forearm=robot.ARM[4].origin[0] + robot.ARM[5].origin[0],
    hand=robot.ARM[6].origin[0] + robot.GRIPPER_ORIGIN[0],
)
"""Of this arm."""
_LOWER, _UPPER = robot.limits()
_VELOCITY = robot.velocity_limits()
_TORSO_SHIFTS = np.array([0.0, 0.04, -0.04, 0.08, -0.08, 0.15, -0.15])
_PAN_SHIFTS = np.array([0.0, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55])
_SHIFTS = np.stack(np.meshgrid(_TORSO_SHIFTS, _PAN_SHIFTS, indexing="ij"), -1).reshape(-1, 2)


@dataclasses.dataclass(frozen=True, eq=False)
class Arm:
    """The torso and the arm as a mapping between ARM_JOINTS q (8,) and the hand's pose X_WG (4, 4).

    Solutions keep away from the joint limits by a margin, and continuous joints in the turn nearest to a reference.
    Arrays of another shape, or that are not finite, raise ValueError.
    """

    margin: float = 0.01
    """Radians from the limits of the arm's joints; the torso keeps a tenth of it in metres."""
    torsos: Array = dataclasses.field(default_factory=lambda: readonly(np.linspace(0.002, 0.384, 8)))
    """Grid of torso heights that a solution may use, metres."""
    pans: Array = dataclasses.field(default_factory=lambda: readonly(np.linspace(-1.59, 1.59, 32)))
    """Grid of shoulder pan angles."""

    def forward(self, q: Array) -> Array:
        """X_WG (4, 4) of q (8,)."""
        X_WG: Array = self.forward_many(shaped("q", q, 8)[None])[0]
        return X_WG

    def forward_many(self, qs: Array) -> Array:
        """X_WGs (n, 4, 4) of qs (n, 8)."""
        qs = shaped("qs", qs, -1, 8)
        R = np.broadcast_to(np.eye(3), (len(qs), 3, 3))
        p = np.zeros((len(qs), 3))
        for j, joint in enumerate(robot.ARM_JOINTS):
            p = p + R @ np.array(joint.origin)
            if joint.kind == "prismatic":
                p = p + qs[:, j, None] * (R @ np.array(joint.axis))
            else:
                R = R @ geometry.rotation_from_vector(qs[:, j, None] * np.array(joint.axis))
        return geometry.transform(R, p + R @ np.array(robot.GRIPPER_ORIGIN))

    def within_limits(self, qs: Array) -> Array:
        """Which of qs (..., 8) keep the margin from every joint limit."""
        lower, upper = self._limits()
        inside: Array = np.all((qs >= lower) & (qs <= upper), axis=-1)
        return inside

    def reaches(self, X_WG: Array) -> bool:
        """Whether the stretched arm, from some torso and pan, is long enough for the wrist that X_WG (4, 4) asks for.

        Where it is not, that is out of reach; where it is, joint limits may still forbid it.
        """
        lower, upper = robot.limits()
        p_W = X_WG[:3, 3] - LINKS.hand * X_WG[:3, 0] - np.array(LINKS.shoulder)
        pan = np.clip(np.arctan2(p_W[1], p_W[0]), lower[1], upper[1])
        across = p_W[:2] - LINKS.lift[0] * np.array([np.cos(pan), np.sin(pan)])
        height = p_W[2] - LINKS.lift[2]
        off = height - np.clip(height, lower[0], upper[0])
        return bool(np.hypot(np.linalg.norm(across), off) <= LINKS.upper_arm + LINKS.forearm)

    def solutions(
        self,
        X_WG: Array,
        *,
        near: Array = robot.VIEW,
        count: int = 32,
        spread: float = 0.4,
        thorough: bool = True,
    ) -> Array:
        """Joint positions (n, 8), n <= count, that put the hand at X_WG (4, 4); the cheapest first, none if n = 0.

        Cheap is what is soon reached from `near` (8,) and far from joint limits. Any two solutions differ by at least
        `spread` in some joint, so that collisions that rule one out may spare the next. Where the grid holds nothing, a
        `thorough` search looks between its lines, for some .3 ms.
        """
        X_WGs = shaped("X_WG", X_WG, 4, 4)[None]
        return self.solutions_many(X_WGs, near=near, count=count, spread=spread, thorough=thorough)[0]

    def solutions_many(
        self,
        X_WGs: Array,
        *,
        near: Array = robot.VIEW,
        count: int = 32,
        spread: float = 0.4,
        thorough: bool = True,
    ) -> list[Array]:
        """`solutions` of each of X_WGs (n, 4, 4): n arrays (.., 8)."""
        # The reference's own torso and pan come first, so that its neighbourhood is never missed by the grid.
        near = shaped("near", near, 8)
        lower, upper = self._limits()
        torsos, pans = np.append(near[0], self.torsos), np.append(near[1], self.pans)
        chosen = []
        for X_WG in shaped("X_WGs", X_WGs, -1, 4, 4):
            found = closed_form.sweep(X_WG, torsos, pans, near, LINKS, lower, upper)
            if thorough and not len(found):
                found = _between(X_WG, near, lower, upper)
            chosen.append(_choose(found, near, count, spread, _VELOCITY, _LOWER, _UPPER))
        return chosen

    def follow(self, X_WGs: Array, q_start: Array, *, count: int = 4, step: float = 0.3) -> Array:
        """Paths (n, k, 8), n <= count, that carry the hand through X_WGs (k, 4, 4) from q_start; the quickest first.

        X_WGs[0] must be the hand's pose at q_start, and neighbouring poses close together: no joint moves by more
        than `step` between two. The arm stays on q_start's branch while torso and pan move evenly.
        """
        X_WGs, q_start = shaped("X_WGs", X_WGs, -1, 4, 4), shaped("q_start", q_start, 8)
        paths = closed_form.follow(X_WGs, q_start, _SHIFTS, step, LINKS, *self._limits())
        seconds = (np.abs(np.diff(paths, axis=1)).sum(1) / _VELOCITY).max(-1)
        paths = paths[np.argsort(seconds, kind="stable")[:count]]
        paths[:, 0] = q_start
        return np.asarray(paths)

    def _limits(self) -> tuple[Array, Array]:
        """Lower and upper limits (8,) within the margin."""
        margin = self.margin * np.array([0.1, *[1.0] * 7])
        return _LOWER + margin, _UPPER - margin


def nearest_turns(qs: Array, near: Array) -> Array:
    """qs (..., 8) with the continuous joints in the turn closest to near (8,)."""
    turned: Array = qs + np.where(CONTINUOUS, 2 * np.pi * np.round((near - qs) / (2 * np.pi)), 0.0)
    return turned


def _between(X_WG: Array, near: Array, lower: Array, upper: Array) -> Array:
    """Solutions (n, 8) between the lines of a grid on which there are none."""
    torsos, pans = (np.linspace(lower[j], upper[j], count) for j, count in ((0, 8), (1, 32)))
    found = [np.empty((0, 8))]
    for torso, pan in closed_form.seek(X_WG, torsos, pans, LINKS, lower, upper):
        # What there is around the place that was found, too, as that lies at the very edge.
        around = np.linspace(-0.5, 0.5, 9)
        nearby = torso + around * (torsos[1] - torsos[0]), pan + around * (pans[1] - pans[0])
        found.append(closed_form.sweep(X_WG, *nearby, near, LINKS, lower, upper))
    return np.concatenate(found)


@compiled
def _choose(qs: Array, near: Array, count: int, spread: float, velocity: Array, lower: Array, upper: Array) -> Array:
    """Up to `count` of qs (n, 8), the cheapest first, each at least `spread` in some joint from those before it.

    The cost is about the seconds from near (8,), and a penalty close to the joint limits (8,).
    """
    costs, left, n = np.empty(len(qs)), np.empty(len(qs), np.int64), len(qs)
    best = 0
    for i in range(n):
        most, total, room = 0.0, 0.0, math.inf
        for j in range(8):
            seconds = abs(qs[i, j] - near[j]) / velocity[j]
            most, total = max(most, seconds), total + seconds
            if j > 0:
                room = min(room, qs[i, j] - lower[j], upper[j] - qs[i, j])
        costs[i], left[i] = most + 0.15 * total + 5.0 * max(0.0, 0.15 - room), i
        if costs[i] < costs[best]:
            best = i
    chosen, found = np.empty((min(count, n), 8)), 0
    while n > 0 and found < count:
        for j in range(8):
            chosen[found, j] = qs[best, j]
        found += 1
        last, n_before, n = best, n, 0
        for k in range(n_before):
            i = left[k]
            apart = False
            for j in range(8):
                apart = apart or abs(qs[i, j] - qs[last, j]) >= spread
            if apart and i != last:
                if n == 0 or costs[i] < costs[best]:
                    best = i
                left[n] = i
                n += 1
    return chosen[:found]
