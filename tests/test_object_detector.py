import numpy as np
import pytest

from sum_drake.systems.object_detector import ObjectDetector
from sum_drake.systems.ports import abstract
from sum_drake.types import Camera, Detection, Frame, readonly

CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)


def frame(observation, brightness=0):
    color, depth = np.full((48, 64, 3), brightness, np.uint8), np.full((48, 64), 0.8, np.float32)
    return Frame(observation, readonly(color, np.uint8), readonly(depth, np.float32), CAMERA, readonly(np.eye(4)))


@pytest.fixture
def calls():
    return []


@pytest.fixture
def system(calls):
    """With a detector that finds one box where the picture is bright."""

    def detect(color, depth):
        calls.append((color.shape, depth.shape))
        if color.max() < 128:
            return ()
        return (Detection((1.0, 2.0, float(depth[0, 0] * 100), 10.0), 0.9, (("mug", 0.7),)),)

    return ObjectDetector(detect=detect)


def test_detections_are_of_the_frames_picture_and_depth_and_carry_its_number(system, calls):
    context = system.CreateDefaultContext()
    system.GetInputPort("frame").FixValue(context, abstract(frame(4, 255)))
    found = system.GetOutputPort("detections").Eval(context)
    assert found.observation == 4
    (detection,) = found.boxes
    assert detection.box[2] == pytest.approx(80.0)
    assert detection.p_labels == (("mug", 0.7),)
    assert calls == [((48, 64, 3), (48, 64))]


def test_a_picture_without_objects_gives_no_detections(system):
    context = system.CreateDefaultContext()
    system.GetInputPort("frame").FixValue(context, abstract(frame(0, 0)))
    assert system.GetOutputPort("detections").Eval(context).boxes == ()


def test_each_frame_is_looked_at_once(system, calls):
    """Associator and estimator both pull; the network runs for the first of them only."""
    context = system.CreateDefaultContext()
    port = system.GetInputPort("frame")
    value = port.FixValue(context, abstract(frame(0, 255)))
    for _ in range(3):
        system.GetOutputPort("detections").Eval(context)
    assert len(calls) == 1
    value.GetMutableData().set_value(frame(1, 255))
    assert system.GetOutputPort("detections").Eval(context).observation == 1
    assert len(calls) == 2


def test_the_frame_is_all_it_sees(system):
    assert [system.get_input_port(i).get_name() for i in range(system.num_input_ports())] == ["frame"]
