import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.depth_tolerance import PERFECT
from sum_drake.geometry import rotation_from_vector
from sum_drake.likelihood import (
    SIDE_ERROR,
    WEIGHTS,
    Counts,
    Observation,
    confidence,
    count,
    count_picture,
    log_likelihood,
    observe,
    paper_likelihood,
    register,
    thinned,
)
from sum_drake.rendering import view_rotations
from sum_drake.support import Plane
from sum_drake.types import Camera, Frame, readonly

CAMERA = Camera(width=80, height=60, fx=100.0, fy=100.0, cx=39.5, cy=29.5)


def frame_of(depth: np.ndarray) -> Frame:
    return Frame(0, np.zeros((*depth.shape, 3), np.uint8), depth.astype(np.float32), CAMERA, np.eye(4))


def plane(z: float = 1.0) -> np.ndarray:
    return np.full((60, 80), z)


def points_of(depth: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """A point a pixel of a rendered depth image, with the area that one pixel stands for."""
    v, u = np.mgrid[:60, :80]
    p = np.stack([(u - CAMERA.cx) / CAMERA.fx * depth, (v - CAMERA.cy) / CAMERA.fy * depth, depth], -1)
    areas = (depth**2 / (CAMERA.fx * CAMERA.fy)).reshape(1, -1)
    return torch.tensor(p.reshape(1, -1, 3), dtype=torch.float32), torch.tensor(areas, dtype=torch.float32)


WHOLE = (0.0, 0.0, 80.0, 60.0)


def test_a_perfect_render_explains_everything() -> None:
    observation = observe(frame_of(plane()), WHOLE)
    counts = count(observation, *points_of(plane()), 0.008)
    assert observation.n == 4800
    assert float(counts.inliers[0]) == pytest.approx(4800)
    for score in (paper_likelihood, confidence):
        assert float(score(counts, observation.n)[0]) == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(counts.sides, [[0, 0, 80, 60]])
    assert float(log_likelihood(counts, observation)[0]) == pytest.approx(WEIGHTS[0] + WEIGHTS[1], abs=1e-3)


def test_epsilon_is_the_euclidean_distance_of_both_points() -> None:
    """At a pixel off the axis a depth difference is a longer way along the ray (eq. 9)."""
    observation = observe(frame_of(plane()), WHOLE)
    points, areas = points_of(plane(1.0 + 0.0075))
    length = torch.sqrt((points**2).sum(-1))[0] / 1.0075
    expected = ((0.0075 * length) < 0.008).sum()
    counts = count(observation, points, areas, 0.008)
    assert 0 < int(expected) < 4800
    assert float(counts.inliers[0]) == pytest.approx(float(expected), rel=0.002)


def test_in_front_is_a_violation_and_behind_is_hidden() -> None:
    observation = observe(frame_of(plane()), WHOLE)
    before = count(observation, *points_of(plane(0.9)), 0.008)
    behind = count(observation, *points_of(plane(1.1)), 0.008)
    assert float(before.free_space[0]) == pytest.approx(4800, rel=1e-4) and float(before.occluded[0]) == 0
    assert float(behind.occluded[0]) == pytest.approx(4800, rel=1e-4) and float(behind.free_space[0]) == 0
    low, hidden = log_likelihood(before, observation), log_likelihood(behind, observation)
    assert float(low[0]) < float(hidden[0]) < 0, "nor does what hides explain the box"


def test_inliers_count_in_the_box_only_and_n_is_the_observed_points_in_it() -> None:
    depth = plane()
    depth[:10] = 0
    observation = observe(frame_of(depth), (10.0, 5.0, 20.0, 10.0))
    counts = count(observation, *points_of(plane()), 0.008)
    assert observation.n == 100
    assert float(counts.inliers[0]) == pytest.approx(100)


def test_missing_depth_says_nothing() -> None:
    depth = plane()
    depth[:, 40:] = 0
    observation = observe(frame_of(depth), WHOLE)
    counts = count(observation, *points_of(plane(0.5)), 0.008)
    # What is seen ends where depth does, and so do rendered points and violations.
    assert float(counts.rendered[0]) == pytest.approx(2400, rel=1e-4)
    assert float(counts.free_space[0]) == pytest.approx(2400, rel=0.03)


def test_violations_at_depth_edges_do_not_count() -> None:
    depth = plane()
    depth[:, 40:] = 1.5
    observation = observe(frame_of(depth), WHOLE)
    assert np.flatnonzero(observation.at_edge.numpy().any(0)).tolist() == [39, 40]
    counts = count(observation, *points_of(plane()), 0.008)
    assert float(counts.free_space[0]) == pytest.approx(60 * 39, rel=1e-4)


def test_soft_inliers_prefer_the_nearer() -> None:
    observation = observe(frame_of(plane()), WHOLE)
    scores = [
        float(log_likelihood(count(observation, *points_of(plane(z)), 0.008, soft=True), observation)[0])
        for z in (1.0, 1.002, 1.004)
    ]
    assert scores[0] > scores[1] > scores[2]


@pytest.mark.parametrize("box", [(0, 0, 0, 0), (500, 500, 10, 10), (-50, -50, 10, 10), (10.2, 10.2, 0.5, 0.5)], ids=str)
def test_boxes_without_a_pixel_observe_nothing(box: tuple[float, float, float, float]) -> None:
    observation = observe(frame_of(plane()), box)
    assert observation.n == 0
    counts = count(observation, *points_of(plane()), 0.008)
    for score in (paper_likelihood, confidence):
        assert float(score(counts, observation.n)[0]) == 0
    assert np.isfinite(float(log_likelihood(counts, observation)[0]))


def test_depth_that_is_not_finite_is_missing() -> None:
    depth = plane()
    depth[0, 0], depth[1, 1], depth[2, 2] = np.nan, np.inf, -1.0
    observation = observe(frame_of(depth), WHOLE)
    assert observation.n == 4797
    assert torch.isfinite(observation.depth).all()


@settings(max_examples=50)
@given(
    st.tuples(*[st.floats(-200, 200) for _ in range(2)], *[st.floats(0, 300) for _ in range(2)]),
    st.integers(0, 2**32 - 1),
)
def test_scores_are_finite_and_in_range(box: tuple[float, float, float, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random((60, 80)) < 0.2, 0, rng.uniform(0.5, 2, (60, 80)))
    observation = observe(frame_of(depth), box)
    points = torch.tensor(rng.normal(size=(5, 40, 3)), dtype=torch.float32)
    areas = torch.full((5, 1), 1e-5)
    counts = count(observation, points, areas, 0.01)
    parts = counts.inliers + counts.free_space + counts.occluded
    assert bool((parts <= counts.rendered * 1.0001 + 1e-3).all())
    value = confidence(counts, observation.n)
    assert bool(torch.isfinite(value).all()) and bool((value >= 0).all()) and bool((value <= 1).all())
    assert bool(torch.isfinite(log_likelihood(counts, observation)).all())


def test_hidden_points_weigh_less_than_missing_ones() -> None:
    found = torch.tensor([100.0, 100.0])
    sides = torch.tensor([0.0, 0.0, 10.0, 10.0]).expand(2, 4)
    counts = Counts(found, found, torch.zeros(2), torch.tensor([0.0, 100.0]), torch.tensor([100.0, 200.0]), sides)
    value = confidence(counts, 100)
    assert 1.0 == float(value[0]) > float(value[1]) > (1 / 2) ** 0.5


def seen_part(left: int, right: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Points of the columns from left to right of a plane at 1 m."""
    points, areas = points_of(plane())
    shown = torch.zeros(60, 80, dtype=torch.bool)
    shown[:, left:right] = True
    return points[:, shown.view(-1)], areas[:, shown.view(-1)]


def test_the_sides_of_the_box_are_where_the_object_is_seen_to_end() -> None:
    """Equally well explained boxes differ by how far the explanation reaches."""
    observation = observe(frame_of(plane()), (20.0, 0.0, 40.0, 60.0))

    def score(left: int, right: int) -> float:
        return float(log_likelihood(count(observation, *seen_part(left, right), 0.008), observation)[0])

    assert score(20, 60) > score(24, 60) > score(30, 60)
    assert score(20, 60) > score(20, 68), "what is seen outside the box would have been in it"
    off = int(SIDE_ERROR * 40) + 1
    within = count(observation, *seen_part(20, 60 + off - 2), 0.008)
    beyond = count(observation, *seen_part(20, 60 + 2 * off), 0.008)
    assert float(within.free_space[0]) == 0
    assert float(beyond.free_space[0]) > 0


def test_the_plane_below_is_nothing_to_be_explained_and_nothing_reaches_under_it() -> None:
    below = Plane(readonly([0.0, 0.0, -1.0]), 1.0)
    depth = plane()
    depth[20:40, 30:50] = 0.95  # a block on a table that is seen from above
    observation = observe(frame_of(depth), (25.0, 15.0, 30.0, 30.0), plane=below)
    assert observation.n == 400
    block = np.where(depth < 1, depth, 0)
    points, areas = points_of(block)
    on_it = count(observation, points[:, block.reshape(-1) > 0], areas[:, block.reshape(-1) > 0], 0.008)
    table = count(observation, *points_of(plane()), 0.008)
    assert float(log_likelihood(on_it, observation)[0]) > float(log_likelihood(table, observation)[0]) + 3
    under = count(observation, *points_of(plane(1.05)), 0.008)
    assert float(under.free_space[0]) == pytest.approx(4800, rel=1e-3)
    flat = observe(frame_of(plane()), (25.0, 15.0, 30.0, 30.0), plane=below)
    assert flat.n == 900, "where all there is lies in the plane, that is the object"


def test_where_the_background_has_spread_over_the_left_side_free_space_proves_nothing() -> None:
    """Stereo matching gives the first columns of what stands out the depth of what is behind."""
    block, seen = plane(), plane()
    block[20:40, 30:50] = 0.8
    seen[20:40, 33:50] = 0.8
    points, areas = points_of(np.where(block < 1, block, 0))
    told, not_told = (
        observe(frame_of(seen), (30.0, 20.0, 20.0, 20.0), tolerance=dataclasses.replace(PERFECT, bleed=bleed))
        for bleed in (3, 0)
    )
    assert float(count(told, points, areas, 0.008).free_space[0]) == 0
    assert float(count(not_told, points, areas, 0.008).free_space[0]) > 30
    right = plane()
    right[20:40, 30:47] = 0.8
    behind = observe(frame_of(right), (30.0, 20.0, 20.0, 20.0), tolerance=dataclasses.replace(PERFECT, bleed=3))
    assert float(count(behind, points, areas, 0.008).free_space[0]) > 30, "only on the left"


def test_scores_and_registration_stay_on_the_device_of_the_points() -> None:
    """On torch's meta device, which computes shapes alone and refuses to mix with the CPU, as a GPU does."""
    block = plane()
    block[20:40, 30:50] = 0.95
    below = Plane(readonly([0.0, 0.0, -1.0]), 1.0)
    observation = observe(frame_of(block), (25.0, 15.0, 30.0, 30.0), plane=below).to("meta")
    points, areas = torch.empty(5, 40, 3, device="meta"), torch.empty(5, 1, device="meta")
    counts = count(observation, points, areas, 0.007, soft=True)
    assert log_likelihood(counts, observation).device.type == "meta"
    assert confidence(counts, observation.n).device.type == "meta"
    for moved in register(observation, points, points, torch.empty(5, 3, device="meta"), 0.02):
        assert moved.device.type == "meta" and moved.shape == (5, 3)


def test_of_what_explains_as_many_points_the_closer_is_likelier() -> None:
    """A nearly square box turned by a quarter is a millimetre or two off everywhere: inliers all the same."""
    observation = observe(frame_of(plane()), WHOLE)
    exact, near = (count(observation, *points_of(plane(1.0 + off)), 0.007) for off in (0.0, 0.002))
    assert float(near.inliers[0]) == pytest.approx(float(exact.inliers[0]), rel=0.01)
    assert float(log_likelihood(exact, observation)[0]) > float(log_likelihood(near, observation)[0]) + 1


def test_thinned_observations_weigh_poses_alike() -> None:
    observation = observe(frame_of(plane()), (20.0, 0.0, 40.0, 60.0))
    few = thinned(observation, pixels=1000)
    assert few.depth.numel() <= 1300
    for columns in ((20, 60), (30, 60), (20, 45)):
        whole, part = (log_likelihood(count(one, *seen_part(*columns), 0.008), one) for one in (observation, few))
        assert float(part[0]) == pytest.approx(float(whole[0]), abs=0.8)
    v, u = np.mgrid[: few.camera.height, : few.camera.width]
    x, y = (u - few.camera.cx) / few.camera.fx, (v - few.camera.cy) / few.camera.fy
    columns, rows = x * CAMERA.fx + CAMERA.cx, y * CAMERA.fy + CAMERA.cy
    np.testing.assert_allclose(columns, np.round(columns), atol=1e-9, err_msg="its pixels are pixels of the frame")
    np.testing.assert_allclose(rows, np.round(rows), atol=1e-9)
    nothing = observe(frame_of(plane()), (0.0, 0.0, 0.0, 0.0))
    assert thinned(nothing).n == 0


def test_depth_on_a_grid_of_its_own_is_not_thinned_away() -> None:
    """As of a coarse depth camera, warped into a fine colour camera's picture."""
    depth = plane()
    depth[1::2] = depth[:, 1::2] = 0
    observation = observe(frame_of(np.roll(depth, (1, 1), (0, 1))), WHOLE)
    assert thinned(observation, pixels=depth.size // 4).n == observation.n


R_CO = view_rotations(np.array([[1.0, 1.0, 1.0]]))[0].T
"""A box turned to show the camera a corner."""


def corner() -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of the three faces that are seen, relative to the middle, in C."""
    rng = np.random.default_rng(0)
    points, normals = [], []
    for axis in range(3):
        p = rng.uniform(-0.1, 0.1, (300, 3))
        p[:, axis] = -0.1
        points.append(p)
        normals.append(np.tile(-np.eye(3)[axis], (300, 1)))
    return np.concatenate(points) @ R_CO.T, np.concatenate(normals) @ R_CO.T


def observed_corner() -> Observation:
    """The box at 1 m before a wall, by intersecting rays with its slabs."""
    camera = Camera(240, 180, 400.0, 400.0, 119.5, 89.5)
    v, u = np.mgrid[:180, :240]
    d = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1) @ R_CO
    o = -np.array([0, 0, 1.0]) @ R_CO
    a, b = (-0.1 - o) / d, (0.1 - o) / d
    enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
    depth = np.where(enter <= leave, enter, 1.3).astype(np.float32)
    return observe(Frame(0, np.zeros((180, 240, 3), np.uint8), depth, camera, np.eye(4)), (0, 0, 240, 180))


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_registration_brings_a_pose_home(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, normals = (torch.tensor(x, dtype=torch.float32) for x in corner())
    w = rng.normal(size=3)
    R = torch.tensor(rotation_from_vector(0.12 * w / np.linalg.norm(w)), dtype=torch.float32)
    shift = rng.normal(size=3)
    p_CM = torch.tensor([[0, 0, 1.0]]) + torch.tensor(0.012 * shift / np.linalg.norm(shift), dtype=torch.float32)
    observation = observed_corner()
    for _ in range(12):
        facing = (normals @ R.T)[:, 2] < -0.1
        p = (points[facing] @ R.T)[None] + p_CM
        turn, move = register(observation, p, (normals[facing] @ R.T)[None], p_CM, 0.04)
        R = torch.tensor(rotation_from_vector(turn.double().numpy()[0]), dtype=torch.float32) @ R
        p_CM = p_CM + move
    assert float((p_CM - torch.tensor([0, 0, 1.0])).norm()) < 0.004
    assert np.arccos(np.clip((np.trace(R.numpy()) - 1) / 2, -1, 1)) < 0.04


def test_registration_without_an_observation_stays() -> None:
    observation = observe(frame_of(np.zeros((60, 80))), WHOLE)
    points, normals = (torch.tensor(x, dtype=torch.float32)[None] for x in corner())
    p_CM = torch.tensor([[0, 0, 1.0]])
    turn, move = register(observation, points + p_CM, normals, p_CM, 0.04)
    assert float(turn.norm()) == float(move.norm()) == 0


def test_a_thin_thing_on_its_edge_is_told_from_the_table_and_one_that_lies_in_it_is_not() -> None:
    """As a ruler across its box, which is 5 % of what is in there."""
    depth = plane()
    v, u = np.mgrid[:60, :80]
    depth[np.abs(v - 0.75 * u) < 2] = 0.98
    table = Plane(np.array([0.0, 0.0, -1.0]), 1.0)
    assert observe(frame_of(depth), WHOLE, plane=table).n == np.count_nonzero(depth < 1)
    assert observe(frame_of(np.where(depth < 1, 0.998, 1.0)), WHOLE, plane=table).n == depth.size


def test_a_pose_that_shows_nothing_explains_nothing() -> None:
    observation = observe(frame_of(plane()), WHOLE)
    counts = count_picture(observation, np.zeros((60, 80), np.float32), 0.008)
    assert float(counts.rendered[0]) == float(counts.inliers[0]) == float(counts.free_space[0]) == 0
    assert np.isfinite(float(log_likelihood(counts, observation)[0]))
