import dataclasses

import numpy as np
import pytest
from scenes import X_WC, observe, standing

from sum_drake.estimates import draw_estimates, estimate_frame, estimates_table
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.frame_folder import LabelledBox
from sum_drake.geometry import inverse, pose_error
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.types import readonly

PACKAGE = load_catalogue()
FAST = FilterConfig(particles=800, particles_last=100, iterations=5, warmup=3)


@pytest.fixture(scope="module")
def catalogue():
    return Catalogue(PACKAGE.path, (PACKAGE["soup_can"], PACKAGE["tide"]))


@pytest.fixture(scope="module")
def seen(catalogue):
    X_WOs = {"soup_can": standing(PACKAGE, "soup_can", 0.55, -0.12), "tide": standing(PACKAGE, "tide", 0.6, 0.1, 0.4)}
    frame, boxes = observe(PACKAGE, X_WOs)
    depth = frame.depth.copy()
    depth[:20, :20] = 0
    return dataclasses.replace(frame, depth=readonly(depth, np.float32)), boxes, X_WOs


@pytest.fixture(scope="module")
def estimates(catalogue, seen):
    frame, boxes, _ = seen
    asked = [
        LabelledBox("tide", boxes["tide"], 0.9),
        LabelledBox("unicorn", boxes["tide"], 0.9),
        LabelledBox("soup_can", (10.0, 10.0, 0.0, 5.0), 0.9),
        LabelledBox("soup_can", (900.0, 10.0, 50.0, 50.0), 0.9),
        LabelledBox("soup_can", (0.0, 0.0, 18.0, 18.0), 0.9),
        LabelledBox("soup_can", boxes["soup_can"], 0.9),
    ]
    return estimate_frame(frame, asked, catalogue, PoseEstimator(catalogue, FAST), seed=3)


def test_objects_are_where_they_are_in_the_cameras_frame(estimates, seen):
    for one in (estimates[0], estimates[-1]):
        p, angle = pose_error(one.X_CO, inverse(X_WC) @ seen[2][one.label], PACKAGE[one.label].symmetry)
        assert p < 0.01
        assert angle < np.deg2rad(10)
        assert one.accepted
        assert one.message == ""
        assert 0 < one.translation_std_m < 0.02


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_depth_of_another_unit_is_refused(catalogue, seen, scale):
    frame, boxes, _ = seen
    frame = dataclasses.replace(frame, depth=readonly(scale * frame.depth, np.float32))
    asked = [LabelledBox(label, box, 0.9) for label, box in boxes.items()]
    for one in estimate_frame(frame, asked, catalogue, PoseEstimator(catalogue, FAST), seed=0):
        assert one.probability == 0
        assert "times as large as the object; expected a box about it, and depth" in one.message


def test_boxes_of_nothing_say_why_and_are_not_believed(estimates):
    told = [one.message for one in estimates[1:-1]]
    for message, words in zip(
        told, ("no 'unicorn'; expected one of soup_can", "empty", "outside", "no depth"),
        strict=True,
    ):  # fmt: skip
        assert words in message
    for one in estimates[1:-1]:
        assert (one.probability, one.accepted, one.score) == (0.0, False, 0.0)
        assert np.isfinite(one.X_CO).all()
        np.testing.assert_allclose(one.X_CO[3], [0, 0, 0, 1])


def test_a_seed_is_a_result(catalogue, seen):
    frame, boxes, _ = seen
    asked = [LabelledBox("soup_can", boxes["soup_can"], 0.9)]
    estimator = PoseEstimator(catalogue, FAST)
    one, same, other = (estimate_frame(frame, asked, catalogue, estimator, seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.X_CO, same.X_CO)
    assert not np.array_equal(one.X_CO, other.X_CO)


def test_table_and_picture_show_all(estimates, catalogue, seen):
    lines = estimates_table(estimates).splitlines()
    assert len(lines) == 1 + len(estimates)
    assert "outside" in lines[4]
    assert estimates_table([]) == "nothing detected"
    frame = seen[0]
    picture = draw_estimates(frame, estimates, catalogue)
    assert picture.shape == (4 * frame.camera.height, 4 * frame.camera.width, 3)
    assert (picture != draw_estimates(frame, [], catalogue)).any()
