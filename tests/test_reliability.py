import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.reliability import reliability


@given(st.integers(0, 2**32 - 1), st.integers(200, 400))
@settings(max_examples=20)
def test_what_comes_true_as_often_as_stated_has_hardly_any_calibration_error(seed, n):
    rng = np.random.default_rng(seed)
    p = np.repeat(np.arange(0.05, 1.0, 0.1), n)  # ten values, n times each, so that each is a bin
    outcome = np.concatenate([rng.permutation(n) < round(value * n) for value in p[::n]])
    assert reliability(p, outcome).error <= 0.5 / n + 1e-9
    assert reliability(np.minimum(p + 0.1, 1.0), outcome).error >= 0.08


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60), st.randoms(use_true_random=False))
def test_calibration_bins_have_equal_mass_and_no_order(pairs, random):
    p, so = (np.array(column, float) for column in zip(*pairs, strict=True))
    found = reliability(p, so)
    assert found.counts.sum() == len(p)
    assert np.ptp(found.counts) <= 1
    assert np.all(np.diff(found.stated) >= 0)
    assert np.average(found.observed, weights=found.counts) == pytest.approx(so.mean())
    assert np.average(found.stated, weights=found.counts) == pytest.approx(p.mean())
    mixed = random.sample(range(len(p)), len(p))
    np.testing.assert_allclose(reliability(p[mixed], so[mixed]).observed, found.observed, atol=1e-12)


def test_calibration_of_nothing_is_unknown():
    assert np.isnan(reliability([], []).error)
