"""What a camera sees of many poses of an object."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.appearance import Appearances, RenderedAnew, ViewedFromAllSides, _view_table
from sum_drake.geometry import rotation_from_quaternion
from sum_drake.likelihood import count, log_likelihood, observe, register
from sum_drake.objects import load_catalogue
from sum_drake.particles import Particles
from sum_drake.rendering import fibonacci_sphere, mesh_arrays
from sum_drake.types import Camera, Frame


@pytest.fixture(scope="module")
def mug() -> ViewedFromAllSides:
    return ViewedFromAllSides(*mesh_arrays(load_catalogue(), "mug"))


def some(n: int, seed: int = 0) -> Particles:
    rng = np.random.default_rng(seed)
    R_COs = rotation_from_quaternion(rng.normal(size=(n, 4)))
    p_CMs = np.concatenate([rng.uniform(-0.3, 0.3, (n, 2)), rng.uniform(0.5, 1.5, (n, 1))], 1)
    return Particles(torch.from_numpy(R_COs).float(), torch.from_numpy(p_CMs).float())


@given(st.integers(0, 2**32 - 1))
def test_the_view_that_is_looked_up_is_as_good_as_the_nearest(seed: int) -> None:
    directions = fibonacci_sphere(1000)
    rays = np.random.default_rng(seed).normal(size=(200, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    found = _view_table(1000, "cpu").nearest(torch.from_numpy(rays)).numpy()
    angles = np.degrees(np.arccos(np.clip(rays @ directions.T, -1, 1)))
    assert np.all(angles[np.arange(200), found] <= angles.min(1) + 2.0)


def test_poles_and_the_seam_have_views() -> None:
    rays = torch.tensor([[0, 0, 1.0], [0, 0, -1.0], [-1.0, 0.0, 0], [-1.0, -1e-9, 0]])
    found = _view_table(1000, "cpu").nearest(rays).numpy()
    near = (rays.numpy() * fibonacci_sphere(1000)[found]).sum(1)
    assert np.all(near > np.cos(np.radians(5)))


def test_points_lie_about_the_middle_and_face_the_camera(mug: ViewedFromAllSides) -> None:
    particles = some(40)
    shown = mug.show(particles, normals=True)
    assert shown.normals_C is not None
    assert shown.p_CPs.shape == shown.normals_C.shape == (40, 192, 3)
    off = (shown.p_CPs - particles.p_CMs[:, None]).norm(dim=-1)
    assert float(off.max()) <= mug.radius + 1e-6
    facing = -(shown.normals_C * shown.p_CPs).sum(-1) / shown.p_CPs.norm(dim=-1)
    assert float((facing > -0.1).float().mean()) > 0.99
    assert mug.show(particles).normals_C is None


def test_many_particles_show_fewer_points_that_stand_for_as_much(mug: ViewedFromAllSides) -> None:
    few, many = mug.show(some(100)), mug.show(some(4000))
    assert few.p_CPs.shape[1] > many.p_CPs.shape[1]
    covered = [float((one.areas[:100] * one.p_CPs.shape[1]).sum()) for one in (few, many)]
    assert covered[0] == pytest.approx(covered[1], rel=0.05)


@pytest.mark.parametrize("render", ["views", "each"])
def test_an_object_is_made_ready_once(render: str) -> None:
    appearances = Appearances(load_catalogue(), render)
    assert appearances["sugar"] is appearances["sugar"]
    kind = ViewedFromAllSides if render == "views" else RenderedAnew
    assert isinstance(appearances["sugar"], kind)


@pytest.mark.skipif(
    not torch.cuda.is_available(),
    reason="compares a CUDA device's numbers with the CPU's, so it needs one; that nothing leaves the device of its "
    "points is tested everywhere, in test_likelihood.py",
)
def test_cuda_gives_the_same_numbers_within_tolerance(mug: ViewedFromAllSides) -> None:
    camera = Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
    depth = np.random.default_rng(0).uniform(0.8, 1.0, (240, 320)).astype(np.float32)
    observation = observe(Frame(0, np.zeros((240, 320, 3), np.uint8), depth, camera, np.eye(4)), (90, 60, 120, 110))
    there = ViewedFromAllSides(*mesh_arrays(load_catalogue(), "mug"), device="cuda")
    particles = some(200)
    results = []
    for appearance, device in ((mug, "cpu"), (there, "cuda")):
        seen, shown = observation.to(device), appearance.show(particles, normals=True)
        assert shown.normals_C is not None
        score = log_likelihood(count(seen, shown.p_CPs, shown.areas, 0.05, soft=True), seen)
        moved = register(seen, shown.p_CPs, shown.normals_C, particles.p_CMs.to(device), 0.05)
        results.append([one.cpu().numpy() for one in (score, *moved)])
    for here, on_cuda in zip(*results, strict=True):
        np.testing.assert_allclose(here, on_cuda, rtol=1e-3, atol=1e-3)
