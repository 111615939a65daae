import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.geometry import (
    SYMMETRIES,
    apply,
    inverse,
    iou,
    pose_error,
    rotation_angle,
    rotation_error,
    rotation_from_quaternion,
    rotation_from_vector,
    super_fibonacci,
    symmetry_group,
    transform,
)

numbers = st.floats(-3.0, 3.0, allow_nan=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
poses = st.builds(lambda w, p: transform(rotation_from_vector(w), p), vectors, vectors)
boxes = st.tuples(*[st.floats(0, 600)] * 2, *[st.floats(0.5, 300)] * 2)


@given(poses, poses, vectors)
def test_motions_form_a_group_that_acts_on_points(X_AB, X_BC, p_CQ):
    np.testing.assert_allclose(X_AB @ inverse(X_AB), np.eye(4), atol=1e-12)
    composed = apply(X_AB @ X_BC, p_CQ[None])
    np.testing.assert_allclose(composed, apply(X_AB, apply(X_BC, p_CQ[None])), atol=1e-10)


@given(vectors)
def test_rotation_vector_gives_a_rotation_of_its_length(w):
    R = rotation_from_vector(w)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    angle = np.linalg.norm(w) % (2 * np.pi)
    assert rotation_angle(R) == pytest.approx(min(angle, 2 * np.pi - angle), abs=1e-7)


def test_quaternion_and_rotation_vector_agree_on_a_batch():
    angles = np.linspace(0, 3, 7)
    q = np.stack([np.cos(angles / 2), 0 * angles, np.sin(angles / 2), 0 * angles], -1)
    w = np.stack([0 * angles, angles, 0 * angles], -1)
    np.testing.assert_allclose(rotation_from_quaternion(5.0 * q), rotation_from_vector(w), atol=1e-12)


@given(poses, poses, st.sampled_from(SYMMETRIES), st.floats(0, 2 * np.pi))
def test_no_member_of_the_group_changes_an_error(X_WA, X_WB, name, angle):
    symmetry = symmetry_group(name)
    error = pose_error(X_WA, X_WB, symmetry)
    for R in symmetry.rotations:
        turn = np.eye(3) if symmetry.axis is None else rotation_from_vector(symmetry.axis * angle)
        turned = pose_error(X_WA @ transform(R @ turn, np.zeros(3)), X_WB, symmetry)
        np.testing.assert_allclose(turned, error, atol=1e-6)


@given(poses, st.sampled_from(SYMMETRIES))
def test_error_with_itself_is_zero_and_symmetry_never_makes_it_larger(X_WA, name):
    plain, symmetry = symmetry_group("none"), symmetry_group(name)
    assert rotation_error(X_WA[:3, :3], X_WA[:3, :3], symmetry) == pytest.approx(0.0, abs=1e-7)
    R = rotation_from_vector(np.array([0.3, -1.1, 0.7]))
    assert rotation_error(X_WA[:3, :3], R, symmetry) <= rotation_error(X_WA[:3, :3], R, plain) + 1e-9


@pytest.mark.parametrize("name", SYMMETRIES)
def test_symmetry_rotations_are_closed_under_composition(name):
    symmetry = symmetry_group(name)
    for A in symmetry.rotations:
        for B in symmetry.rotations:
            assert rotation_error(A @ B, np.eye(3), symmetry) < 1e-9


def test_a_can_stood_on_its_head_is_the_same_can_but_a_bottle_is_not():
    over = rotation_from_vector(np.array([np.pi, 0, 0]))
    assert rotation_error(np.eye(3), over, symmetry_group("cylinder")) < 1e-9
    assert rotation_error(np.eye(3), over, symmetry_group("revolution")) == pytest.approx(np.pi)


def test_super_fibonacci_covers_rotations_better_than_chance():
    rng = np.random.default_rng(0)
    probes = rotation_from_quaternion(rng.normal(size=(300, 4)))

    def gap(q):
        R = rotation_from_quaternion(q)
        return float(np.arccos((np.einsum("aij,bij->ab", probes, R).max(1) - 1) / 2).max())

    assert gap(super_fibonacci(600, rng)) < 0.85 * gap(rng.normal(size=(600, 4)))


def test_unknown_symmetry_is_a_key_error():
    with pytest.raises(KeyError):
        symmetry_group("threefold")


def iou_of_two(a, b):
    """One pair at a time: what `iou` does for all at once."""
    w = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    h = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    intersection = max(w, 0.0) * max(h, 0.0)
    return intersection / (a[2] * a[3] + b[2] * b[3] - intersection)


@given(st.lists(boxes, max_size=8), st.lists(boxes, max_size=8))
def test_iou_is_that_of_pairs(a, b):
    expected = np.array([[iou_of_two(p, q) for q in b] for p in a]).reshape(len(a), len(b))
    np.testing.assert_allclose(iou(a, b), expected, atol=1e-9)
    np.testing.assert_allclose(iou(a, b), iou(b, a).T, atol=1e-9)
    np.testing.assert_allclose(np.diag(iou(a, a)), 1.0)


def test_iou_of_whole_pixels_of_disjoint_and_of_empty_boxes():
    assert iou([[0, 0, 10, 10]], [[5, 0, 10, 10]])[0, 0] == 50 / 150
    assert iou((0, 0, 10, 10), (20, 0, 10, 10))[0, 0] == 0
    assert iou([[0, 0, 10, 10]], [[10, 0, 10, 10]])[0, 0] == 0
    assert iou([[3, 3, 0, 0]], [[3, 3, 0, 0]])[0, 0] == 0
