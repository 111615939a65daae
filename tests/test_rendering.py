import threading
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from sum_drake.geometry import inverse, rotation_angle, rotation_from_quaternion, transform
from sum_drake.rendering import (
    Atlas,
    DepthRenderer,
    coarse,
    fibonacci_sphere,
    predicted_box,
    see_surface,
    view_rotations,
)
from sum_drake.types import Array, Camera, Frame

CAMERA = Camera(width=320, height=240, fx=270.0, fy=260.0, cx=150.3, cy=121.8)
HALF = np.array([0.03, 0.05, 0.08])


def mug() -> trimesh.Trimesh:
    wall = trimesh.creation.annulus(0.036, 0.040, 0.095)
    base = trimesh.creation.cylinder(0.04, 0.006)
    base.apply_translation([0, 0, -0.0445])
    handle = trimesh.creation.torus(0.025, 0.006, major_sections=24, minor_sections=10)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([0.05, 0, 0])
    return trimesh.util.concatenate([wall, base, handle])


MESHES = {"box": trimesh.creation.box(2 * HALF), "mug": mug()}
CATALOGUE = {label: SimpleNamespace(load_mesh=lambda mesh=mesh: mesh) for label, mesh in MESHES.items()}


def pose(seed: int, *, near: float = 0.4, far: float = 2.0, spread: float = 0.4) -> Array:
    """An object in front of the camera, anywhere in the picture."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(near, far)
    p = np.array([*rng.uniform(-spread, spread, 2) * z, z])
    return transform(rotation_from_quaternion(rng.normal(size=4)), p)


def box_depth(X_CO: Array, camera: Camera) -> Array:
    """Depth of the box by intersecting every pixel's ray with its slabs."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1)
    X_OC = inverse(X_CO)
    d = rays @ X_OC[:3, :3].T
    d = np.where(np.abs(d) < 1e-12, 1e-12, d)
    a, b = (-HALF - X_OC[:3, 3]) / d, (HALF - X_OC[:3, 3]) / d
    enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
    return np.where(enter <= leave, enter, 0.0)


@pytest.fixture(scope="module")
def renderer() -> DepthRenderer:
    return DepthRenderer(CATALOGUE)


@pytest.mark.parametrize("seed", range(6))
def test_depth_is_exact_at_integer_pixel_centres(renderer: DepthRenderer, seed: int) -> None:
    X_CO = pose(seed)
    depth, expected = renderer.depth("box", X_CO, CAMERA), box_depth(X_CO, CAMERA)
    both = (depth > 0) & (expected > 0)
    assert both.sum() > 50
    assert ((depth > 0) != (expected > 0)).sum() <= 3  # a ray may graze an edge
    assert np.abs(depth - expected)[both].max() < 5e-5


def test_crop_beside_the_principal_point_shows_the_same(renderer: DepthRenderer) -> None:
    X_CO = transform(np.eye(3), np.array([0.3, 0.2, 0.9]))
    whole = renderer.depth("box", X_CO, CAMERA)
    crop = Camera(100, 80, CAMERA.fx, CAMERA.fy, CAMERA.cx - 200, CAMERA.cy - 150)
    np.testing.assert_allclose(renderer.depth("box", X_CO, crop), whole[150:230, 200:300], atol=2e-6)
    assert (whole[150:230, 200:300] > 0).sum() > 100


def test_object_behind_the_camera_is_not_seen(renderer: DepthRenderer) -> None:
    assert not renderer.depth("box", transform(np.eye(3), np.array([0, 0, -1.0])), CAMERA).any()


def test_other_thread_raises(renderer: DepthRenderer) -> None:
    renderer.depth("box", pose(0), CAMERA)
    errors: list[Exception] = []

    def call() -> None:
        try:
            renderer.depth("box", pose(0), CAMERA)
        except RuntimeError as error:
            errors.append(error)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    assert "thread" in str(errors[0])


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_view_rotations_bring_z_onto_the_ray(seed: int) -> None:
    d = np.random.default_rng(seed).normal(size=(8, 3))
    R = view_rotations(d)
    np.testing.assert_allclose(R[..., 2], d / np.linalg.norm(d, axis=-1, keepdims=True), atol=1e-9)
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (8, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-9)


def test_view_rotation_straight_back_is_a_rotation() -> None:
    R = view_rotations(np.array([[0, 0, -1.0]]))[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3))
    np.testing.assert_allclose(R[:, 2], [0, 0, -1])


def test_fibonacci_sphere_leaves_no_gap() -> None:
    directions = fibonacci_sphere(1000)
    probes = np.random.default_rng(0).normal(size=(500, 3))
    probes /= np.linalg.norm(probes, axis=1, keepdims=True)
    assert np.rad2deg(np.arccos((probes @ directions.T).max(1))).max() < 4.5


def test_coarse_keeps_shape_within_limit() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    vertices, faces = coarse(sphere.vertices, sphere.faces, 400)
    assert 350 < len(faces) <= 400
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.1).max() < 0.005
    small = coarse(MESHES["box"].vertices, MESHES["box"].faces, 400)
    assert len(small[1]) == 12


