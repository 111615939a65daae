import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.existence import (
    EVIDENCE,
    SIGNS,
    SURVIVES,
    WEIGHTS,
    agreed_probability,
    evidence,
    missed_probability,
    track_probability,
)
from sum_drake.presence import UNKNOWN, Presence

share = st.floats(0, 1)
pixels = st.floats(0, 1e6)
features = st.fixed_dictionaries(
    {
        "close": share,
        "free_space": pixels,
        "observed": pixels,
        "sides": st.floats(0, 16),
        "near_share": share,
        "translation_std_m": st.floats(0, 10),
    },
    optional={"sunk_m": st.floats(-1, 1)},
)
GOOD = {
    "close": 0.9, "free_space": 5.0, "observed": 2000.0, "sides": 0.1, "near_share": 0.98, "translation_std_m": 0.002,
}  # fmt: skip


@given(share, share, share, features)
def test_it_is_a_probability(p_box, p_label, likelihood, told):
    assert 0.0 <= track_probability(p_box, p_label, likelihood, told) <= 1.0
    assert np.isfinite(evidence(p_box, p_label, likelihood, told)).all()


@given(share, share, share, share)
def test_better_evidence_never_lowers_it(p_box, p_label, low, high):
    low, high = sorted((low, high))
    assert track_probability(p_box, p_label, low, GOOD) <= track_probability(p_box, p_label, high, GOOD)
    assert track_probability(low, p_label, 0.5, GOOD) <= track_probability(high, p_label, 0.5, GOOD)


@pytest.mark.parametrize(
    ("name", "worse"),
    [
        ("close", 0.3),
        ("free_space", 900.0),
        ("sides", 5.0),
        ("near_share", 0.4),
        ("translation_std_m", 0.05),
        ("sunk_m", 0.04),
        ("sunk_m", -0.08),
    ],
)
def test_each_piece_of_evidence_counts(name, worse):
    good = track_probability(0.9, 0.9, 0.9, GOOD)
    assert good > 0.95
    assert track_probability(0.9, 0.9, 0.9, GOOD | {name: worse}) < good


def test_weights_have_their_signs():
    assert len(WEIGHTS) == len(EVIDENCE) == len(SIGNS) == len(evidence(0.9, 0.9, 0.9, GOOD))
    assert all(weight * sign >= 0 for weight, sign in zip(WEIGHTS, SIGNS, strict=True))


def test_one_of_two_poses_that_nothing_tells_apart_is_no_sure_thing():
    assert track_probability(1.0, 1.0, 0.95, GOOD | {"near_share": 0.5}) <= 0.5


def test_nothing_explained_is_nothing_there():
    assert track_probability(1.0, 1.0, 0.0, GOOD) == 0.0


looks = st.builds(Presence, st.floats(0, 1e5), share, share, share)
EMPTY = Presence(2000.0, 0.0, 0.95, 0.0)
THERE = Presence(2000.0, 0.95, 0.0, 0.0)
HIDDEN = Presence(2000.0, 0.0, 0.0, 1.0)


@given(share, looks, st.booleans())
def test_after_a_miss_it_is_at_most_as_probable(p, seen, again):
    assert 0.0 <= missed_probability(p, seen, again=again) <= p


@given(st.floats(0.01, 0.99))
def test_what_a_place_shows_that_nothing_was_detected_in(p):
    """An empty one ends belief, a hidden one says nothing, a full one does not tell real ones from mistakes."""
    assert missed_probability(p, EMPTY) < 0.1 * p
    assert missed_probability(p, HIDDEN) == pytest.approx(SURVIVES * p)
    assert missed_probability(p, UNKNOWN) == pytest.approx(SURVIVES * p)
    assert missed_probability(p, EMPTY) < missed_probability(p, THERE) < missed_probability(p, HIDDEN)
    assert missed_probability(p, THERE) < missed_probability(p, THERE, again=True)


def test_a_sure_track_outlasts_a_miss_where_depth_shows_it_and_a_doubtful_one_does_not():
    assert missed_probability(0.95, THERE) > 0.5
    assert missed_probability(0.6, THERE) < 0.3


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_an_estimate_that_agrees_with_what_was_believed_gains_by_it_but_not_like_a_new_witness(now, before):
    found = agreed_probability(now, before)
    before *= SURVIVES
    assert (found >= now) == (before >= 0.5) or found == pytest.approx(now)
    independent = now * before / (now * before + (1 - now) * (1 - before))
    assert min(now, independent) - 1e-9 <= found <= max(now, independent) + 1e-9
