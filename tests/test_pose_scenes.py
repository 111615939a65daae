import numpy as np
import pytest

from sum_drake.bench.pose_scenes import JITTER, LEAST_VISIBLE, other_meshes, pose_scene
from sum_drake.geometry import inverse, iou
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import DepthRenderer, predicted_box

CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def renderer() -> DepthRenderer:
    return DepthRenderer(CATALOGUE, faces=20_000)


@pytest.fixture(scope="module")
def scene(renderer: DepthRenderer):
    return pose_scene(CATALOGUE, renderer, 1000)


def test_a_scene_is_a_function_of_its_seed(scene, renderer):
    again, other = pose_scene(CATALOGUE, renderer, 1000), pose_scene(CATALOGUE, renderer, 1001)
    np.testing.assert_array_equal(scene.frame.depth, again.frame.depth)
    assert [one.box for one in scene.instances] == [one.box for one in again.instances]
    tuning = pose_scene(CATALOGUE, renderer, 1)
    assert (scene.sensor, other.sensor, tuning.sensor) == ("structured_light", "wide_stereo", "stereo")
    assert not np.array_equal(scene.frame.depth, other.frame.depth)


def test_instances_are_where_the_depth_says(scene):
    """What is measured in an unoccluded object's box is mostly on its surface."""
    assert scene.instances
    for one in scene.instances:
        assert one.visible_share >= LEAST_VISIBLE
        box = predicted_box(np.asarray(CATALOGUE[one.label].load_mesh().vertices), one.X_WO, scene.frame)
        if not one.wrong_box and one.visible_share > 0.99:
            assert iou(one.box, box)[0, 0] > (1 - 2 * JITTER) ** 2
            middle = (inverse(scene.frame.X_WC) @ one.X_WO)[2, 3]
            x, y, w, h = (int(side) for side in box)
            seen = scene.frame.depth[y + h // 2 - 2 : y + h // 2 + 3, x + w // 2 - 2 : x + w // 2 + 3]
            size = float(np.linalg.norm(CATALOGUE[one.label].dimensions))
            assert abs(np.median(seen[seen > 0]) - middle) < size


def test_boxes_are_off_and_some_are_of_others(renderer):
    scenes = [pose_scene(CATALOGUE, renderer, seed) for seed in range(1000, 1012)]
    instances = [one for scene in scenes for one in scene.instances]
    assert 0 < sum(one.wrong_box for one in instances) < 0.25 * len(instances)


def test_other_meshes_are_a_little_off_and_coarser(tmp_path):
    few = Catalogue(CATALOGUE.path, (CATALOGUE["mug"], CATALOGUE["tide"]))
    told = other_meshes(few, tmp_path, 0)
    assert told.labels == few.labels
    for label in few.labels:
        true, other = few[label].load_mesh(), told[label].load_mesh()
        assert len(other.faces) <= 1000
        assert 0.96 < np.linalg.norm(other.extents) / np.linalg.norm(true.extents) < 1.06
        assert told[label].symmetry is few[label].symmetry
        middle = np.asarray(true.vertices).mean(0)
        assert np.linalg.norm(np.asarray(other.vertices).mean(0) - middle) < 0.02
