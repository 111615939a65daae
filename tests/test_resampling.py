import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.resampling import systematic

WEIGHTS = st.lists(st.floats(0, 10), min_size=1, max_size=30).filter(lambda weights: sum(weights) > 1e-3).map(np.array)
OFFSETS = st.floats(0, 1, exclude_max=True)


@given(WEIGHTS, st.integers(1, 200), OFFSETS)
def test_each_particle_is_chosen_as_often_as_its_weight_says_give_or_take_one(weights, n, offset):
    chosen = systematic(weights, n, offset)
    assert chosen.shape == (n,) and (np.diff(chosen) >= 0).all()
    times = np.bincount(chosen, minlength=len(weights))
    assert (np.abs(times - n * weights / weights.sum()) < 1 + 1e-6).all()


@given(WEIGHTS, st.integers(1, 50), OFFSETS)
def test_what_weighs_nothing_is_never_chosen(weights, n, offset):
    assert (weights[systematic(weights, n, offset)] > 0).all()


def test_equal_weights_are_kept_as_they_are():
    np.testing.assert_array_equal(systematic(np.full(7, 0.3), 7, 0.5), np.arange(7))
