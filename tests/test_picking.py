"""Whole picks and places, judged by scenes of their own."""

import dataclasses
import itertools

import numpy as np
import pytest

from sum_drake import robot, timing
from sum_drake.action_model import STILL
from sum_drake.geometry import apply, inverse, rotation_from_vector, transform
from sum_drake.grasp_ranking import CAUSES, RankedGrasps, rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates, opening
from sum_drake.kinematics import CONTINUOUS, Arm
from sum_drake.letting_go import release_gap
from sum_drake.objects import load_catalogue, sample_surface
from sum_drake.pick_config import PickConfig
from sum_drake.picking import Infeasible, PickPlan, plan_pick_place
from sum_drake.planning_scene import PlanningScene, solid_of
from sum_drake.playback import GAP_SPEED
from sum_drake.types import Grasp, PoseBelief, Region

ARM = Arm()
CATALOGUE = load_catalogue()
BIN = Region("non_cleaning_bin", np.array([0.12, 0.62, 0.47]), np.array([0.18, 0.18, 0.18]))
TOP = Region("table", np.array([0.72, 0.0, 0.95]), np.array([0.30, 0.45, 0.25]))
TABLE = 0.70


@pytest.fixture(scope="module")
def scene():
    return PlanningScene()


def standing(label, x, y, yaw=0.0):
    """X_WO (4, 4) of an object that stands on the table."""
    R = rotation_from_vector(np.array([0.0, 0.0, yaw]))
    return transform(R, np.array([x, y, TABLE + CATALOGUE[label].dimensions[2] / 2]))


def from_above(label, X_WO, count=4):
    """Grasps of an upright box across its thin side, at various heights, as if they had been ranked."""
    width, _, height = CATALOGUE[label].dimensions
    grasps, X_WGs = [], []
    for depth in np.linspace(0.015, 0.027, count):
        R_OG = np.column_stack([[0, 0, -1.0], [1.0, 0, 0], [0, -1.0, 0]])
        X_OG = transform(R_OG, np.array([0, 0, height / 2 - depth]))
        grasps.append(Grasp(label, X_OG, min(width, 0.08), 1.0))
        X_WGs.append(X_WO @ X_OG)
    return RankedGrasps(
        tuple(grasps), np.array(X_WGs), np.full(count, 0.1), np.ones(count), tuple((c, 0) for c in CAUSES)
    )


def plan(scene, label="soup_can", x=0.6, y=0.05, **changes):
    X_WO = standing(label, x, y)
    given = {
        "arm": ARM, "scene": scene, "ranked": from_above(label, X_WO), "X_WO": X_WO, "model": CATALOGUE[label],
        "region": BIN, "q_now": robot.VIEW, "seed": 3, "config": PickConfig(),
    }  # fmt: skip
    return plan_pick_place(**{**given, **changes})


def assert_sound(scene, made, model, X_WO, obstacles):
    """Continuous, within limits, free at .005 rad by scenes set up here, and ending where it should."""
    segments = made.pick.segments + made.place.segments
    assert [s.name for s in segments] == [
        "approach", "reach", "close", "lift", "transport", "open", "retreat", "weigh", "return",
    ]  # fmt: skip
    for before, after in itertools.pairwise(segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    for segment in segments:
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6, segment.name
        ends = segment.trajectory.velocities[[0, -1]]
        np.testing.assert_allclose(ends, 0.0, atol=1e-9)
    others = tuple(solid_of(m, X) for m, X in obstacles)
    hulls = solid_of(model, X_WO).hulls
    empty = scene.with_solids(others)
    whole = scene.with_solids((*others, solid_of(model, X_WO, "target")))
    holding = empty.holding(hulls, inverse(made.X_WG) @ X_WO)
    for segment in segments:
        # Slow enough that no joint moves by more than .005 between samples.
        qs = timing.sample(segment.trajectory, 0.004 / np.abs(segment.trajectory.velocities).max().clip(0.1))
        judge = {"approach": whole, "transport": holding}.get(segment.name, empty)
        gap = segment.gap if segment.gap > 0 else made.grasp.width
        assert judge.with_gap(gap).free_many(qs).all(), segment.name
    # The held object comes off the table and stays clear of it.
    lift = timing.sample(segments[3].trajectory, 0.02)
    assert holding.with_gap(made.grasp.width).free_many(lift)[-10:].all()
    turns = (segments[-1].trajectory.positions[-1] - robot.VIEW) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.where(CONTINUOUS, np.round(turns), 0.0), atol=1e-6)
    # The object is let go inside the region.
    np.testing.assert_allclose(made.X_WG_place @ inverse(made.X_WG) @ X_WO, made.X_WO_place, atol=1e-9)
    np.testing.assert_allclose(ARM.forward(segments[5].trajectory.positions[0]), made.X_WG_place, atol=1e-6)


