"""The compiled checks against Drake's, and edges against configurations along them."""

import numpy as np
import pytest
from arm_poses import walled_scene
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from sum_drake import robot
from sum_drake.collision_model import REVOLUTE, Skeleton, collision_model
from sum_drake.convex import CYLINDER
from sum_drake.geometry import apply
from sum_drake.kinematics import Arm
from sum_drake.objects import load_catalogue
from sum_drake.parsing import parser_allowed
from sum_drake.planning_scene import PlanningScene, solid_of

SEEDS = st.integers(0, 2**32 - 1)


def drawn(rng, n, spread=0.5):
    """Configurations about the viewing pose, within limits."""
    lower, upper = robot.limits()
    return np.clip(robot.VIEW + rng.normal(0, spread, (n, 8)), lower, upper)


@pytest.fixture(scope="module")
def scenes():
    mug = load_catalogue()["mug"]
    X_WO = np.eye(4)
    X_WO[:3, 3] = 0.6, -0.1, 0.75
    walled = PlanningScene(solids=(*walled_scene().solids, solid_of(mug, X_WO)))
    X_GO = np.eye(4)
    X_GO[0, 3] = 0.03
    return {
        "bare": PlanningScene(),
        "walled": walled,
        "padded": walled.padded(furniture=0.01, solids=0.006, self_distance=0.005),
        "ignoring": walled.ignoring("wall", "mug").with_gap(0.02),
        "holding": walled.ignoring("mug").holding(solid_of(mug, X_WO).hulls, X_GO),
    }


@pytest.mark.parametrize("name", ["bare", "walled", "padded", "ignoring", "holding"])
def test_it_says_what_drake_says(scenes, name):
    scene = scenes[name]
    qs = drawn(np.random.default_rng(1), 300)
    drake = np.array(scene.checker.CheckConfigsCollisionFree(list(scene.full(qs)), parallelize=False), dtype=bool)
    assert 0.1 < drake.mean() < 0.95
    np.testing.assert_array_equal(scene.free_many(qs), drake)
    assert [scene.is_free(q) for q in qs[:20]] == drake[:20].tolist()


def test_links_are_where_forward_kinematics_has_them(scenes):
    model, arm = scenes["bare"].model, Arm()
    for q in drawn(np.random.default_rng(2), 10, 1.0):
        hand = model.links.poses(q)[8] @ np.array([[1, 0, 0, robot.GRIPPER_ORIGIN[0]], [0, 1, 0, 0], [0, 0, 1, 0],
                                                   [0, 0, 0, 1]])  # fmt: skip
        np.testing.assert_allclose(hand, arm.forward(q), atol=1e-9)


@settings(max_examples=25)
@given(seed=SEEDS)
def test_a_free_edge_is_free_everywhere_and_a_step_finds_what_is_in_the_way(scenes, seed):
    scene, rng = scenes["padded"], np.random.default_rng(seed)
    q0, q1 = drawn(rng, 2, 0.4)
    every = scene.free_many(np.linspace(q0, q1, 2 + int(np.abs(q1 - q0).max() / 0.001)))
    if scene.edge_free(q0, q1, 0.005):
        # What is thinner than the step may be missed, and nothing else.
        longest = np.diff(np.flatnonzero(np.concatenate([[True], every, [True]]))).max() - 1
        assert (longest - 1) * np.abs(q1 - q0).max() / (len(every) - 1) < 0.005
        assert every[0] and every[-1]
    else:
        assert not every.all()


def hull_points(bodies, i):
    """(n, 3): of body i, where it is before it is swollen; of a cylinder, around its rims."""
    points = bodies.points[bodies.first[i] : bodies.first[i + 1]]
    if bodies.kind[i] != CYLINDER:
        return points
    (radius, _, half), turns = points[0], np.linspace(0, 2 * np.pi, 32, endpoint=False)
    rim = np.stack([radius * np.cos(turns), radius * np.sin(turns), np.full(32, half)], axis=1)
    return np.concatenate([rim, rim * [1, 1, -1]])


@settings(max_examples=25)
@given(seed=SEEDS)
def test_no_point_of_a_link_moves_faster_than_is_reckoned_with(scenes, seed):
    model, rng = scenes["bare"].model, np.random.default_rng(seed)
    lower, upper = robot.limits()
    q = rng.uniform(np.maximum(lower, -3), np.minimum(upper, 3))
    points = [apply(model.X_LB[i], hull_points(model.bodies, i)) for i in range(len(model.link))]
    link, p_LQ = np.repeat(model.link, [len(of) for of in points]), np.concatenate(points)
    swell = np.repeat(model.bodies.swell, [len(of) for of in points])
    for k in range(8):
        moved = q.copy()
        moved[k] += 1e-5
        rate = (model.links.poses(moved) - model.links.poses(q))[link] / 1e-5
        shift = np.linalg.norm((rate[:, :3, :3] @ p_LQ[:, :, None])[:, :, 0] + rate[:, :3, 3], axis=1)
        # Of a ball about a point, what is farthest from the joint's axis moves faster by radius times turn.
        turn = np.linalg.norm(rate[:, :3, :3], axis=(1, 2)) / np.sqrt(2)
        assert np.all(shift + swell * turn <= model.speed[k, link] + 1e-6)


def test_any_robot_drake_reads_will_do():
    urdf = """<robot name="two">
      <link name="a"><collision><geometry><box size=".1 .1 .1"/></geometry></collision></link>
      <link name="b"><collision><origin xyz=".5 0 0"/><geometry><sphere radius=".05"/></geometry></collision></link>
      <link name="c"><collision><origin xyz="0 0 .2"/><geometry><cylinder radius=".03" length=".2"/></geometry>
        </collision></link>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
      <joint name="k" type="prismatic"><parent link="b"/><child link="c"/><origin xyz=".5 0 0" rpy=".3 0 0"/>
        <axis xyz="0 1 0"/><limit lower="-.3" upper=".3" effort="1" velocity="1"/></joint></robot>"""
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    (model,) = builder.parser().AddModelsFromString(urdf, "urdf")
    plant = builder.plant()
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("a"), RigidTransform())
    checker = SceneGraphCollisionChecker(model=builder.Build(), robot_model_instances=[model], edge_step_size=0.01)
    checker.AddCollisionShapeToFrame("ball", checker.plant().world_frame(), Sphere(0.1), RigidTransform([0, 0.5, 0]))
    skeleton = Skeleton.of(checker, ["j", "k"])
    mine = collision_model(checker, skeleton, np.zeros(2))
    assert mine.links.kind.tolist() == [REVOLUTE, 1]
    qs = np.random.default_rng(0).uniform([-3, -0.3], [3, 0.3], (2000, 2))
    drake = [checker.CheckConfigCollisionFree(q) for q in qs]
    assert 0.5 < np.mean(drake) < 0.99
    np.testing.assert_array_equal(mine.free_many(qs), drake)


def test_joints_come_from_the_base_outwards(scenes):
    checker = scenes["bare"].checker
    names = [joint.name for joint in robot.ARM_JOINTS]
    with pytest.raises(ValueError, match="from the base outwards"):
        collision_model(checker, Skeleton.of(checker, names[::-1]), scenes["bare"].q_full)
    with pytest.raises(ValueError, match="expected one that turns or slides"):
        Skeleton.of(checker, ["torso_fixed_joint"])
