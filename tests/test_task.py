"""What the robot does next: which object, where to, when it looks again, and when it is done."""

import dataclasses

import numpy as np
import pytest
from deciding import (
    CAN,
    CATALOGUE,
    CONFIG,
    EYE,
    GOAL,
    MOST_LIKELY,
    REGIONS,
    believe,
    make_task,
    pick_can,
    see,
    see_can,
    tried,
)
from scenes import TABLE, standing

from sum_drake.attempting import _same_grasp
from sum_drake.geometry import apply, rotation_from_vector, transform
from sum_drake.objects import sample_surface
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import solid_of
from sum_drake.robot import VIEW
from sum_drake.standing import not_of
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import Attempt, PickPlace, Region, readonly


def height_of_release(plan, region):
    """Of the object's lowest point above the region's floor, metres."""
    hulls = np.concatenate(solid_of(CATALOGUE[plan.grasp.label], EYE).hulls)
    return apply(plan.X_WO_place, hulls)[:, 2].min() - region.floor_height


@pytest.fixture(scope="module")
def can_seen():
    return see_can()


@pytest.fixture(scope="module")
def pick():
    return pick_can()


def test_what_is_believed_and_can_be_grasped_is_picked_from_where_the_arm_is(pick):
    assert (pick.track.label, pick.region, pick.refused) == ("soup_can", "non_cleaning_bin", ())
    np.testing.assert_allclose(pick.plan.pick.segments[0].trajectory.positions[0], VIEW)
    bin_ = REGIONS["non_cleaning_bin"]
    assert np.all(np.abs(pick.plan.X_WO_place[:2, 3] - bin_.p_W[:2]) < bin_.half_extents[:2])
    assert min(abs(height_of_release(pick.plan, bin_) - h) for h in PickConfig().release_heights) < 1e-6, "empty bin"


def test_a_grasp_like_one_that_failed_is_not_tried_again_and_what_cannot_be_tried_is_passed_over(pick):
    failed = pick.plan.grasp.X_OG
    mug = standing(CATALOGUE, "mug", 0.6, -0.2)
    seen = see({"soup_can": CAN, "mug": mug}, [believe("soup_can", CAN), believe("mug", mug, 1, likelihood=0.9)])
    attempts = [tried("soup_can", released=False, X_OG=failed), *[tried("mug", released=False)] * CONFIG.max_attempts]
    choice = make_task(config=MOST_LIKELY).decide(seen, attempts, 0, VIEW)
    assert isinstance(choice, Pick)
    assert choice.track.label == "soup_can"
    assert not _same_grasp(choice.plan.grasp.X_OG, failed)
    (refused,) = choice.refused
    assert (refused.label, refused.reason, refused.action) == ("mug", "too_many_failures", None), "likelier, but"
    forgetful = make_task(config=dataclasses.replace(MOST_LIKELY, remember=False)).decide(seen, attempts, 0, VIEW)
    assert isinstance(forgetful, Pick) and _same_grasp(forgetful.plan.grasp.X_OG, failed), "it was the best one"


def test_things_are_let_go_higher_the_more_lie_in_the_bin_already(can_seen):
    placed = [tried(label) for label in ("mug", "toy")]
    elsewhere = [tried("tide", region="cleaning_bin"), tried("sugar", released=False)]
    choice = make_task().decide(can_seen, placed + elsewhere, 0, VIEW)
    assert isinstance(choice, Pick)
    height = height_of_release(choice.plan, REGIONS["non_cleaning_bin"]) - 2 * CONFIG.fill_per_object
    assert min(abs(height - h) for h in PickConfig().release_heights) < 1e-6


def test_an_empty_table_is_cleared():
    choice = make_task().decide(see({}, []), (), 0, VIEW)
    assert isinstance(choice, Stop)
    assert choice.outcome == "cleared"


@pytest.mark.parametrize("accepted", [None, False], ids=["no track", "a track that is not accepted"])
def test_what_stands_there_and_is_not_believed_is_looked_at_again_until_that_is_no_use(accepted):
    mug = standing(CATALOGUE, "mug", 0.6, 0.1)
    tracks = [] if accepted is None else [believe("mug", mug, accepted=accepted)]
    seen = see({"mug": mug}, tracks)
    choices = [make_task().decide(seen, (), looks, VIEW) for looks in range(CONFIG.max_looks)]
    assert [type(choice) for choice in choices] == [Look] * (CONFIG.max_looks - 1) + [Stop]
    assert choices[-1].outcome.startswith("stopped: ")
    assert "no object is believed" in choices[-1].outcome