def assert_lands_in(region, made, model):
    corners = apply(made.X_WO_place, np.concatenate(solid_of(model, np.eye(4)).hulls))
    assert (np.abs(corners[:, :2] - region.p_W[:2]).max(0) <= region.half_extents[:2]).all()
    assert region.floor_height < corners[:, 2].min() < region.rim_height


@pytest.fixture(scope="module")
def made(scene):
    answer = plan(scene)
    assert isinstance(answer, PickPlan)
    return answer


def test_an_object_is_picked_and_placed(scene, made):
    assert_sound(scene, made, CATALOGUE["soup_can"], standing("soup_can", 0.6, 0.05), [])
    assert_lands_in(BIN, made, CATALOGUE["soup_can"])
    assert made.pick.duration + made.place.duration < 30
    assert made.grasp_candidates == 4


def test_a_real_grasp_in_a_cluttered_scene(scene):
    model, X_WO = CATALOGUE["mug"], standing("mug", 0.62, -0.05, 0.4)
    obstacles = [(CATALOGUE[label], standing(label, x, y)) for label, x, y in
                 (("sugar", 0.62, 0.13), ("shampoo", 0.72, -0.12), ("soup_can", 0.5, -0.2))]  # fmt: skip
    points_W = np.concatenate([apply(X, np.asarray(m.load_mesh().vertices)) for m, X in obstacles])
    config = GraspConfig()
    ranked = rank_grasps(
        grasp_candidates(model, config=config, seed=0), model=model, X_WO=X_WO,
        belief=PoseBelief(X_WO[None], np.ones(1)), points_W=points_W, table_height=TABLE, config=config,
    )  # fmt: skip
    made = plan(scene, ranked=ranked, model=model, X_WO=X_WO, obstacles=obstacles, points_W=points_W)
    assert isinstance(made, PickPlan)
    assert_sound(scene, made, model, X_WO, obstacles)
    assert_lands_in(BIN, made, model)


def beside(scene, gap, padding, **changes):
    """A soup can picked with another `gap` metres beside an open finger; the scene in which the hand reaches for it."""
    finger = 0.05 + robot.HAND.pad_thickness  # open fingers are .1 apart along x in `from_above`
    x = 0.6 + finger + gap + CATALOGUE["soup_can"].dimensions[0] / 2
    neighbour = (CATALOGUE["soup_can"], standing("soup_can", x, 0.05))
    made = plan(scene, obstacles=[neighbour], config=PickConfig(**changes))
    around = scene.with_solids((solid_of(*neighbour),))
    return made, around.padded(furniture=0.0, solids=padding, self_distance=0.0).with_gap(0.1)


def test_a_reach_keeps_away_from_a_neighbour_where_there_is_room_and_goes_close_where_there_is_none(scene):
    made, near = beside(scene, 0.006, 0.005)
    assert isinstance(made, PickPlan)
    assert near.path_free(made.pick.segments[1].trajectory.positions, 0.005)
    made, near = beside(scene, 0.002, 0.0)
    assert isinstance(made, PickPlan)
    assert near.path_free(made.pick.segments[1].trajectory.positions, 0.005)
    refused, _ = beside(scene, 0.002, 0.0, neighbour_paddings=[0.005])
    assert isinstance(refused, Infeasible)
    assert "soup_can" in "".join(cause for cause, count in refused.rejected_by if count)


