"""The catalogue and the fifteen objects behind it."""

import itertools
import logging
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Box, Capsule, Convex, Mesh, Role
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import RobotDiagramBuilder

from sum_drake.assets import InputError
from sum_drake.geometry import inverse, pose_error, rotation_from_vector, transform
from sum_drake.objects import Catalogue, check, describe, is_shaded, load_catalogue, sample_surface
from sum_drake.parsing import make_parser, parser_allowed
from sum_drake.robot import HAND

PAPER = (
    "tide", "downy", "clorox", "spray_bottle", "scotch_brite", "shampoo", "sugar", "ranch", "waterpot", "toy",
)  # fmt: skip
CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return CATALOGUE


def write(path: Path, text: str) -> Path:
    file = path / "objects.yaml"
    file.write_text(text)
    return file


def box_obj(path: Path, extents: tuple[float, float, float] = (0.1, 0.05, 0.08)) -> Path:
    file = path / "box.obj"
    trimesh.creation.box(extents).export(file)
    return file


# --- the fifteen -----------------------------------------------------------------------------------------------------


def test_the_papers_ten_and_five_of_a_kitchen(catalogue: Catalogue) -> None:
    assert len(catalogue) == 15
    assert set(PAPER) <= set(catalogue.labels)
    assert catalogue.categories == ("cleaning", "non-cleaning")
    assert {m.label for m in catalogue.models if m.category == "cleaning"} == {
        "tide", "downy", "clorox", "spray_bottle", "scotch_brite",
    }  # fmt: skip


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_visual_mesh_is_closed_smooth_and_centred(catalogue: Catalogue, label: str) -> None:
    model = catalogue[label]
    mesh = model.load_mesh()
    assert 1000 <= len(mesh.faces) <= 6000
    assert mesh.is_watertight and mesh.volume > 0
    np.testing.assert_allclose(mesh.bounds.mean(0), 0, atol=1e-5)
    np.testing.assert_allclose(mesh.extents, model.dimensions)
    text = model.mesh.read_text()
    assert "\nvn " in text and "\nvt " in text
    material = model.mesh.with_suffix(".mtl").read_text()
    assert "Kd 1 1 1" in material and f"map_Kd {label}.png" in material


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_collision_pieces_are_convex_and_follow_the_shape(catalogue: Catalogue, label: str) -> None:
    model = catalogue[label]
    pieces = model.load_collision()
    assert 1 <= len(pieces) <= 12
    for piece in pieces:
        assert piece.is_watertight
        assert piece.volume == pytest.approx(piece.convex_hull.volume, rel=1e-3)
    # Every point of the surface is near a piece, and no piece sticks out.
    points, _ = sample_surface(model, 600, np.random.default_rng(0))
    outside = np.min([_distance_outside(piece, points) for piece in pieces], axis=0)
    assert np.percentile(outside, 95) < 0.004
    assert outside.max() < 0.012
    corners = np.concatenate([piece.vertices for piece in pieces])
    low, high = model.load_mesh().bounds
    assert np.all(corners > low - 0.004) and np.all(corners < high + 0.004)


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_what_physics_collides_with_is_where_the_collision_pieces_are(catalogue: Catalogue, label: str) -> None:
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    builder.parser().AddModels(str(catalogue[label].sdf))
    inspector = builder.scene_graph().model_inspector()
    shapes = {inspector.GetName(i).split("::")[-1]: i for i in inspector.GetAllGeometryIds(Role.kProximity)}
    pieces = catalogue[label].load_collision()
    assert len(shapes) == len(pieces)
    for k, piece in enumerate(pieces):
        shape = inspector.GetShape(shapes[f"collision_{k}"])
        X_OS = inspector.GetPoseInFrame(shapes[f"collision_{k}"])
        if isinstance(shape, Convex | Mesh):
            assert X_OS.IsNearlyIdentity(0.0)  # the very file that the piece is
            continue
        axis = np.abs(X_OS.rotation().matrix()[:, 2])
        if isinstance(shape, Box):
            half = np.abs(X_OS.rotation().matrix()) @ shape.size() / 2
        elif isinstance(shape, Capsule):
            half = shape.length() / 2 * axis + shape.radius()
        else:
            half = shape.length() / 2 * axis + shape.radius() * np.sqrt(1 - axis**2)
        np.testing.assert_allclose(X_OS.translation() - half, piece.bounds[0], atol=0.003)
        np.testing.assert_allclose(X_OS.translation() + half, piece.bounds[1], atol=0.003)


