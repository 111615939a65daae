"""Convex pieces cover a mesh, and closely where Drake would refuse it."""

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Convex
from scipy.spatial import ConvexHull

from sum_drake.assets import InputError
from sum_drake.collision_mesh import PIECES, convex_pieces, find_mesh

ONE = np.ones(3)


def covered(points, pieces):
    """Which points (n, 3) lie in some piece."""
    inside = np.zeros(len(points), bool)
    for piece in pieces:
        faces = ConvexHull(piece).equations
        inside |= (points @ faces[:, :3].T + faces[:, 3] <= 1e-6).all(1)
    return inside


def pieces_of(folder, mesh, name="part.stl", scale=ONE):
    mesh.export(folder / name)
    return convex_pieces(folder / name, scale, "link 'a'")


def angle_iron():
    upright = trimesh.creation.box([0.1, 0.1, 1.0])
    foot = trimesh.creation.box([1.0, 0.1, 0.1])
    upright.apply_translation([0, 0, 0.5])
    foot.apply_translation([0.5, 0, 0.05])
    return upright, foot


@pytest.mark.parametrize("kind", ["torus", "stairs", "tilted"])
def test_a_hollow_shape_is_covered_closely(tmp_path, kind):
    if kind == "torus":
        mesh = trimesh.creation.torus(0.3, 0.08, major_sections=24, minor_sections=10)
    else:
        outline = np.array([[0, 0], [1, 0], [1, 0.2], [0.4, 0.2], [0.4, 0.6], [0.2, 0.6], [0.2, 1], [0, 1]])
        mesh = extruded(outline, 0.2)
    if kind == "tilted":
        mesh.apply_transform(trimesh.transformations.rotation_matrix(0.5, [1, 2, 3]))
    pieces = pieces_of(tmp_path, mesh)
    assert 1 < len(pieces) <= PIECES
    assert covered(trimesh.sample.sample_surface(mesh, 2000, seed=1)[0], pieces).all()
    hull = ConvexHull(mesh.vertices).volume
    assert sum(ConvexHull(piece).volume for piece in pieces) < 0.85 * hull


def extruded(outline, height):
    """A prism over a polygon whose corners all see its first one."""
    n = len(outline)
    points = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0, height)])
    sides = [(i, (i + 1) % n, (i + 1) % n + n) for i in range(n)] + [(i, (i + 1) % n + n, i + n) for i in range(n)]
    lids = [(0, i + 1, i) for i in range(1, n - 1)] + [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    return trimesh.Trimesh(points, sides + lids, process=False)


def test_parts_that_touch_nothing_are_hulls_of_their_own(tmp_path):
    pieces = pieces_of(tmp_path, trimesh.util.concatenate(angle_iron()))
    assert len(pieces) == 2
    assert sum(ConvexHull(piece).volume for piece in pieces) == pytest.approx(0.02)
    housing = trimesh.util.concatenate([trimesh.creation.box([1, 1, 1]), trimesh.creation.box([0.1, 0.1, 0.1])])
    assert len(pieces_of(tmp_path, housing)) == 1, "what is inside another part can touch nothing"


def test_what_drake_reads_is_one_hull_as_it_is_to_drake(tmp_path):
    (piece,) = pieces_of(tmp_path, trimesh.util.concatenate(angle_iron()), "part.obj")
    assert ConvexHull(piece).volume == pytest.approx(0.06225)


VTK = """# vtk DataFile Version 3.0
one tetrahedron
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 double
0 0 0
1 0 0
0 2 0
0 0 3
CELLS 1 5
4 0 1 2 3
CELL_TYPES 1
10
"""


def test_files_that_drake_reads_are_what_they_are_to_drake(tmp_path):
    box = trimesh.creation.box([1, 2, 3])
    box.apply_translation([0, 0, 5])
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box)).items():
        (tmp_path / name).write_bytes(content)
    box.export(tmp_path / "model.obj")
    (tmp_path / "model.vtk").write_text(VTK)
    for path in (tmp_path / f"model.{kind}" for kind in ("gltf", "obj", "vtk")):
        hull = Convex(filename=str(path)).GetConvexHull()
        points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
        (piece,) = convex_pieces(path, ONE, "x")
        np.testing.assert_allclose(np.sort(piece.round(9), axis=0), np.sort(points.round(9), axis=0), atol=1e-6)
    box.export(tmp_path / "model.glb")
    np.testing.assert_allclose(convex_pieces(tmp_path / "model.glb", ONE, "x")[0].mean(0), [0, -5, 0], atol=1e-6)


def test_convex_meshes_stay_as_they_are(tmp_path):
    for mesh in (trimesh.creation.icosphere(2, 0.1), trimesh.creation.capsule(0.3, 0.1), trimesh.creation.box(ONE)):
        (piece,) = pieces_of(tmp_path, mesh)
        assert ConvexHull(piece).volume == pytest.approx(mesh.volume, rel=1e-5)


def test_a_flat_mesh_is_a_little_thick(tmp_path):
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 1]], [[0, 1, 2], [0, 2, 3]], process=False)
    (piece,) = pieces_of(tmp_path, flat)
    assert 0 < ConvexHull(piece).volume < 1e-3
    assert covered(np.asarray(flat.vertices), [piece]).all()


def test_scale_may_mirror(tmp_path):
    (piece,) = pieces_of(tmp_path, trimesh.creation.box([1, 2, 3]), scale=np.array([0.1, -0.1, 0.1]))
    np.testing.assert_allclose(np.ptp(piece, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stl", b"", "cannot be read|has no faces"),
        ("a.stl", bytes(range(256)) * 3, "cannot be read|has no faces"),
        ("a.ply", b"ply\nnonsense", "cannot be read"),
        ("a.dae", b"<COLLADA>", "cannot be read"),
        ("a.dae", b"<COLLADA/>", "has no faces"),
        ("a.obj", b"v 0 0 0\n", "has no faces|cannot be read"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices that are not finite"),
        ("a.blend", b"?", "cannot be read"),
    ],
)
def test_meshes_that_cannot_be_used(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        convex_pieces(tmp_path / name, ONE, "link 'a': collision")
    assert str(caught.value).startswith("link 'a': collision: mesh")
    assert "\n" not in str(caught.value)


def test_where_a_mesh_may_lie(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    (tmp_path / "with space.stl").touch()
    urdf = tmp_path / "arm.urdf"
    assert find_mesh((tmp_path / "with space.stl").as_uri(), urdf, "x").samefile(tmp_path / "with space.stl")
    assert find_mesh(str(tmp_path / "with space.stl"), urdf, "x").samefile(tmp_path / "with space.stl")
    assert find_mesh("package://sum_drake/robots/fetch/base_dark.obj", urdf, "x").is_file()
    for uri in ("http://example.org/a.stl", "package://", "gone.stl", "file:///gone.stl", "package://gone/a.stl"):
        with pytest.raises(InputError, match=r"^x: mesh '.*expected"):
            find_mesh(uri, urdf, "x")
