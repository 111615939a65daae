"""Training pictures made anew: boxes stay on what they are the boxes of."""

import numpy as np
import pytest

from sum_drake.detection.augmentation import CROP, augment

BOXES = np.array([[100.0, 100, 60, 80], [400, 300, 100, 40], [610, 10, 30, 40]])
SHADES = (250, 160, 80)


def picture():
    color = np.zeros((480, 640, 3), np.uint8)
    for (x, y, w, h), shade in zip(BOXES.astype(int), SHADES, strict=True):
        color[y : y + h, x : x + w] = shade
    return color


@pytest.mark.parametrize("seed", range(60))
def test_boxes_stay_tight(seed):
    """Row and column through a box's middle are of one shade exactly from side to side."""
    example = augment(picture(), BOXES, np.array([1, 2, 3]), np.ones(3, bool), np.random.default_rng(seed))
    grey = example.color.astype(float).mean(2)
    for x, y, w, h in example.boxes:
        u, v = int(x + w / 2), int(y + h / 2)
        for line, at, low, high in ((grey[v], u, x, x + w), (grey[:, u], v, y, y + h)):
            same = np.abs(line - line[at]) < max(10.0, 0.15 * line[at])
            first = at - np.argmin(np.append(same[: at + 1][::-1], False)) + 1
            last = at + np.argmin(np.append(same[at:], False))
            assert abs(first - low) < 2.5 and abs(last - high) < 2.5


def test_objects_that_are_hardly_visible_or_cut_off_are_left_out():
    left_out = 0
    for seed in range(60):
        example = augment(
            picture(), BOXES, np.array([1, 2, 3]), np.array([True, True, False]), np.random.default_rng(seed)
        )
        assert 3 not in example.classes
        assert len(example.boxes) == len(example.classes)
        left_out += len(example.ignored)
    assert left_out > 0


def test_every_object_is_seen_in_some_cut_out():
    seen = set()
    for seed in range(40):
        example = augment(picture(), BOXES, np.array([1, 2, 3]), np.ones(3, bool), np.random.default_rng(seed))
        assert example.color.shape == (CROP, CROP, 3)
        seen |= set(example.classes.tolist())
    assert seen == {1, 2, 3}


def test_picture_without_objects():
    example = augment(picture(), np.zeros((0, 4)), np.zeros(0, np.int64), np.zeros(0, bool), np.random.default_rng(0))
    assert len(example.boxes) == len(example.ignored) == 0


def test_a_seed_gives_one_picture():
    a, b = (augment(picture(), BOXES, np.array([1, 2, 3]), np.ones(3, bool), np.random.default_rng(5)) for _ in "ab")
    assert np.array_equal(a.color, b.color) and np.array_equal(a.boxes, b.boxes)
