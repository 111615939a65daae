"""The way on of an arm that was stopped with an object in its hand."""

import itertools

import numpy as np
import pytest
from test_picking import ARM, BIN, CATALOGUE, plan, standing

from sum_drake import timing
from sum_drake.carrying import Carrying
from sum_drake.geometry import inverse
from sum_drake.pick_config import PickConfig
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene, solid_of

LABEL, X_WO = "soup_can", standing("soup_can", 0.6, 0.05)


@pytest.fixture(scope="module")
def scene():
    return PlanningScene()


@pytest.fixture(scope="module")
def made(scene):
    answer = plan(scene)
    assert isinstance(answer, PickPlan)
    return answer


def carrying(scene, made, q_now, **more):
    return Carrying(
        arm=ARM, scene=scene, plan=made, X_WO=X_WO, model=CATALOGUE[LABEL], q_now=q_now, seed=1, config=PickConfig(),
        **more,
    )  # fmt: skip


def test_it_rises_goes_around_and_lets_go_as_planned(scene, made):
    q_now = timing.evaluate(made.place.segments[0].trajectory, 0.4)[0]
    motion = carrying(scene, made, q_now).plan_on(9)
    assert (motion.id, motion.load) == (9, made.place.load)
    assert [segment.name for segment in motion.segments] == ["lift", "transport", "open", "retreat", "weigh", "return"]
    assert motion.segments[2:] == made.place.segments[1:]
    np.testing.assert_allclose(motion.segments[0].trajectory.positions[0], q_now)
    for before, after in itertools.pairwise(motion.segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    rise = ARM.forward_many(timing.sample(motion.segments[0].trajectory, 0.05))[:, :3, 3]
    assert rise[-1, 2] > rise[0, 2] + 0.04 and np.abs(rise[:, :2] - rise[0, :2]).max() < 0.003
    held = scene.holding(solid_of(CATALOGUE[LABEL], X_WO).hulls, inverse(made.X_WG) @ X_WO)
    for segment in motion.segments[:2]:
        assert segment.gap == 0.0, "the hand stays closed"
        assert held.with_gap(made.grasp.width).free_many(timing.sample(segment.trajectory, 0.004)).all()
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6


def test_what_cannot_be_brought_away_is_put_down_where_it_was_and_the_hand_goes_back_as_it_came(scene, made):
    q_now = timing.evaluate(made.place.segments[0].trajectory, 1.0)[0]
    motion = carrying(scene, made, q_now).plan_back(9)
    assert [segment.name for segment in motion.segments] == ["lift", "transport", "lower", "open", "retreat", "return"]
    assert motion.load == made.place.load
    came = {segment.name: segment for segment in made.pick.segments}
    q_grasp, q_start = came["close"].trajectory.positions[-1], came["approach"].trajectory.positions[0]
    np.testing.assert_allclose(motion.segments[2].trajectory.positions[-1], came["lift"].trajectory.positions[0])
    np.testing.assert_allclose(motion.segments[3].trajectory.positions[0], q_grasp, atol=1e-9)
    np.testing.assert_allclose(motion.segments[-1].trajectory.positions[-1], q_start)
    for before, after in itertools.pairwise(motion.segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    assert [segment.gap for segment in motion.segments[:3]] == [0.0] * 3, "the hand stays closed until it is there"
    assert all(segment.gap >= came["approach"].gap - 1e-9 for segment in motion.segments[3:])
    for segment in motion.segments:
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6
    with pytest.raises(RuntimeError, match="no free way on"):
        carrying(scene, made, q_now, obstacles=[(CATALOGUE["tide"], X_WO)]).plan_back(9)


def test_where_there_is_no_way_it_is_said_why(scene, made):
    q_now = timing.evaluate(made.place.segments[0].trajectory, 0.4)[0]
    with pytest.raises(RuntimeError, match=r"no free way on .*goal_in_collision .*tide"):
        carrying(scene, made, q_now, obstacles=[(CATALOGUE["tide"], made.X_WO_place)]).plan_on(9)


def test_in_its_bin_it_is_let_go_though_something_was_met_there(scene, made):
    """What lies in the bin already is not known of, and is met on every way."""
    way = made.place.segments[0].trajectory
    q_there, q_above = way.positions[-1], timing.evaluate(way, 0.4)[0]
    held = carrying(scene, made, q_there, bin=BIN)
    assert held.is_in_bin
    motion = held.plan_on(9)
    assert motion.id == 9
    assert [segment.name for segment in motion.segments] == ["open", "retreat", "return"]
    np.testing.assert_allclose(motion.segments[0].trajectory.positions[0], q_there)
    for elsewhere in (carrying(scene, made, q_above, bin=BIN), carrying(scene, made, q_there)):
        assert not elsewhere.is_in_bin
        assert elsewhere.plan_on(9).segments[0].name == "lift", "on the table, or not over it yet: it is not dropped"
