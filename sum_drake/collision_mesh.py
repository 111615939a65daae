"""Collision meshes of a robot: where they lie, and convex pieces that cover them."""

import itertools
import os
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np
import trimesh
from pydrake.geometry import Convex
from scipy.spatial import ConvexHull, QhullError

from sum_drake.assets import MODELS, InputError, one_line
from sum_drake.collada import read_collada
from sum_drake.types import Array

DRAKE_READS = (".obj", ".gltf", ".vtk")
"""What Drake itself reads, and takes as one convex hull: so it is here, too."""
PIECES = 8
"""At most so many convex pieces cover one connected part of a mesh."""
GAIN = 0.05
"""A cut must save this share of the whole hull's volume."""
PARTS = 32
"""A mesh of more connected parts is cut as one."""
THIN = 1e-4
"""Metres: what is flatter is made this thick, since nothing flat has a convex hull."""
_CUTS = (0.25, 0.4, 0.5, 0.6, 0.75)


def find_mesh(uri: str, urdf: Path, where: str) -> Path:
    """The file of a mesh that a URDF names: package://, model://, file:// or a path.

    A path is relative to the URDF. Of package://NAME/REST, NAME/REST and REST are looked for in the URDF's folder, in
    every folder above it and in those on ROS_PACKAGE_PATH, nearest first. Raises InputError where there is no such
    file.
    """
    scheme, _, rest = uri.partition("://")
    folders = [urdf.resolve().parent, *urdf.resolve().parent.parents]
    if not rest:
        tried = [urdf.resolve().parent / uri]
    elif scheme == "file":
        tried = [Path(unquote(urlparse(uri).path))]
    elif scheme in ("package", "model"):
        roads = [Path(road) for road in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if road]
        name, _, inner = rest.partition("/")
        tried = [folder / part for folder in (*folders, *roads) for part in (rest, inner) if part]
        tried += [MODELS / inner] if name == "sum_drake" else []
    else:
        raise InputError(f"{where}: mesh '{uri}' is no file; expected package://, file:// or a path")
    for path in tried:
        if path.is_file():
            return path
    looked = f"in {folders[0]}" if not rest or scheme == "file" else f"in or above {folders[0]}, or on ROS_PACKAGE_PATH"
    raise InputError(f"{where}: mesh '{uri}' is missing; expected the file {looked}")


def convex_pieces(path: Path, scale: Array, where: str) -> list[Array]:
    """Vertices (n, 3) of convex hulls that cover the mesh of a file, scaled (3,): one for what Drake reads itself.

    Otherwise every connected part is cut by planes as long as that makes its hulls smaller by much. The hulls of what
    lies on either side of a plane cover the solid between them, so nothing of it is lost. Raises InputError.
    """
    mesh = _load(path, where)
    triangles = np.asarray(mesh.triangles, dtype=float) * scale
    if path.suffix.lower() in DRAKE_READS:
        return [_hull(triangles.reshape(-1, 3))[0]]
    joined = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    joined.merge_vertices(merge_norm=True, merge_tex=True)
    parts = trimesh.graph.connected_components(joined.face_adjacency, nodes=np.arange(len(joined.faces)), min_len=1)
    if len(parts) > PARTS:
        parts = [np.arange(len(triangles))]
    pieces = list(itertools.chain.from_iterable(_cut(triangles[np.asarray(part)]) for part in parts))
    return _without_covered(pieces)


def _load(path: Path, where: str) -> trimesh.Trimesh:
    mesh: Any
    kind = path.suffix.lower()
    try:
        if kind == ".dae":
            corners = read_collada(path).reshape(-1, 3)
            mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
        elif kind == ".vtk":
            hull = Convex(filename=str(path)).GetConvexHull()
            points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
            mesh = trimesh.Trimesh(points, ConvexHull(points).simplices, process=False)
        else:
            mesh = trimesh.load(path, force="mesh", skip_materials=True, process=False)
            if kind in (".gltf", ".glb"):  # their y is up, which Drake makes z
                mesh.apply_transform([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    except Exception as error:
        raise InputError(f"{where}: mesh {path} cannot be read ({one_line(error)}); expected a mesh file") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"{where}: mesh {path} has no faces; expected a triangle mesh")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"{where}: mesh {path} has vertices that are not finite; expected metres")
    return mesh


def _hull(points: Array) -> tuple[Array, float]:
    """Vertices (n, 3) of the convex hull and its volume; of what is flat, a little thicker."""
    points = np.unique(points, axis=0)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        axes = np.linalg.svd(points - points.mean(0), full_matrices=True)[2]
        spread = np.ptp(points @ axes.T, axis=0)
        thin = axes[spread < THIN]
        for axis in thin if len(thin) else axes[2:]:
            points = np.vstack([points - THIN / 2 * axis, points + THIN / 2 * axis])
        hull = ConvexHull(points, qhull_options="QJ")
    return points[hull.vertices], float(hull.volume)


