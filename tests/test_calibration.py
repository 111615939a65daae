"""Temperatures: recovered from data they made, and harmless to what is likeliest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sum_drake.detection.calibration import Calibration, fit

TEMPERATURE = st.floats(0.3, 5.0)
LOGITS = arrays(np.float64, (6, 5), elements=st.floats(-20, 20))


@given(logits=LOGITS, box=TEMPERATURE, offset=st.floats(-2, 2), label=TEMPERATURE)
def test_probabilities_are_a_distribution_and_keep_the_order_of_labels(logits, box, offset, label):
    p = Calibration(box, offset, label).probabilities(logits)
    np.testing.assert_allclose(p.sum(1), 1.0)
    assert (p >= 0).all()
    for row, chosen in zip(p[:, 1:], logits[:, 1:], strict=True):
        assert row[np.argmax(chosen)] == pytest.approx(row.max())


@given(logits=LOGITS)
def test_without_calibration_probabilities_are_the_softmax(logits):
    expected = np.exp(logits - logits.max(1, keepdims=True))
    expected /= expected.sum(1, keepdims=True)
    np.testing.assert_allclose(Calibration().probabilities(logits), expected, atol=1e-9)


def test_fit_recovers_what_made_the_data():
    rng = np.random.default_rng(0)
    made = Calibration(box_temperature=2.5, box_offset=-0.7, label_temperature=0.6)
    logits = rng.normal(0, 3, (6000, 6))
    p = made.probabilities(logits)
    classes = np.array([rng.choice(6, p=row) for row in p])
    found = fit(logits, classes)
    assert found.box_temperature == pytest.approx(2.5, rel=0.15)
    assert found.box_offset == pytest.approx(-0.7, abs=0.1)
    assert found.label_temperature == pytest.approx(0.6, rel=0.1)


@pytest.mark.parametrize("classes", [[], [1, 2, 3], [0, 0, 0]])
def test_few_examples_of_one_kind_change_little(classes):
    found = fit(np.eye(4)[1:][: len(classes)] * 3, np.array(classes, dtype=np.int64))
    assert all(0.2 < t < 5 for t in (found.box_temperature, found.label_temperature))
    assert abs(found.box_offset) < 2