def test_an_object_that_was_tried_often_enough_is_refused_and_the_reason_is_told(can_seen):
    attempts = [tried("soup_can", released=False)] * CONFIG.max_attempts
    look = make_task().decide(can_seen, attempts, 0, VIEW)
    assert isinstance(look, Look)
    (refused,) = look.refused
    assert (refused.label, refused.kind, refused.reason) == ("soup_can", "none", "too_many_failures")
    stop = make_task().decide(can_seen, attempts, CONFIG.max_looks - 1, VIEW)
    assert isinstance(stop, Stop)
    assert stop.outcome == "stopped: no object can be attempted (soup_can too_many_failures)"


def test_what_was_given_up_before_anything_moved_is_no_try():
    far = see({}, [believe("sugar", standing(CATALOGUE, "sugar", 2.0, 0.0))])
    given_up = [dataclasses.replace(tried("sugar"), action=None, reason="ik")] * CONFIG.max_attempts
    look = make_task(pick_config=PickConfig(grasps=3)).decide(far, given_up, 0, VIEW)
    assert isinstance(look, Look)
    (refused,) = look.refused
    assert refused.reason == "out_of_reach", "examined again, in vain"
    assert dict(refused.rejected_by)["out_of_reach"] == 3
    assert refused.grasp_candidates >= 3


def test_the_likeliest_object_of_eq_3_comes_first():
    tracks = [
        believe("mug", standing(CATALOGUE, "mug", 0.6, 0.2), 0, likelihood=0.5),
        believe("toy", standing(CATALOGUE, "toy", 0.6, 0.0), 1, likelihood=0.9, p_box=0.5),
        believe("sugar", standing(CATALOGUE, "sugar", 0.6, -0.2), 2, likelihood=0.6),
    ]
    attempts = [tried(track.label, released=False) for track in tracks for _ in range(CONFIG.max_attempts)]
    look = make_task(config=MOST_LIKELY).decide(see({}, tracks), attempts, 0, VIEW)
    assert [refused.label for refused in look.refused] == ["sugar", "mug", "toy"]


@pytest.mark.parametrize(
    ("x", "order"), [(0.47, ["mug", "tea", "sugar"]), (0.72, ["sugar", "mug", "tea"])], ids=["edge", "middle"]
)
def test_what_might_fall_off_the_table_goes_before_what_it_lies_on(x, order):
    """Tea lies on the sugar: with both at an edge the sugar waits, however likely it is, and in the middle it does not.

    That is, it is tried last: tired of all three, the order shows in what is refused.
    """
    on_it = standing(CATALOGUE, "tea", x, 0.2)
    on_it[2, 3] += CATALOGUE["sugar"].dimensions[2]
    tracks = [
        believe("sugar", standing(CATALOGUE, "sugar", x, 0.2), 0, likelihood=0.9),
        believe("tea", on_it, 1, likelihood=0.4),
        believe("mug", standing(CATALOGUE, "mug", 0.6, -0.2), 2, likelihood=0.5),
    ]
    tired = [tried(track.label, released=False) for track in tracks for _ in range(CONFIG.max_attempts)]
    look = make_task(config=MOST_LIKELY).decide(see({}, tracks), tired, 0, VIEW)
    assert [refused.label for refused in look.refused] == order
    papers = dataclasses.replace(MOST_LIKELY, spare_neighbours=False)
    look = make_task(config=papers).decide(see({}, tracks), tired, 0, VIEW)
    assert [refused.label for refused in look.refused] == ["sugar", "mug", "tea"], "the likeliest first, come what may"
    mug = make_task(config=MOST_LIKELY).decide(see({}, tracks), tired[: 2 * CONFIG.max_attempts], 0, VIEW)
    assert isinstance(mug, Pick)
    assert mug.track.label == "mug"
    assert ("; sugar waits, as tea might fall off the table" in mug.why) == (x < 0.5)


@pytest.mark.parametrize("goal", [{**GOAL, "soup_can": "leave"}, {"cleaning": "cleaning_bin"}], ids=["leave", "none"])
def test_what_is_to_be_left_alone_stays_and_the_rest_of_the_table_is_clear(can_seen, goal):
    choice = make_task(goal=goal).decide(can_seen, (), 0, VIEW)
    assert isinstance(choice, Stop)
    assert (choice.outcome, choice.refused) == ("cleared", ())


def test_what_is_left_alone_hides_nothing_else():
    """A mug nobody believes in is looked at again although the can beside it is to stay."""
    seen = see({"soup_can": CAN, "mug": standing(CATALOGUE, "mug", 0.6, -0.2)}, [believe("soup_can", CAN)])
    assert isinstance(make_task(goal={**GOAL, "soup_can": "leave"}).decide(seen, (), 0, VIEW), Look)


