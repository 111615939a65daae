"""The object catalogue: what the robot knows of each kind of object, ours or a user's own."""

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import MODELS, InputError, one_line
from sum_drake.geometry import SYMMETRIES, Symmetry, symmetry_group, transform
from sum_drake.robot import HAND
from sum_drake.types import Array, Immutable
from sum_drake.yamlio import parse_yaml

if TYPE_CHECKING:
    import trimesh

Image = NDArray[np.uint8]

CATALOGUE = MODELS / "objects" / "catalogue.yaml"
LARGEST = 2.0
"""Metres: a mesh larger than this is taken to be in millimetres."""


@dataclasses.dataclass(frozen=True, eq=False)
class ObjectModel(Immutable):
    """One kind of object. Its frame O is the mesh's."""

    label: str
    mesh: Path
    """Visual mesh in metres: OBJ, or anything trimesh reads."""
    category: str
    symmetry: Symmetry
    """Of the shape; the print does not count."""
    dimensions: tuple[float, float, float]
    """Extents of the mesh along O's axes, metres."""
    mass: float | None = None
    """Kilograms; None where the catalogue does not say."""
    sdf: Path | None = None
    """Simulation model, one free link named as the label; None for a user's mesh."""
    collision: tuple[Path, ...] = ()
    """Convex pieces in O, OBJ; empty where the catalogue gives none."""
    source: str = ""
    """Where the dimensions come from."""

    def load_mesh(self) -> "trimesh.Trimesh":
        """The mesh, welded: vertices that differ in normal or texture only are one. Cached; do not modify it."""
        return _load_mesh(self.mesh)

    def load_collision(self) -> list["trimesh.Trimesh"]:
        """The convex pieces, or the convex hull of the mesh where there are none."""
        if not self.collision:
            return [self.load_mesh().convex_hull]
        return [_load_mesh(path) for path in self.collision]


class UnknownLabel(InputError, KeyError):
    """A label that the catalogue lacks: bad input from a user, a missing key to whoever takes it for a mapping."""

    __str__ = Exception.__str__  # KeyError's quotes the message.


@dataclasses.dataclass(frozen=True, eq=False)
class Catalogue(Immutable, Mapping[str, ObjectModel]):
    """Object models by label, in the file's order."""

    path: Path
    models: tuple[ObjectModel, ...]

    @functools.cached_property
    def _by_label(self) -> dict[str, ObjectModel]:
        return {model.label: model for model in self.models}

    def __getitem__(self, label: str) -> ObjectModel:
        if label not in self._by_label:
            raise UnknownLabel(f"label '{label}' is not in {self.path}: expected one of {', '.join(self.labels)}")
        return self._by_label[label]

    def __contains__(self, label: object) -> bool:
        return label in self._by_label

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_label)

    def __len__(self) -> int:
        return len(self.models)

    @property
    def labels(self) -> tuple[str, ...]:
        """All labels, in the file's order."""
        return tuple(model.label for model in self.models)

    @property
    def categories(self) -> tuple[str, ...]:
        """All categories, each once, in the order in which they first appear."""
        return tuple(dict.fromkeys(model.category for model in self.models))


