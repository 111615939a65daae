"""The score of an episode from the referee's samples: what was to be seen, what slipped, which truth counts when."""

import dataclasses

import numpy as np
import pytest
from scenes import X_WC, observe, standing

from sum_drake.objects import load_catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.summary_schema import validate_summary
from sum_drake.systems.episode import Episode
from sum_drake.systems.referee import TruthSample
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.verdict import _slips, score, visible_shares
from sum_drake.types import (
    Attempt,
    Detection,
    Perception,
    PickPlace,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)

EYE = readonly(np.eye(4))
REFUSED = Attempt(0, 1, "mug", "cleaning_bin", "none", "ik", 10, (("ik", 10),), None)


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def renderer(catalogue):
    return DepthRenderer(catalogue)


def shares_of(catalogue, renderer, X_WOs):
    frame, _ = observe(catalogue, X_WOs)
    return dict(visible_shares(tuple(X_WOs.items()), frame, renderer))


def away(X_WO, distance):
    """The same object further along its line of sight."""
    line = X_WO[:3, 3] - X_WC[:3, 3]
    moved = X_WO.copy()
    moved[:3, 3] += distance * line / np.linalg.norm(line)
    return moved


def test_nothing_hides_an_object_that_stands_alone_or_beside_another(catalogue, renderer):
    X_WOs = {"sugar": standing(catalogue, "sugar", 0.6, 0.2), "mug": standing(catalogue, "mug", 0.6, -0.2)}
    assert shares_of(catalogue, renderer, X_WOs) == {"sugar": 1.0, "mug": 1.0}
    assert visible_shares((), observe(catalogue, {})[0], renderer) == ()


def test_what_lies_behind_something_larger_is_hidden_and_what_is_in_front_is_not(catalogue, renderer):
    sugar = standing(catalogue, "sugar", 0.6, 0.0)
    X_WOs = {"soup_can": away(sugar, 0.3), "sugar": sugar}
    assert shares_of(catalogue, renderer, X_WOs) == {"soup_can": 0.0, "sugar": 1.0}


def test_the_share_falls_as_one_thing_slides_behind_another(catalogue, renderer):
    can = standing(catalogue, "soup_can", 0.62, 0.0)
    shares = []
    for y in (0.2, 0.06, 0.03, 0.0):
        X_WOs = {"soup_can": can, "sugar": standing(catalogue, "sugar", 0.55, y)}
        shares.append(shares_of(catalogue, renderer, X_WOs)["soup_can"])
    assert shares[0] == 1.0
    assert 0.0 < shares[1] < 1.0
    assert shares == sorted(shares, reverse=True)


def test_an_object_out_of_the_picture_has_no_share(catalogue, renderer):
    X_WOs = {"sugar": standing(catalogue, "sugar", 0.6, 0.0), "mug": standing(catalogue, "mug", 0.6, 3.0)}
    assert shares_of(catalogue, renderer, X_WOs) == {"sugar": 1.0, "mug": None}


def at(x, z=0.0):
    X = np.eye(4)
    X[[0, 2], 3] = x, z
    return readonly(X)


def sample(motion, segment, hand, mug, observations=1):
    return TruthSample(0.0, observations, motion, segment, (("mug", mug),), hand)


def executed(step=0, label="mug", released=True):
    action = PickPlace(step, "pick_place", 1, label, EYE, EYE, "cleaning_bin", 0.04, 0.04, released)
    reason = "executed" if released else "empty_hand"
    return Attempt(step, 1, label, "cleaning_bin", "pick_place", reason, 10, (), action)


