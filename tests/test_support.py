import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.film import look_at
from sum_drake.geometry import inverse, rotation_from_quaternion, transform
from sum_drake.particles import Particles
from sum_drake.support import SUNK, Ground, Plane, sunk, support_plane, table_plane
from sum_drake.types import Camera, Frame, Region, readonly

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
v, u = np.mgrid[:120, :160]
RAYS = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], -1)
BOX = (60.0, 40.0, 40.0, 40.0)
UPRIGHT = np.eye(3)


def table(normal, height, noise=0.001, seed=0):
    """Depth of a plane that lies `height` below the camera."""
    normal = np.array(normal) / np.linalg.norm(normal)
    rng = np.random.default_rng(seed)
    return np.where(RAYS @ normal < -0.05, -height / np.minimum(RAYS @ normal, -0.05), 0) + rng.normal(
        0, noise, u.shape
    )


def frame_of(depth):
    return Frame(0, np.zeros((120, 160, 3), np.uint8), readonly(depth, np.float32), CAMERA, np.eye(4))


def find(depth, box=BOX):
    return support_plane(frame_of(depth), box, np.random.default_rng(1), tolerance=0.006)


@settings(max_examples=25)
@given(st.floats(-0.4, 0.4), st.floats(-0.9, -0.2), st.floats(0.5, 1.2))
def test_a_table_is_found_where_it_is(a, b, height):
    normal = np.array([a, b, -1.0]) / np.linalg.norm([a, b, -1.0])
    depth = table(normal, height)
    depth[45:75, 65:95] *= 0.9  # something stands in the box
    plane = find(depth)
    assert plane is not None
    assert plane.normal_C @ normal > np.cos(np.radians(1.5))
    assert plane.offset == pytest.approx(height, abs=0.01)
    points = RAYS[50, 80] * depth[50, 80]
    assert plane.height(points) > 0.02, "what stands on it is above"


def test_an_objects_own_side_is_no_table():
    depth = np.random.default_rng(0).uniform(0.8, 2.0, u.shape)  # clutter all around
    depth[40:80, 60:100] = 0.7
    assert find(depth) is None


def test_nothing_around_is_no_table():
    assert find(np.zeros(u.shape)) is None
    assert find(table([0, -0.5, -1], 0.8), (900.0, 900.0, 10.0, 10.0)) is None
    assert find(table([0, -0.5, -1], 0.8), (0.0, 0.0, 0.0, 0.0)) is None


def cluttered(height):
    """A table of which a strip shows, a level shelf and a slanted board all around the box. (depth, the table)."""
    normal = np.array([0.0, -0.6, -0.8])
    depth = table(normal, height)
    depth[:, :78] = table(normal, height - 0.2)[:, :78]
    depth[:, 90:] = table([-0.5, -0.5, -0.7], height - 0.15)[:, 90:]
    return depth, Plane(readonly(normal), height)


def test_among_clutter_a_table_is_where_it_is_known_to_be():
    depth, true = cluttered(0.8)
    found = find(depth)
    assert (
        found is None
        or abs(found.height(RAYS[50, 70] * depth[50, 70]) - true.height(RAYS[50, 70] * depth[50, 70])) > 0.1
    )
    told = support_plane(frame_of(depth), BOX, np.random.default_rng(1), tolerance=0.006, known=true)
    assert told is true, "hidden: it is taken to be where it is known"
    bare = table(true.normal_C, 0.8)
    off = Plane(true.normal_C, 0.79)
    seen = support_plane(frame_of(bare), BOX, np.random.default_rng(1), tolerance=0.006, known=off)
    assert seen is not None and seen.offset == pytest.approx(0.8, abs=0.003), "seen: it is where it is seen"
    nothing = support_plane(frame_of(np.zeros(u.shape)), BOX, np.random.default_rng(1), tolerance=0.006, known=true)
    assert nothing is true


def test_a_known_table_is_told_only_of_what_is_over_it():
    top = Region("table", readonly([0.0, 0.0, 1.0]), readonly([0.3, 0.3, 0.2]))
    X_WC = look_at(np.array([0.0, -0.5, 1.6]), np.array([0.0, 0.0, 0.8]))
    n_C, offset = X_WC[2, :3], X_WC[2, 3] - 0.8
    depth = -offset / np.minimum(RAYS @ n_C, -0.05)
    frame = Frame(0, np.zeros((120, 160, 3), np.uint8), readonly(depth, np.float32), CAMERA, readonly(X_WC))
    plane = table_plane(frame, BOX, top)
    assert plane is not None
    assert np.abs(plane.height(RAYS[40:80, 60:100] * depth[40:80, 60:100, None])).max() < 1e-6
    assert plane.height(np.zeros(3)) == pytest.approx(0.8)
    assert table_plane(frame, (0.0, 0.0, 20.0, 20.0), top) is None, "beyond the table's edge"
    assert table_plane(frame_of(np.zeros(u.shape)), BOX, top) is None


def test_what_hangs_over_the_tables_edge_is_not_sunk_into_it():
    top = Region("table", readonly([0.0, 0.0, 1.0]), readonly([0.5, 0.5, 0.2]))
    corners = 0.05 * np.stack(np.meshgrid(*3 * [[-1.0, 1.0]]), -1).reshape(-1, 3)

    def at(x: float, z: float, R_WO: np.ndarray = UPRIGHT) -> float:
        return sunk(corners, transform(R_WO, np.array([x, 0.0, z])), top)

    assert at(0.0, 0.82) == pytest.approx(0.03)
    assert at(0.0, 0.92) == pytest.approx(-0.07)
    tilted = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])  # its lowest corners have the largest x
    assert at(0.5, 0.85, tilted) < at(0.3, 0.85, tilted)
    assert at(2.0, 0.0) == 0.0


TOP = Region("table", readonly([0.0, 0.0, 1.0]), readonly([0.5, 0.5, 0.2]))
POSITIONS = st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(0.7, 1.0))


@settings(max_examples=50)
@given(st.lists(st.tuples(POSITIONS, st.tuples(*4 * [st.floats(-1, 1)])), min_size=1, max_size=5))
def test_a_pose_is_the_less_likely_the_deeper_it_is_sunk_into_a_known_table(drawn):
    X_WC = look_at(np.array([0.1, -0.5, 1.6]), np.array([0.0, 0.0, 0.8]))
    ground = Ground(Plane(readonly(X_WC[2, :3]), float(X_WC[2, 3] - 0.8)), X_WC, TOP)
    corners = np.array([0.05, 0.03, 0.08]) * np.stack(np.meshgrid(*3 * [[-1.0, 1.0]]), -1).reshape(-1, 3)
    R_WOs = rotation_from_quaternion(np.array([q for _, q in drawn]) + 1e-3)
    X_WOs = transform(R_WOs, np.array([p for p, _ in drawn]))
    X_COs = inverse(X_WC) @ X_WOs
    particles = Particles(*(torch.from_numpy(X_COs[:, :3, i]).float() for i in (slice(0, 3), 3)))
    told = ground.log_prior(particles, torch.from_numpy(corners).float()).numpy()
    depths = np.array([sunk(corners, X_WO, TOP) for X_WO in X_WOs])
    assert (told[depths < SUNK] > -1e-4).all()
    assert (told <= 0).all() and (told[depths > 0.02] < -1).all()
    order = np.argsort(depths)
    assert (np.diff(told[order]) <= 1e-3).all()
