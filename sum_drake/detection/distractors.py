"""Procedural things that are none of the catalogue's: cartons, cans, bottles, bowls, books, balls ...

A shape is a list of grids of points, each smooth in itself; where two grids meet there is an edge. The families of
`SHIFT` are held out: only scenes of the split `shift` hold such shapes.
"""

import dataclasses
from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from sum_drake.detection.textures import Texture
from sum_drake.types import Array

Grid = Array
"""(rows, columns, 3): the normal points along d/dcolumn x d/drow."""


@dataclasses.dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh with normals and texture coordinates. Metres; the origin is the middle of its extents."""

    vertices: Array
    """(v, 3)."""
    normals: Array
    """(v, 3), outward unit vectors."""
    uvs: Array
    """(v, 2) in [0, 1]: RenderEngineVtk does not repeat a texture."""
    faces: NDArray[np.int64]
    """(f, 3), counter-clockwise seen from outside."""


def draw_distractor(rng: np.random.Generator, *, shift: bool = False) -> Surface:
    """A shape of a family drawn from `TRAIN`, or from `SHIFT`, 4 to 25 cm large."""
    families = SHIFT if shift else TRAIN
    return make_distractor(tuple(families)[rng.integers(len(families))], rng)


def make_distractor(family: str, rng: np.random.Generator) -> Surface:
    """A shape of one family. Raises KeyError for a family that is neither in TRAIN nor in SHIFT."""
    return surface({**TRAIN, **SHIFT}[family](rng))


def box(x: float, y: float, z: float) -> Surface:
    """A box with these sides; each face shows the whole texture."""
    return surface(_box(np.array([x, y, z])))


def surface(grids: Sequence[Grid]) -> Surface:
    """Joins grids into one mesh, moved so that the middle of its extents is the origin."""
    vertices, normals, uvs, faces, offset = [], [], [], [], 0
    for grid in grids:
        rows, columns = grid.shape[:2]
        across, along = _slope(grid, 1), _slope(grid, 0)
        normal = np.cross(across, along)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        # At a pole all columns are one point, which says nothing about directions; the row beside it does.
        for pole, beside in ((0, 1), (-1, -2)):
            if length[pole].max() < 1e-6 * length.max():
                normal[pole], length[pole] = normal[beside], length[beside]
        vertices.append(grid.reshape(-1, 3))
        normals.append((normal / np.maximum(length, 1e-12)).reshape(-1, 3))
        v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
        uvs.append(np.stack([u, v], -1).reshape(-1, 2))
        corner = offset + np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
        triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        faces.append(triangles)
        offset += rows * columns
    points = np.concatenate(vertices)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    triangles = np.concatenate(faces)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    real = np.linalg.norm(np.cross(b - a, c - a), axis=-1) > 1e-12
    return Surface(points, np.concatenate(normals), np.concatenate(uvs), triangles[real])


def drake_mesh(shape: Surface, texture: Texture, name: str = "surface") -> Mesh:
    """The shape with its texture as a mesh in memory, for rendering."""
    lines = ["mtllib surface.mtl", "usemtl surface"]
    lines += [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in shape.vertices.tolist()]
    lines += [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in shape.normals.tolist()]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in shape.uvs.tolist()]
    lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in (shape.faces + 1).tolist()]
    material = "newmtl surface\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd surface.png\n"
    png = cv2.imencode(".png", texture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", name),
            supporting_files={
                "surface.mtl": MemoryFile(material, ".mtl", "surface.mtl"),
                "surface.png": MemoryFile(png, ".png", "surface.png"),
            },
        )
    )


def _slope(grid: Grid, axis: int) -> Array:
    """Derivative along an axis; around a seam, where a grid closes on itself, across it."""
    slope: Array = np.gradient(grid, axis=axis)
    ends = grid.take(0, axis), grid.take(-1, axis)
    if grid.shape[axis] > 3 and np.allclose(*ends):
        across = grid.take(1, axis) - grid.take(-2, axis)
        index: list[slice | list[int]] = [slice(None)] * 3
        index[axis] = [0, -1]
        slope[tuple(index)] = np.expand_dims(across, axis)
    return slope


# --- building blocks -------------------------------------------------------------------------------------------------


def _box(sides: Array) -> list[Grid]:
    grids = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            n, a, b = np.zeros(3), np.zeros(3), np.zeros(3)
            n[axis], a[(axis + 1) % 3], b[(axis + 2) % 3] = sign, sign, 1.0  # a x b = n
            corners = [[n - a - b, n + a - b], [n - a + b, n + a + b]]
            grids.append(np.array(corners) * sides / 2)
    return grids


def _revolve(
    pieces: Sequence[Sequence[tuple[float, float]]], *, flatness: float = 1.0, exponent: float = 2.0, columns: int = 37
) -> list[Grid]:
    """Turns an outline of smooth pieces, each points (radius, z), about z, from the bottom's middle outwards and up.

    flatness: extent along y over that along x; exponent: of the superellipse that the sections are.
    """
    angle = np.linspace(0, 2 * np.pi, columns)
    c, s = np.cos(angle), np.sin(angle)
    round_ = (np.abs(c) ** exponent + np.abs(s) ** exponent) ** (-1 / exponent)
    section = np.stack([c * round_, flatness * s * round_], -1)
    grids = []
    for piece in pieces:
        r, z = np.array(piece).T
        xy = r[:, None, None] * section
        grids.append(np.concatenate([xy, np.broadcast_to(z[:, None, None], (*xy.shape[:2], 1))], -1))
    return grids


def _arc(r: float, z: float, dr: float, dz: float, *, points: int = 7) -> list[tuple[float, float]]:
    """A quarter of an ellipse from (r, z) to (r + dr, z + dz) that sets out along z."""
    t = np.linspace(0, np.pi / 2, points)
    return [(r + dr * (1 - np.cos(a)), z + dz * np.sin(a)) for a in t]


def _prism(outline: Array, height: float) -> list[Grid]:
    """An outline (n, 2), counter-clockwise and star-shaped about the origin, pulled up along z."""
    closed = np.concatenate([outline, outline[:1]])
    low, high = (np.concatenate([closed, np.full((len(closed), 1), z)], 1) for z in (0.0, height))
    sides = [np.stack([low[i : i + 2], high[i : i + 2]]) for i in range(len(outline))]
    shrink = np.array([0.0, 0.5, 1.0])[:, None, None] * np.array([1.0, 1.0, 0.0])
    bottom, top = (ring * shrink + ring * np.array([0.0, 0.0, 1.0]) for ring in (low, high))
    return [*sides, bottom, top[::-1]]


# --- families of training --------------------------------------------------------------------------------------------


def _carton(rng: np.random.Generator) -> list[Grid]:
    return _box(rng.uniform([0.04, 0.03, 0.04], [0.16, 0.12, 0.24]))


def _book(rng: np.random.Generator) -> list[Grid]:
    return _box(rng.uniform([0.12, 0.09, 0.01], [0.24, 0.17, 0.045]))


def _can(rng: np.random.Generator) -> list[Grid]:
    r, h = rng.uniform(0.025, 0.06), rng.uniform(0.03, 0.2)
    return _revolve([[(0, 0), (r / 2, 0), (r, 0)], [(r, 0), (r, h / 2), (r, h)], [(r, h), (r / 2, h), (0, h)]])


def _bottle(rng: np.random.Generator) -> list[Grid]:
    r, h = rng.uniform(0.025, 0.05), rng.uniform(0.08, 0.16)
    neck, shoulder, cap = r * rng.uniform(0.25, 0.6), rng.uniform(0.01, 0.06), rng.uniform(0.01, 0.04)
    top = h + shoulder
    return _revolve(
        [
            [(0, 0), (r / 2, 0), (r, 0)],
            [(r, 0), (r, h / 2), (r * rng.uniform(0.85, 1.0), h * 0.7), (r, h)],
            _arc(r, h, neck - r, shoulder),
            [(neck, top), (neck, top + cap)],
            [(neck, top + cap), (neck / 2, top + cap), (0, top + cap)],
        ],
        flatness=rng.uniform(0.6, 1.0),
        exponent=rng.uniform(2.0, 5.0),
    )


def _bowl(rng: np.random.Generator) -> list[Grid]:
    r, h, wall = rng.uniform(0.05, 0.11), rng.uniform(0.03, 0.09), 0.004
    foot = r * rng.uniform(0.3, 0.6)
    outside = [(foot + (r - foot) * np.sin(a), h * (1 - np.cos(a))) for a in np.linspace(0, np.pi / 2, 9)]
    inside = [(max(p - wall, 0.0), z + wall) for p, z in outside[::-1]]
    inside[0] = (r - wall, h)
    return _revolve([[(0, 0), (foot / 2, 0), (foot, 0)], outside, [outside[-1], inside[0]], [*inside, (0, wall)]])


def _ball(rng: np.random.Generator) -> list[Grid]:
    r, h = rng.uniform(0.025, 0.07), rng.uniform(0.7, 1.4)
    return _revolve(
        [[(r * np.sin(a), -r * h * np.cos(a)) for a in np.linspace(0, np.pi, 19)]], flatness=rng.uniform(0.7, 1.0)
    )


# --- families held out -----------------------------------------------------------------------------------------------


def _cone(rng: np.random.Generator) -> list[Grid]:
    r, h, tip = rng.uniform(0.04, 0.08), rng.uniform(0.06, 0.2), rng.uniform(0, 0.015)
    return _revolve(
        [[(0, 0), (r / 2, 0), (r, 0)], [(r, 0), ((r + tip) / 2, h / 2), (tip, h)], [(tip, h), (tip / 2, h), (0, h)]]
    )


def _ring(rng: np.random.Generator) -> list[Grid]:
    R, r = rng.uniform(0.04, 0.08), rng.uniform(0.01, 0.03)
    return _revolve([[(R + r * np.cos(a), r * np.sin(a)) for a in np.linspace(-np.pi, np.pi, 21)]])


def _star(rng: np.random.Generator) -> list[Grid]:
    points, r, inner = int(rng.integers(3, 8)), rng.uniform(0.04, 0.08), rng.uniform(0.4, 0.75)
    angle = np.arange(2 * points) * np.pi / points
    radius = np.where(np.arange(2 * points) % 2, r * inner, r)
    return _prism(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1), rng.uniform(0.02, 0.12))


def _wedge(rng: np.random.Generator) -> list[Grid]:
    x, y = rng.uniform(0.03, 0.08, 2)
    return _prism(np.array([[-x, -y], [x, -y], [-x * rng.uniform(0, 1), y]]), rng.uniform(0.04, 0.15))


def _goblet(rng: np.random.Generator) -> list[Grid]:
    foot, stem, r = rng.uniform(0.025, 0.04), rng.uniform(0.03, 0.08), rng.uniform(0.025, 0.045)
    thin, cup, wall = 0.005, rng.uniform(0.05, 0.1), 0.003
    low = 0.006 + stem
    outside = [(thin + (r - thin) * np.sin(a), low + cup * (1 - np.cos(a))) for a in np.linspace(0, np.pi / 2, 9)]
    inside = [(max(p - wall, 0.0), z + wall) for p, z in outside[::-1]]
    inside[0] = (r - wall, low + cup)
    return _revolve(
        [
            [(0, 0), (foot / 2, 0), (foot, 0)],
            [(foot, 0), (foot, 0.004)],
            [(foot, 0.004), (foot / 2, 0.005), (thin, 0.006)],
            [(thin, 0.006), (thin, low)],
            outside,
            [outside[-1], inside[0]],
            [*inside, (0.0, low + wall)],
        ]
    )


def _pebble(rng: np.random.Generator) -> list[Grid]:
    """An ellipsoid with low waves on it."""
    [grid] = _revolve([[(np.sin(a), -np.cos(a)) for a in np.linspace(0, np.pi, 19)]])
    waves = np.ones(grid.shape[:2])
    for _ in range(5):
        waves += 0.1 * np.sin(grid @ rng.normal(0, 2.5, 3) + rng.uniform(0, 6))
    return [grid * waves[..., None] * rng.uniform([0.03, 0.025, 0.02], [0.08, 0.06, 0.05])]


Maker = Callable[[np.random.Generator], list[Grid]]
TRAIN: dict[str, Maker] = {
    "carton": _carton, "book": _book, "can": _can, "bottle": _bottle, "bowl": _bowl, "ball": _ball,
}  # fmt: skip
"""Families that training, validation and ordinary test scenes draw from."""
SHIFT: dict[str, Maker] = {
    "cone": _cone, "ring": _ring, "star": _star, "wedge": _wedge, "goblet": _goblet, "pebble": _pebble,
}  # fmt: skip
"""Families that only scenes of the split `shift` draw from."""