def test_coarse_copes_with_triangles_that_share_no_vertex_and_with_many_loose_parts() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    soup = coarse(sphere.vertices[sphere.faces].reshape(-1, 3), np.arange(3 * len(sphere.faces)).reshape(-1, 3), 400)
    assert 300 < len(soup[1]) <= 400
    assert np.abs(np.linalg.norm(soup[0][np.unique(soup[1])], axis=1) - 0.1).max() < 0.005
    rng = np.random.default_rng(0)
    crumbs = [trimesh.creation.icosahedron() for _ in range(100)]
    for crumb in crumbs:
        crumb.apply_transform(trimesh.transformations.scale_and_translate(0.004, rng.uniform(-0.05, 0.05, 3)))
    many = trimesh.util.concatenate(crumbs)
    vertices, faces = coarse(many.vertices, many.faces, 300)
    assert 30 < len(faces) <= 300
    np.testing.assert_allclose(vertices[faces].reshape(-1, 3).min(0), many.bounds[0], atol=0.012)


def match_of(points_C: Array, areas: Array, observed: Array, camera: Camera, epsilon: float) -> float:
    """Pixels of an observation that points at their projections explain to within epsilon."""
    u = np.rint(camera.fx * points_C[:, 0] / points_C[:, 2] + camera.cx).astype(int)
    v = np.rint(camera.fy * points_C[:, 1] / points_C[:, 2] + camera.cy).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    z = observed[v[inside], u[inside]]
    near = (z > 0) & (np.abs(z - points_C[inside, 2]) < epsilon)
    pixels = areas[inside] * camera.fx * camera.fy / points_C[inside, 2] ** 2
    return float(pixels[near].sum())


@pytest.mark.parametrize(("near", "far", "spread"), [(0.5, 0.6, 0.05), (1.4, 1.6, 0.05), (0.8, 1.0, 0.4)])
def test_atlas_and_surface_agree_with_exact_renders(
    renderer: DepthRenderer, near: float, far: float, spread: float
) -> None:
    """Near, far and in the corner: the score of a wrong pose by tiles, by looks, and by a render of its own."""
    mesh = MESHES["mug"]
    atlas = Atlas(mesh.vertices, mesh.faces, columns=6)
    surface = see_surface(mesh.vertices, mesh.faces, views=500)
    truths = np.stack([pose(i, near=near, far=far, spread=spread) for i in range(4)])
    rng = np.random.default_rng(1)
    scores = []
    for X_CO in truths:
        observed = renderer.depth("mug", X_CO, CAMERA)
        n = (observed > 0).sum()
        for scale in np.linspace(0, 1, 12):
            w = rng.normal(size=3) * 0.5 * scale
            guess = X_CO @ transform(
                rotation_from_quaternion(np.array([1, *w / 2])), rng.normal(size=3) * 0.015 * scale
            )
            alone = renderer.depth("mug", guess, CAMERA)
            exact = ((np.abs(alone - observed) < 0.01) & (alone > 0) & (observed > 0)).sum() / n
            p_CM = guess[:3, :3] @ atlas.p_OM + guess[:3, 3]
            R_CV = view_rotations(p_CM[None])[0]
            points, seen = atlas.points((R_CV.T @ guess[:3, :3])[None])
            p_C = points[0][seen[0]] @ R_CV.T + p_CM
            tiles = match_of(p_C, np.full(len(p_C), atlas.pixel**2), observed, CAMERA, 0.01) / n
            view = int((surface.directions @ (guess[:3, :3].T @ p_CM)).argmax())
            p_C = surface.points[view] @ guess[:3, :3].T + p_CM
            looks = match_of(p_C, np.full(len(p_C), surface.areas[view]), observed, CAMERA, 0.01) / n
            scores.append((exact, tiles, looks))
    exact, tiles, looks = np.array(scores).T
    assert np.corrcoef(exact, tiles)[0, 1] > 0.97
    assert np.corrcoef(exact, looks)[0, 1] > 0.95
    assert np.abs(exact - tiles).mean() < 0.06
    assert np.abs(exact - looks).mean() < 0.08


@pytest.fixture(scope="module")
def mug_atlas() -> Atlas:
    return Atlas(MESHES["mug"].vertices, MESHES["mug"].faces, columns=3, limit=1500)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(0.5, 0.6, 0.1), (1.4, 2.0, 0.05), (0.7, 1.0, 0.42)]))
def test_tiles_show_what_a_render_of_its_own_shows(
    renderer: DepthRenderer, mug_atlas: Atlas, seed: int, place: tuple[float, float, float]
) -> None:
    """Near, far and in the corner, at any orientation: as many pixels, at the same depths."""
    near, far, spread = place
    X_CO = pose(seed, near=near, far=far, spread=spread)
    picture = Camera(960, 720, 540.0, 520.0, 450.0, 380.0)  # that no object is cut by
    alone = renderer.depth("mug", X_CO, picture)
    p_CM = X_CO[:3, :3] @ mug_atlas.p_OM + X_CO[:3, 3]
    R_CV = view_rotations(p_CM[None])[0]
    points, seen = mug_atlas.points((R_CV.T @ X_CO[:3, :3])[None])
    p_C = points[0][seen[0]] @ R_CV.T + p_CM
    area = np.full(len(p_C), mug_atlas.pixel**2)
    pixels = float((area * picture.fx * picture.fy / p_C[:, 2] ** 2).sum())
    assert match_of(p_C, area, alone, picture, 0.008) > 0.83 * pixels
    assert pixels == pytest.approx(np.count_nonzero(alone), rel=0.2)


