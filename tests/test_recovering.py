"""Ways for an arm whose attempt did not go as planned."""

import dataclasses

import numpy as np
import pytest
from deciding import ARM, CATALOGUE, CONFIG, REGIONS, SCENE, believe, pick_can, see, see_can
from scenes import standing

from sum_drake import timing
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import solid_of
from sum_drake.recovering import Recovering
from sum_drake.robot import VIEW
from sum_drake.shaking import SHAKES

RECOVERING = Recovering(
    CATALOGUE, ARM, SCENE, REGIONS, CONFIG.clear_height, CONFIG.max_obstacle_points, PickConfig(), 2
)


@pytest.fixture(scope="module")
def can_seen():
    return see_can()


@pytest.fixture(scope="module")
def pick():
    return pick_can()


@pytest.fixture(scope="module")
def q_over_table():
    """The arm (8,) with the hand just over the table, pointing down."""
    X_WG = np.eye(4)
    X_WG[:3, :3] = np.column_stack([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
    X_WG[:3, 3] = [0.6, -0.1, 0.80]
    return ARM.solutions(X_WG, count=1)[0]


def assert_returns(motion, q):
    assert motion.id == 7
    np.testing.assert_allclose(motion.segments[0].trajectory.positions[0], q)
    # Continuous joints may come back a turn away.
    end = motion.segments[-1].trajectory.positions[-1]
    np.testing.assert_allclose(np.cos(end - VIEW), 1.0, atol=1e-9)


def test_the_way_back_goes_around_what_was_last_seen(q_over_table):
    tide = standing(CATALOGUE, "tide", 0.55, 0.2)
    motion = RECOVERING.retreat(see({"tide": tide}, [believe("tide", tide)]), q_over_table, 7)
    assert_returns(motion, q_over_table)
    among = SCENE.with_solids((solid_of(CATALOGUE["tide"], tide),))
    for segment in motion.segments:
        assert among.free_many(timing.sample(segment.trajectory, 0.01)).all(), segment.name


def test_a_belief_that_leaves_no_way_back_is_not_believed(q_over_table):
    """What was pushed about may be believed where the arm must go; table and bins still count."""
    hand = ARM.forward(VIEW)
    X_WO = np.eye(4)
    X_WO[:3, 3] = hand[:3, 3]
    motion = RECOVERING.retreat(see({}, [believe("tide", X_WO)]), q_over_table, 7)
    assert_returns(motion, q_over_table)
    assert not SCENE.with_solids((solid_of(CATALOGUE["tide"], X_WO),)).is_free(VIEW)
    for segment in motion.segments:
        assert SCENE.free_many(timing.sample(segment.trajectory, 0.01)).all(), segment.name


def test_the_way_on_with_what_is_in_the_hand_ends_where_it_was_to_be_let_go(can_seen, pick):
    q = timing.evaluate(pick.plan.place.segments[0].trajectory, 0.4)[0]
    motion = RECOVERING.carry_on(can_seen, pick, q, 7)
    assert (motion.id, motion.load) == (7, pick.plan.place.load)
    np.testing.assert_allclose(motion.segments[0].trajectory.positions[0], q)
    assert [segment.name for segment in motion.segments] == ["lift", "transport", "open", "retreat", "weigh", "return"]
    np.testing.assert_allclose(ARM.forward(motion.segments[2].trajectory.positions[0]), pick.plan.X_WG_place, atol=1e-6)


def test_the_way_back_with_something_in_the_hand_leads_past_where_it_was_taken(can_seen, pick, q_over_table):
    q = timing.evaluate(pick.plan.place.segments[0].trajectory, 0.4)[0]
    motion = RECOVERING.retreat(can_seen, q, 7, pick)
    assert_returns(motion, q)
    assert [segment.name for segment in motion.segments][2:4] == ["lower", "open"]
    X_WG = ARM.forward(motion.segments[3].trajectory.positions[0])
    np.testing.assert_allclose(X_WG, pick.plan.X_WG, atol=1e-6)
    # Where something has taken its place meanwhile, it is let go where the arm is.
    X_WO = standing(CATALOGUE, "tide", 0.6, 0.05)
    blocked = see({"tide": X_WO}, [believe("tide", X_WO, 3)])
    assert RECOVERING.retreat(blocked, q, 7, pick).segments[0].name == "open"


def test_what_is_held_is_not_gone_around_where_it_was_taken(can_seen, pick):
    """It cannot be put back; that it is still believed there must not cost the way around everything else."""
    q = timing.evaluate(pick.plan.place.segments[0].trajectory, 0.4)[0]
    at_home, on_the_way = np.eye(4), np.eye(4)
    at_home[:3, 3] = ARM.forward(VIEW)[:3, 3]
    straight = RECOVERING.retreat(see({}, [believe("soup_can", at_home)]), q, 7)
    back = straight.segments[-1].trajectory
    on_the_way[:3, 3] = ARM.forward(timing.evaluate(back, back.times[-1] / 2)[0])[:3, 3]
    place = standing(CATALOGUE, "tide", 0.6, 0.05)
    held = dataclasses.replace(pick, track=dataclasses.replace(pick.track, X_WO=at_home))
    others = [believe("tide", place, 3), believe("mustard", on_the_way, 4)]
    motion = RECOVERING.retreat(see({}, [held.track, *others]), q, 7, held)
    assert_returns(motion, q)
    assert motion.segments[0].name == "open"
    among = SCENE.with_solids([solid_of(CATALOGUE[track.label], track.X_WO) for track in others])
    assert not among.free_many(timing.sample(back, 0.01)).all()
    for segment in motion.segments:
        assert among.free_many(timing.sample(segment.trajectory, 0.01)).all(), segment.name


def test_what_was_stopped_over_its_bin_is_let_go_there(can_seen, pick):
    """What lies in the bin is met on every way; brought back to the table it would be no better off."""
    way = pick.plan.place.segments[0].trajectory
    q_in_bin, q_over_bin = way.positions[-1], timing.evaluate(way, way.times[-1] - 0.6)[0]
    assert ARM.forward(q_over_bin)[2, 3] > ARM.forward(q_in_bin)[2, 3] + 0.05
    for motion in (RECOVERING.carry_on(can_seen, pick, q_in_bin, 7), RECOVERING.retreat(can_seen, q_over_bin, 7, pick)):
        assert [segment.name for segment in motion.segments] == ["open", "retreat", "return"]
    aside = dataclasses.replace(pick, region="table")
    names = [segment.name for segment in RECOVERING.carry_on(can_seen, aside, q_in_bin, 7).segments]
    assert names[0] == "lift", "on a table it is not dropped from wherever it is"


@pytest.mark.parametrize("times", range(SHAKES))
def test_what_hangs_on_the_hand_is_shaken_off_over_where_it_was_to_be(can_seen, pick, times):
    q_now = pick.plan.place.segments[-1].trajectory.positions[-1]
    motion = RECOVERING.shake(can_seen, pick, q_now, 7, times)
    assert motion.id == 7
    assert [segment.name for segment in motion.segments] == [
        "shake", "weigh", "shake", "shake", "open", "shake", "return",
    ]  # fmt: skip
    for q in (motion.segments[0].trajectory.positions[0], motion.segments[-1].trajectory.positions[-1]):
        np.testing.assert_allclose(q, q_now)
    off = ARM.forward(motion.segments[4].trajectory.positions[0])[:3, 3] - pick.plan.X_WG_place[:3, 3]
    np.testing.assert_allclose(off[:2], 0.0, atol=1e-6)
