import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scored import FAR, LABELS, NEAR_A, A, B, C, K, image, many, probabilities, shuffled

from sum_drake.detection import metrics
from sum_drake.detection.dataset import AnnotatedImage, AnnotatedObject
from sum_drake.detection.metrics import FALSE, LEFT_OUT
from sum_drake.types import Camera


def assert_same(one, other):
    np.testing.assert_allclose(dataclasses.astuple(one), dataclasses.astuple(other))


def test_a_worked_example():
    """One label, three objects: right at .9, false at .8, right at .7, and one object that is never found.

    Precision is 1, 1/2, 2/3 at recall 1/3, 1/3, 2/3; interpolated it is 1 up to 1/3 and 2/3 up to 2/3: 5/9 in all.
    """
    scene = image([(A, 1), (B, 1), (C, 1)], [(A, 1, 0.9), (FAR, 1, 0.8), (B, 1, 0.7)])
    curve = metrics.precision_recall([scene], 1)
    np.testing.assert_allclose(curve.thresholds, [0.9, 0.8, 0.7])
    np.testing.assert_allclose(curve.precision, [1, 1 / 2, 2 / 3])
    np.testing.assert_allclose(curve.recall, [1 / 3, 1 / 3, 2 / 3])
    assert curve.average_precision == pytest.approx(5 / 9)


def test_a_box_near_enough_for_one_threshold_is_false_at_a_stricter_one():
    scene = image([(A, 1)], [(NEAR_A, 1, 0.9)])
    aps = metrics.average_precisions([scene], K)
    np.testing.assert_array_equal(aps[0], [1, 1, 1, 0, 0, 0, 0, 0, 0, 0])
    assert metrics.mean_average_precision(aps) == pytest.approx(0.3)
    assert metrics.mean_average_precision(aps[:, :1]) == 1.0


@given(many)
def test_perfect_detections_score_1(drawn):
    scenes = [image(objects, [(box, label, 0.9) for box, label, scored in objects if scored]) for objects, _ in drawn]
    aps = metrics.average_precisions(scenes, K)
    occur = {label for objects, _ in drawn for _, label, scored in objects if scored}
    assert {1 + i for i in np.flatnonzero(~np.isnan(aps[:, 0]))} == occur
    assert np.all(aps[[label - 1 for label in occur]] == 1.0)
    point = metrics.best_operating_point(scenes, 0.0)
    if occur:
        assert metrics.mean_average_precision(aps) == 1.0
        assert (point.recall, point.precision, point.false_positives_per_image) == (1.0, 1.0, 0.0)
    else:
        assert np.isnan(metrics.mean_average_precision(aps))
        assert np.isnan(point.recall)


@given(many, st.randoms(use_true_random=False))
@settings(max_examples=60)
def test_no_order_matters(drawn, random):
    ordered = [image(*one) for one in drawn]
    mixed = shuffled(drawn, random)
    for threshold in (0.5, 0.75):
        one, other = (metrics.average_precisions(scenes, K, [threshold]) for scenes in (ordered, mixed))
        np.testing.assert_array_equal(one, other)
    assert_same(metrics.best_operating_point(ordered), metrics.best_operating_point(mixed))
    np.testing.assert_array_equal(metrics.confusion_matrix(ordered, 0.3), metrics.confusion_matrix(mixed, 0.3))


@given(many)
@settings(max_examples=60)
def test_figures_stay_within_their_bounds_and_every_box_is_accounted_for(drawn):
    scenes = [image(*one) for one in drawn]
    aps = metrics.average_precisions(scenes, K, [0.5])
    assert np.all(np.isnan(aps) | ((aps >= 0) & (aps <= 1)))
    for scene in scenes:
        taken = metrics.take(scene)
        own = taken[taken >= 0]
        assert len(set(own)) == len(own), "an object is taken once"
        assert scene.scored[own].all()
        assert set(taken[taken < 0]) <= {FALSE, LEFT_OUT}
    counts = metrics.confusion_matrix(scenes, 0.0)
    objects = np.concatenate([scene.true_classes[scene.scored] for scene in scenes])
    np.testing.assert_array_equal(counts.sum(1)[1:], np.bincount(objects, minlength=1 + K)[1:])
    thresholds, recall, false = metrics.recall_curve(scenes)
    assert np.all(np.diff(thresholds) < 0)
    assert np.all(np.diff(recall) >= 0)
    assert np.all(np.diff(false) >= 0)


