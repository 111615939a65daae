"""What is compiled of collision checking, in one file: machine code that is kept on disk is made anew when its own file
changes, not when one does that it calls into.

Distances of convex bodies are by Gilbert, Johnson and Keerthi (1988): the point of the Minkowski difference nearest to
the origin is closed in on by simplices. At each step there is a lower bound of the distance, from the supporting plane,
and an upper one. A caller who asks only whether bodies are closer than `touch`, or farther apart than `enough`, is
answered as soon as either bound says so, mostly after two or three steps.

`tables` is that of `collision_model.CollisionModel`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sum_drake.compiled import compiled
from sum_drake.types import Array

Ints = NDArray[np.int64]
Tables = tuple[Any, ...]
ITERATIONS = 60
TINY = 1e-12


@compiled
def _support(kind: int, points: Array, first: int, last: int, R: Array, p: Array, d: Array, out: Array) -> None:
    """The point of a body at R (3, 3), p (3,) farthest along d (3,), before it is swollen."""
    x = R[0, 0] * d[0] + R[1, 0] * d[1] + R[2, 0] * d[2]
    y = R[0, 1] * d[0] + R[1, 1] * d[1] + R[2, 1] * d[2]
    z = R[0, 2] * d[0] + R[1, 2] * d[1] + R[2, 2] * d[2]
    if kind == 1:
        across = np.sqrt(x * x + y * y)
        r, h = points[first, 0], points[first, 2]
        a = r * x / across if across > 1e-12 else 0.0
        b = r * y / across if across > 1e-12 else 0.0
        c = h if z >= 0 else -h
    else:
        best = first
        most = x * points[first, 0] + y * points[first, 1] + z * points[first, 2]
        for i in range(first + 1, last):
            along = x * points[i, 0] + y * points[i, 1] + z * points[i, 2]
            if along > most:
                most = along
                best = i
        a, b, c = points[best, 0], points[best, 1], points[best, 2]
    for k in range(3):
        out[k] = R[k, 0] * a + R[k, 1] * b + R[k, 2] * c + p[k]


@compiled
def _nearest_on_segment(a: Array, b: Array, weights: Array) -> None:
    """Barycentric weights (2,) of the point of a segment nearest to the origin."""
    aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    length = aa - 2 * ab + bb
    t = (aa - ab) / length if length > 1e-30 else 0.0
    t = min(max(t, 0.0), 1.0)
    weights[0], weights[1] = 1 - t, t


@compiled
def _nearest_on_triangle(a: Array, b: Array, c: Array, weights: Array) -> None:
    """Barycentric weights (3,) of the point of a triangle nearest to the origin (Ericson 2005, 5.1.5)."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = b[k] - a[k], c[k] - a[k]
        d1 -= ab * a[k]
        d2 -= ac * a[k]
        d3 -= ab * b[k]
        d4 -= ac * b[k]
        d5 -= ab * c[k]
        d6 -= ac * c[k]
    weights[0] = weights[1] = weights[2] = 0.0
    if d1 <= 0 and d2 <= 0:
        weights[0] = 1.0
        return
    if d3 >= 0 and d4 <= d3:
        weights[1] = 1.0
        return
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        v = d1 / (d1 - d3)
        weights[0], weights[1] = 1 - v, v
        return
    if d6 >= 0 and d5 <= d6:
        weights[2] = 1.0
        return
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        w = d2 / (d2 - d6)
        weights[0], weights[2] = 1 - w, w
        return
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        weights[1], weights[2] = 1 - w, w
        return
    total = va + vb + vc
    if total > 1e-30:
        weights[0], weights[1], weights[2] = va / total, vb / total, vc / total
        return
    # All on one line: the nearest of the three sides.
    best = np.inf
    found = np.zeros(3)
    pair = np.empty(2)
    for side in range(3):
        i, j = side, (side + 1) % 3
        p, q = (a, b) if side == 0 else ((b, c) if side == 1 else (c, a))
        _nearest_on_segment(p, q, pair)
        length = 0.0
        for k in range(3):
            length += (pair[0] * p[k] + pair[1] * q[k]) ** 2
        if length < best:
            best = length
            found[0] = found[1] = found[2] = 0.0
            found[i], found[j] = pair[0], pair[1]
    weights[0], weights[1], weights[2] = found[0], found[1], found[2]


