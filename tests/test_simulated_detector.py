import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.sensors import ImageLabel16I

from sum_drake.detection.simulated import SimulatedDetectorConfig
from sum_drake.systems.ports import abstract
from sum_drake.systems.simulated_detector import SimulatedDetector
from sum_drake.types import Camera, Frame, readonly


def frame(observation):
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    color, depth = np.zeros((48, 64, 3), np.uint8), np.ones((48, 64), np.float32)
    return Frame(observation, readonly(color, np.uint8), readonly(depth, np.float32), camera, readonly(np.eye(4)))


@pytest.fixture
def system():
    return SimulatedDetector(
        objects={3: "mug"}, labels=("mug", "toy", "tide"), sigma_c=0.1, config=SimulatedDetectorConfig(), seed=1
    )


def detect(system, observation):
    context = system.CreateDefaultContext()
    image = ImageLabel16I(64, 48, 0)
    image.mutable_data[10:30, 20:50, 0] = 3
    system.GetInputPort("frame").FixValue(context, abstract(frame(observation)))
    system.GetInputPort("label_image").FixValue(context, Value[ImageLabel16I](image))
    return system.GetOutputPort("detections").Eval(context)


def test_detections_carry_the_frames_observation_and_repeat_for_it(system):
    first = detect(system, 2)
    assert first.observation == 2
    assert detect(system, 2) == first


def test_errors_differ_between_observations(system):
    assert len({detect(system, k).boxes for k in range(5)}) == 5