@given(many, st.floats(0.05, 1.0))
@settings(max_examples=60)
def test_a_threshold_afterwards_is_a_threshold_before(drawn, threshold):
    """Matching everything and then dropping what scores too little is the same as never having had it."""
    scenes = [image(*one) for one in drawn]
    strict = [image(objects, [box for box in boxes if box[2] >= threshold]) for objects, boxes in drawn]
    kept = [metrics.take(scene)[scene.probabilities[:, 1:].max(1, initial=0) >= threshold] for scene in scenes]
    for after, before in zip(kept, map(metrics.take, strict), strict=True):
        np.testing.assert_array_equal(after, before)
    assert_same(metrics.operating_point(scenes, threshold), metrics.operating_point(strict, threshold))


@given(many, st.sampled_from([0.0, 0.5, 1.0, 2.0]))
@settings(max_examples=60)
def test_the_best_threshold_is_the_best_of_all(drawn, allowed):
    scenes = [image(*one) for one in drawn]
    assume(any(scene.scored.any() for scene in scenes))
    best = metrics.best_operating_point(scenes, allowed)
    assert best.false_positives_per_image <= allowed
    assert_same(best, metrics.operating_point(scenes, best.threshold))
    for threshold in metrics.recall_curve(scenes)[0]:
        point = metrics.operating_point(scenes, threshold)
        if point.false_positives_per_image <= allowed:
            assert point.recall <= best.recall
            assert point.recall < best.recall or best.recall == 0 or threshold <= best.threshold


def test_a_second_box_on_an_object_is_false_and_so_is_a_wrong_label():
    scene = image([(A, 1), (B, 2)], [(A, 1, 0.9), (NEAR_A, 1, 0.8), (B, 3, 0.7)])
    np.testing.assert_array_equal(metrics.take(scene), [0, FALSE, FALSE])
    point = metrics.operating_point([scene], 0.5)
    assert (point.recall, point.false_positives_per_image) == (0.5, 2.0)
    assert point.precision == pytest.approx(1 / 3)


def test_a_box_takes_the_object_it_overlaps_most_and_the_next_one_what_is_left():
    lower, between = (0, 0, 10, 8), (0, 0, 10, 9.5)  # IoU .95 with A, .84 with lower
    scene = image([(lower, 1), (A, 1)], [(A, 1, 0.6), (between, 1, 0.7)])
    np.testing.assert_array_equal(metrics.take(scene), [0, 1])


def test_objects_left_out_are_neither_missed_nor_found_nor_make_their_boxes_false():
    hidden = (B, 2, False)
    without, found = image([(A, 1), hidden], [(A, 1, 0.9)]), image([(A, 1), hidden], [(A, 1, 0.9), (B, 2, 0.8)])
    twice = image([(A, 1), hidden], [(A, 1, 0.9), (B, 2, 0.8), (B, 2, 0.7)])
    for scene in (without, found, twice):
        assert metrics.operating_point([scene], 0.1) == metrics.OperatingPoint(0.1, 1.0, 1.0, 0.0)
        assert np.isnan(metrics.average_precisions([scene], K)[1, 0])
        assert metrics.confusion_matrix([scene], 0.1).sum() == 1
    mistaken = image([(A, 1), hidden], [(A, 1, 0.9), (B, 3, 0.8)])
    assert metrics.operating_point([mistaken], 0.1).false_positives_per_image == 1.0


def test_pictures_without_objects_count_false_positives_and_nothing_else():
    scenes = [image(), image([], [(A, 1, 0.9)])]
    point = metrics.operating_point(scenes, 0.5)
    assert np.isnan(point.recall)
    assert (point.precision, point.false_positives_per_image) == (0.0, 0.5)
    assert np.isnan(metrics.mean_average_precision(metrics.average_precisions(scenes, K)))
    assert metrics.best_operating_point(scenes, 0.1).threshold == float("inf")
    assert metrics.top1([]) != metrics.top1([]), "nan"


