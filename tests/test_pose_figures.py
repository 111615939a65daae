import dataclasses

import numpy as np
import pytest

from sum_drake.bench.aims import aim, format_figures
from sum_drake.bench.pose_figures import AIMS, PoseRow, adds, curve, errors, figures
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import load_catalogue

CATALOGUE = load_catalogue()
RIGHT = PoseRow("default", 1000, "mug", 0, "stereo", 1.0, False, 0.004, 3.0, 90.0, 0.002, 0.9, 0.8, 9, [])


def test_shares_are_of_instances_in_their_own_boxes():
    rows = [
        RIGHT,
        dataclasses.replace(RIGHT, translation_m=0.015, visible_share=0.5, sensor="structured_light"),
        dataclasses.replace(RIGHT, rotation_deg=25.0, visible_share=0.4),
        dataclasses.replace(RIGHT, translation_m=0.3, adds_m=0.2),
        dataclasses.replace(RIGHT, wrong_box=True, translation_m=0.3, probability=0.2),
    ]
    found = figures(rows)
    assert found["default.within_1cm_10deg"] == 1 / 4
    assert found["default.within_2cm_20deg"] == 2 / 4
    assert found["default.within_5cm_30deg"] == 3 / 4
    assert found["default.raw_within_5cm_30deg"] == 0
    assert found["default.within_2cm_20deg_low_visibility"] == 1 / 2
    assert found["default.within_2cm_20deg_stereo"] == 1 / 3
    assert found["default.adds_auc"] == pytest.approx((3 * 0.98 + 0) / 4)
    assert found["default.mean_probability_in_wrong_boxes"] == pytest.approx(0.2)
    assert found["default.mean_probability"] == pytest.approx((4 * 0.9 + 0.2) / 5)
    assert found["default.brier"] == pytest.approx((2 * 0.01 + 2 * 0.81 + 0.04) / 5)
    assert found["default.brier_of_the_mean"] == pytest.approx(0.4 * 0.6)
    assert found["default.calibration_error"] == pytest.approx((4 * 0.4 + 0.2) / 5)
    assert found["default.cpu_s_per_object"] == pytest.approx(0.8)
    assert aim(AIMS, "default.within_1cm_10deg", 0.25).endswith("missed")
    assert "at most 1: reached" in format_figures(found, AIMS)


def test_the_papers_experiment_is_told_apart_with_a_lead_and_how_sure_it_is():
    good = [
        dataclasses.replace(RIGHT, method="default", scene=scene, rotation_deg=0.0, detected=True) for scene in range(4)
    ]
    poor = [dataclasses.replace(row, method="fpfh", translation_m=0.03 * row.scene) for row in good]
    worse = [dataclasses.replace(row, method="fpfh_icp", translation_m=0.5) for row in good]
    found = figures([dataclasses.replace(RIGHT, translation_m=0.3), *good, *poor, *worse])
    assert found["default.within_2cm_20deg"] == 0 and found["trials.default.within_2cm_20deg"] == 1
    assert (found["trials.scenes"], found["trials.true_positives"]) == (4, 4)
    one_of_90 = 1 / 91  # nothing is within 0 degrees
    assert found["trials.default.area_1cm"] == pytest.approx(1 - one_of_90)
    assert found["trials.fpfh.area_1cm"] == pytest.approx(0.25 * (1 - one_of_90))
    assert found["trials.lead_1cm"] == pytest.approx(0.75 * (1 - one_of_90))
    assert 0.25 * (1 - one_of_90) <= found["trials.lead_1cm_low95"] < found["trials.lead_1cm"]
    assert found["trials.lead_10cm"] == pytest.approx(0.0), "the best of the others"
    for metres, told in ((1, "reached"), (10, "missed")):
        name = f"trials.lead_{metres}cm_low95"
        assert told in aim(AIMS, name, found[name])
    assert not [name for name in figures([RIGHT]) if name.startswith("trials")]


def test_curves_of_the_papers_plots_rise_to_the_share_within_the_translation_bound():
    rows = [RIGHT, dataclasses.replace(RIGHT, rotation_deg=100.0), dataclasses.replace(RIGHT, translation_m=0.3)]
    np.testing.assert_allclose(curve(rows, 0.01, np.array([1.0, 10.0, 90.0, 180.0])), [0, 1 / 3, 1 / 3, 2 / 3])
    assert np.isnan(curve([], 0.01, np.array([1.0]))).all()


def test_errors_of_a_symmetric_object():
    model = CATALOGUE["soup_can"]
    turned = transform(rotation_from_vector(np.array([0, 0, 2.0])), np.zeros(3))
    shift, angle, raw, distance = errors(model, turned, np.eye(4))
    assert shift == 0
    assert angle == pytest.approx(0, abs=1e-5)
    assert raw == pytest.approx(np.degrees(2.0))
    assert distance < 0.004, "as far as samples of one surface are from each other"


def test_adds_is_how_far_the_surface_moved():
    model = CATALOGUE["tide"]
    assert adds(model, np.eye(4), np.eye(4)) == 0
    far = transform(np.eye(3), np.array([0.0, 0.0, 1.0]))
    assert 0.7 < adds(model, np.eye(4), far) < 1.0
