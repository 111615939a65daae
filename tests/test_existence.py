from hypothesis import given
from hypothesis import strategies as st

from sum_drake.existence import missed_probability, track_probability

share = st.floats(0, 1)


@given(share, share, share)
def test_it_is_a_probability(p_box, p_label, likelihood):
    assert 0.0 <= track_probability(p_box, p_label, likelihood) <= 1.0


@given(share, share, share, share)
def test_better_evidence_never_lowers_it(p_box, p_label, low, high):
    low, high = sorted((low, high))
    assert track_probability(p_box, p_label, low) <= track_probability(p_box, p_label, high)
    assert track_probability(low, p_label, 0.5) <= track_probability(high, p_label, 0.5)


def test_nothing_explained_is_nothing_there():
    assert track_probability(1.0, 1.0, 0.0) == 0.0


@given(share)
def test_not_being_seen_lowers_it_and_never_below_zero(p):
    assert 0.0 <= missed_probability(p) <= p
