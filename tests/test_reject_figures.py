"""Figures of the reject bench, from hypotheses whose truth is known."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.bench.hypotheses import Counted, FirstLook, Judged
from sum_drake.bench.reject_figures import (
    SAYERS,
    brier_skill,
    confusion,
    coverage_risk,
    figures,
    recovered,
    roc,
    said,
)
from sum_drake.bench.sequences import Followed, Outcome
from sum_drake.bench.watching import Update

FEATURES = (("inliers", 80.0), ("observed", 100.0), ("p_look", 0.7))


def judged(label, p, right, *, table=1, accepted=None, observation=0):
    return Judged(
        table, True, observation, 0, True, label, 0.9, 0.8, 0.6, FEATURES, p,
        p >= 0.5 if accepted is None else accepted, right,
    )  # fmt: skip


def look(*hypotheses, visible=(), counted=(0, 0, 0, 0), table=1, trial=0):
    return FirstLook(table, trial, tuple(visible), tuple(hypotheses), Counted(*counted))


def outcome(fault="slips", handled=1, happened="slipped", believed="slipped"):
    return Outcome(7, fault, "mug", True, handled, happened, believed)


def test_what_is_rejected_and_kept():
    looks = [
        look(judged("mug", 0.9, True), judged("toy", 0.8, False), judged("tide", 0.1, False), visible=("mug", "tea")),
        look(judged("mug", 0.3, True, table=2), judged("tea", 0.2, False, table=2), visible=("mug",), table=2),
    ]
    found = figures(looks, [], [])
    assert found["false_rejected"] == pytest.approx(2 / 3)
    assert found["true_kept"] == 0.5
    assert found["coverage"] == pytest.approx(1 / 3)
    assert found["risk"] == 0.5
    assert np.isnan(found["recovered_within_2"]) and np.isnan(found["paper.false_rejected"])


def test_an_object_with_two_right_hypotheses_is_kept_if_one_stands_for_it():
    both = [judged("mug", 0.9, True), judged("mug", 0.8, True, accepted=False)]
    assert figures([look(*both)], [], [])["true_kept"] == 1.0


def test_the_papers_experiment_is_a_mean_over_scenes_with_its_error_over_trials():
    trials = [look(counted=(2, 2, 5, 5), trial=0), look(counted=(4, 2, 5, 4), trial=0, table=2),
              look(counted=(1, 1, 5, 5), trial=1), look(counted=(0, 0, 5, 5), trial=1, table=2)]  # fmt: skip
    found = figures([], trials, [])
    assert found["paper.false_rejected"] == pytest.approx((0.75 + 1.0) / 2)
    assert found["paper.standard_error"] == pytest.approx(0.125)
    assert found["paper.true_kept"] == pytest.approx(19 / 20)


def test_found_again_within_two_observations_by_fault():
    outcomes = [outcome(), outcome(handled=2), outcome(handled=0), outcome(fault="taken", happened="", believed="")]
    assert recovered(outcomes) == 0.75
    followed = Followed(tuple(outcomes), (), (Update(1, 4, 1, 0.8, 1.5), Update(2, 0, 2, 0.0, 2.0)), ())
    found = figures([], [], [followed])
    assert found["recovered_within_2.slips"] == pytest.approx(2 / 3)
    assert found["recovered_within_2.taken"] == 1.0
    assert found["tracked_cpu_s_per_object"] == pytest.approx(0.2)
    assert found["scratch_cpu_s_per_object"] == pytest.approx(3.5 / 3)
    assert found["outcome_believed"] == 1.0
    assert confusion(outcomes) == {("slipped", "slipped"): 3}


def test_coverage_and_risk_of_the_likeliest_hypothesis_of_each_label():
    looks = [look(judged("mug", 0.9, True), judged("mug", 0.2, False), judged("toy", 0.6, False), visible=("mug", "a"))]
    coverage, risk = coverage_risk(looks)
    assert coverage.tolist() == [0.5, 0.5]
    assert risk.tolist() == [0.0, 0.5]


scores = st.lists(st.tuples(st.sampled_from([0.0, 0.1, 0.5, 0.7, 1.0]), st.booleans()), min_size=2, max_size=40)


@given(scores.filter(lambda rows: len({right for _, right in rows}) == 2))
def test_the_area_under_a_roc_is_how_often_a_right_one_stands_above_a_wrong_one(rows):
    score, right = np.array([s for s, _ in rows]), np.array([r for _, r in rows])
    curve = roc(score, right)
    pairs = [(a > b) + 0.5 * (a == b) for a in score[right] for b in score[~right]]
    assert curve.area == pytest.approx(np.mean(pairs))
    assert curve.at(0.95) <= curve.at(0.5)
    assert (np.diff(curve.kept) >= 0).all() and (np.diff(curve.rejected) <= 0).all()


def test_what_others_say_of_a_hypothesis():
    one = judged("mug", 0.9, True)
    told = said(one)
    assert list(told) == list(SAYERS) and list(told.values()) == pytest.approx([0.9, 0.7, 0.72, 0.8, 0.576])


def test_skill_is_over_stating_the_mean():
    rows = [judged("mug", 1.0, True), judged("toy", 0.0, False)]
    assert brier_skill(rows) == 1.0
    assert brier_skill([dataclasses.replace(row, probability=0.5) for row in rows]) == 0.0
    assert np.isnan(brier_skill(rows[:1])) and np.isnan(brier_skill([]))
