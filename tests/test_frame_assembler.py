import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from sum_drake.systems.frame_assembler import FrameAssembler
from sum_drake.types import Camera


def test_frame_holds_what_the_ports_say_and_the_number_of_the_observation():
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    system = FrameAssembler(camera=camera)
    context = system.CreateDefaultContext()
    context.SetTime(3.5)
    color, depth = ImageRgba8U(64, 48, 0), ImageDepth32F(64, 48, 1)
    color.mutable_data[5, 6] = [10, 20, 30, 255]
    depth.mutable_data[7, 8] = 0.75
    depth.mutable_data[0, 0] = np.inf
    depth.mutable_data[0, 1] = np.nan
    X_WC = RigidTransform([0.1, 0.2, 1.3])
    system.GetInputPort("color_image").FixValue(context, Value[ImageRgba8U](color))
    system.GetInputPort("depth_image").FixValue(context, Value[ImageDepth32F](depth))
    system.GetInputPort("X_WC").FixValue(context, Value[RigidTransform](X_WC))
    system.GetInputPort("observe").FixValue(context, [4.0])
    frame = system.GetOutputPort("frame").Eval(context)
    assert (frame.observation, frame.time, frame.camera) == (3, 3.5, camera)
    assert frame.color.shape == (48, 64, 3)
    np.testing.assert_array_equal(frame.color[5, 6], [10, 20, 30])
    assert frame.depth[7, 8] == np.float32(0.75)
    assert frame.depth[0, 0] == frame.depth[0, 1] == 0.0, "what the sensor did not see is 0"
    np.testing.assert_array_equal(frame.X_WC, X_WC.GetAsMatrix4())
    assert not frame.depth.flags.writeable
