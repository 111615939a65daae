import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

from sum_drake.detection import distractors
from sum_drake.detection.distractors import SHIFT, TRAIN, Surface, box, drake_mesh, draw_distractor, make_distractor
from sum_drake.rendering import view_rotations

FAMILIES = (*TRAIN, *SHIFT)


def welded(shape: Surface) -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    mesh.merge_vertices(digits_vertex=7)
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_shapes_are_closed_and_of_the_size_of_household_things(family: str, seed: int) -> None:
    shape = make_distractor(family, np.random.default_rng(seed))
    mesh = welded(shape)
    assert mesh.is_watertight and mesh.volume > 0
    assert 0.03 < mesh.extents.max() < 0.27 and mesh.extents.min() > 0.008
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), 0, atol=1e-9)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1))
def test_normals_are_unit_and_point_outwards(family: str, seed: int) -> None:
    shape = make_distractor(family, np.random.default_rng(seed))
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1, atol=1e-9)
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    winding = np.cross(b - a, c - a)
    winding /= np.linalg.norm(winding, axis=1, keepdims=True)
    shading = shape.normals[shape.faces].mean(axis=1)
    assert np.mean(np.einsum("fi,fi->f", winding, shading) > 0.3) > 0.98
    assert shape.uvs.min() >= 0 and shape.uvs.max() <= 1


def test_a_shape_depends_on_its_seed_alone() -> None:
    for family in FAMILIES:
        a, b, other = (make_distractor(family, np.random.default_rng(seed)) for seed in (5, 5, 6))
        np.testing.assert_array_equal(a.vertices, b.vertices)
        assert a.vertices.shape != other.vertices.shape or not np.allclose(a.vertices, other.vertices)


def test_held_out_families_are_never_drawn_for_training_nor_the_others_for_shift(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(rng: np.random.Generator) -> list[np.ndarray]:
        raise AssertionError("a family of the other set was drawn")

    assert not set(TRAIN) & set(SHIFT)
    with monkeypatch.context() as patch:
        patch.setattr(distractors, "SHIFT", dict.fromkeys(SHIFT, refuse))
        for seed in range(40):
            draw_distractor(np.random.default_rng(seed))
    monkeypatch.setattr(distractors, "TRAIN", dict.fromkeys(TRAIN, refuse))
    for seed in range(40):
        draw_distractor(np.random.default_rng(seed), shift=True)


def test_a_box_has_the_sides_it_was_asked_for() -> None:
    mesh = welded(box(0.1, 0.2, 0.3))
    np.testing.assert_allclose(mesh.extents, [0.1, 0.2, 0.3])
    assert mesh.volume == pytest.approx(0.006)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(KeyError, match="teapot"):
        make_distractor("teapot", np.random.default_rng(0))


def test_a_side_shows_the_whole_texture_and_does_not_mirror_it() -> None:
    texture = np.zeros((64, 64, 3), np.uint8)
    texture[:32, :32], texture[:32, 32:], texture[32:, 32:] = [255, 0, 0], [0, 255, 0], [0, 0, 255]  # clockwise
    graph = SceneGraph()
    light = LightParameter(type="point", frame="camera", position=[0, 0, 0], intensity=1.0)
    graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams(lights=[light])))
    geometry = GeometryInstance(RigidTransform(), drake_mesh(box(0.2, 0.2, 0.2), texture), "box")
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    geometry.set_perception_properties(properties)
    graph.RegisterAnchoredGeometry(graph.RegisterSource("test"), geometry)
    query = graph.get_query_output_port().Eval(graph.CreateDefaultContext())
    core = RenderCameraCore(
        "vtk", CameraInfo(80, 80, 100.0, 100.0, 40.0, 40.0), ClippingRange(0.05, 5), RigidTransform()
    )
    camera = ColorRenderCamera(core, False)
    for side in ([1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0], [0, 0, 1.0], [0, 0, -1.0]):
        X_WC = np.eye(4)
        X_WC[:3, :3] = view_rotations(-np.array([side]))[0]
        X_WC[:3, 3] = 0.5 * np.array(side)
        image = query.RenderColorImage(camera, SceneGraph.world_frame_id(), RigidTransform(X_WC)).data[..., :3]
        quadrants = [image[v, u].astype(int) for v, u in ((28, 28), (28, 52), (52, 52), (52, 28))]
        seen = ["rgb"[q.argmax()] if q.max() > 60 else "black" for q in quadrants]
        start = seen.index("r")
        assert seen[start:] + seen[:start] == ["r", "g", "b", "black"], side
