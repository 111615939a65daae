import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.boxes import distance, measured, pixels_around, pixels_in
from sum_drake.types import Camera, Frame, readonly

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
boxes = st.tuples(*[st.floats(-100, 200)] * 2, *[st.floats(0, 150)] * 2)


def frame(depth):
    return Frame(0, np.zeros((48, 64, 3), np.uint8), readonly(depth, np.float32), CAMERA, readonly(np.eye(4)))


@given(boxes)
def test_a_box_holds_the_pixels_whose_centres_are_in_it(box):
    x, y, w, h = box
    v, u = np.mgrid[:48, :64]
    held = np.zeros((48, 64), bool)
    held[pixels_in(box, CAMERA)] = True
    np.testing.assert_array_equal(held, (x <= u) & (u < x + w) & (y <= v) & (v < y + h))
    around = np.zeros((48, 64), bool)
    around[pixels_around(box, CAMERA, 0.5)] = True
    assert not (held & ~around).any()


def test_a_boxes_distance_is_of_its_near_part_and_of_nothing_unknown():
    depth = np.full((48, 64), 2.0)
    depth[10:20, 10:20] = 1.0
    depth[0, :3] = np.nan, np.inf, 0
    assert distance(frame(depth), (5.0, 10.0, 20.0, 10.0)) == 1.0
    assert len(measured(frame(depth), (0.0, 0.0, 4.0, 1.0))) == 1
    assert np.isnan(distance(frame(depth), (0.0, 0.0, 2.0, 1.0)))
    assert np.isnan(distance(frame(depth), (70.0, 0.0, 2.0, 1.0)))