def test_what_can_only_be_let_go_from_high_above_is(scene):
    made = plan(scene, config=PickConfig(release_heights=[0.33]))
    assert isinstance(made, PickPlan)
    hulls = apply(made.X_WO_place, np.concatenate(solid_of(CATALOGUE["soup_can"], np.eye(4)).hulls))
    assert hulls[:, 2].min() - BIN.floor_height == pytest.approx(0.33, abs=1e-6)


def test_what_does_not_fit_into_its_region_is_not_brought_there(scene):
    tight = Region("bin", BIN.p_W, np.array([0.04, 0.04, 0.18]))
    refused = plan(scene, region=tight)
    assert isinstance(refused, Infeasible) and refused.reason == "no_place"


def test_from_an_uncertain_neighbour_the_arm_keeps_farther_away(scene):
    neighbour = (CATALOGUE["tea"], standing("tea", 0.6, 0.25))
    for margin in (0.0, 0.02):
        made = plan(scene, obstacles=[neighbour], margins=[margin])
        assert isinstance(made, PickPlan)
        judge = scene.with_solids((solid_of(*neighbour),)).padded(
            furniture=0.0, solids=PickConfig().solid_padding + margin - 0.001
        )
        way = made.pick.segments[0].trajectory
        assert judge.with_gap(0.1).free_many(timing.sample(way, 0.004)).all(), margin


def test_the_hand_lets_go_surely_and_straight_back(scene):
    # Half open for the approach, as where the object is narrow: it may sit in the hand wider than was believed.
    narrow = dataclasses.replace(from_above("soup_can", standing("soup_can", 0.6, 0.05)), gaps=np.full(4, 0.07))
    made = plan(scene, ranked=narrow)
    assert isinstance(made, PickPlan)
    release, retreat, weighing, home = made.place.segments[1:]
    assert {release.gap, retreat.gap, weighing.gap, home.gap} == {robot.HAND.gap_max}
    assert weighing.trajectory.times[-1] > STILL and not np.ptp(weighing.trajectory.positions, axis=0).any()
    assert release.trajectory.times[-1] > release.gap / GAP_SPEED + 0.2  # the command gets there, and so does the hand
    hands = inverse(made.X_WG_place) @ ARM.forward_many(timing.sample(retreat.trajectory, 0.05))
    assert np.abs(hands[:, 1:3, 3]).max() < 0.003  # along its own x
    assert np.all(np.diff(hands[:, 0, 3]) <= 0) and hands[-1, 0, 3] < -0.06
    assert_sound(scene, made, CATALOGUE["soup_can"], standing("soup_can", 0.6, 0.05), [])


@pytest.mark.parametrize("label", ["mug", "tide", "waterpot", "soup_can", "sugar"])
def test_fingers_that_open_stay_off_the_rest_of_the_object(label):
    model = CATALOGUE[label]
    config = GraspConfig(samples=60, spacing=0.004)
    points = sample_surface(model, 5000, np.random.default_rng(0))[0]
    wide = []
    for grasp in grasp_candidates(model, config=config, seed=0)[::20]:
        gap = float(opening(grasp.width, config))
        release = release_gap(model, inverse(grasp.X_OG), gap, 0.004)
        assert gap <= release <= robot.HAND.gap_max
        for open_to in np.linspace(gap, release, 8)[1:]:  # nothing is met on the way, nor in drawing back
            x, y, z = apply(inverse(grasp.X_OG), points).T
            met = (x < robot.HAND.pad_x[1]) & (np.abs(z) < robot.HAND.pad_half_width)
            met &= (np.abs(y) > gap / 2 + 0.002) & (np.abs(y) < open_to / 2 + robot.HAND.pad_thickness)
            assert not met.any()
        wide.append(release == robot.HAND.gap_max)
    assert any(wide)
    assert all(wide) == (label in ("soup_can", "sugar"))  # only those are without a handle or an inside


