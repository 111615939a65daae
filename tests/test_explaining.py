"""Counts by cause, in words."""

import pytest

from sum_drake import explaining
from sum_drake.explaining import explained, given_up, in_the_way, parted
from sum_drake.grasp_ranking import CAUSES
from sum_drake.pick_phases import REASONS
from sum_drake.types import Attempt

REJECTED = (
    ("approach_from_below", 430), ("table", 210), ("neighbour_finger_tide", 96), ("neighbour_palm_soup_can", 30),
    ("neighbour_approach_unexplained", 5), ("belief_too_wide", 0), ("grasp_collision_tide", 4), ("lift_soup_can", 3),
    ("reach", 2), ("ik", 1),
)  # fmt: skip


@pytest.mark.parametrize(
    ("cause", "parts"),
    [
        ("ik", ("ik", "")),
        ("neighbour_finger_soup_can", ("neighbour_finger", "soup_can")),
        ("grasp_collision_r_gripper_finger_link", ("grasp_collision", "r_gripper_finger_link")),
        ("reach_tide#2", ("reach", "tide#2")),
        ("lift", ("lift", "")),
        ("place_collision_non_cleaning_bin", ("place_collision", "non_cleaning_bin")),
        ("place_ik", ("place_ik", "")),
        ("table", ("table", "")),
        ("of_a_later_version", ("of_a_later_version", "")),
    ],
)
def test_a_cause_is_told_from_the_body_it_names(cause, parts):
    assert parted(cause) == parts


def test_there_are_words_for_every_cause():
    assert set(CAUSES) | set(REASONS) - {"no_grasp"} == set(explaining.CAUSES)


def test_what_is_in_the_way_is_counted_by_body():
    assert in_the_way(REJECTED) == {"tide": 100, "soup_can": 33, "unexplained": 5}


def test_a_person_can_read_it():
    assert explained(812, REJECTED) == (
        "812 grasps considered: 430 from below, 210 too near the table, 96 with tide at a finger, "
        "30 with soup can in the palm, 5 with something unexplained in the hand's way, 4 touch tide, "
        "3 no straight way up past soup can, 2 no straight way to it past something, "
        "1 within reach, but no way to hold the arm, 31 hold"
    )
    assert explained(1, (("out_of_reach", 1),)) == "1 grasp considered: 1 out of the arm's reach"
    assert explained(0, ()) == "0 grasps considered"


@pytest.mark.parametrize(
    ("reason", "rejected_by", "said"),
    [
        ("too_many_failures", (), "it was tried as often as allowed"),
        ("not_seen", (), "it is believed to be there, but cannot be seen"),
        ("no_grasp", (("table", 7),), "no grasp; 7 grasps considered: 7 too near the table"),
    ],
)
def test_an_attempt_that_was_given_up_says_why(reason, rejected_by, said):
    count = sum(n for _, n in rejected_by)
    assert given_up(Attempt(0, 1, "tide", "bin", "none", reason, count, rejected_by, None)) == said
