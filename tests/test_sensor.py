import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import (
    Box,
    ClippingRange,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from sum_drake.assets import InputError
from sum_drake.sensor import (
    DepthNoiseConfig,
    HeadCameraConfig,
    add_depth_noise,
    back_project,
    make_camera,
    make_camera_info,
)
from sum_drake.types import Camera

SMALL = HeadCameraConfig(width=64, height=48, focal_length=55.0)
CAMERA = make_camera(HeadCameraConfig())


def render_plane(config: HeadCameraConfig, X_CP: RigidTransform) -> np.ndarray:
    """RenderEngineVtk's depth of the plane z = 0 of frame P."""
    scene_graph = SceneGraph()
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    source = scene_graph.RegisterSource("test")
    X_CB = X_CP @ RigidTransform([0, 0, -0.05])
    slab = GeometryInstance(X_CB, Box(20, 20, 0.1), "slab")
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    slab.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(source, slab)
    context = scene_graph.CreateDefaultContext()
    core = RenderCameraCore("vtk", make_camera_info(config), ClippingRange(0.05, 10.0), RigidTransform())
    camera = DepthRenderCamera(core, DepthRange(config.depth_min, config.depth_max))
    query = scene_graph.get_query_output_port().Eval(context)
    return query.RenderDepthImage(camera, scene_graph.world_frame_id(), RigidTransform()).data[..., 0]


def distance_to_plane(depth: np.ndarray, camera: Camera, X_CP: RigidTransform) -> np.ndarray:
    points = back_project(depth, camera)[depth > 0]
    return np.abs(X_CP.inverse().multiply(points.T)[2])


def test_back_projection_meets_the_renderers_pixel_centres():
    X_CP = RigidTransform(RollPitchYaw(np.pi + 0.6, -0.5, 0), [0, 0, 0.9])
    depth = render_plane(SMALL, X_CP)
    depth = np.where(np.isfinite(depth), depth, 0.0)
    assert (depth > 0).mean() > 0.9
    camera = make_camera(SMALL)
    assert distance_to_plane(depth, camera, X_CP).max() < 1e-4
    # Reading the centres half a pixel beside costs millimetres: the test above can fail.
    shifted = Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5)
    assert np.median(distance_to_plane(depth, shifted, X_CP)) > 2e-3


@given(st.floats(0.3, 3.0), st.integers(0, 639), st.integers(0, 479))
@settings(max_examples=25)
def test_back_projection_inverts_projection(z, u, v):
    depth = np.zeros((480, 640), np.float32)
    depth[v, u] = z
    p = back_project(depth, CAMERA)[v, u]
    assert p[2] == pytest.approx(z)
    assert CAMERA.fx * p[0] / p[2] + CAMERA.cx == pytest.approx(u, abs=1e-6)
    assert CAMERA.fy * p[1] / p[2] + CAMERA.cy == pytest.approx(v, abs=1e-6)


def flat(z: float) -> np.ndarray:
    return np.full((480, 640), z, np.float32)


def tilted(angle: float, z: float = 1.0) -> np.ndarray:
    """Depth of a plane whose normal is `angle` radians from the optical axis, about the picture's y axis."""
    u = (np.arange(640) - CAMERA.cx) / CAMERA.fx
    depth = z * np.cos(angle) / (np.cos(angle) - np.sin(angle) * u)
    return np.broadcast_to(np.where(depth > 0, depth, 0), (480, 640)).astype(np.float32)


def test_switched_off_it_only_clears_what_is_no_depth():
    depth = flat(1.0)
    depth[0, :3] = [np.inf, np.nan, 0]
    noisy = add_depth_noise(depth, CAMERA, np.random.default_rng(0), DepthNoiseConfig(enabled=False))
    assert noisy.dtype == np.float32
    np.testing.assert_array_equal(noisy[0, :3], 0)
    np.testing.assert_array_equal(noisy[1:], depth[1:])


def test_it_is_a_function_of_the_generator():
    first, second, other = (
        add_depth_noise(flat(1.0), CAMERA, np.random.default_rng(seed), DepthNoiseConfig()) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, second)
    assert (first != other).mean() > 0.5


def test_the_given_picture_is_left_alone():
    depth = flat(1.0)
    add_depth_noise(depth, CAMERA, np.random.default_rng(0), DepthNoiseConfig())
    np.testing.assert_array_equal(depth, flat(1.0))