def test_a_picture_without_depth_is_no_clear_table():
    seen = see({}, [])
    assert make_task().decide(seen, (), 0, VIEW).outcome == "cleared"
    dark = dataclasses.replace(seen.frame, depth=readonly(np.zeros_like(seen.frame.depth), np.float32))
    seen = dataclasses.replace(seen, frame=dark)
    choices = [make_task().decide(seen, (), looks, VIEW) for looks in range(CONFIG.max_looks)]
    assert [type(choice) for choice in choices] == [Look] * (CONFIG.max_looks - 1) + [Stop]
    assert choices[-1].outcome == "stopped: the camera shows depth of 0 % of the table"


def test_what_is_likely_there_but_hidden_is_waited_for():
    hidden = dataclasses.replace(believe("mug", standing(CATALOGUE, "mug", 0.6, 0.1), accepted=False), seen=-1)
    choices = [make_task().decide(see({}, [hidden]), (), looks, VIEW) for looks in range(CONFIG.max_looks)]
    assert [type(choice) for choice in choices] == [Look] * (CONFIG.max_looks - 1) + [Stop]
    assert choices[-1].outcome == "stopped: mug is believed to be there but cannot be seen"
    doubted = dataclasses.replace(hidden, probability=0.2)
    assert make_task().decide(see({}, [doubted]), (), 0, VIEW).outcome == "cleared"


# By belief and feasibility together.

AREA = Region("aside", readonly([0.62, 0.2, 0.95]), readonly([0.12, 0.18, 0.25]))
TEA = CATALOGUE["tea"]
SUGAR_X = CATALOGUE["sugar"].dimensions[0]
ON_THE_CAN = standing(CATALOGUE, "tea", 0.6, 0.1)
ON_THE_CAN[2, 3] += CATALOGUE["soup_can"].dimensions[2]
BLOCKED = {"soup_can": standing(CATALOGUE, "soup_can", 0.6, 0.1), "tea": ON_THE_CAN}
ASIDE_GOAL = {"regions": {**REGIONS, "aside": AREA}, "goal": {"soup_can": "non_cleaning_bin", "tea": "aside"}}
"""The tea stands where it belongs, in an area of the table, and on the can, which goes to the bin."""


def see_blocked():
    return see(BLOCKED, [believe(label, X_WO, i) for i, (label, X_WO) in enumerate(BLOCKED.items())])


@pytest.fixture(scope="module")
def blocked():
    return see_blocked()


@pytest.fixture(scope="module")
def making_way(blocked):
    choice = make_task(**ASIDE_GOAL).decide(blocked, (), 0, VIEW)
    assert isinstance(choice, Pick)
    return choice


def moved(choice, reason="executed"):
    """The attempt at what was chosen, as if it had been made."""
    plan, track = choice.plan, choice.track
    action = PickPlace(
        0, choice.kind, track.id, track.label, plan.X_WG, plan.X_WO_place, choice.region, 0.04, 0.04, True
    )
    counts = plan.grasp_candidates, plan.rejected_by
    return Attempt(
        0, track.id, track.label, choice.region, choice.kind, reason, *counts, action, plan.grasp.X_OG, choice.why
    )


def test_what_is_in_the_way_is_moved_to_a_free_place_and_the_reason_is_told(making_way):
    choice = making_way
    assert (choice.track.label, choice.kind, choice.region) == ("tea", "move", "aside")
    assert "lies or leans on soup_can" in choice.why and "grasps at soup_can" in choice.why
    p_W = apply(choice.plan.X_WO_place, np.concatenate(solid_of(TEA, EYE).hulls))
    assert (np.abs(p_W[:, :2] - AREA.p_W[:2]) < AREA.half_extents[:2]).all(), "it stays where it belongs"
    assert 0 < p_W[:, 2].min() - TABLE < 0.02, "on the table, not where it was, on the can"
    assert np.linalg.norm(choice.plan.X_WO_place[:2, 3] - BLOCKED["soup_can"][:2, 3]) > 0.12
    assert [s.name for s in choice.plan.place.segments] == ["transport", "lower", "open", "retreat", "weigh", "return"]


def test_once_the_blocker_is_aside_the_object_is_taken(making_way):
    now = {**BLOCKED, "tea": making_way.plan.X_WO_place}
    seen = see(now, [believe(label, X_WO, i) for i, (label, X_WO) in enumerate(now.items())])
    choice = make_task(**ASIDE_GOAL).decide(seen, [moved(making_way)], 0, VIEW)
    assert isinstance(choice, Pick)
    assert (choice.track.label, choice.kind, choice.region) == ("soup_can", "pick_place", "non_cleaning_bin")


