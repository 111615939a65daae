"""Closed surfaces with texture coordinates, and the convex pieces that stand for them in physics.

Everything is built from rings: a loft joins a stack of them, a sweep carries one along a path. Parts of one object
overlap (a handle's ends sink into the body) rather than being united, so that no boolean operation is needed and
every part stays closed.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial import ConvexHull

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

Section = tuple[float, float, float, float, float, float]
"""z, half-extents along x and y, exponent of the superellipse (2: ellipse, large: rectangle), centre's x and y."""


@dataclasses.dataclass
class Part:
    """A closed triangle mesh; `uv` (f, 3, 2) are its corners in the unit square of the texture's regions `region`."""

    vertices: Array  # (v, 3)
    faces: Indices  # (f, 3)
    uv: Array  # (f, 3, 2)
    region: list[str]  # (f,)

    def moved(self, R: Array, p: Sequence[float]) -> "Part":
        """The same part rotated, then shifted."""
        return dataclasses.replace(self, vertices=self.vertices @ R.T + np.asarray(p))


@dataclasses.dataclass
class Piece:
    """A convex collision piece: `points` (n, 3) span it; `kind` and `size` name the primitive it is, if it is one.

    kind: box (x, y, z), cylinder (radius, length along z), capsule (the same, length without caps) or convex.
    """

    kind: str
    points: Array
    size: tuple[float, ...] = ()
    p: Array = dataclasses.field(default_factory=lambda: np.zeros(3))
    R: Array = dataclasses.field(default_factory=lambda: np.eye(3))


# --- rings -----------------------------------------------------------------------------------------------------------


def superellipse(section: Section, n: int = 40) -> Array:
    """(n, 3) ring, counter-clockwise seen from above, starting at -x: texture u = .5 faces +x, an object's front."""
    z, rx, ry, exponent, cx, cy = section
    angle = np.pi + np.arange(n) * 2 * np.pi / n
    c, s = np.cos(angle), np.sin(angle)
    r = (np.abs(c) ** exponent + np.abs(s) ** exponent) ** (-1 / exponent)
    return np.stack([cx + rx * r * c, cy + ry * r * s, np.full(n, z)], 1)