def test_recall_by_visible_share():
    objects = [(A, 1, True, 0.3), (B, 1, True, 0.5), (C, 1, True, 1.0), (FAR, 1, False, 0.1)]
    rows = metrics.recall_by_visible_share([image(objects, [(A, 1, 0.2), (C, 1, 0.9)])], 0.5)
    found = {(low, high): (count, recall) for low, high, count, recall in rows}
    assert found[0.25, 0.5] == (1, 0.0), "found, but below the threshold"
    assert found[0.5, 0.7] == (1, 0.0)
    assert found[0.95, 1.0] == (1, 1.0)
    count, recall = found[0.7, 0.95]
    assert count == 0
    assert np.isnan(recall)


@given(many, st.sampled_from([0.0, 0.4, 0.95]))
@settings(max_examples=60)
def test_counts_by_label_add_up_to_the_working_point(drawn, threshold):
    scenes = [image(*one) for one in drawn]
    objects, found, false = metrics.counts_by_label(scenes, K, threshold).sum(0)
    point = metrics.operating_point(scenes, threshold)
    np.testing.assert_allclose(found / objects if objects else np.nan, point.recall)
    assert false / len(scenes) == pytest.approx(point.false_positives_per_image)


def test_the_confusion_matrix_names_what_was_taken_for_what():
    scene = image([(A, 1), (B, 2), (C, 3)], [(A, 2, 0.9), (B, 2, 0.8), (FAR, 1, 0.7), (C, 3, 0.1)])
    counts = metrics.confusion_matrix([scene], 0.5)
    expected = np.zeros((1 + K, 1 + K), int)
    expected[1, 2] = expected[2, 2] = expected[0, 1] = expected[3, 0] = 1
    np.testing.assert_array_equal(counts, expected)


def test_top1_holds_background_against_the_detector():
    scene = image([(A, 1), (B, 2), (C, 3, False)])
    assert metrics.top1([scene]) == 1.0
    unseen = scene.true_probabilities.copy()
    unseen[0], unseen[2] = probabilities(1, 0.4), probabilities(1, 0.9)
    assert metrics.top1([dataclasses.replace(scene, true_probabilities=unseen)]) == 0.5


def annotated(*objects):
    camera = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    return AnnotatedImage(
        "test/0/0", np.zeros((480, 640, 3), np.uint8), np.ones((480, 640), np.float32), camera, objects
    )


def test_an_annotated_picture_becomes_a_scored_one():
    picture = annotated(AnnotatedObject("tide", A, 0.9, 900), AnnotatedObject("mug", B, 0.1, 900))
    scene = metrics.scored_image(picture, LABELS, [A], [probabilities(3, 0.7)], np.zeros((2, 1 + K)))
    np.testing.assert_array_equal(scene.true_classes, [3, 1])
    np.testing.assert_array_equal(scene.scored, [True, False])
    assert metrics.operating_point([scene], 0.5).recall == 1.0
    with pytest.raises(ValueError, match="true_probabilities"):
        metrics.scored_image(picture, LABELS, [A], [probabilities(3, 0.7)], np.zeros((1, 1 + K)))
    empty = metrics.scored_image(annotated(), LABELS, [], [], [])
    assert empty.boxes.shape == (0, 4)
    assert empty.true_probabilities.shape == (0, 1 + K)


def test_recall_of_proposals_by_count():
    picture = annotated(
        AnnotatedObject("tide", A, 0.9, 900), AnnotatedObject("mug", B, 0.9, 900), AnnotatedObject("toy", C, 0.1, 900)
    )
    overlaps = metrics.proposal_overlaps(np.array([NEAR_A, FAR, A, B], float), picture, (0, 1, 3, 100))
    np.testing.assert_allclose(overlaps, [[0, 0.6, 1, 1], [0, 0, 0, 1]])
    np.testing.assert_allclose(metrics.proposal_recall(overlaps, 0.5), [0, 0.5, 0.5, 1])
    np.testing.assert_allclose(metrics.proposal_recall(overlaps, 0.7), [0, 0, 0.5, 1])
    assert np.isnan(metrics.proposal_recall(np.zeros((0, 2)), 0.5)).all()
