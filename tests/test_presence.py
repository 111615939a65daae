import dataclasses

import numpy as np
import pytest
from scenes import observe, standing

from sum_drake.geometry import transform
from sum_drake.objects import load_catalogue
from sum_drake.presence import UNKNOWN, PresenceCheck
from sum_drake.types import readonly


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def presence(catalogue):
    return PresenceCheck(catalogue)


def test_an_object_in_its_place_is_explained_and_an_empty_place_is_free(catalogue, presence):
    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    frame, _ = observe(catalogue, {"sugar": X_WO})
    seen = presence.look(frame, "sugar", X_WO)
    assert seen.pixels > 300
    assert seen.explained > 0.85
    assert seen.free < 0.1
    empty, _ = observe(catalogue, {})
    seen = presence.look(empty, "sugar", X_WO)
    assert seen.explained < 0.15
    assert seen.free > 0.7


def test_what_stands_behind_another_is_hidden(catalogue, presence):
    X_WO = standing(catalogue, "soup_can", 0.75, 0.0)
    frame, _ = observe(catalogue, {"tide": standing(catalogue, "tide", 0.62, 0.0, yaw=np.pi / 2)})
    without, _ = observe(catalogue, {})
    assert presence.look(frame, "soup_can", X_WO).hidden > 0.3
    assert presence.look(without, "soup_can", X_WO).hidden < 0.05


def test_out_of_the_picture_or_without_depth_nothing_is_known(catalogue, presence):
    frame, _ = observe(catalogue, {})
    assert presence.look(frame, "sugar", transform(np.eye(3), np.array([0.6, 9.0, 0.8]))) == UNKNOWN
    assert presence.look(frame, "sugar", frame.X_WC) == UNKNOWN
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    assert presence.look(blind, "sugar", standing(catalogue, "sugar", 0.6, 0.1)) == UNKNOWN


def test_explained_pixels_are_those_that_show_the_object(catalogue, presence):
    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    frame, boxes = observe(catalogue, {"sugar": X_WO})
    mask = presence.explained(frame, "sugar", X_WO)
    assert mask.shape == frame.depth.shape
    rows, columns = np.nonzero(mask)
    x, y, w, h = boxes["sugar"]
    assert x - 2 <= columns.min() <= columns.max() <= x + w + 2
    assert y - 2 <= rows.min() <= rows.max() <= y + h + 2
    assert len(rows) > 0.4 * w * h
