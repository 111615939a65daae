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


@pytest.fixture(scope="module")
def hand_of_urdf():
    """X_WG (4, 4) of q (8,), by Drake."""
    plant = MultibodyPlant(0.0)
    make_parser(plant).AddModels(url=robot.FETCH_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    hand = plant.GetBodyByName("gripper_link")
    order = [plant.GetJointByName(joint.name).position_start() for joint in robot.ARM_JOINTS]

    def pose(q):
        positions = np.zeros(plant.num_positions())
        positions[order] = q
        plant.SetPositions(context, positions)
        return plant.EvalBodyPoseInWorld(context, hand).GetAsMatrix4()

    return pose


def test_forward_is_that_of_the_urdf(hand_of_urdf):
    for q in random_positions(np.random.default_rng(0), 20):
        np.testing.assert_allclose(ARM.forward(q), hand_of_urdf(q), atol=1e-12)


def test_solutions_put_the_hand_of_the_urdf_there(hand_of_urdf):
    for X_WG in ARM.forward_many(random_positions(np.random.default_rng(5), 20)):
        for q in ARM.solutions(X_WG):
            np.testing.assert_allclose(hand_of_urdf(q), X_WG, atol=1e-9)


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


@settings(max_examples=40)
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


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.floats(0.0, 2.0), st.booleans())
def test_the_cheapest_that_differ_are_chosen(seed, count, spread, close_to_limits):
    rng = np.random.default_rng(seed)
    q, near = random_positions(rng, 2)
    if close_to_limits:
        near[[1, 2, 4, 6]] *= 0.98 / np.abs(near[[1, 2, 4, 6]])
    every = ARM.solutions(ARM.forward(q), near=near, count=5000, spread=0.0)
    lower, upper = robot.limits()
    seconds = np.abs(every - near) / robot.velocity_limits()
    room = np.minimum(every - lower, upper - every)[:, 1:].min(1, initial=np.inf)
    costs = seconds.max(1, initial=0.0) + 0.15 * seconds.sum(1) + 5.0 * np.maximum(0.0, 0.15 - room)
    assert (np.diff(costs) >= -1e-12).all()
    wanted = []
    for q_next in every:
        if len(wanted) < count and all(np.abs(q_next - other).max() >= spread for other in wanted):
            wanted.append(q_next)
    chosen = ARM.solutions(ARM.forward(q), near=near, count=count, spread=spread)
    np.testing.assert_array_equal(chosen, np.reshape(wanted, (-1, 8)))


def test_many_poses_at_once_are_solved_as_one_by_one():
    near = random_positions(np.random.default_rng(6), 1)[0]
    X_WGs = ARM.forward_many(random_positions(np.random.default_rng(7), 20))
    X_WGs[3, 0, 3] = 5.0
    together = ARM.solutions_many(X_WGs, near=near, count=5)
    assert len(together) == len(X_WGs)
    assert together[3].shape == (0, 8)
    for qs, X_WG in zip(together, X_WGs, strict=True):
        np.testing.assert_array_equal(qs, ARM.solutions(X_WG, near=near, count=5))
    assert ARM.solutions_many(np.empty((0, 4, 4))) == []


def test_what_the_grid_misses_is_found_between_its_lines():
    # Stretched upwards with the torso as high as it goes: only a sliver of torso heights and pans reaches so far.
    rng = np.random.default_rng(8)
    qs = random_positions(rng, 300)
    qs[:, 0] = robot.TORSO.upper - 0.001 - 0.002 * rng.random(300)
    qs[:, 1:3] = rng.uniform([-1.5, -1.2], [1.5, -0.9], (300, 2))
    qs[:, [4, 6]] *= 0.02
    X_WGs = ARM.forward_many(qs)
    on_grid = ARM.solutions_many(X_WGs, thorough=False)
    between = ARM.solutions_many(X_WGs)
    assert sum(len(found) > 0 for found in on_grid) < 200
    assert sum(len(found) > 0 for found in between) >= 297
    for found, X_WG in zip(between, X_WGs, strict=True):
        if len(found):
            assert_reaches(found, X_WG)
        assert ARM.within_limits(found).all()


def test_arrays_of_any_kind_are_taken():
    q = np.array([0.2, 0.3, 0.2, 0.4, 0.9, 0.7, 0.5, -0.5])
    X_WG = ARM.forward(q)
    wanted = ARM.solutions(X_WG, near=q)
    frozen = np.asfortranarray(X_WG)
    frozen.flags.writeable = False
    np.testing.assert_array_equal(ARM.solutions(frozen, near=q.tolist()), wanted)
    with pytest.raises(ValueError, match="X_WG: is not finite"):
        ARM.solutions(np.full((4, 4), np.nan))


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


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(-0.15, 0.15))
def test_what_follows_a_line_keeps_its_branch_and_moves_torso_and_pan_evenly(seed, height):
    X_WGs = lifted(ARM.forward(random_positions(np.random.default_rng(seed), 1)[0]), height, 16)
    for q_start in ARM.solutions(X_WGs[0], count=2):
        for path in ARM.follow(X_WGs, q_start, count=100, step=0.2):
            np.testing.assert_array_equal(path[0], q_start)
            np.testing.assert_allclose(np.diff(path[:, :2], 2, axis=0), 0.0, atol=1e-9)
            assert ARM.within_limits(path).all()
            assert np.abs(np.diff(path, axis=0)).max() < 0.2
            np.testing.assert_allclose(ARM.forward_many(path), X_WGs, atol=1e-6)
            for branch in (np.sin(path[:, 4]), np.cos(path[:, 3]), np.sin(path[:, 6])):
                assert (np.abs(branch) < 1e-6).any() or len(set(np.sign(branch))) == 1


def test_a_line_that_leaves_the_workspace_is_not_followed():
    q = np.array([0.2, 0.3, 0.2, 0.4, 0.9, 0.7, 0.5, -0.5])
    assert len(ARM.follow(lifted(ARM.forward(q), 3.0, 300), q)) == 0


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: ARM.forward(np.zeros(7)), r"q: has the shape \(7,\); expected \(8,\)"),
        (lambda: ARM.forward(np.zeros((1, 8))), r"q: has the shape \(1, 8\); expected \(8,\)"),
        (lambda: ARM.forward_many(np.zeros(8)), r"qs: has the shape \(8,\); expected \(n, 8\)"),
        (lambda: ARM.solutions(np.eye(3)), r"X_WG: has the shape \(3, 3\); expected \(4, 4\)"),
        (lambda: ARM.solutions(np.eye(4), near=np.zeros(7)), r"near: has the shape \(7,\); expected \(8,\)"),
        (lambda: ARM.solutions(np.eye(4) * np.nan), "X_WG: is not finite"),
        (lambda: ARM.solutions_many(np.eye(4)), r"X_WGs: has the shape \(4, 4\); expected \(n, 4, 4\)"),
        (lambda: ARM.follow(np.eye(4)[None], np.zeros(7)), r"q_start: has the shape \(7,\); expected \(8,\)"),
    ],
)
def test_arrays_of_another_shape_are_one_line(ask, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        ask()
