"""The detector's way from a picture to detections, with a network that was never trained: what must hold for any."""

import dataclasses

import numpy as np
import pytest
import torch

from sum_drake.assets import InputError
from sum_drake.detection.calibration import Calibration
from sum_drake.detection.inference import ANY_LABEL_IOU, SAME_LABEL_IOU, Detector
from sum_drake.detection.network import Network
from sum_drake.detection.weights import Weights
from sum_drake.geometry import iou

LABELS = ("tide", "mug", "toy")


def untrained(threshold=0.05):
    torch.manual_seed(1)
    network = Network(4, width=24, hidden=32)
    torch.nn.init.normal_(network.classify.weight, std=1.0)
    return Weights(LABELS, 24, 32, network.state_dict(), Calibration(), threshold)


def picture(height=240, width=320, seed=0):
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 20, width // 20, 3))
    return np.kron(coarse, np.ones((20, 20, 1))).astype(np.uint8)


@pytest.fixture(scope="module")
def detector():
    return Detector(untrained())


def test_boxes_lie_in_the_picture_and_probabilities_are_distributions(detector):
    scored = detector.detect(picture())
    assert len(scored.boxes) > 0
    assert (scored.boxes[:, :2] >= 0).all()
    assert (scored.boxes[:, :2] + scored.boxes[:, 2:] <= [320 + 1e-9, 240 + 1e-9]).all()
    np.testing.assert_allclose(scored.probabilities.sum(1), 1.0)


def test_no_two_boxes_show_one_object(detector):
    scored = detector.detect(picture())
    labels = scored.probabilities[:, 1:].argmax(1)
    overlap = np.triu(iou(scored.boxes, scored.boxes), 1)
    limit = np.where(labels[:, None] == labels[None], SAME_LABEL_IOU, ANY_LABEL_IOU)
    assert (overlap <= limit).all()


def test_detections_pass_the_threshold_and_the_sigma_c_rule():
    weights = untrained(threshold=0.3)
    detections = Detector(weights, sigma_c=0.5)(picture())
    assert detections
    scores = [one.p_box * one.p_labels[0][1] for one in detections]
    assert scores == sorted(scores, reverse=True) and scores[-1] >= 0.3
    for one in detections:
        assert all(p >= 0.5 * one.p_labels[0][1] for _, p in one.p_labels)
        assert 0 < sum(p for _, p in one.p_labels) <= 1 + 1e-9
    assert len(Detector(weights, threshold=0.01)(picture())) >= len(detections)


def test_nothing_above_the_threshold_is_no_error():
    assert Detector(untrained(), threshold=1.01)(picture()) == ()


def test_a_picture_gives_the_same_twice(detector):
    a, b = (detector.detect(picture()) for _ in "ab")
    assert np.array_equal(a.boxes, b.boxes) and np.array_equal(a.logits, b.logits)


def test_a_picture_twice_the_size_gives_boxes_twice_the_size(detector):
    small = picture(600, 800)
    large = np.repeat(np.repeat(small, 2, axis=0), 2, axis=1)
    a, b = detector.detect(small), detector.detect(large)
    np.testing.assert_allclose(2 * a.boxes[0], b.boxes[0], rtol=1e-3)


def test_depth_is_for_the_proposer_that_wants_it(detector):
    with_depth = detector.detect(picture(), np.ones((240, 320), np.float32))
    np.testing.assert_array_equal(with_depth.boxes, detector.detect(picture()).boxes)


def test_other_proposers_feed_the_same_head():
    color = np.full((240, 320, 3), 90, np.uint8)
    color[80:160, 120:220] = (220, 60, 40)
    scored = Detector(untrained(), proposer="edge_boxes").detect(color)
    assert len(scored.boxes) > 0


def test_classify_answers_box_by_box(detector):
    boxes = np.array([[10.0, 20, 60, 50], [100, 100, 90, 80]])
    both = detector.classify(picture(), boxes)
    np.testing.assert_allclose(both[1:], detector.classify(picture(), boxes[1:]), atol=1e-5)
    assert detector.classify(picture(), np.zeros((0, 4))).shape == (0, 4)


@pytest.mark.parametrize(
    ("color", "depth", "words"),
    [
        (np.zeros((240, 320), np.uint8), None, "expected .height, width, 3. RGB of 8 bits"),
        (np.zeros((240, 320, 4), np.uint8), None, "expected .height, width, 3. RGB of 8 bits"),
        (np.zeros((240, 320, 3), np.uint16), None, "uint16: expected"),
        (np.zeros((8, 320, 3), np.uint8), None, "320 x 8 pixels: expected at least 32 x 32"),
        (np.zeros((240, 320, 3), np.uint8), np.zeros((120, 160), np.float32), "expected the same size"),
    ],
)
def test_pictures_that_cannot_be_used(detector, color, depth, words):
    with pytest.raises(InputError, match=words):
        detector.detect(color, depth)


def test_unknown_proposer():
    with pytest.raises(InputError, match="proposer 'guess' is unknown: expected one of learned, edge_boxes"):
        Detector(untrained(), proposer="guess")


def test_threshold_of_the_weights_unless_told():
    weights = dataclasses.replace(untrained(), threshold=0.7)
    assert Detector(weights).threshold == 0.7
    assert Detector(weights, threshold=0.2).threshold == 0.2


def test_labels_that_are_not_asked_for_are_background(detector):
    """Of a catalogue of two, a box that shows anything else shows nothing."""
    two = Detector(untrained(), labels=(LABELS[2], LABELS[0]))
    boxes = np.array([[10.0, 10.0, 60.0, 60.0], [200.0, 100.0, 90.0, 50.0]])
    all_labels, chosen = detector.classify(picture(), boxes), two.classify(picture(), boxes)
    np.testing.assert_allclose(chosen[:, 1:], all_labels[:, [3, 1]])
    np.testing.assert_allclose(chosen.sum(1), 1)
    assert {label for one in two(picture()) for label, _ in one.p_labels} <= set(two.labels)


@pytest.mark.parametrize("size", [(160, 4096), (4096, 160), (33, 640)])
def test_boxes_of_a_long_picture_are_in_its_own_pixels(detector, size):
    color = np.random.default_rng(0).integers(0, 256, (*size, 3)).astype(np.uint8)
    boxes = detector.detect(color).boxes
    assert np.all(boxes[:, 2:] >= 4)
    assert np.all(boxes[:, :2] >= 0)
    assert np.all(boxes[:, :2] + boxes[:, 2:] <= [size[1], size[0]])


def test_a_picture_of_any_shape_is_seen_as_its_part_of_a_larger_one():
    """A picture of 720 lines, halved, ends within a cell of the network: it must see no worse for that."""
    rng = np.random.default_rng(0)
    small = rng.integers(0, 256, (30, 40, 3)).astype(np.uint8)
    large = np.repeat(np.repeat(small, 20, 0), 20, 1)  # 600 x 800
    box = np.array([[40.0, 40.0, 80.0, 60.0]])
    detector = Detector(untrained())
    np.testing.assert_allclose(detector.classify(large[:450], box), detector.classify(large, box), atol=1e-5)