@pytest.mark.parametrize("z", [0.5, 1.0, 2.0, 3.0])
def test_axial_noise_grows_with_distance_and_has_no_bias(z):
    config = DepthNoiseConfig(disparity_step=0.0)
    noisy = add_depth_noise(flat(z), CAMERA, np.random.default_rng(0), config)
    seen = noisy[noisy > 0]
    assert seen.std() == pytest.approx(0.0012 + 0.0019 * (z - 0.4) ** 2, rel=0.03)
    assert seen.mean() == pytest.approx(z, abs=1e-4)
    assert seen.size > 0.98 * noisy.size


def test_depth_comes_in_steps_of_disparity():
    noisy = add_depth_noise(flat(2.0), CAMERA, np.random.default_rng(0), DepthNoiseConfig())
    steps = np.unique(noisy[noisy > 0])
    assert np.diff(steps).min() == pytest.approx(0.125 * 2.0**2 / (525 * 0.075), rel=0.05)
    assert noisy[noisy > 0].mean() == pytest.approx(2.0, abs=2e-3)


def test_what_stands_out_shades_a_band_on_its_left():
    depth = flat(1.2)
    depth[:, 300:400] = 0.9
    noisy = add_depth_noise(depth, CAMERA, np.random.default_rng(0), DepthNoiseConfig(edge_dropout=0.0, lateral=0.0))
    missing = (noisy == 0).mean(0) > 0.5
    width = 525 * 0.075 * (1 / 0.9 - 1 / 1.2)
    assert missing[299] and not missing[300:640].any()
    assert missing.sum() == pytest.approx(width, abs=1.5)


def test_returns_go_missing_beside_edges():
    depth = flat(1.2)
    depth[:, 300:400] = 0.9
    noisy = add_depth_noise(depth, CAMERA, np.random.default_rng(0), DepthNoiseConfig(shadows=False))
    rate = (noisy == 0).mean(0)
    assert rate[[299, 300, 399, 400]].mean() == pytest.approx(DepthNoiseConfig().edge_dropout, abs=0.05)
    assert rate[310:390].mean() < 0.01


def test_grazing_surfaces_return_nothing():
    config = DepthNoiseConfig(shadows=False)

    def missing(angle: float) -> float:
        depth = tilted(angle)
        noisy = add_depth_noise(depth, CAMERA, np.random.default_rng(0), config)
        middle = np.s_[:, 316:324]
        return float((noisy[middle][depth[middle] > 0] == 0).mean())

    assert missing(np.radians(45)) < 0.02
    assert 0.2 < missing(np.radians(78)) < 0.8
    assert missing(np.radians(86)) > 0.95


def test_a_tilted_plane_stays_where_it_is():
    depth = tilted(np.radians(40))
    depth[(depth < 0.35) | (depth > 3)] = 0
    noisy = add_depth_noise(depth, CAMERA, np.random.default_rng(0), DepthNoiseConfig())
    R = RotationMatrix.MakeYRotation(np.radians(-40)).matrix()
    points = back_project(noisy, CAMERA)[noisy > 0]
    off = (points - [0, 0, 1.0]) @ R[:, 2]
    assert abs(np.median(off)) < 1e-3


@given(st.integers(0, 2**31), st.sampled_from([(0.0, 0.0), (0.5, 0.5), (2.9, 0.2)]))
@settings(max_examples=10)
def test_any_picture_gives_finite_depth(seed, spread):
    rng = np.random.default_rng(seed)
    camera = make_camera(SMALL)
    depth = (spread[0] + spread[1] * rng.normal(size=(48, 64))).astype(np.float32)
    noisy = add_depth_noise(np.maximum(depth, 0), camera, rng, DepthNoiseConfig())
    assert np.isfinite(noisy).all() and (noisy >= 0).all()


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: HeadCameraConfig(width=3), "width"),
        (lambda: HeadCameraConfig(focal_length=0), "focal_length"),
        (lambda: HeadCameraConfig(depth_min=2, depth_max=1), "depth_min"),
        (lambda: DepthNoiseConfig(dropout=1.5), "dropout"),
        (lambda: DepthNoiseConfig(lateral=-1), "lateral"),
        (lambda: DepthNoiseConfig(grazing_start=1.5, grazing_end=1.2), "grazing"),
    ],
)
def test_settings_that_make_no_sense_are_refused(make, word):
    with pytest.raises(InputError, match=word):
        make()
