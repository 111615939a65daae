"""One object at a time: where it belongs, how full its bin is, which grasps are the same."""

import dataclasses

import numpy as np
from deciding import CATALOGUE, CONFIG, GOAL, make_attempting, tried
from scenes import standing

from sum_drake.attempting import _same_grasp, region_of
from sum_drake.geometry import rotation_from_vector
from sum_drake.types import readonly


def test_a_bin_is_taken_to_be_filled_by_what_was_let_go_in_it_up_to_a_limit():
    attempting = make_attempting()
    fills = [attempting.fill("cleaning_bin", [tried("tide", region="cleaning_bin")] * count) for count in range(9)]
    assert fills[:2] == [0.0, CONFIG.fill_per_object]
    assert fills == sorted(fills)
    assert fills[-1] == CONFIG.fill_max
    assert attempting.fill("cleaning_bin", [tried("mug"), tried("tide", region="cleaning_bin", released=False)]) == 0.0
    hung = tried("tide", region="cleaning_bin")
    hung = dataclasses.replace(hung, action=dataclasses.replace(hung.action, hangs=True))
    assert attempting.fill("cleaning_bin", [hung]) == 0.0, "it hangs on the hand"


def test_the_region_of_a_label_goes_before_that_of_its_category():
    assert region_of("tide", GOAL, CATALOGUE) == "cleaning_bin"
    assert region_of("tide", {**GOAL, "tide": "non_cleaning_bin"}, CATALOGUE) == "non_cleaning_bin"
    assert region_of("tide", {"tide": "leave", **GOAL}, CATALOGUE) == "leave"
    assert region_of("mug", {"cleaning": "cleaning_bin"}, CATALOGUE) == "leave", "the goal has neither"


def test_grasps_are_the_same_within_15_mm_and_25_degrees():
    X_OG = readonly(standing(CATALOGUE, "mug", 0.01, 0.02, yaw=0.7))

    def moved(metres, degrees):
        X = X_OG.copy()
        X[1, 3] += metres
        X[:3, :3] = X[:3, :3] @ rotation_from_vector(np.radians([0.0, degrees, 0.0]))
        return X

    assert _same_grasp(X_OG, X_OG)
    assert _same_grasp(X_OG, moved(0.014, 24))
    assert not _same_grasp(X_OG, moved(0.016, 0))
    assert not _same_grasp(X_OG, moved(0.0, 26))
