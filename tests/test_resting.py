"""On which sides things rest."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import write_model

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import ObjectModel, load_catalogue
from sum_drake.resting import STEADY, centre, outside, resting, sides, stands

CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ObjectModel]:
    folder = tmp_path_factory.mktemp("meshes")
    return {
        "carton": write_model(folder, "carton", trimesh.creation.box([0.04, 0.08, 0.12])),
        "cone": write_model(folder, "cone", trimesh.creation.cone(0.04, 0.12)),
        "pole": write_model(folder, "pole", trimesh.creation.cylinder(0.03, 0.20, sections=64)),
    }


def tilted(degrees: float, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> np.ndarray:
    return rotation_from_vector(np.radians(degrees) * np.array(axis))


def test_a_box_rests_on_its_six_sides(models: dict[str, ObjectModel]) -> None:
    assert sorted(map(tuple, np.round(sides(models["carton"])))) == sorted(
        tuple(sign * row) for row in np.eye(3) for sign in (-1.0, 1.0)
    )
    np.testing.assert_allclose(centre(models["carton"]), 0.0, atol=1e-9)


def test_a_cone_does_not_stand_on_its_tip_and_a_cylinder_rolls(models: dict[str, ObjectModel]) -> None:
    down_cone, down_pole = sides(models["cone"]), sides(models["pole"])
    assert down_cone[:, 2].min() == pytest.approx(-1.0) and down_cone[:, 2].max() < 0.5
    assert (np.abs(down_pole[:, 2]) > 0.99).sum() == 2 and len(down_pole) > 30


@pytest.mark.parametrize("degrees", [0, 8, -8])
def test_what_is_tilted_as_little_as_poses_are_off_stands_and_is_left_so(
    models: dict[str, ObjectModel], degrees: float
) -> None:
    R = tilted(degrees)
    assert stands(models["carton"], transform(R, np.zeros(3)))
    assert resting(models["carton"], R) is R


@pytest.mark.parametrize(("degrees", "comes_to"), [(25, 0), (-30, 0), (70, 90)])
def test_what_leans_would_fall_onto_the_next_side(
    models: dict[str, ObjectModel], degrees: float, comes_to: float
) -> None:
    R = tilted(degrees)
    assert not stands(models["carton"], transform(R, np.zeros(3)))
    np.testing.assert_allclose(resting(models["carton"], R), tilted(comes_to), atol=1e-9)


@settings(max_examples=20)
@given(st.tuples(*[st.floats(-3, 3)] * 3), st.sampled_from(sorted(CATALOGUE)))
def test_what_has_been_laid_to_rest_stands(w: tuple[float, float, float], label: str) -> None:
    model = CATALOGUE[label]
    R = resting(model, rotation_from_vector(np.array(w)))
    assert stands(model, transform(R, np.zeros(3)))
    assert resting(model, R) is R
    assert np.max(sides(model) @ -R[2]) > np.cos(STEADY)


def test_the_outside_of_a_box_is_where_it_is(models: dict[str, ObjectModel]) -> None:
    p = outside(models["carton"])
    np.testing.assert_allclose(np.ptp(p, axis=0), [0.04, 0.08, 0.12], atol=1e-3)
    assert np.isclose(np.abs(p) / [0.02, 0.04, 0.06], 1.0).any(1).all()
    assert not p.flags.writeable
