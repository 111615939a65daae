import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator

from sum_drake.detection import arrangement
from sum_drake.detection.arrangement import TABLE, Body, Ground, pour, toss
from sum_drake.geometry import apply
from sum_drake.types import Array

GROUND = Ground(np.array([0.7, 0.0]), np.array([0.3, 0.45]), np.array([0.65, 0.1]), np.array([0.15, 0.2]))
CARTON = Body(0.4, (np.asarray(trimesh.creation.box([0.06, 0.09, 0.18]).vertices),))
CAN = Body(0.3, (np.asarray(trimesh.creation.cylinder(0.035, 0.1).vertices),))
HAMMER = Body(
    0.5,
    (
        np.asarray(trimesh.creation.box([0.03, 0.03, 0.2]).vertices),
        np.asarray(trimesh.creation.box([0.1, 0.04, 0.04]).vertices) + np.array([0, 0, 0.1]),
    ),
)
KINDS = (CARTON, CAN, HAMMER)


def lowest(body: Body, X_WO: Array) -> float:
    """Height over the table of the lowest point that is above the table's top, not beside it."""
    points = apply(X_WO, body.points)
    over = (np.abs(points[:, :2] - GROUND.center) < GROUND.half - 0.005).all(axis=1)
    return float(points[over, 2].min() - TABLE) if over.any() else np.inf


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 8))
def test_what_is_poured_lies_on_the_table_and_not_in_it(seed: int, count: int) -> None:
    bodies = [KINDS[i % 3] for i in range(count)]
    X_WOs = pour(bodies, GROUND, np.random.default_rng(seed))
    assert len(X_WOs) == count
    for body, X_WO in zip(bodies, X_WOs, strict=True):
        if X_WO is None:
            continue
        np.testing.assert_allclose(X_WO[:3, :3] @ X_WO[:3, :3].T, np.eye(3), atol=1e-9)
        assert lowest(body, X_WO) > -0.006
        middle = apply(X_WO, body.points).mean(axis=0)
        assert (np.abs(middle[:2] - GROUND.center) < GROUND.half + 0.1).all() and middle[2] < TABLE + 0.8


def test_a_single_thing_has_come_down() -> None:
    for seed, body in enumerate(KINDS):
        [X_WO] = pour([body], GROUND, np.random.default_rng(seed))
        assert X_WO is not None and abs(lowest(body, X_WO)) < 0.003


def test_what_falls_off_is_left_out() -> None:
    edge = Ground(GROUND.center, GROUND.half, np.array([0.7, 0.47]), np.array([0.2, 0.01]))
    X_WOs = pour([CARTON, CAN, HAMMER, CAN], edge, np.random.default_rng(1))
    assert any(X_WO is None for X_WO in X_WOs)
    for X_WO in X_WOs:
        assert X_WO is None or X_WO[2, 3] > TABLE - 0.2


def test_a_pour_depends_on_its_seed_alone() -> None:
    a, b = (pour([CAN, HAMMER, CARTON], GROUND, np.random.default_rng(3)) for _ in range(2))
    for X, Y in zip(a, b, strict=True):
        np.testing.assert_array_equal(X, Y)


def test_a_pour_that_drake_cannot_step_is_tossed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(Simulator):
        def AdvanceTo(self, time: float) -> None:
            raise RuntimeError("the solver did not converge")

    monkeypatch.setattr(arrangement, "Simulator", Broken)
    X_WOs = pour([CAN, CARTON], GROUND, np.random.default_rng(0))
    assert all(X_WO is not None and lowest(body, X_WO) > -1e-9 for body, X_WO in zip([CAN, CARTON], X_WOs, strict=True))


def test_nothing_poured_is_nothing() -> None:
    assert pour([], GROUND, np.random.default_rng(0)) == [] == toss([], GROUND, np.random.default_rng(0))


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 15))
def test_what_is_tossed_is_over_its_region_and_hardly_touches(seed: int, count: int) -> None:
    bodies = [KINDS[i % 3] for i in range(count)]
    X_WOs = toss(bodies, GROUND, np.random.default_rng(seed))
    placed = []
    for body, X_WO in zip(bodies, X_WOs, strict=True):
        if X_WO is None:
            continue
        points = apply(X_WO, body.points)
        assert -1e-9 < points[:, 2].min() - TABLE < 0.15 + 1e-9
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        assert (np.abs(middle[:2] - GROUND.region_center) <= GROUND.region_half + 1e-9).all()
        placed.append((middle[:2], np.linalg.norm(points[:, :2] - middle[:2], axis=1).max(), points[:, 2]))
    for i, (p, r, z) in enumerate(placed):
        for q, s, y in placed[:i]:
            apart = np.linalg.norm(p - q) >= 0.85 * (r + s) - 1e-9
            assert apart or z.min() >= y.max() - 1e-9 or y.min() >= z.max() - 1e-9


def test_what_finds_no_room_is_left_out() -> None:
    small = Ground(GROUND.center, GROUND.half, np.array([0.7, 0.0]), np.array([0.05, 0.05]))
    X_WOs = toss([CARTON] * 15, small, np.random.default_rng(0))
    assert X_WOs[0] is not None and any(X_WO is None for X_WO in X_WOs)
