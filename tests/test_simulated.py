import numpy as np
import pytest

from sum_drake.detection.simulated import SimulatedDetectorConfig, simulate_detections

LABELS = ("mug", "sugar", "tide", "toy")
PERFECT = SimulatedDetectorConfig(
    miss_rate=0.0, box_jitter=0.0, wrong_label_rate=0.0, true_label_lost_rate=0.0, false_boxes=0.0
)


@pytest.fixture
def label_image():
    image = np.zeros((480, 640), np.int16)
    image[100:150, 200:260] = 7
    image[300:400, 50:90] = 9
    image[10:12, 10:12] = 11
    return image


def detect(image, config, seed=0, sigma_c=0.1):
    objects = {9: "sugar", 7: "mug", 11: "toy"}
    return simulate_detections(image, objects, LABELS, sigma_c=sigma_c, config=config, rng=np.random.default_rng(seed))


def test_without_errors_boxes_are_exact_and_tiny_objects_unseen(label_image):
    detections = detect(label_image, PERFECT)
    assert [d.box for d in detections] == [(200, 100, 60, 50), (50, 300, 40, 100)]
    assert [d.p_labels[0][0] for d in detections] == ["mug", "sugar"]


def test_error_rates_are_those_that_were_set(label_image):
    config = SimulatedDetectorConfig(miss_rate=0.2, wrong_label_rate=0.3, false_boxes=0.5)
    runs = [detect(label_image, config, seed) for seed in range(600)]
    boxes = sum(len(run) for run in runs) / 600
    assert boxes == pytest.approx(2 * 0.8 + 0.5, abs=0.1)
    near_mug = [d for run in runs for d in run if abs(d.box[0] - 200) < 15 and abs(d.box[1] - 100) < 15]
    wrong = np.mean([d.p_labels[0][0] != "mug" for d in near_mug])
    assert wrong == pytest.approx(0.3, abs=0.06)


def test_boxes_stay_in_the_picture_and_confidences_are_a_distribution(label_image):
    wild = SimulatedDetectorConfig(box_jitter=0.5, false_boxes=3.0, wrong_label_rate=0.5)
    for seed in range(50):
        for detection in detect(label_image, wild, seed):
            x, y, w, h = detection.box
            assert 0 <= x < x + w <= 640
            assert 0 <= y < y + h <= 480
            confidences = [p for _, p in detection.p_labels]
            assert confidences == sorted(confidences, reverse=True)
            assert 0 < sum(confidences) <= 1
            assert len({label for label, _ in detection.p_labels}) == len(detection.p_labels)


def test_same_seed_same_errors(label_image):
    config = SimulatedDetectorConfig()
    assert detect(label_image, config, 3) == detect(label_image, config, 3)
    assert detect(label_image, config, 3) != detect(label_image, config, 4)
