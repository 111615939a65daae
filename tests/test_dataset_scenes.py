import dataclasses
import threading
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box, Rgba
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectives

from sum_drake import robot
from sum_drake.assets import MODELS, InputError
from sum_drake.detection import dataset_scenes
from sum_drake.detection.arrangement import TABLE, Ground
from sum_drake.detection.dataset import AnnotatedImage, AnnotatedObject, EncodedImage, scene_entropy
from sum_drake.detection.dataset_scenes import _draw_scene, _Scene, render_encoded, render_scene
from sum_drake.detection.looks import draw_look
from sum_drake.detection.scene_rendering import Part, SceneRenderer, home_state, station_ground, station_parts
from sum_drake.geometry import apply, inverse
from sum_drake.look import station_look
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import predicted_box
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, back_project, make_camera
from sum_drake.systems.pouring import PouringConfig
from sum_drake.systems.station import default_plant_config, make_station
from sum_drake.types import Array, Camera, Frame, readonly
from sum_drake.visual_mesh import visual_mesh

CAMERA = make_camera(HeadCameraConfig())
X_WC = robot.camera_pose(home_state())
GROUND = Ground(np.array([0.72, 0.0]), np.array([0.3, 0.45]), np.array([0.6, 0.0]), np.array([0.15, 0.2]))
TOP = Part(Box(0.6, 0.9, 0.04), RigidTransform([0.72, 0.0, TABLE - 0.02]), Rgba(0.5, 0.4, 0.3, 1.0))


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def standing(catalogue: Catalogue, label: str, x: float, y: float) -> Array:
    X_WO = np.eye(4)
    X_WO[:3, 3] = x, y, TABLE - catalogue[label].load_mesh().bounds[0, 2]
    return X_WO


def scene_of(catalogue: Catalogue, X_WOs: dict[str, Array], *parts: Part) -> _Scene:
    objects = tuple((label, visual_mesh(catalogue[label]), X_WO) for label, X_WO in X_WOs.items())
    return _Scene(objects, (TOP, *parts), station_look(), False, False, GROUND)


def annotate(catalogue: Catalogue, scene: _Scene, camera: Camera = CAMERA) -> dict[str, AnnotatedObject]:
    labels = SceneRenderer(scene).labels(camera, X_WC)
    return {o.label: o for o in dataset_scenes._annotate(scene, labels, camera, X_WC, catalogue)}


# --- annotation ------------------------------------------------------------------------------------------------------


def test_boxes_are_those_of_the_projected_meshes(catalogue: Catalogue) -> None:
    X_WOs = {
        "mug": standing(catalogue, "mug", 0.6, 0.0),
        "tide": standing(catalogue, "tide", 0.7, 0.25),
        "banana": standing(catalogue, "banana", 0.5, -0.2),
        "spray_bottle": standing(catalogue, "spray_bottle", 0.75, -0.25),
    }
    found = annotate(catalogue, scene_of(catalogue, X_WOs))
    assert list(found) == list(X_WOs)
    frame = Frame(0, readonly([], np.uint8), readonly([], np.float32), CAMERA, readonly(X_WC))
    for label, X_WO in X_WOs.items():
        expected = predicted_box(np.asarray(catalogue[label].load_mesh().vertices), X_WO, frame)
        np.testing.assert_allclose(found[label].box, expected, atol=1.01, err_msg=label)
        assert found[label].visible_share > 0.98
        w, h = found[label].box[2:]
        assert 0.2 * w * h < found[label].pixels <= w * h


def test_what_stands_before_an_object_lowers_its_visible_share_and_shrinks_its_box(catalogue: Catalogue) -> None:
    X_WOs = {"sugar": standing(catalogue, "sugar", 0.65, 0.0)}
    whole = annotate(catalogue, scene_of(catalogue, X_WOs))["sugar"]
    # A board that hides the half with y > 0 from this camera, whose x axis is W's -y.
    board = Part(Box(0.01, 0.5, 0.6), RigidTransform([0.5, 0.25, TABLE + 0.3]), Rgba(0.2, 0.2, 0.2, 1.0))
    half = annotate(catalogue, scene_of(catalogue, X_WOs, board))["sugar"]
    assert whole.visible_share > 0.98
    assert half.visible_share == pytest.approx(half.pixels / whole.pixels, abs=0.02)
    assert 0.3 < half.visible_share < 0.7
    assert half.box[0] > whole.box[0] + 5 and half.box[0] + half.box[2] == whole.box[0] + whole.box[2]


