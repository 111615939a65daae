import numpy as np
import pytest
from pydrake.systems.sensors import ImageDepth32F

from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, make_camera
from sum_drake.systems.depth_noise import DepthNoise

CAMERA = make_camera(HeadCameraConfig(width=80, height=60, focal_length=65.0))


def image(z: float) -> ImageDepth32F:
    depth = ImageDepth32F(CAMERA.width, CAMERA.height)
    depth.mutable_data[...] = z
    return depth


def make(seed: int = 0, **settings):
    # With so short a focal length the disparity steps would be centimetres.
    dut = DepthNoise(camera=CAMERA, config=DepthNoiseConfig(disparity_step=0.0, **settings), seed=seed)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("depth_image").FixValue(context, image(1.0))
    return dut, context


def noisy(dut, context) -> np.ndarray:
    return dut.GetOutputPort("noisy_depth_image").Eval(context).data[..., 0].copy()


def test_ports():
    dut, _ = make()
    assert [dut.get_input_port(i).get_name() for i in range(dut.num_input_ports())] == ["depth_image"]
    assert [dut.get_output_port(i).get_name() for i in range(dut.num_output_ports())] == ["noisy_depth_image"]


def test_it_adds_the_sensors_noise():
    depth = noisy(*make())
    assert depth.shape == (60, 80)
    assert 0.0005 < depth[depth > 0].std() < 0.01
    assert np.median(depth) == pytest.approx(1.0, abs=0.02)


def test_switched_off_it_passes_the_picture_and_clears_infinity():
    dut, context = make(enabled=False)
    depth = image(1.0)
    depth.mutable_data[0, 0] = np.inf
    dut.GetInputPort("depth_image").FixValue(context, depth)
    assert noisy(dut, context)[0, 0] == 0
    np.testing.assert_array_equal(noisy(dut, context)[1:], 1.0)


def test_a_cloned_context_sees_the_same():
    dut, context = make()
    context.SetTime(0.3)
    clone = context.Clone()
    context.SetTime(0.7)
    later = noisy(dut, context)
    np.testing.assert_array_equal(noisy(dut, clone), noisy(*_at(0.3)))
    assert (noisy(dut, clone) != later).mean() > 0.3


def _at(time: float):
    dut, context = make()
    context.SetTime(time)
    return dut, context


def test_seeds_differ():
    assert (noisy(*make(seed=1)) != noisy(*make(seed=2))).mean() > 0.3


def test_a_new_picture_is_noticed():
    dut, context = make()
    noisy(dut, context)
    dut.GetInputPort("depth_image").FixValue(context, image(2.0))
    assert np.median(noisy(dut, context)) == pytest.approx(2.0, abs=0.05)
