"""Inverse kinematics of an arm with a spherical wrist, torso and shoulder pan given (Pieper 1968), compiled.

With these two chosen, where the wrist's centre is says how far the elbow bends, and leaves it two places: the upper arm
rolled to one side or to the other. Each place can be had in four ways, as the elbow bends backwards just as well with
the rolls beside it half a turn on, and so does the wrist. These eight are all there are. Most places are ruled out by a
few products: angles are worked out only where elbow, lift and wrist are within their limits.

Frames: S turns with the pan, its origin where the shoulder lifts; F is the forearm before its roll; V is the wrist's
centre. Lower and upper limits are (8,) and infinite where a joint turns without end.
"""

import math
from typing import NamedTuple

import numpy as np

from sum_drake.compiled import compiled
from sum_drake.types import Array

WAYS = 4
"""In which each of the two places of the elbow can be had."""
STRAIGHT = 1e-9
"""Sine of the wrist's flex below which only the sum of the rolls beside it is defined: the hand takes it."""
START = 1e-3
"""How far from the first position of a line the arm may stand."""
DESCENT = 400
"""Places that are looked at on the way from one start towards the limits' inside."""
FINEST = 1e-7
"""Of the grid's spacing: below this step, nothing is found on that way."""


class Links(NamedTuple):
    """What the arm measures, metres."""

    shoulder: tuple[float, float, float]
    """p_WS where the pan turns, about z, with the torso at 0."""
    lift: tuple[float, float, float]
    """From there to where the lift turns, about y."""
    upper_arm: float
    forearm: float
    """From the elbow to the wrist's centre."""
    hand: float
    """From there to the hand, along its x."""


class _Reach(NamedTuple):
    """p_SV, and the elbow's cosine by the law of cosines: not within -1 to 1 where the links do not reach so far."""

    x: float
    y: float
    z: float
    cos_elbow: float


class _Place(NamedTuple):
    """A place of the elbow as sines and cosines, the elbow bent forwards."""

    sin_lift: float
    cos_lift: float
    sin_roll: float
    cos_roll: float
    sin_elbow: float
    cos_elbow: float


@compiled
def _reach(X_WG: Array, links: Links, torso: float, c: float, s: float) -> _Reach:
    """c, s: cosine and sine of the pan."""
    x = X_WG[0, 3] - links.hand * X_WG[0, 0] - links.shoulder[0]
    y = X_WG[1, 3] - links.hand * X_WG[1, 0] - links.shoulder[1]
    z = X_WG[2, 3] - links.hand * X_WG[2, 0] - links.shoulder[2] - torso - links.lift[2]
    x, y = c * x + s * y - links.lift[0], c * y - s * x - links.lift[1]
    a, b = links.upper_arm, links.forearm
    return _Reach(x, y, z, (x * x + y * y + z * z - a * a - b * b) / (2.0 * a * b))


@compiled
def _reachable(reach: _Reach, links: Links) -> bool:
    """Whether the elbow has places. Not where the arm is quite straight: there, its roll could be anything."""
    return abs(reach.cos_elbow) < 1.0 and reach.y**2 <= links.forearm**2 * (1.0 - reach.cos_elbow**2)


@compiled
def _place(reach: _Reach, links: Links, side: int) -> _Place:
    """The place on one side (+1 or -1: the sign of the roll's cosine), or what comes nearest to it."""
    cos_elbow = min(max(reach.cos_elbow, -1.0), 1.0)
    sin_elbow = math.sqrt(1.0 - cos_elbow * cos_elbow)
    radius = links.forearm * sin_elbow
    sin_roll = min(max(reach.y / radius, -1.0), 1.0) if radius > 0.0 else 0.0
    cos_roll = side * math.sqrt(1.0 - sin_roll * sin_roll)
    along, across = links.upper_arm + links.forearm * cos_elbow, -radius * cos_roll
    sin_lift, cos_lift = across * reach.x - along * reach.z, along * reach.x + across * reach.z
    length = math.hypot(sin_lift, cos_lift)
    if length == 0.0:  # the wrist on the lift's axis, where no elbow bends so far: any lift is as good
        sin_lift, cos_lift, length = 0.0, 1.0, 1.0
    return _Place(sin_lift / length, cos_lift / length, sin_roll, cos_roll, sin_elbow, cos_elbow)


