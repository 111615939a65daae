import dataclasses

import numpy as np
import pytest
from scenes import observe, standing

from sum_drake.association import AssociationConfig, associate
from sum_drake.belief import AcceptanceConfig, update
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.objects import load_catalogue
from sum_drake.types import Associations, Detection, Detections, PickPlace, SceneBelief, readonly

CONFIG = FilterConfig(particles=500, iterations=6)
ASSOCIATION = AssociationConfig(max_missed=2)


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def estimator(catalogue):
    return PoseEstimator(catalogue, CONFIG)


def see(held, frame, boxes, estimator, *, action=None, threshold=0.5, unique=True, seed=1):
    detections = Detections(frame.observation, tuple(boxes))
    pairs = Associations(frame.observation, associate(held.tracks, boxes, ASSOCIATION))
    return update(
        held, frame, detections, pairs, action, estimator,
        filter_config=CONFIG, association_config=ASSOCIATION, acceptance=AcceptanceConfig(threshold),
        unique_labels=unique, seed=seed,
    )  # fmt: skip


def test_an_object_is_found_followed_and_found_again_after_it_was_placed(catalogue, estimator):
    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    frame, boxes = observe(catalogue, {"sugar": X_WO})
    first = see(SceneBelief(), frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator)
    (track,) = first.tracks
    assert track.accepted
    translation, rotation = pose_error(track.X_WO, X_WO, catalogue["sugar"].symmetry)
    assert translation < 0.02
    assert rotation < np.radians(20)

    # Placed elsewhere, within view: the belief goes with the action, and the box there is a track of that label.
    X_WO_placed = standing(catalogue, "sugar", 0.6, -0.15, yaw=0.4)
    action = PickPlace(
        0, "pick_place", track.id, "sugar", readonly(np.eye(4)), readonly(X_WO_placed), "table", 0.04, 0.04, True
    )
    frame, boxes = observe(catalogue, {"sugar": X_WO_placed}, observation=1)
    second = see(first, frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator, action=action)
    accepted = [t for t in second.tracks if t.accepted]
    assert len(accepted) == 1
    assert pose_error(accepted[0].X_WO, X_WO_placed, catalogue["sugar"].symmetry)[0] < 0.02


def test_rivals_for_one_box_contest_it_and_the_shape_decides(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0, yaw=0.5)})
    box = Detection(boxes["sugar"], 0.95, (("tide", 0.5), ("sugar", 0.45)))
    belief = see(SceneBelief(), frame, [box], estimator, threshold=0.0)
    assert {track.label for track in belief.tracks} == {"tide", "sugar"}, "the loser's track is kept"
    assert [track.label for track in belief.tracks if track.accepted] == ["sugar"]


def test_labels_are_unique_only_where_that_is_asked_for(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    x, y, w, h = boxes["sugar"]
    twice = [Detection((x, y, w, h), 0.9, (("sugar", 0.9),)), Detection((x + 2, y, w, h), 0.9, (("sugar", 0.8),))]
    assert sum(t.accepted for t in see(SceneBelief(), frame, twice, estimator, threshold=0.0).tracks) == 1
    both = see(SceneBelief(), frame, twice, estimator, threshold=0.0, unique=False)
    assert sum(t.accepted for t in both.tracks) == 2


def test_a_track_that_is_not_seen_is_not_accepted_and_ends_after_k_observations(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    belief = see(SceneBelief(), frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator)
    counts = []
    for k in (1, 2, 3):
        belief = see(belief, dataclasses.replace(frame, observation=k), [], estimator)
        counts.append(len(belief.tracks))
        assert not any(track.accepted for track in belief.tracks)
    assert counts == [1, 0, 0]


def test_ids_are_never_used_again_and_the_seed_decides_every_draw(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    seen = [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))]
    one, same, other = (see(SceneBelief(), frame, seen, estimator, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.tracks[0].belief.X_WOs, same.tracks[0].belief.X_WOs)
    assert not np.array_equal(one.tracks[0].belief.X_WOs, other.tracks[0].belief.X_WOs)
    later = see(dataclasses.replace(one, tracks=()), dataclasses.replace(frame, observation=1), seen, estimator)
    assert later.tracks[0].id == 1


def test_a_box_without_depth_is_a_poor_hypothesis_and_no_error(catalogue, estimator):
    frame, _ = observe(catalogue, {})
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    belief = see(SceneBelief(), blind, [Detection((50, 50, 40, 40), 0.9, (("sugar", 0.9),))], estimator)
    assert belief.tracks[0].probability == 0.0
    assert not belief.tracks[0].accepted


def test_inputs_of_different_observations_are_refused(catalogue, estimator):
    frame, _ = observe(catalogue, {})
    with pytest.raises(ValueError, match="different observations"):
        update(
            SceneBelief(), frame, Detections(1, ()), Associations(0, ()), None, estimator,
            filter_config=CONFIG, association_config=ASSOCIATION, acceptance=AcceptanceConfig(),
            unique_labels=True, seed=0,
        )  # fmt: skip
