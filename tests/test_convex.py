"""Distances of convex bodies against quadratic programmes and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from sum_drake.convex import CYLINDER, HULL, Bodies, distance
from sum_drake.geometry import rotation_from_quaternion, transform

SEEDS = st.integers(0, 2**32 - 1)


def pose(rng, spread):
    return transform(rotation_from_quaternion(rng.normal(size=4)), rng.uniform(-spread, spread, 3))


def hull_distance(p_Ws, p_Wt):
    """Of two hulls, by a quadratic programme over barycentric weights."""
    n, m = len(p_Ws), len(p_Wt)

    def squared(w):
        off = w[:n] @ p_Ws - w[n:] @ p_Wt
        return off @ off, np.concatenate([2 * p_Ws @ off, -2 * p_Wt @ off])

    sums = [{"type": "eq", "fun": lambda w: w[:n].sum() - 1}, {"type": "eq", "fun": lambda w: w[n:].sum() - 1}]
    even = np.concatenate([np.full(n, 1 / n), np.full(m, 1 / m)])
    found = minimize(squared, even, jac=True, bounds=[(0, 1)] * (n + m), constraints=sums, method="SLSQP",
                     options={"ftol": 1e-14, "maxiter": 500})  # fmt: skip
    return float(np.sqrt(max(found.fun, 0.0)))


@settings(max_examples=60)
@given(seed=SEEDS)
def test_hulls_are_as_far_apart_as_a_quadratic_programme_says(seed):
    rng = np.random.default_rng(seed)
    sets = [rng.normal(size=(int(rng.integers(4, 9)), 3)) * rng.uniform(0.05, 0.3, 3) for _ in range(2)]
    bodies = Bodies.make([HULL, HULL], sets, [0.0, 0.0])
    X_W0, X_W1 = pose(rng, 0.4), pose(rng, 0.4)
    p_W = [points @ X[:3, :3].T + X[:3, 3] for points, X in zip(sets, (X_W0, X_W1), strict=True)]
    expected = hull_distance(*p_W)
    found = distance(bodies, 0, X_W0, 1, X_W1)
    assert found == pytest.approx(max(expected, 0), abs=1e-3 * expected + 2e-5)
    assert distance(bodies, 1, X_W1, 0, X_W0) == pytest.approx(found, abs=1e-3 * expected + 2e-5)


@settings(max_examples=60)
@given(seed=SEEDS)
def test_spheres_are_points_that_are_swollen(seed):
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.01, 0.3, 2)
    bodies = Bodies.make([HULL, HULL], [np.zeros((1, 3))] * 2, list(radii))
    X_W0, X_W1 = pose(rng, 0.5), pose(rng, 0.5)
    apart = float(np.linalg.norm(X_W0[:3, 3] - X_W1[:3, 3]) - radii.sum())
    found = distance(bodies, 0, X_W0, 1, X_W1)
    assert found == pytest.approx(apart, rel=2e-3, abs=1e-3) if apart > 1e-6 else found <= 1e-6


@settings(max_examples=60)
@given(seed=SEEDS)
def test_a_cylinder_lies_between_the_prisms_within_and_about_it(seed):
    rng = np.random.default_rng(seed)
    r, h = rng.uniform(0.02, 0.3, 2)
    corners = 64
    angles = 2 * np.pi * np.arange(corners) / corners
    inner = np.array([(r * np.cos(a), r * np.sin(a), z) for a in angles for z in (-h, h)])
    outer = inner / [np.cos(np.pi / corners), np.cos(np.pi / corners), 1.0]
    box = rng.uniform(-0.2, 0.2, (8, 3))
    bodies = Bodies.make([CYLINDER, HULL, HULL, HULL], [np.array([[r, 0, h]]), inner, outer, box], [0.0] * 4)
    X_WC, X_WB = pose(rng, 0.5), pose(rng, 0.5)
    exact, within, about = (distance(bodies, i, X_WC, 3, X_WB) for i in range(3))
    assert about * (1 - 2e-3) - 1e-6 <= exact <= within * (1 + 2e-3) + 1e-6


@settings(max_examples=100)
@given(seed=SEEDS, touch=st.floats(0, 0.3))
def test_what_is_asked_for_is_answered_on_the_safe_side(seed, touch):
    rng = np.random.default_rng(seed)
    sets = [rng.normal(size=(6, 3)) * 0.2 for _ in range(2)]
    bodies = Bodies.make([HULL, HULL], sets, [0.0, 0.01])
    X_W0, X_W1 = pose(rng, 0.6), pose(rng, 0.6)
    apart, found = distance(bodies, 0, X_W0, 1, X_W1), distance(bodies, 0, X_W0, 1, X_W1, touch)
    if apart < touch:
        assert found <= touch
    elif apart > touch * 1.01 + 1e-6:
        assert touch < found <= apart * 1.002 + 1e-6


@settings(max_examples=40)
@given(seed=SEEDS, flat=st.integers(1, 3))
def test_points_in_a_plane_or_on_a_line_are_bodies_too(seed, flat):
    rng = np.random.default_rng(seed)
    thin = rng.normal(size=(7, 3)) * 0.2
    thin[:, flat:] = 0.0
    other = rng.normal(size=(5, 3)) * 0.1
    bodies = Bodies.make([HULL, HULL], [thin, other], [0.0, 0.0])
    X_W0, X_W1 = pose(rng, 0.5), pose(rng, 0.5)
    expected = hull_distance(thin @ X_W0[:3, :3].T + X_W0[:3, 3], other @ X_W1[:3, :3].T + X_W1[:3, 3])
    assert distance(bodies, 0, X_W0, 1, X_W1) == pytest.approx(expected, abs=1e-3 * expected + 2e-5)