def test_the_same_question_has_the_same_answer(scene, made):
    again = plan(scene)
    assert isinstance(again, PickPlan)
    for a, b in zip(again.pick.segments + again.place.segments, made.pick.segments + made.place.segments, strict=True):
        np.testing.assert_array_equal(a.trajectory.positions, b.trajectory.positions)
        np.testing.assert_array_equal(a.trajectory.times, b.trajectory.times)


def test_a_plan_cannot_be_changed(made):
    for array in (made.X_WG, made.X_WG_place, made.X_WO_place, made.pick.segments[0].trajectory.positions):
        assert not array.flags.writeable
    solid = solid_of(CATALOGUE["mug"], np.eye(4))
    assert not any(array.flags.writeable for array in (solid.X_WS, *solid.hulls))


def test_another_seed_puts_things_elsewhere(scene, made):
    other = plan(scene, seed=4)
    assert isinstance(other, PickPlan)
    assert not np.allclose(other.X_WO_place, made.X_WO_place)  # so that they do not pile up on one spot


def test_out_of_reach_is_said_so(scene):
    made = plan(scene, x=1.6)
    assert isinstance(made, Infeasible)
    assert made.reason == "out_of_reach"
    assert made.rejected_by[-1] == ("out_of_reach", 4)


def test_within_reach_but_not_so_is_another_thing(scene):
    """Upwards from under the table."""
    X_WO = standing("soup_can", 0.6, 0.05)
    ranked = from_above("soup_can", X_WO)
    X_WGs = ranked.X_WGs @ transform(rotation_from_vector(np.array([0.0, np.pi, 0.0])), np.zeros(3))
    made = plan(scene, ranked=dataclasses.replace(ranked, X_WGs=X_WGs))
    assert isinstance(made, Infeasible)
    assert made.reason in ("ik", "grasp_collision")
    assert "out_of_reach" not in dict(made.rejected_by)


def test_no_grasps_are_said_so(scene):
    ranked = RankedGrasps((), np.empty((0, 4, 4)), np.empty(0), np.empty(0), (("table", 7),))
    made = plan(scene, ranked=ranked)
    assert isinstance(made, Infeasible)
    assert (made.reason, made.grasp_candidates, made.rejected_by) == ("no_grasp", 7, (("table", 7),))


def test_what_is_in_the_way_of_the_hand_is_named(scene):
    X_WO = standing("soup_can", 0.6, 0.05)
    lid = X_WO.copy()
    lid[2, 3] += 0.12
    made = plan(scene, obstacles=[(CATALOGUE["tea"], lid)])
    assert isinstance(made, Infeasible)
    assert made.reason == "grasp_collision"
    assert dict(made.rejected_by)["grasp_collision_tea"] == 4
    assert made.candidates is not None and made.candidates.fates == ("grasp_collision_tea",) * 4
    assert sum(count for _, count in made.rejected_by) == made.grasp_candidates


def test_a_region_out_of_reach_is_said_so(scene):
    far = dataclasses.replace(BIN, p_W=np.array([0.0, 2.5, 0.5]))
    made = plan(scene, region=far)
    assert isinstance(made, Infeasible)
    assert made.reason == "place_out_of_reach"
    assert sum(count for cause, count in made.rejected_by if cause == "place_out_of_reach") == 4


def test_an_arm_that_touches_something_does_not_start(scene):
    palm = apply(ARM.forward(robot.VIEW), np.array([[np.mean(robot.HAND.palm_x), 0.0, 0.0]]))
    made = plan(scene, points_W=palm)
    assert isinstance(made, Infeasible)
    assert made.reason == "start_in_collision"
    assert dict(made.rejected_by)["start_in_collision_unexplained"] == 4, "what it touches"
    assert made.candidates is not None and set(made.candidates.fates) == {"start_in_collision_unexplained"}


