"""Grasps all over an object, whatever its pose."""

import numpy as np
import pytest
import trimesh
from shapes import CONFIG, columns, write_model

from sum_drake.geometry import apply, inverse
from sum_drake.grasping import grasp_candidates, opening
from sum_drake.objects import ObjectModel, load_catalogue
from sum_drake.robot import HAND


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ObjectModel]:
    folder = tmp_path_factory.mktemp("meshes")
    profile = np.array([[0, -0.05], [0.04, -0.05], [0.04, 0.05], [0.036, 0.05], [0.036, -0.046], [0, -0.046]])
    cup = trimesh.creation.revolve(profile, sections=40)
    return {
        "carton": write_model(folder, "carton", trimesh.creation.box([0.04, 0.08, 0.12])),
        "crate": write_model(folder, "crate", trimesh.creation.box([0.20, 0.25, 0.12])),
        "ball": write_model(folder, "ball", trimesh.creation.icosphere(3, 0.035)),
        "cup": write_model(folder, "cup", cup),
        "slab": write_model(folder, "slab", trimesh.creation.box([0.06, 0.10, 0.02])),
        "bar": write_model(folder, "bar", trimesh.creation.box([0.04, 0.40, 0.04]), mass=1.0),
    }


@pytest.mark.parametrize("name", ["carton", "ball", "cup", "slab", "bar"])
def test_the_open_hand_is_free_of_the_object(models: dict[str, ObjectModel], name: str) -> None:
    grasps = grasp_candidates(models[name], config=CONFIG, seed=0)
    assert len(grasps) > 50
    # Points of an independent draw, denser than those the candidates were tested against.
    points, _ = trimesh.sample.sample_surface(models[name].load_mesh(), 20000, seed=1)
    X_OGs, widths = columns(grasps)
    for X_GO, width in zip(inverse(X_OGs), widths, strict=True):
        x, y, z = apply(X_GO, points).T
        y = np.abs(y)
        gap = opening(width, CONFIG)
        slack = 0.001  # the object's own points are sampled
        fingers = (np.abs(x) < HAND.pad_x[1] - slack) & (np.abs(z) < HAND.pad_half_width - slack)
        fingers &= (y > gap / 2 + slack) & (y < gap / 2 + HAND.pad_thickness - slack)
        palm = (x < HAND.palm_x[1]) & (x > HAND.palm_x[0]) & (y < HAND.palm_half[0]) & (np.abs(z) < HAND.palm_half[1])
        assert not fingers.any()
        assert not palm.any()


def test_widths_and_closing_axes_are_those_of_the_shape(models: dict[str, ObjectModel]) -> None:
    X_OGs, widths = columns(grasp_candidates(models["carton"], config=CONFIG, seed=0))
    closing = np.abs(X_OGs[:, :3, 1])
    across = np.array([0.04, 0.08])
    assert np.allclose(closing.max(1), 1.0, atol=0.02)
    assert set(closing.argmax(1)) == {0, 1}  # .12 m does not fit
    assert np.allclose(widths, across[closing.argmax(1)], atol=1e-3)

    X_OGs, widths = columns(grasp_candidates(models["ball"], config=CONFIG, seed=0))
    assert np.allclose(widths, 0.07, atol=2e-3)
    # The contacts of a ball lie opposite each other: its centre is between the pads, on their midline.
    p_GOs = inverse(X_OGs)[:, :3, 3]
    assert np.abs(p_GOs[:, 1:]).max() < 0.003
    assert np.abs(p_GOs[:, 0]).max() < HAND.pad_x[1]


def test_what_is_too_wide_has_no_grasps(models: dict[str, ObjectModel]) -> None:
    assert grasp_candidates(models["crate"], config=CONFIG, seed=0) == ()


def test_a_cup_is_grasped_by_the_rim_and_around(models: dict[str, ObjectModel]) -> None:
    X_OGs, widths = columns(grasp_candidates(models["cup"], config=CONFIG, seed=0))
    around = widths > 0.07
    rim = (widths < 0.006) & (X_OGs[:, 2, 0] < -0.9) & (X_OGs[:, 2, 3] > 0.02)
    assert around.sum() > 20 and rim.sum() > 5
    # One finger inside, one outside, all around the rim.
    angles = np.arctan2(X_OGs[rim, 1, 3], X_OGs[rim, 0, 3])
    assert len(set(np.floor(angles / (np.pi / 2)))) >= 3


def test_handles_and_necks_of_large_objects_are_found() -> None:
    catalogue = load_catalogue()
    X_OGs, widths = columns(grasp_candidates(catalogue["tide"], config=CONFIG, seed=0))
    handle = (X_OGs[:, 1, 3] > 0.045) & (widths < 0.035)
    cap = (X_OGs[:, 2, 3] > 0.08) & (np.abs(widths - 0.061) < 0.006)
    assert handle.sum() >= 3 and cap.sum() >= 10


def test_candidates_are_a_function_of_the_seed(models: dict[str, ObjectModel]) -> None:
    first = grasp_candidates(models["carton"], config=CONFIG, seed=3)
    twin = ObjectModel(**{**vars(models["carton"])})  # another object, so that nothing comes from memory
    again, other = (grasp_candidates(twin, config=CONFIG, seed=seed) for seed in (3, 4))
    assert grasp_candidates(models["carton"], config=CONFIG, seed=3) is first
    assert all(np.array_equal(a.X_OG, b.X_OG) for a, b in zip(first, again, strict=True))
    assert len(other) != len(first) or any(
        not np.array_equal(a.X_OG, b.X_OG) for a, b in zip(first, other, strict=True)
    )
    assert not first[0].X_OG.flags.writeable