def _distance_outside(piece: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Largest signed distance of points (n, 3) to the planes of a convex piece, at least 0."""
    offsets = np.einsum("fi,fi->f", piece.face_normals, piece.triangles[:, 0])
    return np.maximum((points @ piece.face_normals.T - offsets).max(1), 0.0)


def _first_hits(mesh: trimesh.Trimesh, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distances (n,) along rays to the mesh, inf where they miss (Moeller and Trumbore 1997)."""
    a = mesh.triangles[:, 0]
    e1, e2 = mesh.triangles[:, 1] - a, mesh.triangles[:, 2] - a
    distances = np.full(len(origins), np.inf)
    for k, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        h = np.cross(direction, e2)
        det = np.einsum("ij,ij->i", e1, h)
        det[np.abs(det) < 1e-14] = np.nan  # parallel
        u = np.einsum("ij,ij->i", origin - a, h) / det
        q = np.cross(origin - a, e1)
        v = q @ direction / det
        t = np.einsum("ij,ij->i", e2, q) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if hit.any():
            distances[k] = t[hit].min()
    return distances


@pytest.mark.parametrize(
    ("label", "y", "z", "thickness", "width"),
    [
        ("tide", 0.033, 0.018, 0.026, 0.037),
        ("clorox", 0.020, 0.034, 0.026, 0.037),
        ("mug", 0.036, 0.0, 0.0, 0.0),
        ("waterpot", -0.097, -0.003, 0.0, 0.0),
    ],
)
def test_handles_are_holes_in_shape_and_in_physics(
    catalogue: Catalogue, label: str, y: float, z: float, thickness: float, width: float
) -> None:
    """What is put through the handle along x touches neither the mesh nor a collision piece.

    Through a jug's goes a finger (14 x 25 mm) with 6 mm of room all about it.
    """
    model = catalogue[label]
    grid = np.array(list(itertools.product(np.linspace(-0.5, 0.5, 5), repeat=2)))
    entries = np.column_stack([np.full(25, -0.05), y + thickness * grid[:, 0], z + width * grid[:, 1]])
    along = np.tile([1.0, 0.0, 0.0], (25, 1))
    assert np.isinf(_first_hits(model.load_mesh(), entries, along)).all()
    through = (entries[:, None] + np.linspace(0, 0.1, 41)[:, None] * along[:, None]).reshape(-1, 3)
    for piece in model.load_collision():
        assert _distance_outside(piece, through).min() > 0.0


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_hand_has_something_to_hold(catalogue: Catalogue, label: str) -> None:
    """Somewhere two opposite faces are closer than the hand opens, with room to spare."""
    points, normals = sample_surface(catalogue[label], 200, np.random.default_rng(1))
    width = _first_hits(catalogue[label].load_mesh(), points - 1e-4 * normals, -normals)
    assert np.count_nonzero(width < 0.86 * HAND.gap_max) > 20


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_symmetry_is_that_of_the_shape(catalogue: Catalogue, label: str) -> None:
    """Turned by its group the surface falls on itself, and the object has no other half-turn."""
    from scipy.spatial import cKDTree

    model = catalogue[label]
    tree = cKDTree(sample_surface(model, 20_000, np.random.default_rng(2))[0])
    points, _ = sample_surface(model, 2000, np.random.default_rng(3))

    def misfit(R: np.ndarray) -> float:
        return float(np.percentile(tree.query(points @ R.T)[0], 95))

    for R in model.symmetry.rotations:
        assert misfit(R) < 0.004
    if model.symmetry.axis is not None:
        assert misfit(rotation_from_vector(0.7 * model.symmetry.axis)) < 0.004
    for half_turn in (rotation_from_vector(np.pi * axis) for axis in np.eye(3)):
        _, error = pose_error(np.eye(4), transform(half_turn, np.zeros(3)), model.symmetry)
        assert error < 1e-6 or misfit(half_turn) > 0.004


def test_loads_in_drake_without_a_warning(catalogue: Catalogue, caplog: pytest.LogCaptureFixture) -> None:
    plant = MultibodyPlant(0.004)
    parser = make_parser(plant)
    parser.SetStrictParsing()  # warnings are errors
    with caplog.at_level(logging.WARNING):
        for label in catalogue.labels:
            parser.AddModelsFromUrl(f"package://sum_drake/objects/{label}/{label}.sdf")
        plant.Finalize()
    assert not caplog.records
    for label in catalogue.labels:
        body = plant.GetBodyByName(label)
        inertia = body.default_spatial_inertia()
        assert body.default_mass() == pytest.approx(catalogue[label].mass)
        assert 0.03 <= body.default_mass() <= 1.2
        assert inertia.IsPhysicallyValid()
        assert np.all(np.abs(inertia.get_com()) < np.array(catalogue[label].dimensions) / 2)


def test_tables_name_every_object(catalogue: Catalogue) -> None:
    table, findings = describe(catalogue), check()
    assert len(findings) == 15
    for label, finding in zip(catalogue.labels, findings, strict=True):
        assert label in table and finding.line.startswith(label) and finding.line.endswith("good") and finding.usable


# --- sampling --------------------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.sampled_from(CATALOGUE.labels), st.integers(1, 300), st.integers(0, 2**32 - 1))
def test_samples_lie_on_the_surface(label: str, n: int, seed: int) -> None:
    model = CATALOGUE[label]
    points, normals = sample_surface(model, n, np.random.default_rng(seed))
    assert points.shape == normals.shape == (n, 3)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    half = np.array(model.dimensions) / 2
    assert np.all(np.abs(points) <= half + 1e-5)
    again, _ = sample_surface(model, n, np.random.default_rng(seed))
    np.testing.assert_array_equal(points, again)


def test_samples_are_even_over_the_area(catalogue: Catalogue) -> None:
    points, normals = sample_surface(catalogue["tea"], 4000, np.random.default_rng(0))
    x, y, z = catalogue["tea"].dimensions
    front = np.count_nonzero(normals[:, 0] > 0.9) / len(points)
    assert front == pytest.approx(y * z / (2 * (x * y + y * z + z * x)), abs=0.02)


# --- a user's own ----------------------------------------------------------------------------------------------------


def test_a_users_mesh_and_category_are_enough(tmp_path: Path) -> None:
    box_obj(tmp_path)
    file = write(tmp_path, "objects:\n  mine:\n    mesh: box.obj\n    category: tools\n")
    catalogue = load_catalogue(file)
    model = catalogue["mine"]
    assert model.symmetry.name == "none" and model.sdf is None and model.mass is None
    np.testing.assert_allclose(sorted(model.dimensions), [0.05, 0.08, 0.1], atol=1e-6)
    assert len(model.load_collision()) == 1
    (finding,) = check(file)
    assert "no sdf" in finding.line and finding.usable
    assert inverse(np.eye(4)).shape == (4, 4)


ENTRY = "objects:\n  mine:\n    mesh: box.obj\n    category: tools\n"


def broken_meshes(path: Path) -> None:
    """A good box.obj and many that cannot be used."""
    box = box_obj(path).read_text()
    (path / "empty.obj").write_text("")
    (path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    trimesh.creation.box((100, 50, 80)).export(path / "millimetres.obj")
    trimesh.creation.box((1e-5, 5e-6, 8e-6)).export(path / "speck.obj")
    (path / "line.obj").write_text("v 0 0 0\nv .1 0 0\nv .2 0 0\nf 1 2 3\n")
    (path / "nan.obj").write_text(box.replace("v -0.05000000", "v nan", 1))
    (path / "inf.obj").write_text(box.replace("v -0.05000000", "v inf", 1))
    (path / "index.obj").write_text("v 0 0 0\nv .1 0 0\nv 0 .1 0\nf 1 2 9\n")
    (path / "noise.obj").write_bytes(np.random.default_rng(0).bytes(4000))
    (path / "zeros.obj").write_bytes(bytes(4000))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (ENTRY + "    colour: red\n", ("mine", "colour", "expected")),
        (ENTRY + "    symmetry: round\n", ("mine", "round", "cylinder")),
        (ENTRY + "    mass: -1\n", ("mine", "mass")),
        (ENTRY + "    mass: heavy\n", ("mine", "mass")),
        (ENTRY + "    sdf: none.sdf\n", ("mine", "none.sdf")),
        (ENTRY + "    collision: piece.obj\n", ("mine", "collision")),
        (ENTRY + "  mine:\n    mesh: box.obj\n    category: tools\n", ("mine", "twice")),
        (ENTRY + "things: 1\n", ("things",)),
        (ENTRY.replace("box.obj", "gone.obj"), ("mine", "gone.obj", "missing")),
        (ENTRY.replace("box.obj", "objects.yaml"), ("mine", "objects.yaml")),
        (ENTRY.replace("box.obj", "empty.obj"), ("mine", "empty.obj")),
        (ENTRY.replace("box.obj", "points.obj"), ("mine", "points.obj", "faces")),
        (ENTRY.replace("box.obj", "millimetres.obj"), ("mine", "millimetres")),
        (ENTRY.replace("box.obj", "speck.obj"), ("mine", "speck.obj", "1e-05 m", "at least")),
        (ENTRY.replace("box.obj", "line.obj"), ("mine", "line.obj", "without area")),
        (ENTRY.replace("box.obj", "nan.obj"), ("mine", "nan.obj", "not finite")),
        (ENTRY.replace("box.obj", "inf.obj"), ("mine", "inf.obj", "not finite")),
        (ENTRY.replace("box.obj", "index.obj"), ("mine", "index.obj", "cannot be read")),
        # "cannot be read", or "no faces" where a package is installed that guesses an encoding of the bytes.
        (ENTRY.replace("box.obj", "noise.obj"), ("mine", "noise.obj", "expected a")),
        (ENTRY.replace("box.obj", "zeros.obj"), ("mine", "zeros.obj", "no faces")),
        ("objects:\n  mine:\n    mesh: box.obj\n", ("mine", "category")),
        ("objects: {}\n", ("objects",)),
        ("- 1\n", ("objects",)),
        ("objects: [\n", ("YAML",)),
    ],
)
def test_bad_catalogues_name_what_is_wrong_in_one_line(tmp_path: Path, text: str, names: tuple[str, ...]) -> None:
    broken_meshes(tmp_path)
    with pytest.raises(InputError) as error:
        load_catalogue(write(tmp_path, text))
    assert "\n" not in str(error.value)
    for name in (*names, str(tmp_path)):
        assert name in str(error.value)