def test_the_same_question_moves_the_same_thing_to_the_same_place(blocked, making_way):
    again = make_task(**ASIDE_GOAL).decide(blocked, (), 0, VIEW)
    np.testing.assert_array_equal(again.plan.X_WO_place, making_way.plan.X_WO_place)
    assert again.why == making_way.why


def test_a_blocker_is_moved_so_often_and_no_more_and_what_it_blocks_is_explained(blocked, making_way):
    attempts = [moved(making_way)] * CONFIG.max_moves
    choices = [make_task(**ASIDE_GOAL).decide(blocked, attempts, looks, VIEW) for looks in (0, CONFIG.max_looks - 1)]
    look, stop = choices
    assert isinstance(look, Look) and isinstance(stop, Stop)
    (refused,) = look.refused
    assert (refused.label, refused.kind, refused.action) == ("soup_can", "none", None)
    assert sum(n for cause, n in refused.rejected_by if cause.endswith("_tea")) > 50, "what is in the way"
    assert stop.outcome == f"stopped: no object can be attempted (soup_can {refused.reason})"


def test_a_blocker_is_not_brought_back_to_where_it_was_taken_from(blocked, making_way):
    """The first move failed to help: the next place is another one, and not where the tea has been."""
    again = make_task(**ASIDE_GOAL).decide(blocked, [moved(making_way)], 0, VIEW)
    assert isinstance(again, Pick) and again.kind == "move"
    before = (making_way.plan.X_WG @ np.linalg.inv(making_way.plan.grasp.X_OG))[:2, 3]
    np.testing.assert_allclose(before, ON_THE_CAN[:2, 3], atol=1e-6)
    assert np.linalg.norm(again.plan.X_WO_place[:2, 3] - before) > 0.1


def test_what_is_to_be_left_alone_is_not_moved_for_anything(blocked):
    look = make_task(goal={"soup_can": "non_cleaning_bin", "tea": "leave"}).decide(blocked, (), 0, VIEW)
    assert isinstance(look, Look)
    assert [refused.label for refused in look.refused] == ["soup_can"]


def test_what_lies_on_top_goes_first_though_it_is_less_likely():
    """The paper's order tries the can, whose probability is higher."""
    tracks = [
        believe("soup_can", BLOCKED["soup_can"], 0, likelihood=0.9),
        believe("tea", ON_THE_CAN, 1, likelihood=0.5),
    ]
    seen = see(BLOCKED, tracks)
    choice = make_task().decide(seen, (), 0, VIEW)
    assert isinstance(choice, Pick)
    assert (choice.track.label, choice.kind, choice.refused) == ("tea", "pick_place", ())
    assert choice.why.startswith("surest 0.7")
    by_belief = make_task(config=MOST_LIKELY).decide(seen, (), 0, VIEW)
    assert isinstance(by_belief, Pick)
    assert (by_belief.track.label, [refused.label for refused in by_belief.refused]) == ("tea", ["soup_can"])
    assert "it is in the way of" in by_belief.why and "grasps at soup_can" in by_belief.why


def test_an_object_whose_place_is_out_of_reach_is_set_down_elsewhere_before_it_is_given_up(can_seen):
    far = Region("far", readonly([0.0, 2.5, 0.5]), readonly([0.2, 0.2, 0.2]))
    task = make_task(regions={**REGIONS, "far": far}, goal={"soup_can": "far"})
    choice = task.decide(can_seen, (), 0, VIEW)
    assert isinstance(choice, Pick)
    assert (choice.kind, choice.region) == ("move", "table")
    assert choice.why == "cannot be brought to far as it lies: it is set down to be grasped anew"
    (refused,) = choice.refused
    assert refused.reason == "place_out_of_reach"
    given_up = task.decide(can_seen, [moved(choice)] * CONFIG.max_moves, CONFIG.max_looks - 1, VIEW)
    assert given_up.outcome == "stopped: no object can be attempted (soup_can place_out_of_reach)"