@functools.lru_cache(maxsize=256)
def _load_mesh(path: Path) -> "trimesh.Trimesh":
    import trimesh

    if not path.is_file():
        raise InputError(f"mesh {path} is missing: expected a file in metres that trimesh reads, such as an OBJ")
    try:
        mesh = trimesh.load(path, force="mesh", skip_materials=True)
    except Exception as error:
        raise InputError(f"mesh {path} cannot be read: {one_line(error)}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError(f"mesh {path} has no faces: expected a triangle mesh")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"mesh {path} has vertices that are not finite: expected metres")
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    extent = float(mesh.extents.max())
    if extent > LARGEST:
        raise InputError(
            f"mesh {path} is {extent:.4g} m long: expected metres and at most {LARGEST:g} m (is it in millimetres?)"
        )
    return mesh


_KEYS = {"mesh", "category", "symmetry", "mass", "sdf", "collision", "source"}


def load_catalogue(path: Path | None = None) -> Catalogue:
    """Reads a catalogue; None is the catalogue of the fifteen objects that come with the package.

    The file: `objects: {label: {mesh, category, symmetry, mass, sdf, collision, source}}`, of which mesh and category
    are needed; paths are relative to the file. Raises InputError for anything that cannot be used.
    """
    path = CATALOGUE if path is None else Path(path)
    if not path.is_file():
        raise InputError(
            f"catalogue {path} is missing: expected a YAML file with objects: {{label: {{mesh, category}}}}"
        )
    try:
        data = parse_yaml(path.read_text(), str(path))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: {one_line(error)}; expected YAML") from error
    objects = data.get("objects") if isinstance(data, dict) else None
    if not isinstance(objects, dict) or not objects:
        raise InputError(f"{path}: expected objects: {{label: {{mesh, category, ...}}}}, at least one")
    extra = sorted(set(data) - {"objects"}, key=str)
    if extra:
        raise InputError(f"{path}: unknown key '{extra[0]}': expected only 'objects'")
    return Catalogue(path, tuple(_read_model(path, label, entry) for label, entry in objects.items()))


def _read_model(path: Path, label: object, entry: object) -> ObjectModel:
    where = f"{path}: object '{label}'"
    if not isinstance(label, str) or not label:
        raise InputError(f"{where}: expected a label that is text")
    if not isinstance(entry, dict):
        raise InputError(f"{where}: expected {{mesh, category, ...}}")
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{where}: unknown key '{key}': expected {', '.join(sorted(_KEYS))}")
    for key in ("mesh", "category"):
        if not isinstance(entry.get(key), str) or not entry[key]:
            raise InputError(f"{where}: '{key}' is missing: expected text")
    symmetry = entry.get("symmetry", "none")
    if symmetry not in SYMMETRIES:
        raise InputError(f"{where}: unknown symmetry '{symmetry}': expected one of {', '.join(SYMMETRIES)}")
    mass = entry.get("mass")
    if mass is not None and not (isinstance(mass, int | float) and not isinstance(mass, bool) and mass > 0):
        raise InputError(f"{where}: mass is '{mass}': expected kilograms, more than 0")
    collision = entry.get("collision", [])
    if not isinstance(collision, list) or not all(isinstance(piece, str) for piece in collision):
        raise InputError(f"{where}: collision is '{collision}': expected a list of mesh files")
    sdf = entry.get("sdf")
    if sdf is not None and not (path.parent / str(sdf)).is_file():
        raise InputError(f"{where}: sdf {path.parent / str(sdf)} is missing: expected a simulation model")
    pieces = tuple((path.parent / piece).resolve() for piece in collision)
    for piece in pieces:
        if not piece.is_file():
            raise InputError(f"{where}: collision piece {piece} is missing: expected a convex mesh")
    mesh = (path.parent / entry["mesh"]).resolve()
    try:
        extents = _load_mesh(mesh).extents
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    return ObjectModel(
        label=label,
        mesh=mesh,
        category=entry["category"],
        symmetry=symmetry_group(symmetry),
        dimensions=(float(extents[0]), float(extents[1]), float(extents[2])),
        mass=None if mass is None else float(mass),
        sdf=None if sdf is None else (path.parent / str(sdf)).resolve(),
        collision=pieces,
        source=str(entry.get("source", "")),
    )


def sample_surface(model: ObjectModel, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """`n` points (n, 3) spread evenly over the mesh's area, in O, and their outward face normals (n, 3)."""
    mesh = model.load_mesh()
    area = np.cumsum(mesh.area_faces)
    # Stratified: one point in each of n equal shares of the area, so that few points already cover the shape.
    at = (np.arange(n) + rng.random(n)) / n * area[-1]
    face = np.minimum(np.searchsorted(area, at), len(area) - 1)
    u, v = rng.random((2, n, 1))
    root = np.sqrt(u)
    a, b, c = np.moveaxis(mesh.triangles[face], 1, 0)
    return (1 - root) * a + root * (1 - v) * b + root * v * c, np.array(mesh.face_normals[face])


def describe(catalogue: Catalogue) -> str:
    """A table of the catalogue, one line an object."""
    lines = [f"{'label':14s} {'category':14s} {'size, mm':>15s} {'mass, kg':>8s}  {'symmetry':12s} source"]
    for model in catalogue.models:
        size = " x ".join(f"{1e3 * extent:.0f}" for extent in model.dimensions)
        mass = "-" if model.mass is None else f"{model.mass:.2f}"
        line = (
            f"{model.label:14s} {model.category:14s} {size:>15s} {mass:>8s}  {model.symmetry.name:12s} {model.source}"
        )
        lines.append(line.rstrip())
    return "\n".join(lines)


def check(catalogue: Catalogue) -> list[str]:
    """One line an object: faces, whether the mesh is closed, its extents, and what may cause trouble."""
    lines = []
    for model in catalogue.models:
        mesh = model.load_mesh()
        warnings = []
        if not mesh.is_watertight:
            warnings.append("not closed: inside and outside are guessed from the normals")
        elif mesh.volume < 0:
            warnings.append("inside out: the normals point inward")
        if len(mesh.faces) > 20_000:
            warnings.append("many faces: rendering particles will be slow")
        if mesh.extents.max() < 0.02:
            warnings.append("smaller than 2 cm: is it in metres?")
        if np.linalg.norm(mesh.bounds.mean(0)) > 0.5 * mesh.extents.max():
            warnings.append("origin far outside the object: rotations will be badly conditioned")
        if mesh.extents.min() > HAND.gap_max and not model.collision:
            warnings.append(f"no side is narrower than the hand's {1e3 * HAND.gap_max:.0f} mm")
        if model.mesh.suffix == ".obj" and "\nvn " not in model.mesh.read_text(errors="replace"):
            warnings.append("no vertex normals: it will look faceted")
        if model.sdf is None:
            warnings.append("no sdf: it can be perceived but not poured")
        size = " x ".join(f"{1e3 * extent:.0f}" for extent in model.dimensions)
        closed = "closed" if mesh.is_watertight else "open"
        verdict = "; ".join(warnings) or "good"
        lines.append(f"{model.label}: {len(mesh.faces)} faces, {closed}, {size} mm: {verdict}")
    return lines


# --- contact sheet ---------------------------------------------------------------------------------------------------

_VIEWS = ((25.0, 22.0), (200.0, 35.0))
"""Azimuth from the front and elevation of the sheet's views, degrees."""


def render_model(model: ObjectModel, *, azimuth: float = 25.0, elevation: float = 22.0, size: int = 300) -> Image:
    """The object in its catalogue pose seen from `azimuth` and `elevation` (degrees), (size, size, 3) RGB."""
    from pydrake.geometry import (
        ClippingRange,
        ColorRenderCamera,
        GeometryInstance,
        LightParameter,
        MakeRenderEngineVtk,
        Mesh,
        PerceptionProperties,
        RenderCameraCore,
        RenderEngineVtkParams,
        RenderLabel,
        SceneGraph,
    )
    from pydrake.math import RigidTransform
    from pydrake.systems.sensors import CameraInfo

    lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=intensity)
        for direction, intensity in (([-0.5, 0.4, -1], 0.8), ([-0.8, -0.6, -0.2], 0.6), ([0.9, 0.2, -0.4], 0.7))
    ]
    scene_graph = SceneGraph()
    parameters = RenderEngineVtkParams(default_clear_color=[0.96, 0.96, 0.97], lights=lights)
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
    geometry = GeometryInstance(RigidTransform(), Mesh(str(model.mesh)), model.label)
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    geometry.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("sheet"), geometry)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())

    # Seen from where a 30 degree lens just holds the object's sphere.
    fov = np.radians(30.0)
    center = model.load_mesh().bounds.mean(0)
    a, e = np.radians([azimuth, elevation])
    backward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    R_WC = np.stack([right, np.cross(-backward, right), -backward], 1)
    p_WC = center + backward * np.linalg.norm(model.dimensions) / 2 / np.sin(fov / 2)
    core = RenderCameraCore("vtk", CameraInfo(size, size, fov), ClippingRange(0.01, 20.0), RigidTransform())
    image = query.RenderColorImage(
        ColorRenderCamera(core, False), scene_graph.world_frame_id(), RigidTransform(transform(R_WC, p_WC))
    )
    return np.array(image.data[..., :3])


