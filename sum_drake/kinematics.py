"""Forward and inverse kinematics of the arm in closed form.

Torso and shoulder pan are the arm's two redundant joints. With both chosen, the six that remain have a spherical wrist
and an elbow, whose angles follow from trigonometry in at most eight ways (Pieper 1968). Inverse kinematics is
therefore a sweep over a grid of the two, exact at every point of it; a straight line of the hand is the same closed
form along a line in those two joints, on one of the eight branches.
"""

import dataclasses

import numpy as np

from sum_drake import geometry, robot
from sum_drake.types import Array, readonly

CONTINUOUS = np.array([joint.kind == "continuous" for joint in robot.ARM_JOINTS])
"""(8,) which of ARM_JOINTS turn without end."""

_SHOULDER = np.array(robot.TORSO.origin) + np.array(robot.ARM[0].origin)
_LIFT = np.array(robot.ARM[1].origin)
_UPPER_ARM = robot.ARM[2].origin[0] + robot.ARM[3].origin[0]
_FOREARM = robot.ARM[4].origin[0] + robot.ARM[5].origin[0]
_WRIST_TO_HAND = robot.ARM[6].origin[0] + robot.GRIPPER_ORIGIN[0]
_ELBOW_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
_ROLL_SIGNS = np.array([1.0, -1.0, 1.0, -1.0])
_TORSO_SHIFTS = np.array([0.0, 0.04, -0.04, 0.08, -0.08, 0.15, -0.15])
_PAN_SHIFTS = np.array([0.0, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55])