@compiled
def _seen_from_forearm(place: _Place, X_WG: Array, axis: int, c: float, s: float) -> tuple[float, float, float]:
    """One of the hand's axes in F."""
    x, y, z = c * X_WG[0, axis] + s * X_WG[1, axis], c * X_WG[1, axis] - s * X_WG[0, axis], X_WG[2, axis]
    x, z = place.cos_lift * x - place.sin_lift * z, place.sin_lift * x + place.cos_lift * z
    y, z = place.cos_roll * y + place.sin_roll * z, place.cos_roll * z - place.sin_roll * y
    return place.cos_elbow * x - place.sin_elbow * z, y, place.sin_elbow * x + place.cos_elbow * z


@compiled
def _write(qs: Array, X_WG: Array, place: _Place, torso: float, pan: float, near: Array, upper: Array) -> None:
    """The WAYS into qs (4, 8): the elbow is bent backwards in 2 and 3, the wrist in 1 and 3.

    Joints without limits are in the turn nearest to near (8,).
    """
    c, s = math.cos(pan), math.sin(pan)
    xx, yx, zx = _seen_from_forearm(place, X_WG, 0, c, s)
    xy, yy, zy = _seen_from_forearm(place, X_WG, 1, c, s)
    xz, _, _ = _seen_from_forearm(place, X_WG, 2, c, s)
    sin_wrist = math.hypot(yx, zx)  # Rx(forearm) Ry(wrist) Rx(hand) = R_FG
    straight = sin_wrist < STRAIGHT
    lift, roll = math.atan2(place.sin_lift, place.cos_lift), math.atan2(place.sin_roll, place.cos_roll)
    elbow, wrist = math.atan2(place.sin_elbow, place.cos_elbow), math.atan2(sin_wrist, xx)
    forearm = 0.0 if straight else math.atan2(yx, -zx)
    hand = math.atan2(zy, yy) if straight else math.atan2(xy, xz)
    for way in range(WAYS):
        q = qs[way]
        q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7] = torso, pan, lift, roll, elbow, forearm, wrist, hand
        if way >= 2:
            q[3] += math.pi
            q[4] = -elbow
            q[7 if straight else 5] += math.pi
        if way % 2 == 1:
            q[6] = -wrist
            if not straight:
                q[5] += math.pi
                q[7] += math.pi
        for j in range(len(q)):
            if math.isinf(upper[j]):
                q[j] += 2.0 * math.pi * math.floor((near[j] - q[j]) / (2.0 * math.pi) + 0.5)


@compiled
def _inside(q: Array, lower: Array, upper: Array) -> bool:
    inside = True
    for j in range(len(q)):
        inside = inside and lower[j] <= q[j] <= upper[j]
    return inside


@compiled
def _least_cos(lower: float, upper: float) -> float:
    """Of an angle within its limits, bent either way."""
    return math.cos(min(max(-lower, upper), math.pi))


@compiled
def sweep(X_WG: Array, torsos: Array, pans: Array, near: Array, links: Links, lower: Array, upper: Array) -> Array:
    """All joint positions (n, 8) within the limits that put the hand at X_WG (4, 4).

    torsos, pans: the values that are tried, each with each. Joints without limits are in the turn nearest to near (8,).
    """
    cs, ss = np.cos(pans), np.sin(pans)
    least_elbow, least_wrist = _least_cos(lower[4], upper[4]), _least_cos(lower[6], upper[6])
    qs, n = np.empty((2 * WAYS * len(torsos) * len(pans), 8)), 0
    for torso in torsos:
        for k in range(len(pans)):
            if not (lower[0] <= torso <= upper[0] and lower[1] <= pans[k] <= upper[1]):
                continue
            reach = _reach(X_WG, links, torso, cs[k], ss[k])
            if not (reach.cos_elbow >= least_elbow and _reachable(reach, links)):
                continue
            for side in (1, -1):
                place = _place(reach, links, side)
                if not lower[2] <= math.atan2(place.sin_lift, place.cos_lift) <= upper[2]:
                    continue
                if not _seen_from_forearm(place, X_WG, 0, cs[k], ss[k])[0] >= least_wrist:
                    continue
                first = n
                _write(qs[first : first + WAYS], X_WG, place, torso, pans[k], near, upper)
                for way in range(first, first + WAYS):
                    if _inside(qs[way], lower, upper):
                        for j in range(8):
                            qs[n, j] = qs[way, j]
                        n += 1
    return qs[:n]