def render_contact_sheet(catalogue: Catalogue, labels: Sequence[str] | None = None) -> Image:
    """Two views of each object with label, size, mass and category, five objects a row, (h, w, 3) RGB."""
    import cv2

    size, caption, columns = 220, 62, 5
    cells = []
    for model in [catalogue[label] for label in labels or catalogue.labels]:
        views = [render_model(model, azimuth=a, elevation=e, size=size) for a, e in _VIEWS]
        cell = np.concatenate([np.concatenate(views, 1), np.full((caption, 2 * size, 3), 255, np.uint8)])
        extents = " x ".join(f"{1e3 * extent:.0f}" for extent in model.dimensions)
        mass = "" if model.mass is None else f", {model.mass:g} kg"
        lines = (model.label, 0.62, (20, 20, 20)), (f"{extents} mm{mass}, {model.category}", 0.45, (90, 90, 90))
        for k, (text, scale, colour) in enumerate(lines):
            at = (10, size + 22 + 25 * k)
            cv2.putText(cell, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
        cells.append(cv2.copyMakeBorder(cell, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(225, 225, 225)))
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % min(columns, len(cells)))
    width = min(columns, len(cells))
    return np.concatenate([np.concatenate(cells[i : i + width], 1) for i in range(0, len(cells), width)])
