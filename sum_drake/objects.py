"""The object catalogue: what the robot knows of each kind of object, ours or a user's own."""

import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sum_drake.assets import MODELS, InputError, one_line
from sum_drake.geometry import SYMMETRIES, Symmetry, symmetry_group
from sum_drake.robot import HAND
from sum_drake.types import Array, Immutable
from sum_drake.yamlio import parse_yaml

if TYPE_CHECKING:
    import trimesh

CATALOGUE = MODELS / "objects" / "catalogue.yaml"
LARGEST = 2.0
"""Metres: a mesh larger than this is taken to be in millimetres."""
SMALLEST = 0.001
"""Metres: a mesh smaller than this is taken to be in other units, too."""
LEAST_AREA = 1e-6
"""Of a mesh, as a share of its squared diagonal: a needle shows in no picture."""


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
        # Unprocessed: trimesh would drop what is not finite without a word.
        mesh = trimesh.load(path, force="mesh", skip_materials=True, process=False)
    except Exception as error:
        # For bytes that are no text trimesh asks a package that guesses encodings, which need not be there.
        guessing = isinstance(error, ImportError) and error.name == "charset_normalizer"
        why = "its bytes are neither text nor what its name promises" if guessing else one_line(error)
        raise InputError(f"mesh {path} cannot be read ({why}): expected a mesh file, such as an OBJ") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError(f"mesh {path} has no faces: expected a triangle mesh")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"mesh {path} has vertices that are not finite: expected metres")
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    if not mesh.area > LEAST_AREA * float(np.linalg.norm(mesh.extents)) ** 2:
        raise InputError(f"mesh {path} has only faces without area: expected a triangle mesh")
    extent = float(mesh.extents.max())
    if extent > LARGEST:
        raise InputError(
            f"mesh {path} is {extent:.4g} m long: expected metres and at most {LARGEST:g} m (is it in millimetres?)"
        )
    if extent < SMALLEST:
        raise InputError(f"mesh {path} is {extent:.4g} m long: expected metres and at least {SMALLEST:g} m")
    return mesh


_KEYS = {"mesh", "category", "symmetry", "mass", "sdf", "collision", "source"}


def load_catalogue(path: Path | None = None) -> Catalogue:
    """Reads a catalogue; None is the catalogue of the fifteen objects that come with the package.

    The file: `objects: {label: {mesh, category, symmetry, mass, sdf, collision, source}}`, of which mesh and category
    are needed; paths are relative to the file. Raises InputError for anything that cannot be used.
    """
    path = CATALOGUE if path is None else Path(path)
    return Catalogue(path, tuple(_read_model(path, label, entry) for label, entry in _read_entries(path)))


def _read_entries(path: Path) -> list[tuple[object, object]]:
    """Labels and entries of a catalogue file, unchecked. Raises InputError for a file that has none."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "is missing"
        raise InputError(f"catalogue {path} {what}: expected a YAML file with objects: {{label: {{mesh, category}}}}")
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
    return list(objects.items())


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


@dataclasses.dataclass(frozen=True)
class Finding:
    """What `check` says of one object."""

    line: str
    usable: bool
    """Whether a catalogue that holds the object can be loaded."""


def check(path: Path | None = None, tell: Callable[[Finding], None] = lambda finding: None) -> list[Finding]:
    """Every object of a catalogue file: faces, whether the mesh is closed, its extents, and what may cause trouble.

    None is the package's catalogue. An object that cannot be used is a finding, too. tell: given each finding once it
    is made. Raises InputError for a file that is no catalogue.
    """
    path = CATALOGUE if path is None else Path(path)
    findings = []
    for label, entry in _read_entries(path):
        findings.append(_check(path, label, entry))
        tell(findings[-1])
    return findings


def _check(path: Path, label: object, entry: object) -> Finding:
    try:
        model = _read_model(path, label, entry)
        model.load_collision()
    except InputError as error:
        said = str(error).removeprefix(f"{path}: object '{label}': ")
        return Finding(f"{label}: cannot be used: {said}", usable=False)
    mesh = model.load_mesh()
    warnings = []
    if not mesh.is_watertight:
        warnings.append("not closed: inside and outside are guessed from the normals")
    elif mesh.volume < 0:
        warnings.append("inside out: the normals point inward")
    flat = np.count_nonzero(mesh.area_faces == 0)
    if flat:
        warnings.append(f"faces without area: {flat}")
    if len(mesh.faces) > 20_000:
        warnings.append("many faces: rendering particles will be slow")
    if mesh.extents.max() < 0.02:
        warnings.append("smaller than 2 cm: is it in metres?")
    if np.linalg.norm(mesh.bounds.mean(0)) > 0.5 * mesh.extents.max():
        warnings.append("origin far outside the object: rotations will be badly conditioned")
    if mesh.extents.min() > HAND.gap_max and not model.collision:
        warnings.append(f"no side is narrower than the hand's {1e3 * HAND.gap_max:.0f} mm")
    if not is_shaded(model.mesh):
        warnings.append("no OBJ with vertex normals: it is drawn faceted and grey")
    if model.sdf is None:
        warnings.append("no sdf: it can be perceived but not poured")
    size = " x ".join(f"{1e3 * extent:.0f}" for extent in model.dimensions)
    closed = "closed" if mesh.is_watertight else "open"
    verdict = "; ".join(warnings) or "good"
    return Finding(f"{model.label}: {len(mesh.faces)} faces, {closed}, {size} mm: {verdict}", usable=True)


def is_shaded(mesh: Path) -> bool:
    """Whether a mesh is an OBJ that names a normal for every corner: what Drake's renderer draws as it is."""
    if mesh.suffix.lower() != ".obj":
        return False
    lines = (line.split() for line in mesh.read_text(errors="replace").splitlines())
    corners = [corner for words in lines if words[:1] == ["f"] for corner in words[1:]]
    return all(corner.count("/") == 2 and not corner.endswith("/") for corner in corners)
