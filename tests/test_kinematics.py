"""The closed-form kinematics against Drake's, and against themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant

from sum_drake import robot
from sum_drake.geometry import rotation_angle
from sum_drake.kinematics import CONTINUOUS, Arm
from sum_drake.parsing import make_parser

ARM = Arm()


def random_positions(rng, count):
    """(count, 8), anywhere within the joint limits."""
    lower, upper = robot.limits()
    return rng.uniform(np.where(CONTINUOUS, -np.pi, lower), np.where(CONTINUOUS, np.pi, upper), (count, 8))


def assert_reaches(qs, X_WG):
    X_WGs = ARM.forward_many(qs)
    assert np.abs(X_WGs[:, :3, 3] - X_WG[:3, 3]).max() < 1e-9
    assert rotation_angle(X_WGs[:, :3, :3].swapaxes(1, 2) @ X_WG[:3, :3]).max() < 1e-7


def lifted(X_WG, height, count):
    """(count, 4, 4) straight up from X_WG."""
    X_WGs = np.tile(X_WG, (count, 1, 1))
    X_WGs[:, 2, 3] += np.linspace(0, height, count)
    return X_WGs


def test_forward_is_that_of_the_urdf():
    plant = MultibodyPlant(0.0)
    make_parser(plant).AddModels(url=robot.FETCH_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    hand = plant.GetBodyByName("gripper_link")
    order = [plant.GetJointByName(joint.name).position_start() for joint in robot.ARM_JOINTS]
    for q in random_positions(np.random.default_rng(0), 20):
        positions = np.zeros(plant.num_positions())
        positions[order] = q
        plant.SetPositions(context, positions)
        X_WG = plant.EvalBodyPoseInWorld(context, hand).GetAsMatrix4()
        np.testing.assert_allclose(ARM.forward(q), X_WG, atol=1e-12)


def test_what_is_out_of_reach_has_no_solution_and_what_the_arm_does_is_within():
    rng = np.random.default_rng(3)
    assert all(ARM.reaches(X_WG) for X_WG in ARM.forward_many(random_positions(rng, 300)))
    X_WGs = ARM.forward_many(random_positions(rng, 60))
    X_WGs[:, :3, 3] += rng.uniform(-0.6, 0.6, (60, 3))
    beyond = [X_WG for X_WG in X_WGs if not ARM.reaches(X_WG)]
    assert len(beyond) > 5
    assert not any(len(ARM.solutions(X_WG)) for X_WG in beyond)


def test_reachable_poses_are_solved():
    X_WGs = ARM.forward_many(random_positions(np.random.default_rng(1), 300))
    solved = [ARM.solutions(X_WG, count=1) for X_WG in X_WGs]
    assert sum(map(len, solved)) >= 299
    for qs, X_WG in zip(solved, X_WGs, strict=True):
        if len(qs):
            assert_reaches(qs, X_WG)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_solutions_are_exact_distinct_and_within_limits(seed):
    rng = np.random.default_rng(seed)
    q, near = random_positions(rng, 2)
    lower, upper = robot.limits()
    margin = np.array([0.005, *[0.05] * 7])
    q = np.clip(q, lower + margin, upper - margin)
    qs = ARM.solutions(ARM.forward(q), near=near, spread=0.4)
    assert len(qs)
    assert_reaches(qs, ARM.forward(q))
    assert ((qs > lower) & (qs < upper)).all()
    assert (np.abs(qs - near)[:, CONTINUOUS] <= np.pi + 1e-9).all()
    apart = np.abs(qs[:, None] - qs[None]).max(-1)
    assert (apart + np.eye(len(qs)) >= 0.4).all()


def test_the_reference_itself_is_the_first_choice():
    q = random_positions(np.random.default_rng(3), 1)[0]
    q[[1, 2, 4, 6]] *= 0.8
    q[0] = 0.2
    np.testing.assert_allclose(ARM.solutions(ARM.forward(q), near=q)[0], q, atol=1e-6)


def test_a_straight_wrist_is_solved():
    q = np.array([0.2, 0.3, 0.2, 0.4, 0.9, 0.7, 0.0, -0.5])
    qs = ARM.solutions(ARM.forward(q), near=q)
    assert len(qs)
    assert_reaches(qs, ARM.forward(q))


@pytest.mark.parametrize("p_WG", [(2.0, 0.0, 0.8), (0.6, 0.0, 3.0), (-1.0, 0.0, 0.5)])
def test_poses_out_of_reach_have_no_solution(p_WG):
    X_WG = np.eye(4)
    X_WG[:3, 3] = p_WG
    assert ARM.solutions(X_WG).shape == (0, 8)


def test_a_straight_line_is_followed_without_jumps():
    followed = 0
    for q in random_positions(np.random.default_rng(4), 40):
        X_WGs = lifted(ARM.forward(q), 0.1, 11)
        for q_start in ARM.solutions(X_WGs[0], near=q, count=1):
            for path in ARM.follow(X_WGs, q_start):
                np.testing.assert_array_equal(path[0], q_start)
                assert np.abs(np.diff(path, axis=0)).max() < 0.3
                np.testing.assert_allclose(ARM.forward_many(path), X_WGs, atol=1e-6)
                followed += 1
    assert followed > 20


def test_a_line_that_leaves_the_workspace_is_not_followed():
    q = np.array([0.2, 0.3, 0.2, 0.4, 0.9, 0.7, 0.5, -0.5])
    assert len(ARM.follow(lifted(ARM.forward(q), 3.0, 300), q)) == 0
