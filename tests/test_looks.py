import numpy as np
import pytest
from pydrake.geometry import RenderEngineVtkParams

from sum_drake.detection.looks import direction, draw_look

TARGET = np.array([0.7, 0.0, 0.7])


def test_what_is_held_out_is_in_no_training_look() -> None:
    def looks(shift: bool) -> list[RenderEngineVtkParams]:
        return [draw_look(np.random.default_rng(seed), TARGET, shift=shift) for seed in range(60)]

    train, shift = looks(False), looks(True)
    assert {light.type for look in train for light in look.lights} == {"directional", "point"}
    assert not any(look.cast_shadows or look.exposure is not None for look in train)
    assert 5 < sum(look.force_to_pbr for look in train) < 30
    assert all(look.cast_shadows and look.exposure is not None and look.force_to_pbr for look in shift)
    assert all({light.type for light in look.lights[:-1]} == {"spot"} for look in shift)
    for look in [*train, *shift]:
        assert all(light.frame == "world" for light in look.lights[:-1])
        assert [look.lights[-1].frame, look.lights[-1].type] == ["camera", "point"]


@pytest.mark.parametrize("shift", [False, True])
def test_lights_stand_above_the_target_and_shine_on_it(shift: bool) -> None:
    for seed in range(60):
        look = draw_look(np.random.default_rng(seed), TARGET, shift=shift)
        assert 2 <= len(look.lights) <= (4 if shift else 5)
        for light in look.lights[:-1]:
            to_target = TARGET - light.position
            off = np.linalg.norm(np.cross(to_target, light.direction))
            assert light.position[2] > TARGET[2] + 0.3 and light.direction @ to_target > 0 and off < 0.3
            color = np.array([light.color.r(), light.color.g(), light.color.b()])
            assert color.max() == pytest.approx(1) and color.min() >= (0.2 if shift else 0.75)
            assert light.intensity > 0


def test_held_out_lights_are_more_colourful() -> None:
    def saturation(shift: bool) -> float:
        looks = [draw_look(np.random.default_rng(seed), TARGET, shift=shift) for seed in range(60)]
        colors = [[c.r(), c.g(), c.b()] for look in looks for c in [light.color for light in look.lights[:-1]]]
        return float(np.mean(1 - np.min(colors, axis=1)))

    assert saturation(True) > 3 * saturation(False)


def test_a_look_depends_on_its_seed_alone() -> None:
    a, b = (draw_look(np.random.default_rng(4), TARGET) for _ in range(2))
    assert repr(a) == repr(b)


def test_directions_are_unit_vectors() -> None:
    np.testing.assert_allclose(direction(np.pi / 2, 0.0), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(direction(0.7, 1.1)), 1)
