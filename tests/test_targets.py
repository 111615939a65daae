"""What the network is taught: which cells and boxes show an object, which say nothing, and how wrong an answer is."""

import numpy as np
import pytest
import torch

from sum_drake.detection.network import BACKGROUND, STRIDE
from sum_drake.detection.targets import Truth, box_loss, draw_boxes, iou, label_boxes, proposal_loss

OBJECT, HIDDEN = [100.0, 80.0, 60.0, 40.0], [300.0, 200.0, 40.0, 40.0]


def truth(boxes=(OBJECT,), classes=(3,), ignored=(HIDDEN,)):
    return Truth(
        torch.tensor(list(boxes)).reshape(-1, 4),
        torch.tensor(list(classes)),
        torch.tensor(list(ignored)).reshape(-1, 4),
    )


def cells(height=60, width=80):
    v, u = np.mgrid[:height, :width]
    return (u + 0.5) * STRIDE, (v + 0.5) * STRIDE


def perfect_maps(box):
    """Objectness and boxes of a network that knows `box` and nothing else."""
    x, y = cells()
    core = (abs(x - box[0] - box[2] / 2) <= box[2] / 4) & (abs(y - box[1] - box[3] / 2) <= box[3] / 4)
    return torch.tensor(np.where(core, 12.0, -12.0)).float(), torch.tensor(box).expand(60, 80, 4)


def test_perfect_maps_cost_nothing():
    logits, boxes = perfect_maps(OBJECT)
    objectness, sides = proposal_loss(logits, boxes, truth())
    assert objectness < 1e-3 and sides < 1e-5


def test_objectness_where_there_is_nothing_costs():
    logits, boxes = perfect_maps(OBJECT)
    logits[50, 10] = 6.0
    assert proposal_loss(logits, boxes, truth())[0] > 0.1


def test_what_is_said_of_hardly_visible_objects_costs_nothing():
    logits, boxes = perfect_maps(OBJECT)
    x, y = cells()
    inside = (x > HIDDEN[0]) & (x < HIDDEN[0] + HIDDEN[2]) & (y > HIDDEN[1]) & (y < HIDDEN[1] + HIDDEN[3])
    before = proposal_loss(logits, boxes, truth())[0]
    logits[torch.tensor(inside)] = 6.0
    assert proposal_loss(logits, boxes, truth())[0] == before


def test_even_a_tiny_object_has_a_cell():
    box = [101.0, 81.0, 5.0, 5.0]
    logits, boxes = torch.full((60, 80), -12.0), torch.tensor([0.0, 0.0, 50.0, 50.0]).expand(60, 80, 4)
    assert proposal_loss(logits, boxes, truth(boxes=[box], classes=[1]))[1] > 0.5


def test_empty_picture_teaches_that_there_is_nothing():
    logits, boxes = torch.full((60, 80), 3.0), torch.tensor([0.0, 0.0, 50.0, 50.0]).expand(60, 80, 4)
    objectness, sides = proposal_loss(logits, boxes, truth(boxes=[], classes=[], ignored=[]))
    assert objectness > 100 and sides == 0


def test_boxes_get_the_class_of_the_object_they_overlap():
    boxes = torch.tensor(
        [OBJECT, [105.0, 82.0, 60.0, 40.0], [150.0, 80.0, 60.0, 40.0], HIDDEN, [305.0, 205.0, 20.0, 20.0]]
    )
    classes, targets, telling = label_boxes(boxes, truth())
    assert classes.tolist() == [3, 3, BACKGROUND, BACKGROUND, BACKGROUND]
    assert telling.tolist() == [True, True, True, False, False]
    assert targets[0].tolist() == OBJECT


@pytest.mark.parametrize("seed", range(5))
def test_drawn_boxes_are_within_the_picture_and_rightly_labelled(seed):
    rng = np.random.default_rng(seed)
    proposals = torch.tensor([[90.0, 70.0, 70.0, 60.0], [400.0, 300.0, 80.0, 80.0], HIDDEN])
    boxes, classes, targets = draw_boxes(proposals, truth(), (448, 448), count=64, share=0.3, rng=rng)
    assert len(boxes) == len(classes) == len(targets) == 64
    assert 0 < (classes != BACKGROUND).sum() <= 20
    assert (boxes >= 0).all() and ((boxes[:, :2] + boxes[:, 2:]) <= 448).all()
    overlaps = iou(boxes, torch.tensor([OBJECT]))[:, 0]
    assert ((overlaps >= 0.5) == (classes == 3)).all()


def test_drawing_is_a_function_of_its_generator():
    proposals = torch.tensor([[400.0, 300.0, 80.0, 80.0]])
    a, b = (draw_boxes(proposals, truth(), (448, 448), count=32, share=0.3, rng=np.random.default_rng(7)) for _ in "ab")
    assert all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_picture_without_objects_gives_background_alone():
    _, classes, _ = draw_boxes(
        torch.zeros(0, 4), truth(boxes=[], classes=[], ignored=[]), (448, 448), count=16, share=0.5,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    assert (classes == BACKGROUND).all() and len(classes) > 0


def test_corrections_of_background_boxes_are_free():
    boxes = torch.tensor([OBJECT, [10.0, 10.0, 30.0, 30.0]])
    classes, targets, _ = label_boxes(boxes, truth())
    logits = torch.zeros(2, 16)
    wild = torch.tensor([[0.0, 0, 0, 0], [9.0, 9, 9, 9]])
    assert box_loss(logits, wild, boxes, classes, targets)[1] == 0
