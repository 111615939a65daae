"""The detector that comes with the package, on a few pictures of the test splits: no training saw their scenes.

`sum-drake bench detect` measures it on hundreds; here is what no change may break.
"""

import hashlib

import numpy as np
import pytest

from sum_drake.detection import metrics
from sum_drake.detection.dataset_scenes import render_empty_station, render_scene
from sum_drake.detection.evaluation import evaluate
from sum_drake.detection.inference import Detector, load_detector
from sum_drake.detection.weights import DEFAULT
from sum_drake.objects import load_catalogue

CATALOGUE = load_catalogue()
SCENES = range(8)
"""Of each split."""


@pytest.fixture(scope="module")
def detector() -> Detector:
    return load_detector(labels=CATALOGUE.labels)


@pytest.mark.parametrize("split", ["test", "shift"])
def test_most_objects_are_found_and_little_else(detector: Detector, split: str) -> None:
    images = evaluate(detector, [render_scene(CATALOGUE, split, 0, i, 1)[0] for i in SCENES])
    at = metrics.operating_point(images, detector.threshold)
    assert at.recall >= 0.88
    assert at.false_positives_per_image <= 1.4
    assert metrics.top1(images) >= 0.87


def test_an_empty_table_gives_no_detections(detector: Detector) -> None:
    for image in render_empty_station(CATALOGUE, 7, 3):
        assert image.objects == ()
        assert detector(image.color, image.depth) == ()


@pytest.mark.parametrize("level", [0, 90, 255])
def test_a_picture_of_nothing_gives_no_detections(detector: Detector, level: int) -> None:
    assert detector(np.full((480, 640, 3), level, np.uint8)) == ()


def test_the_card_is_of_these_weights() -> None:
    assert hashlib.sha256(DEFAULT.read_bytes()).hexdigest() in DEFAULT.with_suffix(".md").read_text()
