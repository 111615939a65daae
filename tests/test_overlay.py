import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.detection.overlay import MarkedBox, draw_boxes

RED, GREEN = (250, 20, 20), (20, 250, 20)
places = st.tuples(st.floats(-30, 300), st.floats(-30, 200), st.floats(0, 400), st.floats(0, 300))


@given(st.lists(st.tuples(places, st.booleans()), max_size=6))
@settings(max_examples=40)
def test_boxes_anywhere_are_drawn_on_a_picture_of_the_same_size(boxes):
    picture = np.full((160, 240, 3), 90, np.uint8)
    drawn = draw_boxes(picture, [MarkedBox(box, RED, "mug 0.50", dashed) for box, dashed in boxes])
    assert drawn.shape == picture.shape
    assert (picture == 90).all()


def test_words_of_boxes_in_one_place_do_not_cover_each_other():
    picture = np.zeros((160, 240, 3), np.uint8)
    drawn = draw_boxes(picture, [MarkedBox((50, 60, 5, 5), color, "mug 0.50") for color in (RED, GREEN)])
    areas = [int((drawn == color).all(2).sum()) for color in (RED, GREEN)]
    alone = int((draw_boxes(picture, [MarkedBox((50, 60, 5, 5), RED, "mug 0.50")]) == RED).all(2).sum())
    assert min(areas) > 0.8 * alone


def test_a_dashed_box_has_gaps():
    picture = np.zeros((160, 240, 3), np.uint8)
    whole, dashed = (
        (draw_boxes(picture, [MarkedBox((20, 20, 100, 100), RED, dashed=dashed)]) == RED).all(2)
        for dashed in (False, True)
    )
    assert whole[20, 20:120].all()
    assert 0.3 < dashed[20, 20:120].mean() < 0.8
