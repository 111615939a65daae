import numpy as np
import pytest

from sum_drake.detection.listing import detection_rows, detection_table, draw_detections
from sum_drake.types import Detection

LABELS = ("tide", "mug", "toy")
SURE = Detection((20.0, 30.0, 40.0, 50.0), 0.9, (("mug", 0.8), ("toy", 0.1)))
DOUBTFUL = Detection((100.0, 20.0, 30.0, 30.0), 0.5, (("tide", 0.6),))


def test_rows_have_what_a_frame_folder_needs_and_the_rivals():
    first, second = detection_rows([SURE, DOUBTFUL])
    assert first == {
        "label": "mug", "box": [20.0, 30.0, 40.0, 50.0], "score": pytest.approx(0.72), "p_box": 0.9,
        "p_labels": {"mug": 0.8, "toy": 0.1},
    }  # fmt: skip
    assert second["label"] == "tide"
    assert detection_rows([]) == []


def test_the_table_has_a_line_a_detection():
    head, first, second = detection_table([SURE, DOUBTFUL]).splitlines()
    assert head.split()[:2] == ["label", "score"]
    assert first.split()[:3] == ["mug", "0.72", "0.90"]
    assert first.endswith("toy 0.10")
    assert second.startswith("tide")
    assert detection_table([]) == "nothing detected"


def test_boxes_are_drawn_on_a_copy_where_they_are():
    picture = np.full((120, 160, 3), 128, np.uint8)
    drawn = draw_detections(picture, [SURE, DOUBTFUL], LABELS)
    assert (picture == 128).all()
    changed = (drawn != 128).any(2)
    assert changed[30:80, 20].all(), "left side of the first box"
    assert changed[20, 100:130].all(), "top of the second"
    assert not changed[85:].any()
    assert not changed[40:70, 30:50].any(), "what is inside stays to be seen"
    np.testing.assert_array_equal(draw_detections(picture, [], LABELS), picture)
