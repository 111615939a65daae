import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scored import FAR, A, B, image, many, shuffled

from sum_drake.detection.reliability import box_reliability, label_reliability, object_reliability


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
