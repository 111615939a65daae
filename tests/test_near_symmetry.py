"""Motions that nearly map a mesh onto itself."""

import numpy as np
import pytest
import trimesh

from sum_drake.geometry import apply, rotation_angle, rotation_from_vector
from sum_drake.near_symmetry import LEAST_OVERLAP, near_symmetries
from sum_drake.objects import load_catalogue
from sum_drake.rendering import mesh_arrays
from sum_drake.types import Array


def found(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    return near_symmetries(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64), np.zeros(3))


def overlap_of(X_MNs: Array, overlaps: Array, turn: Array, *, within: float = 12.0) -> float:
    """The largest overlap of what turns as `turn`, a rotation vector in degrees, does, and shifts little; 0: none."""
    R = rotation_from_vector(np.radians(turn))
    near = np.degrees(rotation_angle(np.swapaxes(X_MNs[:, :3, :3], 1, 2) @ R)) < within
    near &= np.linalg.norm(X_MNs[:, :3, 3], axis=1) < 0.015
    return float(overlaps[near].max(initial=0.0))


def test_a_box_of_almost_square_section_turned_by_a_quarter() -> None:
    X_MNs, overlaps = found(trimesh.creation.box([0.06, 0.066, 0.16]))
    for turn in ([0, 0, 90], [0, 0, -90], [180, 0, 0], [0, 180, 0], [0, 0, 180]):
        assert overlap_of(X_MNs, overlaps, np.array(turn)) > 0.9, turn
    assert overlap_of(X_MNs, overlaps, np.array([90, 0, 0])) == 0, "a quarter on its side is no alternative"


def test_a_mug_turned_about_its_axis() -> None:
    vertices, faces = mesh_arrays(load_catalogue(), "mug")
    middle = vertices[faces].mean((0, 1))
    X_MNs, overlaps = near_symmetries(vertices, faces, middle)
    # The body's axis is the one about which most turns fit.
    turns = X_MNs[np.linalg.norm(X_MNs[:, :3, 3], axis=1) < 0.03]
    assert len(turns) > 8
    assert overlaps[0] < 0.99, "the handle tells, where it is seen"


def test_a_rod_slid_along_itself() -> None:
    X_MNs, overlaps = found(trimesh.creation.box([0.30, 0.03, 0.03]))
    slid = (np.abs(X_MNs[:, 0, 3]) > 0.015) & (X_MNs[:, 0, 0] > 0.99)
    assert slid.any() and overlaps[slid].max() > 0.8
    X_MNs, _ = found(trimesh.creation.box([0.04, 0.05, 0.06]))
    assert not (np.linalg.norm(X_MNs[:, :3, 3], axis=1) > 0.03).any(), "a short thing that is slid is elsewhere"


@pytest.mark.parametrize("label", load_catalogue().labels)
def test_every_object_has_motions_that_differ_and_do_what_they_say(label: str) -> None:
    vertices, faces = mesh_arrays(load_catalogue(), label)
    X_MNs, overlaps = near_symmetries(vertices, faces, vertices.mean(0))
    R_MNs = X_MNs[:, :3, :3]
    np.testing.assert_allclose(R_MNs @ np.swapaxes(R_MNs, 1, 2), np.broadcast_to(np.eye(3), R_MNs.shape), atol=1e-9)
    assert np.all(np.diff(overlaps) <= 0) and np.all(overlaps >= LEAST_OVERLAP) and np.all(overlaps <= 1)
    moved = [*X_MNs, np.eye(4)]
    for i, X in enumerate(moved):
        for Y in moved[:i]:
            far = np.linalg.norm(X[:3, 3] - Y[:3, 3]) > 0.01
            assert far or np.degrees(rotation_angle(X[:3, :3].T @ Y[:3, :3])) > 15
    again, _ = near_symmetries(vertices, faces, vertices.mean(0))
    np.testing.assert_array_equal(again, X_MNs)


def test_the_middle_is_what_it_turns_about() -> None:
    box = trimesh.creation.box([0.06, 0.06, 0.16])
    shift = np.array([0.3, -0.2, 0.1])
    here = found(box)[0]
    there = near_symmetries(np.asarray(box.vertices) + shift, np.asarray(box.faces, np.int64), shift)[0]
    np.testing.assert_allclose(apply(here, np.eye(3)), apply(there, np.eye(3)), atol=1e-6)