def _cut(triangles: Array) -> list[Array]:
    """Vertices (n, 3) of the hulls of connected triangles (m, 3, 3), the piece first that gains most by a cut."""
    whole = _hull(triangles.reshape(-1, 3))
    if _enclosed(triangles) > (1 - GAIN) * whole[1]:
        return [whole[0]]
    pieces = [(triangles, *whole, _worth(triangles, whole[1]))]
    while len(pieces) < PIECES:
        best = max(range(len(pieces)), key=lambda i: pieces[i][3][0])
        gain, halves = pieces[best][3]
        if gain < GAIN * whole[1]:
            break
        made = [(half, *_hull(half.reshape(-1, 3))) for half in halves]
        pieces[best : best + 1] = [(*piece, _worth(piece[0], piece[2])) for piece in made]
    return [piece[1] for piece in pieces]


def _enclosed(triangles: Array) -> float:
    """The volume that closed triangles (m, 3, 3) enclose."""
    a, b, c = np.moveaxis(triangles - triangles.mean((0, 1)), 1, 0)
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6


def _worth(triangles: Array, volume: float) -> tuple[float, tuple[Array, ...]]:
    """What one cut saves; where that is little, what two in a row do: half a ring fills half of the ring's hull."""
    gain, halves = _best_cut(triangles, volume, _CUTS)
    if gain >= GAIN * volume:
        return gain, halves
    longest = int(np.ptp(triangles, axis=(0, 1)).argmax())
    first_gain, first = _best_cut(triangles, volume, (0.5,), (longest,), least=-np.inf)
    later = sum(_best_cut(half, _hull(half.reshape(-1, 3))[1], (0.4, 0.5, 0.6))[0] for half in first)
    return (first_gain + later, first) if first and first_gain + later > gain else (gain, halves)


def _best_cut(
    triangles: Array,
    volume: float,
    shares: tuple[float, ...],
    axes: tuple[int, ...] = (0, 1, 2),
    least: float = 0.0,
) -> tuple[float, tuple[Array, ...]]:
    """The volume saved by the best of a few planes across the axes, and the triangles on its two sides."""
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    best: tuple[float, tuple[Array, ...]] = (least, ())
    for axis, share in itertools.product(axes, shares):
        if high[axis] - low[axis] < 100 * THIN:
            continue
        at = low[axis] + share * (high[axis] - low[axis])
        halves = tuple(_clip(triangles, axis, at, side) for side in (-1.0, 1.0))
        if not all(map(len, halves)):
            continue
        gain = volume - sum(_hull(half.reshape(-1, 3))[1] for half in halves)
        if gain > best[0]:
            best = gain, halves
    return best


def _clip(triangles: Array, axis: int, at: float, side: float) -> Array:
    """What of triangles (m, 3, 3) lies on one side of a plane, as triangles (n, 3, 3)."""
    height = side * (triangles[:, :, axis] - at)
    inside = height >= 0
    count = inside.sum(1)
    kept = [triangles[count == 3]]
    for wanted in (1, 2):  # the corner that is alone on its side comes first
        chosen = count == wanted
        alone = (inside if wanted == 1 else ~inside)[chosen].argmax(1)
        turned = (alone[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(triangles[chosen], turned[:, :, None], 1)
        h = np.take_along_axis(height[chosen], turned, 1)
        share = (h[:, :1] / (h[:, :1] - h[:, 1:]))[:, :, None]
        crossing = corner[:, :1] + share * (corner[:, 1:] - corner[:, :1])  # (k, 2, 3)
        if wanted == 1:
            kept.append(np.concatenate([corner[:, :1], crossing], 1))
        else:
            kept.append(np.stack([corner[:, 1], corner[:, 2], crossing[:, 0]], 1))
            kept.append(np.stack([corner[:, 2], crossing[:, 0], crossing[:, 1]], 1))
    return np.concatenate(kept)


def _without_covered(pieces: list[Array]) -> list[Array]:
    """The pieces that do not lie inside another one: screws inside a housing."""
    sorted_pieces = sorted(pieces, key=lambda points: -float(np.prod(np.ptp(points, axis=0))))
    kept: list[tuple[Array, Array]] = []
    for points in sorted_pieces:
        if not any((points @ faces[:, :3].T + faces[:, 3] <= 1e-9).all() for _, faces in kept):
            kept.append((points, ConvexHull(points, qhull_options="QJ").equations))
    return [points for points, _ in kept]
