"""The way back after a failed pick."""

import numpy as np
import pytest
from arm_poses import ARM, pointing_down
from scenes import standing

from sum_drake import robot, timing
from sum_drake.kinematics import CONTINUOUS
from sum_drake.objects import load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import PlanningScene, solid_of
from sum_drake.retreat import plan_retreat


@pytest.mark.parametrize("z", [0.76, 0.95])
def test_the_way_back_opens_rises_and_returns(z):
    scene = PlanningScene()
    q_now = ARM.solutions(pointing_down([0.6, -0.1, z]))[0]
    motion = plan_retreat(arm=ARM, scene=scene, q_now=q_now, motion_id=5, seed=0, config=PickConfig())
    assert motion.id == 5
    assert [s.name for s in motion.segments] == ["open", "retreat", "return"]
    assert all(s.gap == robot.HAND.gap_max for s in motion.segments)
    np.testing.assert_allclose(motion.segments[0].trajectory.positions[0], q_now)
    for segment in motion.segments:
        assert scene.free_many(timing.sample(segment.trajectory, 0.004)).all()
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6
    rise = ARM.forward_many(timing.sample(motion.segments[1].trajectory, 0.05))[:, :3, 3]
    assert np.abs(rise[:, :2] - rise[0, :2]).max() < 0.003
    assert rise[-1, 2] > rise[0, 2] + 0.04
    turns = (motion.segments[-1].trajectory.positions[-1] - robot.VIEW) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.where(CONTINUOUS, np.round(turns), 0.0), atol=1e-6)


def test_the_hand_does_not_rise_into_what_is_above_it_nor_open_into_what_is_beside_it():
    catalogue, scene = load_catalogue(), PlanningScene()
    q_now = ARM.solutions(pointing_down([0.6, -0.1, 0.78]))[0]
    above = standing(catalogue, "sugar", 0.6, -0.1)
    above[2, 3] = 1.33
    sides = [standing(catalogue, "soup_can", 0.6, -0.1 + side * 0.083) for side in (-1, 1)]
    obstacles = [(catalogue["sugar"], above), *((catalogue["soup_can"], X) for X in sides)]
    motion = plan_retreat(arm=ARM, scene=scene, q_now=q_now, seed=0, config=PickConfig(), obstacles=obstacles)
    around = scene.with_solids([solid_of(*one) for one in obstacles])
    assert motion.segments[0].gap < robot.HAND.gap_max
    for segment in motion.segments:
        assert around.with_gap(segment.gap).free_many(timing.sample(segment.trajectory, 0.004)).all(), segment.name
