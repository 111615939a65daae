"""What an action of the robot does to the belief over an object's pose (Sui et al. 2017, eq. 10), and how it went.

The published model knows two outcomes for an action's target, placed and stayed, and leaves all else in its place. The
further components are the cases that the paper leaves out: the object slipped in the hand, was dropped on the way, or
swept aside by an arm that was after another one.
"""

import numpy as np
from numpy.typing import NDArray

from sum_drake.existence import presence_log_odds
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import rotation_from_quaternion, rotation_from_vector
from sum_drake.presence import Presence
from sum_drake.resampling import systematic
from sum_drake.robot import HAND
from sum_drake.types import Array, PickPlace, PoseBelief, readonly

OUTCOMES = ("placed", "stayed", "slipped", "dropped", "lost")
"""Of an action, for its target: it is where it was to go; it stayed where it was; it lies near there, elsewhere than
it was; it lies somewhere on the way; it left the table, but not for where it was to go."""
FELT, SQUEEZED = 0.003, 10.0
"""Fingers that are nearer than this hold nothing, metres, nor do those that are driven together with less, newtons."""
HANGS = 0.02
"""An opened hand on which more than this weighs has something hanging on it, kilograms: a third of the catalogue's
lightest object, part of whose weight may rest on the robot. What drives make of an empty hand is below .3 g from .2 s
after the arm has come back on, and less than a millionth of that after .5 s; real drives would ask for more."""
STILL = 0.25
"""So long an arm has to be at rest before what hangs on its hand is weighed, seconds."""
SLIPPED_M, SLIPPED_RAD = 0.05, 0.6
"""Standard deviation of where a thing is that slipped out of the hand, or was swept aside."""
SWEEP_REACH = 0.12
"""Distance from the hand's way over which the share of things that are swept aside falls off, metres."""
NEAR_M = 0.15
"""What slipped lies within this of where it was."""
FOUND_MISSED = 0.1
"""How much likelier it is that an object is nowhere else if it is not found: detectors miss, and things hide."""


def felt(action: PickPlace) -> Array:
    """(5,): probabilities of OUTCOMES by what the hand felt alone: its fingers' gap and force after lift and carry.

    What hangs on the hand once it is back has left the table, or will fall from there on one of the hand's next ways.
    The numbers are set by hand; `bench reject` measures what they lead to.
    """
    if action.hangs:
        p = (0.02, 0.02, 0.02, 0.24, 0.70)
    elif action.released and _held(action.gap_place, action.squeeze_place, action.held_place):
        p = (0.93, 0.01, 0.01, 0.04, 0.01)
    elif _held(action.gap_lift, action.squeeze_lift, action.held_lift):
        p = (0.05, 0.05, 0.25, 0.45, 0.20)
    else:
        p = (0.01, 0.65, 0.29, 0.03, 0.02)
    return np.array(p if action.released else (0.0, *p[1:])) / (1.0 if action.released else 1.0 - p[0])


def holds(gap: float, squeeze: float, width: float) -> bool:
    """Whether fingers hold something `width` thick: they stopped at more than half of it, not wide open, and push.

    gap: between the fingers, metres; squeeze: force that closes them, newtons.
    """
    return 0.5 * width < gap < HAND.gap_max and gap > FELT / 2 and squeeze > SQUEEZED


def _held(gap: float, squeeze: float | None, told: bool | None) -> bool:
    """What the robot took it for, or, where that is not told, whether there was anything between the fingers."""
    return told if told is not None else gap > FELT and (squeeze is None or squeeze > SQUEEZED)


def judged(
    action: PickPlace, there: Presence, at_place: Presence, *, near: float, far: float, blind: bool = False
) -> Array:
    """(5,): probabilities of OUTCOMES by what was felt and seen: Bayes' rule over them.

    there, at_place: what was seen where the object was and where it was to go, `presence.UNKNOWN` where nothing can be.
    near, far: probability of the likeliest track of its label that is not there, within NEAR_M of it and farther.
    blind: nothing could be seen anywhere, so that it says nothing that the object was not found.
    """
    of_found = [1.0 if blind else FOUND_MISSED + p / (1.0 - min(p, 0.98)) for p in (near, far)]
    seen = np.array([np.exp(presence_log_odds(at_place)), np.exp(presence_log_odds(there)), *of_found, 1.0])
    p = felt(action) * seen
    return np.asarray(p / p.sum())


