"""Pictures: the belief lies on what it is about, and anything can be drawn."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.drawing import (
    FINGER_COLOR,
    draw_depth,
    draw_grasp,
    draw_perception,
    footprint,
    hand_boxes,
    label_color,
)
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import predicted_box
from sum_drake.types import (
    Array,
    Camera,
    Detection,
    Frame,
    Perception,
    PickPlace,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)

CAMERA = Camera(320, 240, 262.0, 262.0, 159.5, 119.5)
X_WC = readonly(transform(np.diag([1.0, -1.0, -1.0]), np.array([0.7, 0.0, 1.7])))


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def make_track(id: int, label: str, X_WO: Array, frame: Frame, catalogue: Catalogue, *, accepted: bool) -> Track:
    box = predicted_box(np.asarray(catalogue[label].load_mesh().vertices), X_WO, frame)
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    return Track(
        id,
        label,
        box,
        0.9,
        0.8,
        belief,
        readonly(X_WO),
        0.7,
        0.93 if accepted else 0.07,
        accepted,
        0,
        frame.observation,
    )


def make_perception(step: int, catalogue: Catalogue) -> Perception:
    """A can that is believed in, a mug that is not, on a plain grey table."""
    frame = Frame(
        step, np.full((240, 320, 3), 128, np.uint8), np.full((240, 320), 1.0, np.float32), CAMERA, X_WC, 10.0 * step
    )
    tracks = (
        make_track(0, "soup_can", transform(np.eye(3), np.array([0.7, 0.1, 0.75])), frame, catalogue, accepted=True),
        make_track(1, "mug", transform(np.eye(3), np.array([0.7, -0.15, 0.75])), frame, catalogue, accepted=False),
    )
    detections = tuple(Detection(track.box, track.p_box, ((track.label, track.p_label),)) for track in tracks)
    return Perception(step, frame, detections, (), SceneBelief(step - 1), SceneBelief(step, tracks, 2), None)


def test_the_overlay_lies_on_the_object(catalogue: Catalogue) -> None:
    """The accepted can's picture is tinted within its box and untouched elsewhere; the mug is only outlined."""
    perception = make_perception(0, catalogue)
    can, mug = perception.posterior.tracks
    picture = draw_perception(perception, catalogue, scale=2)
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    changed = (picture != 128).any(-1)
    x, y, w, h = (round(2 * value) for value in can.box)
    assert changed[y + 2 : y + h - 2, x + 2 : x + w - 2].mean() > 0.75
    x, y, w, h = (round(2 * value) for value in mug.box)
    assert 0.02 < changed[y : y + h, x : x + w].mean() < 0.6
    assert not changed[:, : min(round(2 * t.box[0]) for t in (can, mug)) - 60].any()
    assert (picture[changed] == label_color("soup_can", catalogue)).all(-1).any()


@settings(max_examples=25)
@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(-2, 2), min_size=3, max_size=3),
    st.booleans(),
)
def test_any_estimate_can_be_drawn(w: list[float], p: list[float], accepted: bool) -> None:
    """Beside the picture, behind the camera, through it: never an exception, never another size."""
    catalogue = load_catalogue()
    perception = make_perception(0, catalogue)
    track = dataclasses.replace(
        perception.posterior.tracks[0],
        X_WO=transform(rotation_from_vector(np.array(w)), np.array(p)),
        accepted=accepted,
    )
    belief = dataclasses.replace(perception.posterior, tracks=(track,) * 3)
    picture = draw_perception(dataclasses.replace(perception, posterior=belief), catalogue, scale=1)
    assert picture.shape == (240, 320, 3)


def test_a_label_that_the_catalogue_lacks(catalogue: Catalogue) -> None:
    perception = make_perception(0, catalogue)
    track = dataclasses.replace(perception.posterior.tracks[0], label="stapler")
    belief = dataclasses.replace(perception.posterior, tracks=(track,))
    assert draw_perception(dataclasses.replace(perception, posterior=belief), catalogue).shape == (480, 640, 3)


def test_colors_differ(catalogue: Catalogue) -> None:
    colors = [label_color(label, catalogue) for label in catalogue]
    assert len(set(colors)) == len(colors)


def test_depth_picture() -> None:
    depth = np.full((4, 6), 1.0, np.float32)
    depth[0] = 0.0
    depth[1] = 0.8
    picture = draw_depth(depth)
    assert (picture[0] == 0).all() and picture[1].sum() > picture[2].sum() > 0
    assert (draw_depth(np.zeros((4, 6), np.float32)) == 0).all()


def grasping(track: Track, X_WG: Array, *, held: bool = True) -> PickPlace:
    gap, eye = 0.066 if held else 0.0, readonly(np.eye(4))
    what = 0, "pick_place", track.id, track.label, readonly(X_WG), eye, "left"
    return PickPlace(*what, gap, gap, held, held_lift=held)


def test_the_hand_of_a_grasp_is_drawn_where_it_was_to_close(catalogue: Catalogue) -> None:
    """Fingers on both sides of the can; wider open where they then held nothing."""
    perception = make_perception(0, catalogue)
    can = perception.posterior.tracks[0]
    X_WG = transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.7, 0.1, 0.78]))
    spans = []
    for held in (True, False):
        picture = draw_grasp(perception, grasping(can, X_WG, held=held), catalogue)
        assert picture.shape == (360, 480, 3)
        yellow = (np.abs(picture.astype(int) - FINGER_COLOR).max(-1) < 60).nonzero()[0]
        spans.append(float(np.ptp(yellow)))
        assert np.median(yellow) == pytest.approx(180, abs=60), "the grasp is in the middle"
    assert spans[1] > 1.15 * spans[0]


@settings(max_examples=20)
@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_any_grasp_can_be_drawn(w: list[float], p: list[float]) -> None:
    """Beside the picture, behind the camera, at a track that is not known."""
    catalogue = load_catalogue()
    perception = make_perception(0, catalogue)
    action = grasping(perception.posterior.tracks[0], transform(rotation_from_vector(np.array(w)), np.array(p)))
    for track in (0, 7):
        picture = draw_grasp(perception, dataclasses.replace(action, track=track), catalogue, size=(200, 150))
        assert picture.shape == (150, 200, 3)


@given(st.floats(0.0, 0.1))
def test_the_hand_is_the_hands_boxes(gap: float) -> None:
    palm, left, right = hand_boxes(gap)
    np.testing.assert_allclose(left * [1, -1, 1], right[[2, 3, 0, 1, 6, 7, 4, 5]])
    assert left[:, 1].min() == pytest.approx(gap / 2) and palm[:, 0].max() == pytest.approx(left[:, 0].min())


@settings(max_examples=20)
@given(st.floats(0.02, 0.3), st.floats(0.02, 0.3), st.floats(-1, 1))
def test_a_footprint_covers_what_the_mesh_covers(a: float, b: float, x: float) -> None:
    corners = np.array([[x, -x, 0], [x + a, -x, 1], [x + a, b - x, 2], [x, b - x, 5]])
    (outline,) = footprint(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(outline.min(0), [x, -x], atol=0.004)
    np.testing.assert_allclose(outline.max(0), [x + a, b - x], atol=0.004)


def test_a_footprint_has_holes() -> None:
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    p = np.column_stack([np.vstack([0.1 * square, 0.05 * square]), np.zeros(8)])
    sides = [(i, (i + 1) % 4) for i in range(4)]
    faces = np.array([face for i, j in sides for face in ([i, j, 4 + i], [j, 4 + j, 4 + i])])
    assert len(footprint(p, faces)) == 2
