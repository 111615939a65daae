"""How an object is let go, beside what whole picks and places show of it."""

import dataclasses

import numpy as np
import pytest
from test_picking import BIN, CATALOGUE, assert_lands_in, assert_sound, from_above, plan, standing

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.grasp_ranking import CAUSES, RankedGrasps
from sum_drake.planning_scene import PlanningScene
from sum_drake.types import Grasp


@pytest.fixture(scope="module")
def scene():
    return PlanningScene()


def lying_pot():
    """A watering pot that lies on the table, and a grasp across its body, with a finger through its handle."""
    X_WO, X_OG = (
        transform(rotation_from_vector(np.array(w)), np.array(p))
        for w, p in (
            ([-1.2502, 1.2518, 1.3789], [0.5705, 0.08, 0.7452]),
            ([0.033, 0.0073, 0.4051], [-0.0227, -0.0443, -0.0139]),
        )
    )
    grasp = Grasp("waterpot", X_OG, 0.0774, 1.0)
    none = tuple((cause, 0) for cause in CAUSES)
    ranked = RankedGrasps((grasp,), np.array([X_WO @ X_OG]), np.array([0.093]), np.ones(1), none)
    return {"X_WO": X_WO, "ranked": ranked, "model": CATALOGUE["waterpot"]}


def test_what_a_finger_was_put_through_is_let_go_by_a_hand_that_points_down(scene):
    pot = lying_pot()
    made = plan(scene, **pot)
    assert made.X_WG[2, 0] > -0.9, "it is taken aslant"
    np.testing.assert_allclose(made.X_WG_place[:3, 0], [0.0, 0.0, -1.0], atol=1e-6)
    assert_sound(scene, made, pot["model"], pot["X_WO"], [])
    assert_lands_in(BIN, made, pot["model"])
    # Where nothing of it lies beyond a finger, as it is held.
    can = standing("soup_can", 0.6, 0.05)
    slant = rotation_from_vector(np.array([0.0, 0.5, 0.0]))
    grasps = from_above("soup_can", can)
    ranked = dataclasses.replace(
        grasps,
        grasps=tuple(dataclasses.replace(g, X_OG=transform(slant, np.zeros(3)) @ g.X_OG) for g in grasps.grasps),
        X_WGs=np.array([can @ transform(slant, np.zeros(3)) @ g.X_OG for g in grasps.grasps]),
    )
    slanting = plan(scene, ranked=ranked)
    assert slanting.X_WG_place[2, 0] == pytest.approx(slanting.X_WG[2, 0], abs=1e-6) and slanting.X_WG[2, 0] > -0.9
