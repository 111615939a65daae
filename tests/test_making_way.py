"""What is in the way, and how often it may be moved."""

import dataclasses

import numpy as np
import pytest

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.making_way import been, blockers, failed, moves, nearest, worn_out
from sum_drake.types import Attempt, PickPlace, PoseBelief, Track, readonly

EYE = readonly(np.eye(4))


def track(id, label, x):
    X_WO = readonly(transform(np.eye(3), np.array([x, 0.0, 0.75])))
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    return Track(id, label, (0, 0, 9, 9), 0.9, 0.9, belief, X_WO, 0.5, 0.9, True, 0, 0)


SUGAR, TIDE, FAR_TIDE, MUG = track(0, "sugar", 0.6), track(1, "tide", 0.7), track(2, "tide", 1.0), track(3, "mug", 0.5)
ALL = [SUGAR, TIDE, FAR_TIDE, MUG]


def test_the_worst_blocker_comes_first_and_what_hardly_matters_does_not_count():
    counts = (("table", 40), ("neighbour_finger_mug", 20), ("grasp_collision_tide", 30), ("lift_tide#2", 25),
              ("neighbour_palm_unexplained", 50), ("reach_r_gripper_finger_link", 9))  # fmt: skip
    assert [(t.id, n) for t, n in blockers(SUGAR, ALL, counts)] == [(1, 30), (1, 25), (3, 20)]
    assert blockers(SUGAR, ALL, (("table", 400), ("neighbour_finger_mug", 20))) == []
    assert blockers(SUGAR, [SUGAR], counts) == [], "nothing else is believed"
    assert blockers(SUGAR, ALL, ()) == []


def test_of_two_with_one_label_the_nearer_is_meant():
    assert nearest("tide", SUGAR, ALL) is TIDE
    assert nearest("tide", TIDE, ALL) is FAR_TIDE, "not itself"


def attempt(kind="move", reason="executed", X_OG=EYE, set_out=True):
    X_WG = readonly(transform(rotation_from_vector(np.array([0, 1.5, 0])), np.array([0.6, 0.1, 0.8])))
    action = PickPlace(0, kind, 1, "tide", X_WG, EYE, "table", 0.04, 0.04, reason == "executed")
    return Attempt(0, 1, "tide", "table", kind, reason, 9, (), action if set_out else None, X_OG)


def test_moves_count_as_such_and_as_failures_only_where_they_failed():
    picked, moved, missed = attempt("pick_place"), attempt(), attempt(reason="empty_hand")
    given_up = attempt("none", "no_grasp", None, set_out=False)
    history = [picked, moved, missed, given_up, dataclasses.replace(moved, label="mug")]
    assert moves("tide", history) == [moved, missed]
    assert failed("tide", history) == [picked, missed]
    assert failed("sugar", history) == moves("sugar", history) == []


def test_what_failed_three_times_is_tried_again_when_another_is_gone_but_not_for_ever():
    missed, other = attempt("pick_place", "empty_hand"), attempt("pick_place")
    gone = dataclasses.replace(other, label="mug")
    still_there = dataclasses.replace(gone, reason="empty_hand")
    assert not worn_out("tide", [missed] * 2, 3)
    assert worn_out("tide", [missed] * 3, 3)
    assert worn_out("tide", [missed] * 3 + [still_there], 3)
    assert not worn_out("tide", [missed] * 3 + [gone], 3)
    assert worn_out("tide", [missed] * 3 + [gone] + [missed] * 3 + [gone], 3)


def test_where_it_has_been_is_told_by_the_grasp():
    X_OG = readonly(transform(rotation_from_vector(np.array([0.3, 0, 1.0])), np.array([0.01, 0.02, 0.03])))
    made = attempt(X_OG=X_OG)
    (p_W,) = been("tide", [made, attempt(X_OG=None), attempt("pick_place")])
    X_WO = transform(np.eye(3), p_W)
    X_WO[:3, :3] = made.action.X_WG_pick[:3, :3] @ X_OG[:3, :3].T
    np.testing.assert_allclose((X_WO @ X_OG)[:3, 3], made.action.X_WG_pick[:3, 3], atol=1e-12)
    assert p_W == pytest.approx(X_WO[:3, 3])
