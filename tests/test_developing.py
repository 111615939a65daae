import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.detection.developing import Picture, _streak, develop, jpeg


def decode(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def scenery(level: float) -> Picture:
    """A textured picture of a given brightness."""
    noise = np.random.default_rng(0).random((30, 40, 3), dtype=np.float32)
    return np.asarray(level * cv2.resize(noise, (160, 120)), dtype=np.float32)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_picture_depends_on_its_seed_alone(seed: int) -> None:
    a, b = (develop(scenery(0.8), np.random.default_rng(seed)) for _ in range(2))
    assert a == b and decode(a).shape == (120, 160, 3)


def test_dark_pictures_are_brightened_and_bright_ones_are_not_burnt() -> None:
    for seed in range(20):
        dark = decode(develop(scenery(0.3), np.random.default_rng(seed)))
        assert dark.mean() > 1.2 * 255 * scenery(0.3).mean()
        bright = decode(develop(np.clip(scenery(1.4), 0, 1), np.random.default_rng(seed)))
        assert np.mean(bright.min(axis=-1) >= 254) < 0.06


def test_black_and_white_pictures_survive() -> None:
    for level in (0.0, 1.0):
        image = decode(develop(np.full((120, 160, 3), level, np.float32), np.random.default_rng(0)))
        assert image.shape == (120, 160, 3)


def test_what_is_red_stays_red() -> None:
    picture = np.zeros((120, 160, 3), np.float32)
    picture[..., 0] = 0.6
    for seed in range(20):
        red, green, blue = decode(develop(picture, np.random.default_rng(seed))).reshape(-1, 3).mean(axis=0)
        assert red > 2 * green and red > 2 * blue


@given(length=st.integers(3, 7), angle=st.floats(0, np.pi))
def test_blurring_by_motion_keeps_the_brightness(length: int, angle: float) -> None:
    kernel = _streak(length, angle)
    assert kernel.sum() == pytest.approx(1, abs=1e-6) and np.count_nonzero(kernel) >= 3


def test_a_jpeg_of_high_quality_is_the_picture() -> None:
    picture = cv2.GaussianBlur(scenery(1.0), (0, 0), 2)
    assert np.abs(decode(jpeg(picture, 97)) / 255 - picture).mean() < 0.01
    assert decode(jpeg(np.full((8, 8, 3), 1.7, np.float32), 97)).min() >= 254