def rounded_rectangle(z: float, x: float, y: float, radius: float, corner: int = 5, side: int = 6) -> Array:
    """Ring of a rectangle x by y with rounded corners, in the order and with the start of `superellipse`."""
    points = []
    for i, (sx, sy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        angle = np.pi + i * np.pi / 2 + np.linspace(0, np.pi / 2, corner)
        centre = np.array([sx * (x / 2 - radius), sy * (y / 2 - radius)])
        points.append(centre + radius * np.stack([np.cos(angle), np.sin(angle)], 1))
        # Along the straight side to the next corner.
        nx, ny = ((1, -1), (1, 1), (-1, 1), (-1, -1))[i]
        end_angle = np.pi + (i + 1) * np.pi / 2
        end = np.array([nx * (x / 2 - radius), ny * (y / 2 - radius)])
        end = end + radius * np.array([np.cos(end_angle), np.sin(end_angle)])
        t = np.arange(1, side + 1)[:, None] / (side + 1)
        points.append(points[-1][-1] * (1 - t) + end * t)
    ring = np.concatenate(points)
    # Start in the middle of the -x side: its points are the last `side` ones.
    start = len(ring) - side + side // 2
    ring = np.roll(ring, -start, axis=0)
    return np.column_stack([ring, np.full(len(ring), z)])


def smooth(sections: Sequence[Section], count: int) -> list[Section]:
    """`count` sections that follow `sections` without overshoot, spaced by the length of the outline."""
    rows = np.array(sections)
    outline = rows[:, [0, 1, 2, 4, 5]]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    # Every given section is kept: edges that were asked for stay where they are.
    extra = np.setdiff1d(np.linspace(0, s[-1], max(count - len(rows) + 2, 2)), s)
    at = np.sort(np.concatenate([s, extra]))
    return [tuple(row) for row in PchipInterpolator(s, rows)(at).tolist()]


# --- surfaces --------------------------------------------------------------------------------------------------------


def loft(rings: Array, region: str, bottom: str | None = None, top: str | None = None) -> Part:
    """Joins rings (m, n, 3) and closes both ends.

    u runs along the rings, v along the stack, both by length. A cap takes the colour of its rim, or the texture's
    region `bottom` or `top`, mapped flat as seen from outside.
    """
    m, n, _ = rings.shape
    lengths = np.linalg.norm(np.roll(rings, -1, axis=1) - rings, axis=2)
    widest = lengths[np.argmax(lengths.sum(1))]
    u = np.concatenate([[0.0], np.cumsum(widest)]) / widest.sum()
    rise = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(1))])
    v = rise / rise[-1]
    i, j = (a.ravel() for a in np.meshgrid(np.arange(m - 1), np.arange(n), indexing="ij"))
    a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + (j + 1) % n, (i + 1) * n + j
    ta, tb = np.stack([u[j], v[i]], 1), np.stack([u[j + 1], v[i]], 1)
    tc, td = np.stack([u[j + 1], v[i + 1]], 1), np.stack([u[j], v[i + 1]], 1)
    faces = [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    uv = [np.stack([ta, tb, tc], 1), np.stack([ta, tc, td], 1)]
    names = [region] * (2 * len(a))
    vertices = [rings.reshape(-1, 3)]
    for end, flat, sign in ((0, bottom, -1.0), (m - 1, top, 1.0)):
        rim = end * n + np.arange(n)
        following = np.roll(rim, -1)
        centre = m * n + (0 if end == 0 else 1)
        vertices.append(rings[end].mean(0)[None])
        if flat is None:
            corner = np.full(n, float(end > 0))
            mid = (u[:-1] + u[1:]) / 2
            t0, t1, t2 = (np.stack([x, corner], 1) for x in (mid, u[:-1], u[1:]))
        else:
            # Seen from above with the front (+x) at the picture's lower edge; from below mirrored.
            low, high = rings[end].min(0), rings[end].max(0)
            square = (rings[end] - low)[:, :2] / (high - low)[:2]
            plane = np.stack([square[:, 1] if sign > 0 else 1 - square[:, 1], 1 - square[:, 0]], 1)
            middle = (rings[end].mean(0) - low)[:2] / (high - low)[:2]
            middle = np.array([middle[1] if sign > 0 else 1 - middle[1], 1 - middle[0]])
            t0, t1, t2 = np.tile(middle, (n, 1)), plane, np.roll(plane, -1, axis=0)
        fan = (np.full(n, centre), rim, following) if sign > 0 else (np.full(n, centre), following, rim)
        faces.append(np.stack(fan, 1))
        uv.append(np.stack([t0, t1, t2] if sign > 0 else [t0, t2, t1], 1))
        names += [flat or region] * n
    return Part(np.concatenate(vertices), np.concatenate(faces), np.concatenate(uv), names)


def stack(sections: Sequence[Section], region: str, n: int = 40, **caps: str) -> Part:
    """A loft of superellipses."""
    return loft(np.stack([superellipse(s, n) for s in sections]), region, **caps)


def revolve(profile: Sequence[tuple[float, float]], region: str, n: int = 40, **caps: str) -> Part:
    """A surface of revolution about z from (radius, z) rows; the row may turn back inside, as a mug's does."""
    return stack([(z, r, r, 2.0, 0.0, 0.0) for r, z in profile], region, n, **caps)


def ellipsoid(centre: Sequence[float], radii: Sequence[float], region: str, n: int = 24, rings: int = 14) -> Part:
    """An ellipsoid with its poles along z."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 2)[1:-1]
    cx, cy, cz = centre
    rows = [
        (float(cz + radii[2] * np.sin(a)), float(radii[0] * np.cos(a)), float(radii[1] * np.cos(a)), 2.0, cx, cy)
        for a in angle
    ]
    return stack(rows, region, n)


def curve(points: Sequence[Sequence[float]], count: int) -> Array:
    """(count, k): a Catmull-Rom-like curve through `points` (m, k), evenly spaced by length."""
    rows = np.asarray(points, dtype=float)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1))])
    fine = CubicSpline(s, rows)(np.linspace(0, s[-1], 400))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine[:, :3], axis=0), axis=1))])
    at = np.linspace(0, length[-1], count)
    return np.stack([np.interp(at, length, column) for column in fine.T], 1)


def sweep(path: Array, region: str, n: int = 16, across: Sequence[float] = (1.0, 0.0, 0.0), **caps: str) -> Part:
    """A tube along `path` (k, 5): position, then half-extents along `across` and along the normal of the path.

    `across` is the direction that the path's plane is seen along.
    """
    p, half_across, half_normal = path[:, :3], path[:, 3:4], path[:, 4:5]
    t = np.gradient(p, axis=0)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    e1 = np.asarray(across, dtype=float) - t * (t @ np.asarray(across, dtype=float))[:, None]
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    e2 = np.cross(t, e1)
    angle = np.arange(n) * 2 * np.pi / n
    rings = (
        p[:, None]
        + np.cos(angle)[None, :, None] * (half_across * e1)[:, None]
        + np.sin(angle)[None, :, None] * (half_normal * e2)[:, None]
    )
    return loft(rings, region, **caps)


def shading_normals(vertices: Array, faces: Indices, crease: float = 38.0) -> Array:
    """(f, 3, 3) unit normals at the corners, smooth across edges that turn by less than `crease` degrees."""
    cross = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    area = np.linalg.norm(cross, axis=1, keepdims=True)
    unit = cross / np.maximum(area, 1e-15)
    around: list[list[int]] = [[] for _ in vertices]
    for f, face in enumerate(faces):
        for vertex in face:
            around[vertex].append(f)
    limit = np.cos(np.radians(crease))
    normals = np.empty((len(faces), 3, 3))
    for f, face in enumerate(faces):
        for k, vertex in enumerate(face):
            near = np.array(around[vertex])
            near = near[unit[near] @ unit[f] >= limit]
            total = cross[near].sum(0)
            normals[f, k] = total / np.linalg.norm(total)
    return normals


# --- collision pieces ------------------------------------------------------------------------------------------------


def _upright(axis: Array) -> Array:
    """A rotation that takes z to the unit vector `axis`."""
    helper = np.array([1.0, 0, 0]) if abs(axis[0]) < 0.9 else np.array([0, 1.0, 0])
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], 1)


def box(size: Sequence[float], centre: Sequence[float]) -> Piece:
    """An upright box."""
    corners = np.array([[sx, sy, sz] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]) * np.asarray(size) / 2
    return Piece("box", corners + np.asarray(centre), tuple(size), np.array(centre, dtype=float))


def _round(kind: str, start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> Piece:
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    R = _upright((b - a) / length)
    rows = [(radius, -length / 2), (radius, length / 2)]
    if kind == "capsule":
        tip, shoulder = radius, radius * 0.7
        rows = [(0.3 * radius, -length / 2 - tip), (shoulder, -length / 2 - shoulder), *rows,
                (shoulder, length / 2 + shoulder), (0.3 * radius, length / 2 + tip)]  # fmt: skip
    points = np.concatenate([superellipse((z, r, r, 2.0, 0.0, 0.0), 12) for r, z in rows])
    return Piece(kind, points @ R.T + (a + b) / 2, (radius, length), (a + b) / 2, R)


def cylinder(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> Piece:
    """A cylinder between the centres of its ends."""
    return _round("cylinder", start, end, radius)


def capsule(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> Piece:
    """A capsule between the centres of its round ends."""
    return _round("capsule", start, end, radius)


def capsules(path: Array, count: int) -> list[Piece]:
    """A chain of capsules along a swept tube; the radius is the mean of the tube's half-extents."""
    at = np.linspace(0, len(path) - 1, count + 1).round().astype(int)
    return [capsule(path[i, :3], path[j, :3], float(path[[i, j], 3:].mean())) for i, j in itertools.pairwise(at)]


def hull(points: Array, count: int = 40) -> Piece:
    """The convex hull of `points` (n, 3), or of the `count` of them that lie farthest apart."""
    chosen = [int(np.argmax(points[:, 0]))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return Piece("convex", points[chosen])


def hulls(sections: Sequence[Section], cuts: Sequence[float], n: int = 14) -> list[Piece]:
    """Convex pieces of a loft, cut at the heights `cuts`; each spans the sections between two of them."""
    z = np.array([s[0] for s in sections])
    pieces = []
    for low, high in itertools.pairwise(cuts):
        rows = np.array(sections)[(z >= low - 1e-9) & (z <= high + 1e-9)]
        # Few rings are enough, and fewer tetrahedra make contact cheaper.
        keep = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), 5)).round().astype(int))
        pieces.append(Piece("convex", np.concatenate([superellipse(tuple(row), n) for row in rows[keep].tolist()])))
    return pieces


def wedges(inner: float, outer: float, low: float, high: float, count: int) -> list[Piece]:
    """The wall of a cup as `count` convex wedges between two radii and two heights."""
    # The wedge's inner face is the chord of its arc: it reaches into the cavity by a fraction of the wall.
    pieces = []
    step = 2 * np.pi / count
    for k in range(count):
        angles = k * step + np.array([0.0, step / 2, step])
        rows = [(outer, a) for a in angles] + [(inner, a) for a in angles[[0, 2]]]
        plane = np.array([[r * np.cos(a), r * np.sin(a)] for r, a in rows])
        pieces.append(hull(np.concatenate([np.column_stack([plane, np.full(len(plane), z)]) for z in (low, high)])))
    return pieces


def triangulate_hull(points: Array) -> tuple[Array, Indices]:
    """Vertices and outward faces of the convex hull of `points`."""
    shell = ConvexHull(points)
    index = np.full(len(points), -1)
    index[shell.vertices] = np.arange(len(shell.vertices))
    vertices, faces = points[shell.vertices], index[shell.simplices]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - vertices.mean(0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces
