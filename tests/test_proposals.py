"""Boxes: overlap, suppression, order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.detection.proposals import Proposals, make_proposals, nms
from sum_drake.geometry import iou

boxes = st.lists(
    st.tuples(*[st.floats(-50, 50)] * 2, *[st.floats(0, 60)] * 2).map(lambda b: tuple(float(v) for v in b)), max_size=12
)


@given(boxes, st.floats(0, 1), st.randoms(use_true_random=False))
def test_nms_keeps_what_no_better_kept_box_overlaps(candidates, threshold, random):
    scores = np.array([random.randint(0, 5) for _ in candidates], dtype=float)
    kept = nms(candidates, scores, threshold)
    assert list(scores[kept]) == sorted(scores[kept], reverse=True)
    overlaps = iou(np.reshape(candidates, (-1, 4))[kept], np.reshape(candidates, (-1, 4)))
    assert np.all(overlaps[:, kept][np.triu_indices(len(kept), 1)] <= threshold)
    for dropped in set(range(len(candidates))) - set(kept.tolist()):
        better = scores[kept] >= scores[dropped]
        assert np.any(overlaps[better, dropped] > threshold)


def test_nms_of_equal_boxes_and_scores_keeps_the_first():
    assert nms([[0, 0, 5, 5], [0, 0, 5, 5], [20, 0, 5, 5]], [1, 1, 2], 0.5).tolist() == [2, 0]


def test_proposals_come_best_first_and_cannot_be_changed():
    proposals = make_proposals([[0, 0, 1, 1], [1, 1, 2, 2], [2, 2, 3, 3]], [0.1, 0.9, 0.9])
    assert proposals.boxes[:, 0].tolist() == [1, 2, 0]
    assert proposals.best(2).scores.tolist() == [0.9, 0.9]
    with pytest.raises(ValueError, match="read-only"):
        proposals.boxes[0, 0] = 7
    with pytest.raises(ValueError, match=r"expected \(n, 4\)"):
        Proposals(np.zeros((2, 3)), np.zeros(2))


def test_no_box_at_all():
    proposals = make_proposals([], [])
    assert len(proposals) == 0
    assert proposals.boxes.shape == (0, 4)
    assert nms(proposals.boxes, proposals.scores, 0.5).shape == (0,)
    assert iou(proposals.boxes, [[0, 0, 1, 1]]).shape == (0, 1)
