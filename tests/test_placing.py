"""Free places on the table."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import TABLE, standing
from scipy.spatial import cKDTree

from sum_drake.geometry import apply, rotation_from_vector, transform
from sum_drake.objects import load_catalogue
from sum_drake.placing import PlacingConfig, free_places, is_area
from sum_drake.resting import outside, stands
from sum_drake.types import Array, Region, readonly

CATALOGUE = load_catalogue()
MUG = CATALOGUE["mug"]
X_WO = standing(CATALOGUE, "mug", 0.6, 0.0)
CONFIG = PlacingConfig()
TOP = Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25]))
AREA = Region("left", readonly([0.6, 0.25, 0.8]), readonly([0.15, 0.15, 0.1]))
BIN = Region("bin", readonly([0.12, -0.62, 0.47]), readonly([0.20, 0.20, 0.18]))
NOTHING = np.empty((0, 3))


def places(X: Array = X_WO, taken_W: Array = NOTHING, region: Region = TOP, **more: object) -> tuple[Array, ...]:
    given = {"config": CONFIG, **more}
    return free_places(MUG, X, region=region, table=TOP, taken_W=taken_W, **given)


def gap_between(X: Array, taken_W: Array) -> float:
    """Seen from above, metres."""
    return float(cKDTree(taken_W[:, :2]).query(apply(X, outside(MUG))[::5, :2])[0].min())


def test_areas_are_regions_within_the_tables_top() -> None:
    assert is_area(AREA, TOP) and is_area(TOP, TOP)
    assert not is_area(BIN, TOP)
    assert not is_area(dataclasses.replace(AREA, p_W=readonly([0.6, 0.4, 0.8])), TOP), "sticks out"
    assert not is_area(dataclasses.replace(AREA, p_W=readonly([0.6, 0.25, 1.0])), TOP), "a shelf above it"


@settings(max_examples=8)
@given(st.lists(st.tuples(st.floats(0.45, 0.95), st.floats(-0.4, 0.4)), max_size=4))
def test_places_are_free_inside_and_a_little_above_where_it_rests(spots: list[tuple[float, float]]) -> None:
    others = [apply(standing(CATALOGUE, "sugar", x, y), outside(CATALOGUE["sugar"])) for x, y in spots]
    taken_W = np.concatenate([NOTHING, *others])
    for region in (TOP, AREA):
        for X in places(taken_W=taken_W, region=region)[::8]:
            p_W = apply(X, outside(MUG))
            assert (np.abs(p_W[:, :2] - region.p_W[:2]) < region.half_extents[:2]).all()
            assert p_W[:, 2].min() == pytest.approx(TABLE + CONFIG.gap, abs=2e-3)
            assert not len(taken_W) or gap_between(X, taken_W) > CONFIG.margin - 0.02
            assert stands(MUG, X)


def test_roomy_places_come_first_and_near_ones_of_those() -> None:
    wall_W = np.stack([np.full(200, 0.6), np.linspace(-0.45, 0.45, 200), np.full(200, TABLE + 0.1)], 1)
    rooms = [gap_between(X, wall_W) for X in places(taken_W=wall_W)]
    assert rooms[0] > CONFIG.roomy - 0.02
    free = places()
    assert np.linalg.norm(free[0][:2, 3] - X_WO[:2, 3]) < 0.05
    assert len(free) == CONFIG.places


def test_a_full_region_has_no_place() -> None:
    x, y = np.meshgrid(np.arange(0.42, 1.02, 0.05), np.arange(-0.45, 0.45, 0.05))
    assert places(taken_W=np.stack([x, y, np.full_like(x, TABLE + 0.05)], -1).reshape(-1, 3)) == ()
    assert places(region=dataclasses.replace(AREA, half_extents=readonly([0.03, 0.03, 0.1]))) == ()


def test_what_makes_way_goes_aside_and_neither_back_nor_into_other_areas() -> None:
    wanted_W = apply(standing(CATALOGUE, "sugar", 0.6, 0.1), outside(CATALOGUE["sugar"]))
    been_W = [np.array([0.6, -0.1, 0.75]), X_WO[:3, 3]]
    found = places(aside_of_W=wanted_W, been_W=been_W, avoid=[AREA])
    assert found
    for X in found:
        assert gap_between(X, wanted_W) > CONFIG.aside - 0.02
        assert min(np.linalg.norm(X[:2, 3] - p_W[:2]) for p_W in been_W) > CONFIG.aside
        assert (np.abs(apply(X, outside(MUG))[:, :2] - AREA.p_W[:2]) > AREA.half_extents[:2] - 0.01).any(1).all()


def test_only_places_within_reach_count() -> None:
    assert all(X[0, 3] < 0.6 for X in places(within_reach=lambda X: bool(X[0, 3] < 0.6)))
    assert places(within_reach=lambda X: False) == ()


def test_it_lies_as_it_lay_but_for_a_turn_and_a_leaning_one_is_laid_down() -> None:
    down = X_WO[:3, :3].T @ [0.0, 0.0, 1.0]
    assert all(np.allclose(X[:3, :3].T @ [0.0, 0.0, 1.0], down) for X in places())
    leaning = transform(rotation_from_vector(np.array([0.0, 0.6, 0.0])) @ X_WO[:3, :3], X_WO[:3, 3])
    assert not stands(MUG, leaning)
    assert all(stands(MUG, X) for X in places(leaning))


def test_an_estimate_that_is_too_high_is_let_go_as_much_higher() -> None:
    """In truth it stands on the table, and the hand holds it as much lower than believed."""
    high = X_WO.copy()
    high[2, 3] += 0.01
    assert places(high)[0][2, 3] == pytest.approx(places()[0][2, 3] + 0.01, abs=1e-3)
    low = X_WO.copy()
    low[2, 3] -= 0.01
    assert places(low)[0][2, 3] == pytest.approx(places()[0][2, 3], abs=1e-3), "never into the table"


def test_what_stood_on_something_else_is_let_go_just_above_the_table() -> None:
    high = X_WO.copy()
    high[2, 3] += 0.1
    assert places(high)[0][2, 3] == pytest.approx(places()[0][2, 3], abs=1e-9)