def predict(
    belief: PoseBelief,
    action: PickPlace | None,
    *,
    is_target: bool,
    rng: np.random.Generator,
    config: FilterConfig,
) -> PoseBelief:
    """The belief after an action, before the next observation (Sui et al. 2017, eq. 10).

    The action's target is at the action's X_WO_place with sigma_place, with probability w_place, or else still where
    it was, with sigma_stay; the latter for certain when the hand was not opened at the place, or something still hangs
    on it. Shares w_slipped and w_dropped of the target's particles lie about where it was, or on the way and turned
    anyhow. With `by_feel` these
    shares are what the hand felt of each outcome (`felt`; what may have left the table may as well lie on the way) and
    the rest is still where it was. Any other object is
    where it was, with sigma_other, or, with a share w_swept near the way of the arm and less farther from it, aside.
    None, or an action of kind "none": nothing was touched, and the belief is returned as it is. Noise is on positions,
    and on rotation vectors by radians_per_metre.
    """
    if action is None or action.kind == "none":
        return belief
    n = len(belief.weights)
    X_WOs = belief.X_WOs[systematic(belief.weights, n, rng.random())]
    sigma, turn_sigma = np.full(n, config.sigma_other), np.full(n, config.radians_per_metre * config.sigma_other)
    which = rng.random(n)
    if is_target:
        w_place, w_slipped, w_dropped = config.w_place, config.w_slipped, config.w_dropped
        w_place = 0.0 if action.hangs else w_place
        if config.by_feel:
            w_place, _, w_slipped, w_dropped, w_lost = felt(action)
            w_dropped += w_lost
        placed = which < (w_place if action.released else 0.0)
        X_WOs[placed] = action.X_WO_place
        sigma = np.where(placed, config.sigma_place, config.sigma_stay)
        turn_sigma = config.radians_per_metre * sigma
        slipped, dropped = which > 1 - w_slipped, which > 1 - w_slipped - w_dropped
        dropped &= ~slipped
        _drop(X_WOs, dropped, action, rng)
    else:
        slipped = which > 1 - config.w_swept * _share_swept(X_WOs, action)
    sigma, turn_sigma = np.where(slipped, SLIPPED_M, sigma), np.where(slipped, SLIPPED_RAD, turn_sigma)
    X_WOs[:, :3, 3] += sigma[:, None] * rng.normal(size=(n, 3))
    turn = turn_sigma[:, None] * rng.normal(size=(n, 3))
    X_WOs[:, :3, :3] = rotation_from_vector(turn) @ X_WOs[:, :3, :3]
    return PoseBelief(readonly(X_WOs), readonly(np.full(n, 1.0 / n)))


def _drop(X_WOs: Array, dropped: NDArray[np.bool_], action: PickPlace, rng: np.random.Generator) -> None:
    """Puts particles on the way from where they are to the place, at their height, turned anyhow."""
    count = int(dropped.sum())
    way = action.X_WO_place[:2, 3] - X_WOs[dropped, :2, 3]
    X_WOs[dropped, :2, 3] += rng.random((count, 1)) * way
    X_WOs[dropped, :3, :3] = rotation_from_quaternion(rng.normal(size=(count, 4)))


def _share_swept(X_WOs: Array, action: PickPlace) -> Array:
    """(n,) in [0, 1]: how near to the way of the hand, from the pick to the place, seen from above."""
    start, end = action.X_WG_pick[:2, 3], action.X_WO_place[:2, 3]
    way = end - start
    along = np.clip(((X_WOs[:, :2, 3] - start) @ way) / max(float(way @ way), 1e-9), 0.0, 1.0)
    off = np.linalg.norm(X_WOs[:, :2, 3] - start - along[:, None] * way, axis=-1)
    return np.asarray(np.exp(-0.5 * (off / SWEEP_REACH) ** 2))