def test_what_the_border_cuts_off_counts_as_hidden(catalogue: Catalogue) -> None:
    distance = apply(inverse(X_WC), np.array([[0.65, 0.0, TABLE + 0.1]]))[0, 2]
    y = CAMERA.cx * distance / CAMERA.fx  # Its middle is on the picture's left border.
    scene = scene_of(catalogue, {"sugar": standing(catalogue, "sugar", 0.65, y)})
    margin = 200
    wide = dataclasses.replace(CAMERA, width=CAMERA.width + 2 * margin, cx=CAMERA.cx + margin)
    whole, cut = annotate(catalogue, scene, wide)["sugar"], annotate(catalogue, scene)["sugar"]
    assert whole.visible_share > 0.98
    assert cut.box[0] == 0.0 and cut.box[2] == whole.box[0] + whole.box[2] - margin
    assert cut.visible_share == pytest.approx(cut.pixels / whole.pixels, abs=0.02)
    assert 0.3 < cut.visible_share < 0.7


def test_what_is_fully_hidden_or_out_of_the_picture_is_not_annotated(catalogue: Catalogue) -> None:
    X_WOs = {"mug": standing(catalogue, "mug", 0.6, 0.0), "tea": standing(catalogue, "tea", 0.6, 3.0)}
    board = Part(Box(0.01, 0.5, 1.0), RigidTransform([0.5, 0.0, TABLE + 0.3]), Rgba(0.2, 0.2, 0.2, 1.0))
    assert annotate(catalogue, scene_of(catalogue, X_WOs, board)) == {}


def test_depth_and_camera_agree(catalogue: Catalogue) -> None:
    """The table's top, back-projected, is a plane at its height."""
    depth = SceneRenderer(scene_of(catalogue, {})).depth(CAMERA, X_WC)
    points = apply(X_WC, back_project(depth, CAMERA).reshape(-1, 3))[depth.reshape(-1) > 0]
    inside = (np.abs(points[:, :2] - GROUND.center) < GROUND.half - 0.02).all(axis=1)
    assert inside.sum() > 50_000
    np.testing.assert_allclose(points[inside, 2], TABLE, atol=5e-4)


def test_every_object_of_the_catalogue_is_drawn_with_its_texture(catalogue: Catalogue) -> None:
    places = [(x, y) for x in (0.48, 0.65, 0.85) for y in (-0.3, -0.15, 0.0, 0.15, 0.3)]
    X_WOs = {label: standing(catalogue, label, *p) for label, p in zip(catalogue.labels, places, strict=True)}
    renderer = SceneRenderer(scene_of(catalogue, X_WOs))
    color, labels = renderer.color(CAMERA, X_WC), renderer.labels(CAMERA, X_WC)
    for i, label in enumerate(catalogue.labels):
        pixels = color[labels == i + 1]
        assert len(pixels) > 150, label
        assert pixels.mean() > 0.1 and pixels.std(axis=0).max() > 0.06, label


# --- the station -----------------------------------------------------------------------------------------------------


def test_the_station_is_drawn_as_its_own_camera_sees_it(catalogue: Catalogue) -> None:
    X_WOs = {"mug": standing(catalogue, "mug", 0.6, 0.0), "tide": standing(catalogue, "tide", 0.65, 0.2)}
    station = make_station(
        plant_config=default_plant_config(),
        directives=LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml")).directives,
        camera=HeadCameraConfig(),
        noise=DepthNoiseConfig(),
        objects={label: (str(catalogue[label].sdf), X_WO) for label, X_WO in X_WOs.items()},
        seed=0,
    )
    context = station.CreateDefaultContext()
    X = station.GetOutputPort("head_camera.X_WC").Eval(context).GetAsMatrix4()
    np.testing.assert_allclose(X, X_WC, atol=1e-12)
    expected = station.GetOutputPort("head_camera.color_image").Eval(context).data[..., :3]
    scene = dataclasses.replace(scene_of(catalogue, X_WOs), surroundings=station_parts())
    drawn = np.rint(255 * SceneRenderer(scene).color(CAMERA, X_WC))
    assert np.mean(np.abs(drawn - expected)) < 0.05


# --- scenes ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pictures(catalogue: Catalogue) -> dict[str, list[AnnotatedImage]]:
    return {split: [render_scene(catalogue, split, 7, i, 1)[0] for i in range(2)] for split in ("train", "shift")}