@compiled
def _outside(a: Array, b: Array, c: Array, d: Array) -> bool:
    """Whether the origin lies on the other side of the plane a, b, c than d, or that cannot be told."""
    n0 = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
    n1 = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
    n2 = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    of_origin = -(a[0] * n0 + a[1] * n1 + a[2] * n2)
    of_d = (d[0] - a[0]) * n0 + (d[1] - a[1]) * n1 + (d[2] - a[2]) * n2
    return bool(of_origin * of_d <= 0.0 or abs(of_d) < 1e-18)


@compiled
def _reduce(simplex: Array, count: int, v: Array, weights: Array, kept: Ints) -> int:
    """Sets v (3,) to the point of the simplex nearest to the origin and keeps the corners that span it.

    simplex (4, 3), of which `count` corners are set. Returns how many are left; 4 where the origin is inside.
    """
    if count == 1:
        for k in range(3):
            v[k] = simplex[0, k]
        return 1
    if count == 2:
        _nearest_on_segment(simplex[0], simplex[1], weights)
    elif count == 3:
        _nearest_on_triangle(simplex[0], simplex[1], simplex[2], weights)
    else:
        best = np.inf
        inside = True
        for left_out in range(4):
            i, j, k = (left_out + 1) % 4, (left_out + 2) % 4, (left_out + 3) % 4
            if not _outside(simplex[i], simplex[j], simplex[k], simplex[left_out]):
                continue
            inside = False
            _nearest_on_triangle(simplex[i], simplex[j], simplex[k], weights)
            length = 0.0
            for axis in range(3):
                along = weights[0] * simplex[i, axis] + weights[1] * simplex[j, axis] + weights[2] * simplex[k, axis]
                length += along * along
            if length < best:
                best = length
                kept[0], kept[1], kept[2] = i, j, k
        if inside:
            return 4
        # Ascending, so that a corner is never written over before it is read.
        if kept[0] > kept[1]:
            kept[0], kept[1] = kept[1], kept[0]
        if kept[1] > kept[2]:
            kept[1], kept[2] = kept[2], kept[1]
        if kept[0] > kept[1]:
            kept[0], kept[1] = kept[1], kept[0]
        for slot in range(3):
            for axis in range(3):
                simplex[slot, axis] = simplex[kept[slot], axis]
        count = 3
        _nearest_on_triangle(simplex[0], simplex[1], simplex[2], weights)
    v[0] = v[1] = v[2] = 0.0
    left = 0
    for slot in range(count):
        if weights[slot] > 0.0:
            for axis in range(3):
                v[axis] += weights[slot] * simplex[slot, axis]
                simplex[left, axis] = simplex[slot, axis]
            left += 1
    return left


