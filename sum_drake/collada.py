"""Triangles of a COLLADA file (.dae): where a robot's mesh is, without its looks.

Positions, the scene's transforms and the unit are read. The up axis is not: like RViz and MoveIt, which take the
file's coordinates for the link's.
"""

import itertools
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.types import Array

_DEPTH = 32
"""Nodes nest no deeper; a node that instances itself ends here."""


def read_collada(path: Path) -> Array:
    """Triangles (n, 3, 3), metres, of everything that the file's scene shows; of all it holds where it has no scene.

    Raises ValueError (ElementTree.ParseError, KeyError or IndexError where it is broken).
    """
    root = ElementTree.fromstring(path.read_bytes())
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    by_id = {str(element.get("id")): element for element in root.iter() if element.get("id")}
    unit = root.find("asset/unit")
    metres = float(unit.get("meter", 1.0)) if unit is not None else 1.0
    nodes = root.findall("library_visual_scenes/visual_scene/node")
    if nodes:
        found = list(itertools.chain.from_iterable(_shown(node, by_id, np.eye(4), _DEPTH) for node in nodes))
    else:
        found = [_triangles(geometry, by_id) for geometry in root.findall("library_geometries/geometry")]
    return metres * np.concatenate([np.zeros((0, 3, 3)), *found])


def _shown(node: ElementTree.Element, by_id: dict[str, ElementTree.Element], X: Array, depth: int) -> list[Array]:
    """Triangles of the node and its children, placed."""
    if depth == 0:
        raise ValueError("its nodes nest without end")
    X = X @ _placed(node)
    found = []
    for child in node:
        if child.tag == "instance_geometry":
            points = _triangles(_behind(child, "url", by_id), by_id)
            found.append(points @ X[:3, :3].T + X[:3, 3])
        elif child.tag == "node":
            found += _shown(child, by_id, X, depth - 1)
        elif child.tag == "instance_node":
            found += _shown(_behind(child, "url", by_id), by_id, X, depth - 1)
    return found


def _placed(node: ElementTree.Element) -> Array:
    """The product of a node's transforms (4, 4), in the order in which they are written."""
    X = np.eye(4)
    for element in node:
        if element.tag not in ("matrix", "translate", "rotate", "scale"):
            continue
        values = _floats(element)
        if element.tag == "matrix":
            X = X @ values.reshape(4, 4)
        elif element.tag == "translate":
            X = X @ transform(np.eye(3), values)
        elif element.tag == "rotate":
            axis = values[:3] / np.linalg.norm(values[:3])
            X = X @ transform(rotation_from_vector(np.radians(values[3]) * axis), np.zeros(3))
        else:
            X = X @ np.diag([*values, 1.0])
    return X


def _triangles(geometry: ElementTree.Element, by_id: dict[str, ElementTree.Element]) -> Array:
    """Triangles (n, 3, 3) of a geometry in its own coordinates; polygons are cut into fans."""
    found = []
    for primitive in geometry.iterfind("mesh/*"):
        if primitive.tag not in ("triangles", "polylist", "polygons"):
            continue
        inputs = primitive.findall("input")
        corner = next(each for each in inputs if each.get("semantic") == "VERTEX")
        stride = 1 + max(int(each.get("offset", 0)) for each in inputs)
        points = _positions(_behind(corner, "source", by_id), by_id)
        for p in primitive.findall("p"):
            indices = _floats(p).astype(int)[int(corner.get("offset", 0)) :: stride]
            counts = primitive.find("vcount")
            if primitive.tag == "triangles":
                sizes = np.full(len(indices) // 3, 3)
            elif counts is not None:
                sizes = _floats(counts).astype(int)
            else:
                sizes = np.array([len(indices)])
            for polygon in np.split(indices, np.cumsum(sizes)[:-1]):
                fan = [(polygon[0], b, c) for b, c in itertools.pairwise(polygon[1:])]
                found.append(points[np.array(fan, dtype=int).reshape(-1, 3)])
    return np.concatenate([np.zeros((0, 3, 3)), *found])


def _positions(vertices: ElementTree.Element, by_id: dict[str, ElementTree.Element]) -> Array:
    """Points (n, 3) of a <vertices> or of the <source> it names."""
    if vertices.tag == "vertices":
        named = next(each for each in vertices.findall("input") if each.get("semantic") == "POSITION")
        vertices = _behind(named, "source", by_id)
    values, accessor = vertices.find("float_array"), vertices.find("technique_common/accessor")
    if values is None:
        raise ValueError(f"its source '{vertices.get('id')}' has no numbers")
    stride = 3 if accessor is None else int(accessor.get("stride", 3))
    return _floats(values).reshape(-1, stride)[:, :3]


def _behind(element: ElementTree.Element, key: str, by_id: dict[str, ElementTree.Element]) -> ElementTree.Element:
    return by_id[str(element.get(key)).removeprefix("#")]


def _floats(element: ElementTree.Element) -> Array:
    return np.array((element.text or "").split(), dtype=float)