def test_check_goes_on_after_what_cannot_be_used(tmp_path: Path) -> None:
    """One line an object, in the file's order; the last two are not even entries."""
    broken_meshes(tmp_path)
    names = [file.stem for file in sorted(tmp_path.glob("*.obj"))]
    text = "".join(f"  {name}: {{mesh: {name}.obj, category: tools}}\n" for name in names)
    text += (
        "  pieces: {mesh: box.obj, category: tools, collision: [noise.obj]}\n  nothing: {mesh: box.obj}\n  7: tools\n"
    )
    findings = check(write(tmp_path, "objects:\n" + text))
    assert [finding.line.partition(": ")[0] for finding in findings] == [*names, "pieces", "nothing", "7"]
    assert [finding.line.partition(": ")[0] for finding in findings if finding.usable] == ["box"]
    for finding in findings:
        assert "\n" not in finding.line and finding.usable != ("cannot be used" in finding.line)


def test_check_counts_faces_without_area(tmp_path: Path) -> None:
    file = box_obj(tmp_path)
    file.write_text(file.read_text() + "f 1 1 2\nf 3 4 4\n")
    (finding,) = check(write(tmp_path, ENTRY))
    assert "faces without area: 2" in finding.line and finding.usable


@pytest.mark.parametrize(
    ("faces", "shaded"),
    [("f 1//1 2//1 3//1", True), ("f 1/1/1 2/2/1 3/3/1", True), ("f 1/1 2/2 3/3", False), ("f 1//1 2//1 3//", False),
     ("f 1//1 2//1 3//1\nf 1 2 3", False)],
)  # fmt: skip
def test_only_an_obj_that_uses_normals_throughout_is_shaded(tmp_path: Path, faces: str, shaded: bool) -> None:
    file = tmp_path / "mesh.obj"
    file.write_text(f"v 0 0 0\nv .1 0 0\nv 0 .1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n{faces}\n")
    assert is_shaded(file) == shaded
    assert not is_shaded(file.rename(tmp_path / "mesh.stl"))


def test_unknown_label_and_missing_file(catalogue: Catalogue, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'soap'.*tide"):
        catalogue["soap"]
    assert catalogue.get("soap") is None  # as of any mapping
    with pytest.raises(InputError, match="missing"):
        load_catalogue(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="is a folder: expected a YAML file"):
        load_catalogue(tmp_path)


def test_folder_is_small(catalogue: Catalogue) -> None:
    files = itertools.chain.from_iterable(model.mesh.parent.iterdir() for model in catalogue.models)
    assert sum(file.stat().st_size for file in files) < 8e6
