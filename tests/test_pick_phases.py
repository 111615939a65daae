"""What the phases of a pick make of a scene."""

import numpy as np

from sum_drake.geometry import apply, transform
from sum_drake.objects import load_catalogue
from sum_drake.pick_phases import unexplained
from sum_drake.planning_scene import solid_of


def test_points_of_believed_objects_are_no_obstacles_of_their_own():
    model, X_WO = load_catalogue()["soup_can"], transform(np.eye(3), np.array([0.6, 0.05, 0.75]))
    surface = apply(X_WO, np.asarray(model.load_mesh().vertices))
    stray = surface[:5] + np.array([0.0, 0.3, 0.0])
    left = unexplained(np.concatenate([surface, stray]), [solid_of(model, X_WO)], 0.012)
    np.testing.assert_array_equal(left, stray)
