import dataclasses

import numpy as np
import pytest

from sum_drake.association import AssociationConfig, associate, expected_boxes
from sum_drake.objects import load_catalogue
from sum_drake.systems.data_associator import DataAssociator
from sum_drake.systems.ports import abstract
from sum_drake.types import Camera, Detection, Detections, Frame, PickPlace, PoseBelief, SceneBelief, Track, readonly

BELIEF = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
TRACK = Track(5, "mug", (10, 10, 50, 50), 0.9, 0.9, BELIEF, BELIEF.X_WOs[0], 0.5, 0.5, True, 0, 0)


X_WC = np.diag([1.0, -1.0, -1.0, 1.0])
"""Looks down from 1 m."""
FRAME = Frame(
    4, readonly(np.zeros((480, 640, 3)), np.uint8), readonly(np.zeros((480, 640)), np.float32),
    Camera(640, 480, 525.0, 525.0, 319.5, 239.5), readonly(X_WC + np.pad([[1.0]], ((2, 1), (3, 0)))),
)  # fmt: skip


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


def associated(catalogue, boxes, action=None, tracks=(TRACK,)):
    system = DataAssociator(catalogue=catalogue, config=AssociationConfig())
    context = system.CreateDefaultContext()
    for port, value in (
        ("detections", Detections(4, boxes)),
        ("frame", FRAME),
        ("scene_belief", SceneBelief(3, tracks, 6)),
        ("executed_action", action),
    ):
        system.GetInputPort(port).FixValue(context, abstract(value))
    return system.GetOutputPort("associations").Eval(context)


def test_associations_are_those_of_the_pure_function_and_carry_the_observation(catalogue):
    boxes = (Detection((12, 10, 50, 50), 0.8, (("mug", 0.9),)), Detection((300, 10, 50, 50), 0.8, (("toy", 0.9),)))
    result = associated(catalogue, boxes)
    assert result.observation == 4
    expected = expected_boxes((TRACK,), None, FRAME, lambda label: np.asarray(catalogue[label].load_mesh().vertices))
    assert result.pairs == associate((TRACK,), boxes, AssociationConfig(), expected)
    assert [pair.track for pair in result.pairs] == [5, None]


def test_a_track_is_known_again_where_its_estimate_is_and_where_the_action_put_it(catalogue):
    """Whatever box it was last seen in: the camera, or the object, has moved since."""
    (middle,) = expected_boxes((TRACK,), None, FRAME, lambda label: np.asarray(catalogue[label].load_mesh().vertices))
    here = Detection(middle[0], 0.8, (("mug", 0.9),))
    assert [pair.track for pair in associated(catalogue, (here,)).pairs] == [5]
    x, y, w, h = middle[0]
    there = Detection((x + 525 * 0.2, y, w, h), 0.8, (("mug", 0.9),))
    assert [pair.track for pair in associated(catalogue, (there,)).pairs] == [None]
    X_WO_place = np.eye(4)
    X_WO_place[0, 3] = 0.2
    action = PickPlace(
        3, "pick_place", 5, "mug", BELIEF.X_WOs[0], readonly(X_WO_place), "table", 0.04, 0.04, True
    )  # fmt: skip
    assert [pair.track for pair in associated(catalogue, (there,), action).pairs] == [5]
    given_up = dataclasses.replace(action, released=False)
    assert [pair.track for pair in associated(catalogue, (there,), given_up).pairs] == [None]
