"""Pictures as a detector scored them, for tests of its figures."""

import numpy as np
from hypothesis import strategies as st

from sum_drake.detection.metrics import ScoredImage

LABELS = ("mug", "toy", "tide")
K = len(LABELS)


def probabilities(label, p):
    """A row that gives class `label` the probability p, and leaves the rest to background."""
    row = np.zeros(1 + K)
    row[0], row[label] = 1 - p, p
    return row


def image(objects=(), boxes=(), name="test/0/0"):
    """Of objects (box, class[, scored[, share]]) and boxes (box, class, score); true boxes are recognised."""
    objects = [(*one, *(True, 1.0)[len(one) - 2 :]) for one in objects]
    return ScoredImage(
        name=name,
        boxes=np.reshape([box for box, _, _ in boxes], (-1, 4)).astype(float),
        probabilities=np.reshape([probabilities(label, p) for _, label, p in boxes], (-1, 1 + K)),
        true_boxes=np.reshape([one[0] for one in objects], (-1, 4)).astype(float),
        true_classes=np.array([one[1] for one in objects], np.int64),
        scored=np.array([one[2] for one in objects], bool),
        visible_shares=np.array([one[3] for one in objects], float),
        true_probabilities=np.reshape([probabilities(one[1], 0.9) for one in objects], (-1, 1 + K)),
    )


A, B, C = (0, 0, 10, 10), (100, 0, 10, 10), (200, 0, 10, 10)
NEAR_A = (0, 0, 10, 6)
"""Overlaps A by .6."""
FAR = (300, 300, 10, 10)


def scenes_of(seed):
    """A few scenes as (objects, boxes): objects apart from each other, boxes that are theirs, nearly, or nobody's."""
    rng = np.random.default_rng(seed)

    def box(place):
        return (60 * int(place), 0, *(int(side) for side in rng.integers(4, 40, 2)))

    scenes = []
    for _ in range(rng.integers(1, 5)):
        places = rng.permutation(12)[: rng.integers(0, 6)]
        objects = [(box(place), int(rng.integers(1, 1 + K)), bool(rng.random() < 0.7)) for place in places]
        boxes = []
        for _ in range(rng.integers(0, 12)):
            at = objects[rng.integers(len(objects))] if objects and rng.random() < 0.6 else (box(rng.integers(12)), 0)
            label = at[1] if at[1] and rng.random() < 0.7 else int(rng.integers(1, 1 + K))
            boxes.append((at[0], label, float(rng.choice([0.1, 0.3, 0.5, 0.9, 1.0]))))
        scenes.append((objects, boxes))
    return scenes


many = st.integers(0, 2**32 - 1).map(scenes_of)


def shuffled(drawn, random):
    """The pictures of scenes in another order, and so their objects and boxes."""

    def mixed(items):
        return random.sample(list(items), len(items))

    return [image(mixed(objects), mixed(boxes)) for objects, boxes in mixed(drawn)]