@compiled
def separation(
    kind_a: int, points_a: Array, first_a: int, last_a: int, swell_a: float, R_a: Array, p_a: Array,
    kind_b: int, points_b: Array, first_b: int, last_b: int, swell_b: float, R_b: Array, p_b: Array,
    touch: float, enough: float, work: Array, kept: Ints,
) -> float:  # fmt: skip
    """A lower bound of the distance of two bodies at R (3, 3), p (3,), metres, as good as is asked for.

    At most `touch`: they are no farther apart than that (0 where they overlap). Otherwise the true distance is at least
    what is returned, which is the distance itself to a thousandth of it, unless it was found to be over `enough`.

    work: (8, 3), kept: (3,) int64, to be written over.
    """
    swell, asked = swell_a + swell_b, touch
    touch, enough = touch + swell, enough + swell
    if touch < 0.0:
        touch = 0.0
    simplex, v, d, s_a, s_b = work[:4], work[4], work[5], work[6], work[7]
    weights = np.empty(3)
    for k in range(3):
        v[k] = p_a[k] - p_b[k]
    if v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < TINY:
        v[0] = 1.0
    count = 0
    bound = -np.inf
    for _ in range(ITERATIONS):
        for k in range(3):
            d[k] = -v[k]
        _support(kind_a, points_a, first_a, last_a, R_a, p_a, d, s_a)
        _support(kind_b, points_b, first_b, last_b, R_b, p_b, v, s_b)
        w0, w1, w2 = s_a[0] - s_b[0], s_a[1] - s_b[1], s_a[2] - s_b[2]
        squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        length = np.sqrt(squared)
        along = (v[0] * w0 + v[1] * w1 + v[2] * w2) / length
        if along > bound:
            bound = along
        if bound >= enough and bound > touch:
            return float(bound) - swell
        if count > 0:
            # v is a point of the difference: the bodies are no farther apart than it is long.
            if length <= touch:
                return asked
            if length - bound <= 1e-3 * length:
                return float(bound) - swell if bound > touch else asked
        simplex[count, 0], simplex[count, 1], simplex[count, 2] = w0, w1, w2
        count = _reduce(simplex, count + 1, v, weights, kept)
        if count == 4 or v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < TINY:
            return min(-swell, asked)
    # Hardly ever: what cannot be told apart counts as touching.
    return float(bound) - swell if bound > touch else asked


@compiled
def move(kind: Ints, parent: Ints, X_PF: Array, axis: Array, q: Array, R: Array, p: Array) -> None:
    """Sets R (n + 1, 3, 3), p (n + 1, 3) of all links but the world, which must be set."""
    R_PF = np.empty((3, 3))
    for k in range(len(kind)):
        at, own = parent[k], k + 1
        for i in range(3):
            p[own, i] = (
                R[at, i, 0] * X_PF[k, 0, 3] + R[at, i, 1] * X_PF[k, 1, 3] + R[at, i, 2] * X_PF[k, 2, 3] + p[at, i]
            )
            for j in range(3):
                R_PF[i, j] = R[at, i, 0] * X_PF[k, 0, j] + R[at, i, 1] * X_PF[k, 1, j] + R[at, i, 2] * X_PF[k, 2, j]
        x, y, z = axis[k, 0], axis[k, 1], axis[k, 2]
        if kind[k] == 1:
            for i in range(3):
                p[own, i] += (R_PF[i, 0] * x + R_PF[i, 1] * y + R_PF[i, 2] * z) * q[k]
                for j in range(3):
                    R[own, i, j] = R_PF[i, j]
            continue
        c, s = np.cos(q[k]), np.sin(q[k])
        v = 1 - c
        m00, m01, m02 = x * x * v + c, x * y * v - z * s, x * z * v + y * s
        m10, m11, m12 = x * y * v + z * s, y * y * v + c, y * z * v - x * s
        m20, m21, m22 = x * z * v - y * s, y * z * v + x * s, z * z * v + c
        for i in range(3):
            a, b, d = R_PF[i, 0], R_PF[i, 1], R_PF[i, 2]
            R[own, i, 0] = a * m00 + b * m10 + d * m20
            R[own, i, 1] = a * m01 + b * m11 + d * m21
            R[own, i, 2] = a * m02 + b * m12 + d * m22


