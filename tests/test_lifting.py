"""What an object that is lifted takes along."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import TABLE, standing

from sum_drake.geometry import apply, rotation_from_vector, transform
from sum_drake.lifting import BESIDE, LEANS, TOUCHES, Dragged, dragged, falls, overlap, stays
from sum_drake.objects import load_catalogue
from sum_drake.resting import outside
from sum_drake.types import Array, Region, readonly

CATALOGUE = load_catalogue()
SUGAR, CAN = CATALOGUE["sugar"], CATALOGUE["soup_can"]  # .038 x .089 x .175, and .066 wide
X_WS = standing(CATALOGUE, "sugar", 0.6, 0.0)
ON_TABLE = Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25]))
TOUCHING = 0.089 / 2 + 0.066 / 2


def can(y: float, z: float = 0.0) -> Array:
    X_WO = standing(CATALOGUE, "soup_can", 0.6, y)
    X_WO[2, 3] += z
    return X_WO


def over(X_WO: Array) -> float:
    """How far the can at X_WO reaches over the sugar."""
    return overlap(SUGAR, X_WS, apply(X_WO, outside(CAN)))


def test_what_stands_beside_is_as_far_as_it_is() -> None:
    for gap in (0.005, 0.012, 0.02):
        assert over(can(TOUCHING + gap)) == pytest.approx(-gap, abs=0.006)
    assert over(can(TOUCHING + 2 * BESIDE)) < -BESIDE
    assert over(can(TOUCHING - 0.015)) == pytest.approx(0.015, abs=0.006)
    assert overlap(SUGAR, X_WS, np.empty((0, 3))) == -np.inf


def test_what_lies_on_it_comes_along_and_what_it_lies_on_does_not() -> None:
    on_top = can(0.0, z=SUGAR.dimensions[2])
    assert stays(SUGAR, X_WS, CAN, on_top) == LEANS
    assert stays(CAN, on_top, SUGAR, X_WS) == 1.0


def test_what_leans_on_it_is_likelier_to_move_than_what_stands_beside_it() -> None:
    """A mustard bottle, tilted towards the sugar until it touches."""
    bottle = CATALOGUE["mustard"]
    upright = standing(CATALOGUE, "mustard", 0.6, 0.095)
    assert stays(SUGAR, X_WS, bottle, upright) == pytest.approx(TOUCHES, abs=0.05)
    R = rotation_from_vector(np.array([np.radians(20), 0, 0])) @ upright[:3, :3]
    p = outside(bottle) @ R.T
    leaning = transform(R, np.array([0.6, 0.0, TABLE - p[:, 2].min()]))
    leaning[1, 3] = 0.0445 - p[p[:, 2] < p[:, 2].min() + 0.17, 1].min() + 0.002
    assert stays(SUGAR, X_WS, bottle, leaning) == LEANS
    assert stays(bottle, leaning, SUGAR, X_WS) > LEANS, "the sugar stands by itself"


@settings(max_examples=15)
@given(st.floats(0.0, 0.15), st.floats(0.0, 0.05), st.floats(-np.pi, np.pi))
def test_a_neighbour_that_is_farther_off_is_no_likelier_to_move(y: float, more: float, yaw: float) -> None:
    turn = transform(rotation_from_vector(np.array([0.0, 0.0, yaw])), np.zeros(3))
    near, far = (stays(SUGAR, turn @ X_WS, CAN, turn @ can(each)) for each in (y, y + more + 0.006))
    assert LEANS <= near <= 1.0
    assert far >= near - 0.11, "but for the cells of the grid"


def test_neighbours_are_told_worst_first() -> None:
    beside, on_top = can(TOUCHING + 0.002), standing(CATALOGUE, "tea", 0.6, 0.0)
    on_top[2, 3] += SUGAR.dimensions[2]
    away = standing(CATALOGUE, "mug", 0.6, -0.3)
    found = dragged(SUGAR, X_WS, [(CAN, beside), (CATALOGUE["mug"], away), (CATALOGUE["tea"], on_top)], ON_TABLE)
    assert [one.label for one in found] == ["tea", "soup_can"]
    assert dragged(SUGAR, X_WS, [], ON_TABLE) == ()


def test_the_nearer_to_an_edge_and_the_longer_the_likelier_it_falls_off() -> None:
    middle = transform(np.eye(3), np.array([0.72, 0.0, 0.75]))
    assert falls(CAN, middle, ON_TABLE) == falls(SUGAR, middle, ON_TABLE) == 0.0
    near = transform(np.eye(3), np.array([0.72, 0.45 - 0.05, 0.75]))
    assert 0.0 < falls(CAN, near, ON_TABLE) < falls(SUGAR, near, ON_TABLE) < 1.0
    beyond = transform(np.eye(3), np.array([0.40, 0.0, 0.75]))
    assert falls(CAN, beyond, ON_TABLE) == 1.0
    assert Dragged("tea", stays=0.3, falls=0.5).kept == pytest.approx(0.65)
    assert Dragged("tea", stays=0.3).kept == Dragged("tea", stays=1.0, falls=1.0).kept == 1.0
