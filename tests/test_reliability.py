import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scored import FAR, A, B, image, many, shuffled

from sum_drake.detection.reliability import box_reliability, label_reliability, object_reliability, reliability


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


def test_both_probabilities_are_held_against_what_is_the_case():
    scene = image([(A, 1), (B, 2)], [(A, 1, 0.8), (B, 3, 0.6), (FAR, 2, 0.1)])
    boxes = box_reliability([scene])
    np.testing.assert_allclose(boxes.stated, [0.1, 0.6, 0.8])
    np.testing.assert_allclose(boxes.observed, [0, 0, 1])
    assert boxes.error == pytest.approx((0.1 + 0.6 + 0.2) / 3)
    assert box_reliability([scene], least=0.5).error == pytest.approx((0.6 + 0.2) / 2)
    objects = object_reliability([scene])
    np.testing.assert_allclose(objects.stated, [0.1, 0.6, 0.8])
    np.testing.assert_allclose(objects.observed, [0, 1, 1], err_msg="an object is one whatever it is called")
    taken_for = scene.true_probabilities.copy()
    taken_for[1] = [0.1, 0.6, 0.3, 0.0]
    mistaken = dataclasses.replace(scene, true_probabilities=taken_for)
    labels = label_reliability([mistaken])
    np.testing.assert_allclose(labels.stated, [0.6 / 0.9, 1.0])
    np.testing.assert_allclose(labels.observed, [0, 1])


@given(many, st.randoms(use_true_random=False))
@settings(max_examples=60)
def test_reliability_of_boxes_has_no_order(drawn, random):
    one, other = box_reliability([image(*scene) for scene in drawn]), box_reliability(shuffled(drawn, random))
    np.testing.assert_allclose(one.observed, other.observed)
    assert one.error == pytest.approx(other.error, nan_ok=True)


def test_boxes_on_objects_that_are_left_out_say_nothing_of_reliability():
    hidden = (B, 2, False)
    for boxes in ([(A, 1, 0.9)], [(A, 1, 0.9), (B, 2, 0.8)], [(A, 1, 0.9), (B, 2, 0.8), (B, 2, 0.7)]):
        np.testing.assert_array_equal(box_reliability([image([(A, 1), hidden], boxes)]).counts, [1])
