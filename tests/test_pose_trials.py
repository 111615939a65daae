"""The paper's single scenes: which boxes count, and what is shown of false positives."""

import numpy as np
from test_drawing import make_perception

from sum_drake.bench import pose_trials
from sum_drake.bench.pose_figures import PoseRow, figures
from sum_drake.bench.pose_trials import Corrected, trial_scene, true_positive
from sum_drake.bench.pose_trials_report import corrected_sheet, papers_part
from sum_drake.detection.inference import load_detector
from sum_drake.geometry import iou
from sum_drake.objects import load_catalogue
from sum_drake.rendering import DepthRenderer, predicted_box
from sum_drake.types import Detection

CATALOGUE = load_catalogue()
TRUE = (100.0, 100.0, 50.0, 50.0)


def boxed(x: float, *p_labels: tuple[str, float]) -> Detection:
    return Detection((x, 100.0, 50.0, 50.0), 0.9, p_labels)


def test_a_true_positive_has_the_label_first_and_is_where_the_object_is():
    near, nearer, far = boxed(110.0, ("mug", 0.9)), boxed(105.0, ("mug", 0.6), ("toy", 0.4)), boxed(120.0, ("mug", 1.0))
    assert true_positive([far, near, nearer], "mug", TRUE) == nearer.box
    assert true_positive([far], "mug", TRUE) is None, "half of either is not an intersection over union of a half"
    assert true_positive([near, nearer], "toy", TRUE) is None, "the likeliest label counts"
    assert true_positive([], "mug", TRUE) is None


def test_the_detectors_boxes_are_about_what_is_seen_of_the_objects():
    exact = DepthRenderer(CATALOGUE, faces=20_000)
    scene = trial_scene(CATALOGUE, exact, load_detector(None, labels=CATALOGUE.labels), pose_trials.FIRST)
    assert len(scene.instances) >= 4
    overlaps = []
    for one in scene.instances:
        whole = predicted_box(np.asarray(CATALOGUE[one.label].load_mesh().vertices), one.X_WO, scene.frame)
        overlaps.append((one.visible_share, iou(one.box, whole)[0, 0]))
    whole_ones = [overlap for share, overlap in overlaps if share > 0.95]
    assert len(whole_ones) >= 2 and min(whole_ones) > 0.5, overlaps
    assert all(overlap > 0.3 * share for share, overlap in overlaps), overlaps


def test_looks_with_the_most_false_positives_are_shown_in_three_pictures():
    record = make_perception(0, CATALOGUE)
    row = PoseRow("default", 1, "mug", 0, "stereo", 1.0, False, 0.004, 3.0, 90.0, 0.002, 0.9, 0.8, 9, [], detected=True)
    looks = [Corrected(record, false, max(false - 1, 0), 1) for false in (0, 1, 2, 5, 3)]
    counted = pose_trials.corrected(looks)
    assert counted == {
        "trials.false_positives": 11, "trials.false_positives_rejected": 7, "trials.accepted_wrong": 5,
    }  # fmt: skip
    assert pose_trials.corrected([]) == {}
    html = "".join(papers_part([row], figures([row]), looks, "", CATALOGUE))
    assert html.count("<figure>") == 3 * 3 and html.count(">rotation bound, degrees<") == 4
    assert "7 of 11 hypotheses" in html and "5 accepted ones are wrong" in html
    assert html.index("4 of 5 false") < html.index("2 of 3 false") < html.index("1 of 2 false")
    assert "0 of 1 false" not in html
    assert corrected_sheet(looks[:1], CATALOGUE) is None, "nothing was false in it"
    sheet = corrected_sheet(looks, CATALOGUE)
    h, w = record.frame.color.shape[:2]
    assert sheet.shape[1] == 3 * (w + 4) and 3 * h < sheet.shape[0] < 3 * h + 60
    detections, hypotheses, accepted = np.hsplit(sheet[-h - 2 : -2], 3)
    assert (hypotheses != accepted).any() and (detections != hypotheses).any(), "what is rejected is in the second"
    left_out = "".join(papers_part([], {}, [], "detector.safetensors: knows <15> labels", CATALOGUE))
    assert "knows &lt;15&gt; labels" in left_out and "<svg" not in left_out