def test_slips_go_with_the_attempts_that_were_executed():
    samples = (
        sample(0, "lift", at(0.0, 1.0), at(0.0, 0.9)),
        sample(1, "retreat", at(0.0, 1.0), at(0.0, 0.7)),  # an empty hand, and a way back that was begun twice
        sample(2, "retreat", at(0.0, 1.0), at(0.0, 0.7)),
        sample(3, "lift", at(0.0, 1.0), at(0.0, 0.9), observations=2),
        sample(4, "transport", at(0.0, 1.0), at(0.0, 0.9), observations=2),
        sample(4, "transport", at(0.5, 1.0), at(0.5, 0.87), observations=2),
        sample(4, "open", at(0.5, 1.0), at(0.5, 0.4), observations=2),
    )
    refused = dataclasses.replace(REFUSED, step=1)
    slips = _slips((REFUSED, executed(0, released=False), refused, executed(1), refused), samples)
    assert slips[3] == pytest.approx(0.03)
    assert [slips[k] for k in (0, 1, 2, 4)] == [None] * 4


def test_a_label_that_no_object_has_cannot_slip():
    samples = (sample(1, "transport", at(0.0, 1.0), at(0.0, 0.9)), sample(1, "transport", at(0.5, 1.0), at(0.5, 0.9)))
    assert _slips((executed(label="toy"),), samples) == [None]


def test_a_belief_is_scored_by_where_things_were_when_it_was_asked_for(catalogue):
    """The mug stands when it is looked at, is carried away afterwards, and rests in its bin at the end."""
    scenario = load_scenario(catalogue=catalogue)
    there, there_1 = standing(catalogue, "mug", 0.6, 0.1), standing(catalogue, "mug", 0.63, 0.1)
    binned = standing(catalogue, "mug", 0.12, 0.62)
    binned[2, 3] = 0.40
    frame, boxes = observe(catalogue, {"mug": there})
    track = Track(
        0, "mug", boxes["mug"], 0.9, 0.9, PoseBelief(readonly(there_1[None]), readonly([1.0])), readonly(there_1),
        0.5, 0.7, True, 0, 0,
    )  # fmt: skip
    seen, empty = SceneBelief(0, (track,), 1), SceneBelief(1, (), 1)
    detection = Detection(boxes["mug"], 0.9, (("mug", 0.9),))
    perceptions = (
        Perception(0, frame, (detection,), (), SceneBelief(), seen, None),
        Perception(1, dataclasses.replace(frame, observation=1), (), (), seen, empty, None),
    )
    region = scenario.goal["non-cleaning"]
    action = PickPlace(0, "pick_place", 0, "mug", EYE, readonly(binned), region, 0.04, 0.04, True)
    attempt = Attempt(0, 0, "mug", region, "pick_place", "executed", 10, (("table", 2),), action, EYE)
    truth = (
        sample(-1, "", EYE, readonly(away(there, -0.5)), observations=0),
        sample(-1, "", EYE, readonly(there), observations=1),
        sample(1, "transport", EYE, readonly(away(there, -0.5)), observations=1),
        sample(1, "", EYE, readonly(binned), observations=2),
    )
    episode = Episode(
        outcome="cleared", error=None, perceptions=perceptions, attempts=(attempt,), truth=truth,
        costs={"planning": 2.0}, wall_s=9.0, sim_time_s=30.0,
    )  # fmt: skip
    summary = score(episode, scenario, catalogue, versions={"drake": "1.51.1"}, device="cpu")
    validate_summary(summary)
    (pose,) = summary["observations"][0]["poses"]
    assert pose["translation_error_m"] == pytest.approx(0.03)
    assert pose["visible_share"] == 1.0
    assert summary["observations"][1]["poses"] == []
    assert [(row["object"], row["outcome"]) for row in summary["attempts"]] == [("mug", "sorted")]
    assert (summary["objects_sorted"], summary["objects_total"], summary["completion_ratio"]) == (1, 1, 1.0)
    assert summary["timing"]["planning_cpu_s"] == 2.0
    assert summary["timing"]["sim_time_s"] == 30.0
    assert (summary["versions"], summary["device"]) == ({"drake": "1.51.1"}, "cpu")