def test_atlas_renders_more_poses_than_it_has_copies() -> None:
    mesh = MESHES["box"]
    atlas = Atlas(mesh.vertices, mesh.faces, columns=2)
    R_VOs = rotation_from_quaternion(np.random.default_rng(0).normal(size=(11, 4)))
    points, seen = atlas.points(R_VOs)
    one, seen_one = atlas.points(R_VOs[9:10])
    assert points.shape == (*seen.shape, 3)
    assert seen.any(axis=1).all()
    assert seen.all(axis=0)[:100].all()  # those that show something come first
    # Another tile, another copy: only rounding at the silhouette may differ.
    assert abs(seen[9].sum() - seen_one[0].sum()) <= 8
    distance, _ = cKDTree(points[9][seen[9]]).query(one[0][seen_one[0]])
    assert np.median(distance) < 1e-3
    assert distance.max() < 2 * atlas.pixel


def test_a_tile_keeps_what_is_seen_and_nothing_else() -> None:
    mesh = MESHES["box"]
    atlas = Atlas(mesh.vertices, mesh.faces, columns=2)
    R_VOs = rotation_from_quaternion(np.random.default_rng(0).normal(size=(3, 4)))
    points, seen = atlas.points(R_VOs)
    assert points.shape[1] == seen.sum(axis=1).max() < atlas.tile**2
    assert not points[~seen].any()
    on_the_box = np.abs(np.abs((points @ R_VOs)[seen] + atlas.p_OM) - HALF).min(axis=-1)
    assert on_the_box.max() < 1e-4
    none, nothing = atlas.points(np.zeros((0, 3, 3)))
    assert none.shape == (0, 1, 3)
    assert nothing.shape == (0, 1)


def test_surface_of_a_ruler_that_falls_between_pixels_when_seen_along_its_side() -> None:
    mesh = trimesh.creation.box([0.3, 0.025, 0.002])
    surface = see_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert (surface.areas == 0).any()
    assert (np.abs(surface.points) <= [0.151, 0.0126, 0.0011]).all()


def test_surface_shows_points_of_the_mesh_that_face_the_camera() -> None:
    mesh = MESHES["box"]
    surface = see_surface(mesh.vertices, mesh.faces, views=100)
    on_a_face = np.abs(np.abs(surface.points) - HALF).min(-1)
    assert on_a_face.max() < 1e-6
    facing = -(surface.normals * surface.directions[:, None]).sum(-1)
    assert (facing > 0).mean() > 0.999
    # Silhouette of a box: its faces' areas, each times the cosine to the line of sight.
    sides = 4 * HALF[[1, 2, 0]] * HALF[[2, 0, 1]]
    np.testing.assert_allclose(surface.areas * surface.points.shape[1], np.abs(surface.directions) @ sides, rtol=0.06)


def frame_at(X_WC: Array) -> Frame:
    shape = (CAMERA.height, CAMERA.width)
    return Frame(0, np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.float32), CAMERA, X_WC)


@settings(max_examples=30)
@example(1793640)  # cut by the picture's lower border
@given(st.integers(0, 2**32 - 1))
def test_predicted_box_holds_the_render(seed: int) -> None:
    X_WC, X_CO = pose(seed + 1), pose(seed)
    x, y, w, h = predicted_box(MESHES["box"].vertices, X_WC @ X_CO, frame_at(X_WC))
    v, u = np.nonzero(box_depth(X_CO, CAMERA))
    if not len(u):
        return
    assert x <= u.min() and u.max() + 1 <= x + w
    assert y <= v.min() and v.max() + 1 <= y + h
    if x > 0 and y > 0 and x + w < CAMERA.width and y + h < CAMERA.height:
        # It is tight where nothing is cut off. A ray may miss the tip of a corner that the projection still reaches.
        assert u.min() <= x + 3 and x + w <= u.max() + 4
        assert v.min() <= y + 3 and y + h <= v.max() + 4


def test_predicted_box_of_what_is_out_of_sight_is_empty() -> None:
    X_WC = np.eye(4)
    for p in ([0, 0, -1.0], [5.0, 0, 1.0], [0, 0, 0.02]):
        assert predicted_box(MESHES["box"].vertices, transform(np.eye(3), np.array(p)), frame_at(X_WC)) == (0, 0, 0, 0)


def test_rotation_angle_of_views_is_smallest() -> None:
    d = np.array([[0.6, 0.0, 0.8]])
    assert rotation_angle(view_rotations(d))[0] == pytest.approx(np.arccos(0.8))
