import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.detection import textures
from sum_drake.detection.textures import SHIFT, TRAIN, draw_color, draw_texture, paint

FAMILIES = (*TRAIN, *SHIFT)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([64, 100, 256]))
def test_a_picture_depends_on_its_seed_alone(family: str, seed: int, size: int) -> None:
    texture = paint(family, np.random.default_rng(seed), size=size)
    assert texture.shape == (size, size, 3) and texture.dtype == np.uint8
    np.testing.assert_array_equal(texture, paint(family, np.random.default_rng(seed), size=size))


@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "plain"])
def test_a_pattern_shows(family: str) -> None:
    contrasts = [np.ptp(paint(family, np.random.default_rng(seed)).astype(int), axis=(0, 1)).max() for seed in range(8)]
    assert np.median(contrasts) > 15


def test_pictures_of_a_family_differ() -> None:
    for family in FAMILIES:
        a, b = (paint(family, np.random.default_rng(seed)) for seed in (1, 2))
        assert np.abs(a.astype(int) - b).mean() > 2, family


def test_held_out_families_are_never_drawn_for_training_nor_the_others_for_shift(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(rng: np.random.Generator, size: int) -> np.ndarray:
        raise AssertionError("a family of the other set was drawn")

    assert not set(TRAIN) & set(SHIFT)
    with monkeypatch.context() as patch:
        patch.setattr(textures, "SHIFT", dict.fromkeys(SHIFT, refuse))
        for seed in range(40):
            draw_texture(np.random.default_rng(seed), size=32)
    monkeypatch.setattr(textures, "TRAIN", dict.fromkeys(TRAIN, refuse))
    for seed in range(40):
        draw_texture(np.random.default_rng(seed), shift=True, size=32)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(KeyError, match="velvet"):
        paint("velvet", np.random.default_rng(0))


@given(st.integers(0, 2**32 - 1))
def test_colours_are_colours(seed: int) -> None:
    color = draw_color(np.random.default_rng(seed))
    assert color.shape == (3,) and (color >= 0).all() and (color <= 0.95 + 1e-12).all()


def test_about_half_of_the_colours_are_muted() -> None:
    colors = np.array([draw_color(np.random.default_rng(seed)) for seed in range(400)])
    saturation = 1 - colors.min(axis=1) / colors.max(axis=1)
    assert 0.5 < np.mean(saturation <= 0.35) < 0.85