@compiled
def _room(
    tables: Tables, q: Array, rates: Array, pair_rates: Array, wanted: float,
    R: Array, p: Array, R_B: Array, p_B: Array, balls_W: Array, work: Array, kept: Ints,
) -> float:  # fmt: skip
    """How far a motion may go on, or back, from q, in units of its parameter, at most `wanted`; < 0: something touches.

    rates (l,), pair_rates (l, l): metres that a point of a link moves in a unit, in the world or against another link.
    The rest is to be written over.
    """
    (
        kind, parent, X_PF, axis,
        body_kind, body_first, points, swell, radius,
        first, R_LB, p_LB, padding, _, balls, boxes, widest, _, to_world,
    ) = tables  # fmt: skip
    n = len(kind)
    move(kind, parent, X_PF, axis, q, R, p)
    for link in range(1, n + 1):
        for i in range(3):
            balls_W[link, i] = (
                R[link, i, 0] * balls[link, 0] + R[link, i, 1] * balls[link, 1] + R[link, i, 2] * balls[link, 2]
                + p[link, i]
            )  # fmt: skip
        for b in range(first[link], first[link + 1]):
            for i in range(3):
                r0, r1, r2 = R[link, i, 0], R[link, i, 1], R[link, i, 2]
                p_B[b, i] = r0 * p_LB[b, 0] + r1 * p_LB[b, 1] + r2 * p_LB[b, 2] + p[link, i]
                for j in range(3):
                    R_B[b, i, j] = r0 * R_LB[b, 0, j] + r1 * R_LB[b, 1, j] + r2 * R_LB[b, 2, j]
    room = wanted
    still = first[1]
    for link in range(1, n + 1):
        if balls[link, 3] < 0:
            continue
        rate = max(rates[link], 1e-9)
        most = -1e9
        for b in range(first[link], first[link + 1]):
            most = max(most, to_world[b])
        if most > -1e8:
            for s in range(still):
                # A ball about the whole link against the box about what stands still: most are settled here.
                squared = 0.0
                for i in range(3):
                    off = max(max(boxes[s, 0, i] - balls_W[link, i], balls_W[link, i] - boxes[s, 1, i]), 0.0)
                    squared += off * off
                needed = balls[link, 3] + most + rate * room
                if needed <= 0 or squared >= needed * needed:
                    continue
                for b in range(first[link], first[link + 1]):
                    keep = padding[b, s]
                    if keep < -1e8:
                        continue
                    enough = keep + rate * room
                    squared = 0.0
                    for i in range(3):
                        off = max(max(boxes[s, 0, i] - p_B[b, i], p_B[b, i] - boxes[s, 1, i]), 0.0)
                        squared += off * off
                    needed = radius[b] + enough
                    if squared >= needed * needed:
                        continue
                    apart = separation(
                        body_kind[b], points, body_first[b], body_first[b + 1], swell[b], R_B[b], p_B[b],
                        body_kind[s], points, body_first[s], body_first[s + 1], swell[s], R_LB[s], p_LB[s],
                        keep, enough, work, kept,
                    )  # fmt: skip
                    if apart <= keep:
                        return -1.0
                    room = min(room, (apart - keep) / rate)
        for other in range(1, link):
            if widest[other, link] < -1e8:
                continue
            rate = max(pair_rates[other, link], 1e-9)
            squared = 0.0
            for i in range(3):
                squared += (balls_W[link, i] - balls_W[other, i]) ** 2
            needed = balls[link, 3] + balls[other, 3] + widest[other, link] + rate * room
            if squared >= needed * needed:
                continue
            for b in range(first[link], first[link + 1]):
                for s in range(first[other], first[other + 1]):
                    keep = padding[b, s]
                    if keep < -1e8:
                        continue
                    enough = keep + rate * room
                    squared = 0.0
                    for i in range(3):
                        squared += (p_B[b, i] - p_B[s, i]) ** 2
                    needed = radius[b] + radius[s] + enough
                    if squared >= needed * needed:
                        continue
                    apart = separation(
                        body_kind[b], points, body_first[b], body_first[b + 1], swell[b], R_B[b], p_B[b],
                        body_kind[s], points, body_first[s], body_first[s + 1], swell[s], R_B[s], p_B[s],
                        keep, enough, work, kept,
                    )  # fmt: skip
                    if apart <= keep:
                        return -1.0
                    room = min(room, (apart - keep) / rate)
    return room