@compiled
def _beyond(X_WG: Array, links: Links, torso: float, pan: float, side: int, lower: Array, upper: Array) -> float:
    """How far a place of the elbow is from being one, and from the limits of elbow, lift and wrist; 0: it is inside."""
    c, s = math.cos(pan), math.sin(pan)
    reach = _reach(X_WG, links, torso, c, s)
    place = _place(reach, links, side)
    lift = math.atan2(place.sin_lift, place.cos_lift)
    return float(
        max(reach.cos_elbow - 1.0, _least_cos(lower[4], upper[4]) - reach.cos_elbow, 0.0)
        + max((reach.y / links.forearm) ** 2 - place.sin_elbow**2, 0.0)
        + max(lower[2] - lift, lift - upper[2], 0.0)
        + max(_least_cos(lower[6], upper[6]) - _seen_from_forearm(place, X_WG, 0, c, s)[0], 0.0)
    )


@compiled
def _descend(
    X_WG: Array,
    links: Links,
    torso: float,
    pan: float,
    side: int,
    steps: tuple[float, float],
    lower: Array,
    upper: Array,
) -> tuple[float, float, float]:
    """What is left beyond the limits, torso and pan after a search from one place, by `steps`, then finer ones."""
    beyond, step = _beyond(X_WG, links, torso, pan, side, lower, upper), 1.0
    looks = 0
    while beyond > 0.0 and step > FINEST and looks < DESCENT:
        better = False
        for i in range(-1, 2):
            for k in range(-1, 2):
                a = min(max(torso + i * step * steps[0], lower[0]), upper[0])
                b = min(max(pan + k * step * steps[1], lower[1]), upper[1])
                there = _beyond(X_WG, links, a, b, side, lower, upper)
                looks += 1
                if there < beyond:
                    beyond, torso, pan, better = there, a, b, True
        if not better:
            step /= 2.0
    return beyond, torso, pan


@compiled
def seek(X_WG: Array, torsos: Array, pans: Array, links: Links, lower: Array, upper: Array) -> Array:
    """Torso and pan (n, 2) with which X_WG (4, 4) can be reached where a grid of them, evenly spaced, misses it.

    At the edge of the workspace what can be reached shrinks to slivers between the grid's lines. From each point of the
    grid that is less far beyond the limits than its neighbours, a search by shrinking steps goes on to the inside.
    """
    beyond, found = np.empty((len(torsos), len(pans))), np.empty((2 * len(torsos) * len(pans), 2))
    steps = (torsos[1] - torsos[0], pans[1] - pans[0])
    n = 0
    for side in (1, -1):
        for i in range(len(torsos)):
            for k in range(len(pans)):
                beyond[i, k] = _beyond(X_WG, links, torsos[i], pans[k], side, lower, upper)
        for i in range(len(torsos)):
            for k in range(len(pans)):
                lowest = True
                for a in range(max(i - 1, 0), min(i + 2, len(torsos))):
                    for b in range(max(k - 1, 0), min(k + 2, len(pans))):
                        lowest = lowest and beyond[i, k] <= beyond[a, b]
                if lowest:
                    left, torso, pan = _descend(X_WG, links, torsos[i], pans[k], side, steps, lower, upper)
                    if left == 0.0:
                        found[n, 0], found[n, 1] = torso, pan
                        n += 1
    return found[:n]


@compiled
def follow(X_WGs: Array, q_start: Array, shifts: Array, step: float, links: Links, lower: Array, upper: Array) -> Array:
    """Paths (n, k, 8) within the limits that carry the hand through X_WGs (k, 4, 4) from q_start (8,).

    shifts: (m, 2), how far torso and pan move, evenly, on the way. A path stays on q_start's branch, and no joint moves
    by `step` or more between two poses, or by START to the first.
    """
    k = len(X_WGs)
    paths, n = np.empty((len(shifts), k, 8)), 0
    backwards = math.sin(q_start[4]) < 0.0
    side = -1 if (math.cos(q_start[3]) < 0.0) != backwards else 1
    way = 2 * backwards + (math.sin(q_start[6]) < 0.0)
    ways, last = np.empty((WAYS, 8)), np.empty(8)
    for m in range(len(shifts)):
        for j in range(8):
            last[j] = q_start[j]
        good = True
        for i in range(k):
            share = i / max(k - 1, 1)
            torso, pan = q_start[0] + share * shifts[m, 0], q_start[1] + share * shifts[m, 1]
            reach = _reach(X_WGs[i], links, torso, math.cos(pan), math.sin(pan))
            good = _reachable(reach, links)
            if not good:
                break
            _write(ways, X_WGs[i], _place(reach, links, side), torso, pan, last, upper)
            good = _inside(ways[way], lower, upper)
            most = step if i > 0 else min(step, START)
            for j in range(8):
                good = good and abs(ways[way, j] - last[j]) < most
                paths[n, i, j] = last[j] = ways[way, j]
            if not good:
                break
        n += good
    return paths[:n]
