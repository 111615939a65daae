"""What a depth sensor's noise lets the pose filter ask of a depth image."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.bench.pose_scenes import STEREO
from sum_drake.depth_tolerance import PERFECT, depth_tolerance
from sum_drake.filter_config import filter_config
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, add_depth_noise, make_camera

CAMERA = make_camera(HeadCameraConfig())


def test_a_structured_light_camera_across_the_table() -> None:
    tolerance = depth_tolerance(DepthNoiseConfig(), CAMERA, 0.9)
    assert tolerance.epsilon(filter_config().epsilon) == pytest.approx(0.007, abs=1e-4)
    assert tolerance.epsilon(filter_config().epsilon_first) == pytest.approx(0.010, abs=1e-4)
    assert tolerance.plane == pytest.approx(0.008, abs=1e-4)
    assert tolerance.jump == pytest.approx(0.020, abs=1e-4)


def test_a_sensor_without_errors_leaves_those_of_meshes() -> None:
    assert depth_tolerance(DepthNoiseConfig(enabled=False), CAMERA, 2.0) == PERFECT
    assert PERFECT.epsilon(0.008) == 0.008


@given(st.floats(0.4, 3.0), st.floats(1.01, 2.0))
def test_what_is_farther_is_seen_less_well(z: float, times: float) -> None:
    near, far = (depth_tolerance(DepthNoiseConfig(), CAMERA, one) for one in (z, times * z))
    assert far.sigma > near.sigma
    assert far.epsilon(0.004) > near.epsilon(0.004) > 0.004
    assert far.plane > near.plane and far.jump > near.jump and far.least_points >= near.least_points


@pytest.mark.parametrize("noise", [DepthNoiseConfig(), STEREO], ids=["structured_light", "stereo"])
@pytest.mark.parametrize("z", [0.6, 1.2, 2.0])
def test_sigma_is_that_of_the_depth_that_is_simulated(noise: DepthNoiseConfig, z: float) -> None:
    # Sloping, so that steps of disparity come at all phases.
    true = np.broadcast_to(np.linspace(0.97 * z, 1.03 * z, CAMERA.width), (CAMERA.height, CAMERA.width))
    noise = dataclasses.replace(noise, lateral=0.0)
    seen = add_depth_noise(true, CAMERA, np.random.default_rng(0), noise)
    error = (seen - true)[seen > 0]
    assert error.std() == pytest.approx(depth_tolerance(noise, CAMERA, z).sigma, rel=0.1)


def test_backgrounds_bleed_as_far_as_the_sensor_lets_them() -> None:
    assert depth_tolerance(STEREO, CAMERA, 1.0).bleed == STEREO.edge_erosion
    assert depth_tolerance(dataclasses.replace(STEREO, enabled=False), CAMERA, 1.0).bleed == 0