@compiled
def _spaces(tables: Tables) -> tuple[Array, Array, Array, Array, Array, Array, Ints]:
    """What `_room` writes over."""
    n, b = len(tables[0]), len(tables[4])
    R, p = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 3))
    for i in range(3):
        R[0, i, i] = 1.0
    return R, p, np.empty((b, 3, 3)), np.empty((b, 3)), np.zeros((n + 1, 3)), np.empty((8, 3)), np.empty(3, np.int64)


@compiled
def free(tables: Tables, q: Array) -> bool:
    n = len(tables[0])
    R, p, R_B, p_B, balls_W, work, kept = _spaces(tables)
    rates, pair_rates = np.zeros(n + 1), np.zeros((n + 1, n + 1))
    return _room(tables, q, rates, pair_rates, 0.0, R, p, R_B, p_B, balls_W, work, kept) >= 0


@compiled
def free_many(tables: Tables, qs: Array) -> NDArray[np.bool_]:
    n = len(tables[0])
    R, p, R_B, p_B, balls_W, work, kept = _spaces(tables)
    rates, pair_rates = np.zeros(n + 1), np.zeros((n + 1, n + 1))
    found = np.zeros(len(qs), dtype=np.bool_)
    for i in range(len(qs)):
        found[i] = _room(tables, qs[i], rates, pair_rates, 0.0, R, p, R_B, p_B, balls_W, work, kept) >= 0
    return found


@compiled
def edge_free(tables: Tables, q0: Array, q1: Array, step: float) -> bool:
    """Looks at the ends, then at the middle of what is not yet known to be free, widest first."""
    n = len(tables[0])
    speed, widest, carries = tables[13], tables[16], tables[17]
    R, p, R_B, p_B, balls_W, work, kept = _spaces(tables)
    way = np.abs(q1 - q0)
    rates, pair_rates = np.zeros(n + 1), np.zeros((n + 1, n + 1))
    for link in range(1, n + 1):
        for k in range(n):
            rates[link] += way[k] * speed[k, link]
        for other in range(1, link):
            if widest[other, link] > -1e8:
                for k in range(n):
                    # A joint that carries both moves neither against the other.
                    if carries[k, link] != carries[k, other]:
                        pair_rates[other, link] += way[k] * (speed[k, link] + speed[k, other])
    longest = way.max()
    least = step / longest / 2 if longest > step else 0.5
    q = np.empty(n)
    # Ends first: a search tries to reach where it may not.
    before = _room(tables, q1, rates, pair_rates, 1.0, R, p, R_B, p_B, balls_W, work, kept)
    if before < 0:
        return False
    after = _room(tables, q0, rates, pair_rates, 1.0, R, p, R_B, p_B, balls_W, work, kept)
    if after < 0:
        return False
    # A queue of intervals, so that the widest gaps come first: what is in the way is met early.
    size = 4 * int(1.0 / least) + 16
    queue = np.empty((size, 2))
    queue[0, 0], queue[0, 1] = max(after, least), 1.0 - max(before, least)
    head, tail = 0, 1
    while head < tail:
        a, b = queue[head % size, 0], queue[head % size, 1]
        head += 1
        if b <= a:
            continue
        middle = (a + b) / 2
        for k in range(n):
            q[k] = q0[k] + middle * (q1[k] - q0[k])
        reach = _room(tables, q, rates, pair_rates, (b - a) / 2, R, p, R_B, p_B, balls_W, work, kept)
        if reach < 0:
            return False
        reach = max(reach, least)
        if middle - reach > a:
            queue[tail % size, 0], queue[tail % size, 1] = a, middle - reach
            queue[(tail + 1) % size, 0], queue[(tail + 1) % size, 1] = middle + reach, b
            tail += 2
    return True