def test_pictures_are_neither_dark_nor_burnt_out_and_their_boxes_lie_within(
    pictures: dict[str, list[AnnotatedImage]],
) -> None:
    for images in pictures.values():
        for image in images:
            assert image.color.shape == (480, 640, 3) and image.depth.shape == (480, 640)
            assert 30 < image.color.mean() < 225
            assert np.mean(image.depth > 0) > 0.3 and image.depth.max() <= 3.2
            for o in image.objects:
                x, y, w, h = o.box
                assert 0 <= x < x + w <= 640 and 0 <= y < y + h <= 480
                assert 0 < o.visible_share <= 1 and 0 < o.pixels <= w * h
            assert len({o.label for o in image.objects}) == len(image.objects)


def test_objects_look_like_themselves_in_every_split(catalogue: Catalogue) -> None:
    """The detergent is orange under any light that is used."""
    small = Camera(160, 120, 130.0, 130.0, 79.5, 59.5)
    X_WOs = {"tide": standing(catalogue, "tide", 0.65, 0.0)}
    for shift in (False, True):
        for seed in range(4):
            look = draw_look(np.random.default_rng(seed), np.array([0.7, 0.0, TABLE]), shift=shift)
            renderer = SceneRenderer(dataclasses.replace(scene_of(catalogue, X_WOs), look=look))
            red, green, blue = renderer.color(small, X_WC)[renderer.labels(small, X_WC) == 1].mean(axis=0)
            assert red > 1.3 * green and red > 1.3 * blue, (shift, seed)


def test_fewer_views_are_the_first_of_more_and_bytes_repeat_in_any_thread(catalogue: Catalogue) -> None:
    """VTK's engines belong to the thread that made them: each thread gets its own."""
    two = render_encoded(catalogue, "validation", 3, 1, 2)
    one: list[EncodedImage] = []
    thread = threading.Thread(target=lambda: one.extend(render_encoded(catalogue, "validation", 3, 1, 1)))
    thread.start()
    thread.join()
    assert [len(one), len(two)] == [1, 2]
    assert (one[0].jpeg, one[0].depth_png, one[0].objects) == (two[0].jpeg, two[0].depth_png, two[0].objects)
    assert two[0].jpeg != two[1].jpeg and two[0].camera != two[1].camera


def test_an_unknown_split_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(InputError, match="split 'holdout'"):
        render_scene(catalogue, "holdout", 0, 0, 1)


def test_kinds_counts_and_labels_vary(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without physics and pictures, which have tests of their own."""
    monkeypatch.setattr(dataset_scenes, "pour", dataset_scenes.toss)
    monkeypatch.setattr(dataset_scenes, "draw_texture", lambda *_, **__: np.zeros((4, 4, 3), np.uint8))
    scenes = {
        split: [
            _draw_scene(catalogue, np.random.default_rng([*scene_entropy(0, split, i), 0]), shift=split == "shift")
            for i in range(36)
        ]
        for split in ("train", "shift")
    }
    assert 3 <= sum(scene.station for scene in scenes["train"]) <= 16
    assert not any(scene.station for scene in scenes["shift"])
    assert any(scene.own_light for scene in scenes["train"])
    for split in scenes.values():
        counts = [len(scene.objects) for scene in split]
        assert max(counts) >= 9 and min(counts) <= 2 and 3 < np.mean(counts) < 9
        labels = Counter(label for scene in split for label, _, _ in scene.objects)
        assert set(labels) == set(catalogue.labels)
        for scene in split:
            assert len({label for label, _, _ in scene.objects}) == len(scene.objects)


def test_a_catalogue_of_ones_own_needs_neither_obj_nor_simulation_model(tmp_path: Path) -> None:
    trimesh.creation.icosphere(radius=0.05).export(tmp_path / "ball.stl")
    trimesh.creation.box([0.1, 0.06, 0.04]).export(tmp_path / "brick.ply")
    (tmp_path / "mine.yaml").write_text(
        "objects: {ball: {mesh: ball.stl, category: toys}, brick: {mesh: brick.ply, category: toys}}"
    )
    mine = load_catalogue(tmp_path / "mine.yaml")
    found = Counter(o.label for i in range(2) for o in render_scene(mine, "train", 0, i, 1)[0].objects)
    assert found and set(found) <= {"ball", "brick"}


@pytest.mark.parametrize("count", [1, 5, 10, 15])
def test_the_station_of_the_pictures_is_poured_where_a_run_pours(count: int) -> None:
    config, ground = PouringConfig(), station_ground(count)
    half_y = np.clip(count * config.area_per_object / (4 * config.half_x), config.half_y_min, config.half_y_max)
    np.testing.assert_allclose(ground.region_center, config.center)
    np.testing.assert_allclose(ground.region_half, [config.half_x, half_y])