def test_an_area_of_the_table_is_a_goal_with_a_free_place_for_each(can_seen):
    area = dataclasses.replace(AREA, p_W=readonly([0.6, -0.25, 0.95]))
    mug = standing(CATALOGUE, "mug", 0.6, -0.25)
    seen = see({"soup_can": CAN, "mug": mug}, [believe("soup_can", CAN), believe("mug", mug, 1)])
    task = make_task(regions={**REGIONS, "aside": area}, goal={"soup_can": "aside", "mug": "aside"})
    choice = task.decide(seen, (), 0, VIEW)
    assert isinstance(choice, Pick)
    assert (choice.track.label, choice.kind, choice.region) == ("soup_can", "pick_place", "aside"), "the mug is there"
    X_WO = choice.plan.X_WO_place
    p_W = apply(X_WO, sample_surface(CATALOGUE["soup_can"], 500, np.random.default_rng(0))[0])
    assert (np.abs(p_W[:, :2] - area.p_W[:2]) < area.half_extents[:2]).all()
    assert len(not_of(p_W, CATALOGUE["mug"], mug)) == len(p_W), "free of the mug"
    assert p_W[:, 2].min() - TABLE < 0.02
    there = see({"soup_can": X_WO, "mug": mug}, [believe("soup_can", X_WO), believe("mug", mug, 1)])
    assert task.decide(there, (), 0, VIEW).outcome == "cleared"


def test_an_area_without_room_is_told(can_seen):
    tight = dataclasses.replace(AREA, half_extents=readonly([0.04, 0.04, 0.25]))
    task = make_task(regions={**REGIONS, "aside": tight}, goal={"soup_can": "aside"})
    look = task.decide(can_seen, (), 0, VIEW)
    assert isinstance(look, Look)
    assert look.refused[0].reason == "no_place"


def test_what_fell_off_the_table_is_told_and_not_waited_for():
    fallen = standing(CATALOGUE, "tide", 0.5, -0.75)
    fallen[2, 3] -= REGIONS["table"].floor_height
    stop = make_task().decide(see({}, [believe("tide", fallen)]), (), 0, VIEW)
    assert isinstance(stop, Stop) and stop.outcome == "cleared"
    assert [(refused.label, refused.reason) for refused in stop.refused] == [("tide", "fell_off")]


def test_what_is_hidden_to_the_end_is_an_attempt_given_up():
    hidden = dataclasses.replace(believe("mug", standing(CATALOGUE, "mug", 0.6, 0.1), accepted=False), seen=-1)
    stop = make_task().decide(see({}, [hidden]), (), CONFIG.max_looks - 1, VIEW)
    assert [(refused.label, refused.reason) for refused in stop.refused] == [("mug", "not_seen")]


FLAT = transform(rotation_from_vector(np.array([0.0, np.pi / 2, 0.0])), np.array([0.55, 0.0, 0.70 + SUGAR_X / 2]))
ON_THE_SUGAR = standing(CATALOGUE, "tea", 0.61, 0.0)
ON_THE_SUGAR[2, 3] += SUGAR_X
UNDER = {"sugar": FLAT, "tea": ON_THE_SUGAR}
UNDER_GOAL = {"goal": {"sugar": "non_cleaning_bin"}}
"""A box of sugar lies under one of tea, which is to be left alone."""


def test_what_lies_under_something_is_pulled_out_where_nothing_else_can_be_done():
    seen = see(UNDER, [believe("sugar", FLAT, 0), believe("tea", ON_THE_SUGAR, 1)])
    choice = make_task(**UNDER_GOAL).decide(seen, (), 0, VIEW)
    assert isinstance(choice, Pick)
    assert (choice.track.label, choice.kind, choice.region) == ("sugar", "move", "table"), "the tea stays on the table"
    assert "with what lies on it" in choice.why
    assert [attempt.reason for attempt in choice.refused] == ["lift"]
    off = np.linalg.norm(choice.plan.X_WO_place[:2, 3] - FLAT[:2, 3])
    assert off > 0.1, "not where it was"
    again = make_task(**UNDER_GOAL).decide(seen, [moved(choice)] * CONFIG.max_moves, 0, VIEW)
    assert isinstance(again, Pick)
    assert (again.track.label, again.kind, again.region) == ("sugar", "pick_place", "non_cleaning_bin"), "at last"


def test_before_something_is_pulled_out_what_nothing_explains_is_looked_at_again():
    seen = see(
        {**UNDER, "mug": standing(CATALOGUE, "mug", 0.75, -0.2)},
        [believe("sugar", FLAT), believe("tea", ON_THE_SUGAR, 1)],
    )
    choices = [make_task(**UNDER_GOAL).decide(seen, (), looks, VIEW) for looks in range(CONFIG.max_looks)]
    assert [type(choice) for choice in choices] == [Look] * (CONFIG.max_looks - 1) + [Pick]
    assert all([refused.label for refused in choice.refused] == ["sugar"] for choice in choices)
    assert "with what lies on it" in choices[-1].why
