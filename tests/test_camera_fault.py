import numpy as np
from scenes import CAMERA

from sum_drake.systems.camera_fault import CameraFault
from sum_drake.systems.ports import abstract
from sum_drake.types import Frame, readonly


def shown(observation):
    """The frame of an observation through a camera that fails in 2."""
    color = readonly(np.full((CAMERA.height, CAMERA.width, 3), 9), np.uint8)
    depth = readonly(np.ones((CAMERA.height, CAMERA.width)), np.float32)
    frame = Frame(observation, color, depth, CAMERA, readonly(np.eye(4)), 7.0)
    dut = CameraFault(observations={2})
    context = dut.CreateDefaultContext()
    dut.GetInputPort("frame").FixValue(context, abstract(frame))
    return frame, dut.GetOutputPort("faulty_frame").Eval(context)


def test_frames_pass_but_for_those_in_which_it_fails():
    frame, seen = shown(1)
    assert seen is frame
    frame, seen = shown(2)
    assert not seen.depth.any() and not seen.color.any()
    assert (seen.observation, seen.time, seen.camera) == (2, 7.0, CAMERA)
    assert seen.depth.shape == frame.depth.shape