@dataclasses.dataclass(frozen=True, eq=False)
class Arm:
    """The torso and the arm as a mapping between ARM_JOINTS q (8,) and the hand's pose X_WG (4, 4).

    Solutions keep away from the joint limits by a margin, and continuous joints in the turn nearest to a reference.
    """

    margin: float = 0.01
    """Radians from the limits of the arm's joints; the torso keeps a tenth of it in metres."""
    torsos: Array = dataclasses.field(default_factory=lambda: readonly(np.linspace(0.002, 0.384, 8)))
    """Grid of torso heights that a solution may use, metres."""
    pans: Array = dataclasses.field(default_factory=lambda: readonly(np.linspace(-1.59, 1.59, 32)))
    """Grid of shoulder pan angles."""

    def forward(self, q: Array) -> Array:
        """X_WG (4, 4) of q (8,)."""
        X_WG: Array = self.forward_many(np.asarray(q, dtype=float)[None])[0]
        return X_WG

    def forward_many(self, qs: Array) -> Array:
        """X_WGs (n, 4, 4) of qs (n, 8)."""
        qs = np.asarray(qs, dtype=float)
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
        lower, upper = robot.limits()
        margin = self.margin * np.array([0.1, *[1.0] * 7])
        inside: Array = np.all((qs >= lower + margin) & (qs <= upper - margin), axis=-1)
        return inside

    def reaches(self, X_WG: Array) -> bool:
        """Whether the stretched arm, from some torso and pan, is long enough for the wrist that X_WG (4, 4) asks for.

        Where it is not, that is out of reach; where it is, joint limits may still forbid it.
        """
        lower, upper = robot.limits()
        p_W = X_WG[:3, 3] - _WRIST_TO_HAND * X_WG[:3, 0] - _SHOULDER
        pan = np.clip(np.arctan2(p_W[1], p_W[0]), lower[1], upper[1])
        across = p_W[:2] - _LIFT[0] * np.array([np.cos(pan), np.sin(pan)])
        height = p_W[2] - _LIFT[2]
        off = height - np.clip(height, lower[0], upper[0])
        return bool(np.hypot(np.linalg.norm(across), off) <= _UPPER_ARM + _FOREARM)

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
        `thorough` search goes over a fine one, for some 30 ms.
        """
        # The reference's own torso and pan come first, so that its neighbourhood is never missed by the grid.
        found = self._sweep(X_WG, np.append(near[0], self.torsos), np.append(near[1], self.pans), near)
        if thorough and not len(found):  # at the edge of the workspace the solutions can hide between the grid's lines
            found = self._sweep(X_WG, np.linspace(0.001, 0.385, 60), np.linspace(-1.595, 1.595, 400), near)
        found = found[np.argsort(_cost(found, near), kind="stable")]
        chosen: list[Array] = []
        while len(found) and len(chosen) < count:
            chosen.append(found[0])
            found = found[np.abs(found - found[0]).max(axis=1) >= spread]
        return np.array(chosen).reshape(-1, 8)

    def follow(self, X_WGs: Array, q_start: Array, *, count: int = 4, step: float = 0.3) -> Array:
        """Paths (n, k, 8), n <= count, that carry the hand through X_WGs (k, 4, 4) from q_start; the quickest first.

        X_WGs[0] must be the hand's pose at q_start, and neighbouring poses close together: no joint moves by more
        than `step` between two. The arm stays on q_start's branch while torso and pan move evenly.
        """
        k = len(X_WGs)
        shifts = np.stack(np.meshgrid(_TORSO_SHIFTS, _PAN_SHIFTS, indexing="ij"), -1).reshape(-1, 1, 2)
        lines = q_start[:2] + shifts * np.linspace(0, 1, k)[:, None]  # (m, k, 2)
        m = len(lines)
        every = _closed_form(np.tile(X_WGs, (m, 1, 1)), lines[..., 0].ravel(), lines[..., 1].ravel())
        qs = every[:, 2 * int(np.sin(q_start[4]) < 0) + int(np.cos(q_start[3]) < 0), int(np.sin(q_start[6]) < 0)]
        qs = qs.reshape(m, k, 8)
        qs[:, :, CONTINUOUS] = np.unwrap(qs[:, :, CONTINUOUS], axis=1)
        qs += nearest_turns(qs[:, :1], q_start) - qs[:, :1]
        steps = np.abs(np.diff(np.concatenate([np.broadcast_to(q_start, (m, 1, 8)), qs], 1), axis=1))
        steps[np.isnan(steps)] = np.inf
        good = self.within_limits(qs).all(1) & (steps.max((1, 2)) < step) & (steps[:, 0].max(1) < 1e-3)
        paths = qs[good]
        seconds = (np.abs(np.diff(paths, axis=1)).sum(1) / robot.velocity_limits()).max(-1)
        paths = paths[np.argsort(seconds, kind="stable")[:count]]
        paths[:, 0] = q_start
        return np.asarray(paths)

    def _sweep(self, X_WG: Array, torsos: Array, pans: Array, near: Array) -> Array:
        """All solutions (n, 8) within limits on the grid of torsos and pans."""
        torso, pan = (a.ravel() for a in np.meshgrid(torsos, pans, indexing="ij"))
        qs = _closed_form(np.broadcast_to(X_WG, (len(torso), 4, 4)), torso, pan).reshape(-1, 8)
        qs = qs[~np.isnan(qs).any(1)]
        qs = nearest_turns(qs, near)
        return np.asarray(qs[self.within_limits(qs)])


def nearest_turns(qs: Array, near: Array) -> Array:
    """qs (..., 8) with the continuous joints in the turn closest to near (8,)."""
    turned: Array = qs + np.where(CONTINUOUS, 2 * np.pi * np.round((near - qs) / (2 * np.pi)), 0.0)
    return turned


def _cost(qs: Array, near: Array) -> Array:
    """About the seconds from near to qs (n, 8), and a penalty close to joint limits."""
    seconds = np.abs(qs - near) / robot.velocity_limits()
    lower, upper = robot.limits()
    room = np.minimum(qs - lower, upper - qs)[:, 1:].min(1)
    cost: Array = seconds.max(1) + 0.15 * seconds.sum(1) + 5.0 * np.maximum(0.0, 0.15 - room)
    return cost


def _closed_form(X_WG: Array, torso: Array, pan: Array) -> Array:
    """The branches (n, 4, 2, 8) of joint positions that reach X_WG (n, 4, 4) with torso and pan (n,); nan: none.

    The four are the signs of the elbow and of cos(upperarm roll), the two that of the wrist. Angles are in (-pi, pi].
    Branches outside the limits of lift and elbow are dropped before the wrist is looked at.
    """
    lower, upper = robot.limits()
    c, s = np.cos(pan), np.sin(pan)
    R_WS = np.zeros((len(pan), 3, 3))
    R_WS[:, 0, 0], R_WS[:, 0, 1], R_WS[:, 1, 0], R_WS[:, 1, 1], R_WS[:, 2, 2] = c, -s, s, c, 1.0
    p_WS = _SHOULDER + torso[:, None] * np.array(robot.TORSO.axis) + R_WS @ _LIFT  # S: where the shoulder lift turns
    p_WV = X_WG[:, :3, 3] - _WRIST_TO_HAND * X_WG[:, :3, 0]  # V: the wrist's centre
    w = np.einsum("nji,nj->ni", R_WS, p_WV - p_WS)  # the wrist as the shoulder sees it

    with np.errstate(invalid="ignore", divide="ignore"):
        # Law of cosines at the elbow; then the roll that gives the wrist its sideways part, then the lift.
        cos_e = ((w**2).sum(1) - _UPPER_ARM**2 - _FOREARM**2) / (2 * _UPPER_ARM * _FOREARM)
        elbow = np.arccos(cos_e)[:, None] * _ELBOW_SIGNS  # (n, 4)
        along, across = _UPPER_ARM + _FOREARM * np.cos(elbow), -_FOREARM * np.sin(elbow)
        sin_r = -w[:, 1:2] / across
        roll = np.arctan2(sin_r, _ROLL_SIGNS * np.sqrt(1 - sin_r**2))
        lift = np.arctan2(across * np.cos(roll), along) - np.arctan2(w[:, 2:3], w[:, 0:1])
        lift = (lift + np.pi) % (2 * np.pi) - np.pi
        good = (np.abs(elbow) <= upper[4]) & (lift >= lower[2]) & (lift <= upper[2]) & np.isfinite(roll)
    rows, columns = np.nonzero(good)
    lift, roll, elbow = lift[good], roll[good], elbow[good]

    # The wrist turns what is left: Rx(forearm) Ry(wrist) Rx(hand) = R_FG, F the forearm before its roll.
    cl, sl, cr, sr, ce, se = (f(a) for a in (lift, roll, elbow) for f in (np.cos, np.sin))
    R_SF = np.empty((len(rows), 3, 3))
    R_SF[:, 0, 0], R_SF[:, 0, 1], R_SF[:, 0, 2] = cl * ce - sl * cr * se, sl * sr, cl * se + sl * cr * ce
    R_SF[:, 1, 0], R_SF[:, 1, 1], R_SF[:, 1, 2] = sr * se, cr, -sr * ce
    R_SF[:, 2, 0], R_SF[:, 2, 1], R_SF[:, 2, 2] = -sl * ce - cl * cr * se, cl * sr, -sl * se + cl * cr * ce
    R_FG = np.swapaxes(R_WS[rows] @ R_SF, 1, 2) @ X_WG[rows, :3, :3]
    sin_w = np.hypot(R_FG[:, 1, 0], R_FG[:, 2, 0])
    straight = sin_w < 1e-9  # only the sum of the two rolls is defined: the hand takes it
    forearm = np.where(straight, 0.0, np.arctan2(R_FG[:, 1, 0], -R_FG[:, 2, 0]))
    hand = np.arctan2(R_FG[:, 0, 1], R_FG[:, 0, 2])
    hand = np.where(straight, np.arctan2(R_FG[:, 2, 1], R_FG[:, 1, 1]), hand)
    wrist = np.arctan2(sin_w, R_FG[:, 0, 0])
    first = np.stack([torso[rows], pan[rows], lift, roll, elbow, forearm, wrist, hand], -1)
    second = first * np.where(np.arange(8) == 6, -1.0, 1.0)  # the flex mirrored, both rolls half a turn on
    rolls = second[:, [5, 7]]
    second[:, [5, 7]] = np.where(straight[:, None], rolls, rolls + np.where(rolls > 0, -np.pi, np.pi))
    qs = np.full((len(pan), 4, 2, 8), np.nan)
    qs[rows, columns] = np.stack([first, second], 1)
    return qs
