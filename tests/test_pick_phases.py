"""What the phases of a pick make of a scene."""

import numpy as np
import pytest
from arm_poses import ARM, pointing_down

from sum_drake.geometry import apply, inverse, shifted, transform
from sum_drake.motion import cartesian_path
from sum_drake.objects import load_catalogue
from sum_drake.pick_phases import comes_clear, unexplained
from sum_drake.planning_scene import PlanningScene, Solid, solid_of

CUBE = 0.04 * (np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T - 0.5)


@pytest.fixture(scope="module")
def furniture():
    return PlanningScene()


def lifted(furniture, *solids):
    """The scene of a hand that holds a cube which stands on the table at (.6, -.1), and its way up."""
    X_WG = pointing_down([0.6, -0.1, 0.76])
    q = ARM.solutions(X_WG)[0]
    scene = furniture.with_solids(solids).padded(furniture=0.01, solids=0.005).with_gap(0.06)
    held = scene.holding([CUBE], inverse(X_WG) @ transform(np.eye(3), np.array([0.6, -0.1, 0.721])))
    return held, cartesian_path(ARM, X_WG, shifted(X_WG, np.array([0.0, 0.0, 0.2])), q)[0]


def cube(x, z, size=1.0):
    return Solid("cube", (size * CUBE,), transform(np.eye(3), np.array([x, -0.1, z])))


def test_what_stands_on_the_table_comes_clear_of_it(furniture):
    assert comes_clear(*lifted(furniture))


def test_what_touches_beside_may_go_along_and_what_lies_on_top_may_not(furniture):
    assert comes_clear(*lifted(furniture, cube(0.6 + 0.0402, 0.721)))
    for x in (0.6, 0.63):
        assert not comes_clear(*lifted(furniture, cube(x, 0.721 + 0.0402)))
    assert not comes_clear(*lifted(furniture, cube(0.6, 0.85))), "not through what is above the hand either"
    assert comes_clear(*lifted(furniture, cube(0.63, 0.721 + 0.0402)), drags=True)


def test_a_way_that_is_blocked_after_it_came_clear_is_not_clear(furniture):
    held, path = lifted(furniture, cube(0.6, 1.28))
    assert not comes_clear(held, path)
    assert comes_clear(held, path[: len(path) // 3])


def test_points_of_believed_objects_are_no_obstacles_of_their_own():
    model, X_WO = load_catalogue()["soup_can"], transform(np.eye(3), np.array([0.6, 0.05, 0.75]))
    surface = apply(X_WO, np.asarray(model.load_mesh().vertices))
    stray = surface[:5] + np.array([0.0, 0.3, 0.0])
    left = unexplained(np.concatenate([surface, stray]), [solid_of(model, X_WO)], 0.012)
    np.testing.assert_array_equal(left, stray)