def test_what_became_of_each_grasp_is_told(scene):
    """Those that were given up before the one that was chosen, it, those not looked at, those dropped before."""
    X_WO = standing("soup_can", 0.6, 0.05)
    ranked = from_above("soup_can", X_WO)
    X_WGs = ranked.X_WGs.copy()
    X_WGs[0, :3, 3] += [1.0, 0.0, 0.0]
    dropped = dataclasses.replace(
        ranked,
        X_WGs=X_WGs,
        X_WDs=X_WGs[:2],
        causes=("table", "outranked"),
        rejected_by=(("table", 1), ("outranked", 1)),
    )
    made = plan(scene, ranked=dropped)
    assert isinstance(made, PickPlan) and made.candidates is not None
    told = made.candidates
    assert told.fates[0] == "out_of_reach" and told.fates[-2:] == ("table", "outranked")
    np.testing.assert_array_equal(told.X_WGs, np.concatenate([X_WGs, X_WGs[:2]]))
    assert len(told.scores) == len(ranked.grasps) == len(told.fates) - 2
    (chosen,) = (i for i, fate in enumerate(told.fates) if fate == "chosen")
    np.testing.assert_array_equal(made.grasp.X_OG, ranked.grasps[chosen].X_OG)
    counts = dict(made.rejected_by)
    assert all(counts[fate] >= told.fates.count(fate) for fate in set(told.fates) - {"chosen", ""})


SPOT = standing("soup_can", 0.62, -0.2, 1.0)
SPOT[2, 3] += 0.006


@pytest.fixture(scope="module")
def set_down(scene):
    made = plan(scene, spots=[SPOT], region=TOP)
    assert isinstance(made, PickPlan)
    return made


def test_an_object_is_set_down_on_the_table(scene, set_down):
    """Lowered straight, let go just above its place, and not met again on the way home."""
    made, model, X_WO = set_down, CATALOGUE["soup_can"], standing("soup_can", 0.6, 0.05)
    np.testing.assert_allclose(made.X_WO_place, SPOT)
    np.testing.assert_allclose(made.X_WG_place @ inverse(made.X_WG) @ X_WO, SPOT, atol=1e-9)
    segments = made.pick.segments + made.place.segments
    assert [s.name for s in made.place.segments] == ["transport", "lower", "open", "retreat", "weigh", "return"]
    for before, after in itertools.pairwise(segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    lower = made.place.segments[1]
    assert max(timing.limit_use(lower.trajectory)) <= 1.0 + 1e-6 and lower.gap == 0.0
    hands = np.array([ARM.forward(q) for q in timing.sample(lower.trajectory, 0.02)])
    np.testing.assert_allclose(hands[:, :2, 3], hands[-1:, :2, 3].repeat(len(hands), 0), atol=2e-3)
    assert hands[0, 2, 3] - hands[-1, 2, 3] == pytest.approx(PickConfig().lower, abs=2e-3)
    holding = scene.with_solids(()).holding(solid_of(model, X_WO).hulls, inverse(made.X_WG) @ X_WO)
    assert holding.with_gap(made.grasp.width).free_many(timing.sample(lower.trajectory, 0.01)).all()
    after = scene.with_solids((solid_of(model, SPOT),))
    back = made.place.segments[-1]
    assert after.with_gap(back.gap).free_many(timing.sample(back.trajectory, 0.01)).all()


def test_spots_that_are_none_taken_or_too_far_are_told_apart(scene):
    far = standing("soup_can", 1.6, 0.0)
    inside = standing("soup_can", 0.62, -0.2)
    inside[2, 3] -= 0.05
    for spots, reason in (([], "no_place"), ([far], "place_out_of_reach"), ([inside], "place_collision")):
        made = plan(scene, spots=spots, region=TOP)
        assert isinstance(made, Infeasible)
        assert made.reason == reason
        assert sum(count for _, count in made.rejected_by) == made.grasp_candidates == 4
    assert dict(made.rejected_by)["place_collision_table"] == 4, "what is met"


def test_what_is_over_an_object_is_named_however_far_a_grasp_gets(scene):
    for height in (0.12, 0.31):  # at the hand, and at the wrist behind it
        lid = standing("soup_can", 0.6, 0.05)
        lid[2, 3] += height
        made = plan(scene, obstacles=[(CATALOGUE["sugar"], lid)])
        assert isinstance(made, Infeasible)
        assert made.reason in ("grasp_collision", "reach", "lift")
        assert dict(made.rejected_by)[f"{made.reason}_sugar"] > 0
