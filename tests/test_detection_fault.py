import numpy as np
import pytest
from scenes import CAMERA

from sum_drake.systems.detection_fault import DetectionFault
from sum_drake.systems.ports import abstract
from sum_drake.types import Detection, Detections, Frame, readonly

TRUE = Detection((10.0, 10.0, 20.0, 20.0), 0.8, (("mug", 0.9),))
FALSE = Detection((90.0, 10.0, 20.0, 20.0), 0.9, (("toy", 0.9),))


@pytest.mark.parametrize(("observation", "expected"), [(0, (TRUE,)), (1, (TRUE, FALSE)), (4, (TRUE,))])
def test_a_false_detection_stands_among_the_others_of_its_observations(observation, expected):
    asked = []

    def mistake(frame):
        asked.append(frame.observation)
        return FALSE

    dut = DetectionFault(mistakes={1: (mistake,), 2: (mistake,)})
    context = dut.CreateDefaultContext()
    blank = np.zeros((CAMERA.height, CAMERA.width))
    frame = Frame(observation, readonly(blank, np.uint8), readonly(blank, np.float32), CAMERA, readonly(np.eye(4)))
    dut.GetInputPort("frame").FixValue(context, abstract(frame))
    dut.GetInputPort("detections").FixValue(context, abstract(Detections(observation, (TRUE,))))
    found = dut.GetOutputPort("faulty_detections").Eval(context)
    assert (found.observation, found.boxes) == (observation, expected)
    assert asked == [observation] * (len(expected) - 1)
