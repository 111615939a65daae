import dataclasses

import numpy as np
import pytest
from scenes import observe, standing

from sum_drake.association import AssociationConfig, associate
from sum_drake.belief import AcceptanceConfig, BeliefConfig, _accept, _contended, update
from sum_drake.consistency import PENETRATION, penetration
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.presence import PresenceCheck
from sum_drake.types import Association, Associations, Detection, Detections, PickPlace, SceneBelief, readonly

CONFIG = FilterConfig(particles=500, iterations=6)
ASSOCIATION = AssociationConfig(max_missed=2)


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@dataclasses.dataclass
class Perceiver:
    """What estimates, what looks where nothing was detected, and what both know."""

    estimator: PoseEstimator
    presence: PresenceCheck
    catalogue: Catalogue


@pytest.fixture(scope="module")
def estimator(catalogue):
    return Perceiver(PoseEstimator(catalogue, CONFIG), PresenceCheck(catalogue), catalogue)


def see(held, frame, boxes, estimator, *, action=None, threshold=0.5, unique=True, seed=1, pairs=None, **other):
    """other: `by` of the acceptance, `carry` of the association."""
    association = dataclasses.replace(ASSOCIATION, carry=other.get("carry", True))
    detections = Detections(frame.observation, tuple(boxes))
    if pairs is None:
        pairs = Associations(frame.observation, associate(held.tracks, boxes, ASSOCIATION))
    config = BeliefConfig(CONFIG, association, AcceptanceConfig(threshold, other.get("by", "existence")), unique, seed)
    return update(
        held, frame, detections, pairs, action, estimator.estimator, estimator.presence, estimator.catalogue, config
    )


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


def test_without_carrying_each_look_starts_anew_under_new_ids(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.1)})
    seen = [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))]
    first = see(SceneBelief(), frame, seen, estimator, carry=False)
    again = dataclasses.replace(frame, observation=1)
    anew = Associations(1, (Association(0, "sugar", None, 0.81),))
    second = see(first, again, seen, estimator, carry=False, pairs=anew)
    assert [track.id for track in first.tracks] == [0] and [track.id for track in second.tracks] == [1]
    assert second.tracks[0].born == 1 and second.gone == () and second.believed is None
    third = see(
        second, dataclasses.replace(frame, observation=2), [], estimator, carry=False, pairs=Associations(2, ())
    )
    assert third.tracks == (), "what was believed is forgotten, not missed"


def test_by_score_a_track_is_as_probable_as_the_paper_ranks_it(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.1)})
    seen = [Detection(boxes["sugar"], 0.9, (("sugar", 0.5),))]
    (track,) = see(SceneBelief(), frame, seen, estimator, by="score", threshold=0.35).tracks
    assert track.probability == pytest.approx(0.45 * track.likelihood) and track.accepted
    (learned,) = see(SceneBelief(), frame, seen, estimator).tracks
    assert learned.probability > 0.8 > track.probability and learned.likelihood == track.likelihood


def test_rivals_for_one_box_contest_it_and_the_shape_decides(catalogue, estimator):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0, yaw=0.5)})
    box = Detection(boxes["sugar"], 0.95, (("tide", 0.5), ("sugar", 0.45)))
    belief = see(SceneBelief(), frame, [box], estimator, threshold=0.0)
    assert {track.label for track in belief.tracks} == {"tide", "sugar"}, "the loser's track is kept"
    assert [track.label for track in belief.tracks if track.accepted] == ["sugar"]


def test_labels_are_unique_only_where_that_is_asked_for(catalogue, estimator):
    one, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.15)})
    other, more = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, -0.15)})
    left = np.arange(one.depth.shape[1]) < one.depth.shape[1] / 2
    depth = np.where(left[None], one.depth, other.depth)
    frame = dataclasses.replace(one, depth=readonly(depth, np.float32))
    seen = [Detection(box["sugar"], 0.9, (("sugar", 0.9),)) for box in (boxes, more)]
    assert sum(t.accepted for t in see(SceneBelief(), frame, seen, estimator).tracks) == 1
    assert sum(t.accepted for t in see(SceneBelief(), frame, seen, estimator, unique=False).tracks) == 2


@pytest.mark.parametrize("unique", [True, False])
def test_two_tracks_of_one_object_are_both_right_and_one_stands_for_it(catalogue, estimator, unique):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    x, y, w, h = boxes["sugar"]
    twice = [Detection((x, y, w, h), 0.9, (("sugar", 0.9),)), Detection((x + 2, y, w, h), 0.9, (("sugar", 0.8),))]
    belief = see(SceneBelief(), frame, twice, estimator, unique=unique)
    assert min(track.probability for track in belief.tracks) > 0.8
    assert sum(track.accepted for track in belief.tracks) == 1


def test_a_box_that_shows_something_else_does_not_take_a_track_from_its_object(catalogue, estimator):
    """The detector calls the mug beside it by its name, and misses it: it is where it was."""
    X_WOs = {"sugar": standing(catalogue, "sugar", 0.6, 0.05), "mug": standing(catalogue, "mug", 0.6, -0.08)}
    frame, boxes = observe(catalogue, X_WOs)
    belief = see(SceneBelief(), frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator)
    mug = Detection(boxes["mug"], 0.9, (("sugar", 0.9),))
    pairs = Associations(1, (Association(0, "sugar", 0, 0.5),))
    after = see(belief, dataclasses.replace(frame, observation=1), [mug], estimator, pairs=pairs)
    (kept,) = (track for track in after.tracks if track.accepted)
    assert kept.id == 0
    assert pose_error(kept.X_WO, X_WOs["sugar"], catalogue["sugar"].symmetry)[0] < 0.02


def one_box(catalogue, estimator, *, x=0.6):
    """A belief in a sugar box, and the frame that shows it."""
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", x, 0.0)})
    return see(SceneBelief(), frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator), frame


def test_an_object_that_the_detector_misses_is_still_there_as_long_as_depth_shows_it(catalogue, estimator):
    belief, frame = one_box(catalogue, estimator)
    for k in (1, 2, 3):
        belief = see(belief, dataclasses.replace(frame, observation=k), [], estimator)
        (track,) = belief.tracks
        assert track.accepted
        assert track.seen == 0
        assert dict(track.features)["look_explained"] > 0.8


def test_an_object_that_was_taken_away_is_given_up_at_once_and_why_is_said(catalogue, estimator):
    belief, _ = one_box(catalogue, estimator)
    empty, _ = observe(catalogue, {}, observation=1)
    after = see(belief, empty, [], estimator)
    assert after.tracks == ()
    assert [(gone.label, gone.reason, gone.observation) for gone in after.gone] == [("sugar", "empty", 1)]
    later = see(after, dataclasses.replace(empty, observation=2), [], estimator)
    assert later.gone == ()


def test_what_is_hidden_is_kept_but_not_accepted(catalogue, estimator):
    belief, _ = one_box(catalogue, estimator, x=0.8)
    wall = {"tide": standing(catalogue, "tide", 0.6, 0.0, yaw=np.pi / 2)}
    before = belief.tracks[0].probability
    frame, _ = observe(catalogue, wall, observation=1)
    frame = dataclasses.replace(frame, depth=readonly(np.where(frame.depth > 0, 0.6, 0), np.float32))
    (track,) = see(belief, frame, [], estimator).tracks
    assert track.probability == pytest.approx(before, abs=0.05)
    assert not track.accepted


def test_a_frame_without_depth_changes_little(catalogue, estimator):
    """A camera that failed once: nothing is known to have changed."""
    belief, frame = one_box(catalogue, estimator)
    blind = dataclasses.replace(frame, observation=1, depth=readonly(np.zeros_like(frame.depth), np.float32))
    wrong = Detection(belief.tracks[0].box, 0.9, (("sugar", 0.9),))
    (track,) = see(belief, blind, [wrong], estimator).tracks
    assert track.probability > 0.9 * belief.tracks[0].probability, "a box without depth says nothing against it"
    (track,) = see(belief, blind, [], estimator).tracks
    assert not track.accepted
    again = see(SceneBelief(1, (track,), 1), dataclasses.replace(frame, observation=2), [], estimator)
    assert [t.accepted for t in again.tracks] == [True]


def test_an_action_before_a_blind_look_ends_no_track(catalogue, estimator):
    """It was lifted and lost on the way, perhaps; where it is now, the next look tells."""
    belief, frame = one_box(catalogue, estimator)
    blind = dataclasses.replace(frame, observation=1, depth=readonly(np.zeros_like(frame.depth), np.float32))
    place = readonly(standing(catalogue, "sugar", 0.1, 0.6))
    dropped = PickPlace(0, "pick_place", 0, "sugar", readonly(np.eye(4)), place, "bin", 0.04, 0.0, False)
    after = see(belief, blind, [], estimator, action=dropped)
    assert after.gone == ()
    assert 0.02 < after.tracks[0].probability < 0.3
    seen = Detection(after.tracks[0].box, 0.9, (("sugar", 0.9),))
    again = see(after, dataclasses.replace(frame, observation=2), [seen], estimator)
    assert [(track.id, track.accepted) for track in again.tracks] == [(0, True)]


def test_what_is_hidden_is_not_missed(catalogue, estimator):
    belief, _ = one_box(catalogue, estimator, x=0.8)
    belief = unlikely(belief, 0.45)
    frame, _ = observe(catalogue, {}, observation=1)
    frame = dataclasses.replace(frame, depth=readonly(np.where(frame.depth > 0, 0.6, 0), np.float32))
    for k in (1, 2, 3, 4):
        belief = see(belief, dataclasses.replace(frame, observation=k), [], estimator)
        (track,) = belief.tracks
        assert track.missed == 0 and track.probability > 0.35


def test_two_that_look_alike_are_both_kept_when_one_box_takes_the_others_track(catalogue, estimator):
    X_WOs = standing(catalogue, "sugar", 0.6, 0.15), standing(catalogue, "sugar", 0.6, -0.15)
    (one, boxes), (other, more) = (observe(catalogue, {"sugar": X_WO}) for X_WO in X_WOs)
    depth = np.where(np.arange(one.depth.shape[1])[None] < one.depth.shape[1] / 2, one.depth, other.depth)
    frame = dataclasses.replace(one, depth=readonly(depth, np.float32))
    first = Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))
    belief = see(SceneBelief(), frame, [first], estimator, unique=False)
    second = Detection(more["sugar"], 0.9, (("sugar", 0.9),))
    pairs = Associations(1, (Association(0, "sugar", 0, 0.5),))
    after = see(belief, dataclasses.replace(frame, observation=1), [second], estimator, pairs=pairs, unique=False)
    for X_WO in X_WOs:
        assert any(t.accepted and np.linalg.norm(t.X_WO[:3, 3] - X_WO[:3, 3]) < 0.02 for t in after.tracks)


def test_an_agreeing_track_does_not_bring_in_what_its_neighbour_excludes(catalogue, estimator):
    """Two sugar boxes' worth of one, a little apart; a mug reaches into the weaker estimate only."""
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    belief = see(SceneBelief(), frame, [Detection(boxes["sugar"], 0.9, (("sugar", 0.9),))], estimator)
    (sugar,) = belief.tracks
    aside = np.array(sugar.X_WO)
    aside[1, 3] -= 0.019
    half = catalogue["sugar"].load_mesh().extents[1] / 2 + catalogue["mug"].load_mesh().extents[1] / 2
    mug = standing(catalogue, "mug", 0.6, sugar.X_WO[1, 3] - half - 0.001)
    held = (
        dataclasses.replace(sugar, id=0, features=(("sunk_m", 0.03),), probability=0.95, uncontended=0.95),
        dataclasses.replace(sugar, id=1, X_WO=readonly(aside), probability=0.9, uncontended=0.9, box=(0, 0, 9, 9)),
        dataclasses.replace(sugar, id=2, label="mug", X_WO=readonly(mug), probability=0.9, uncontended=0.9,
                            box=(50, 0, 9, 9)),
    )  # fmt: skip
    tracks, rivals = _contended(list(held), frame, estimator.presence, catalogue)
    config = BeliefConfig(CONFIG, ASSOCIATION, AcceptanceConfig(0.3), True, 1)
    accepted = [t for t in _accept(tracks, rivals, 0, catalogue, config) if t.accepted]
    for i, a in enumerate(accepted):
        for b in accepted[:i]:
            assert penetration(a, b, catalogue) <= PENETRATION


def test_weak_tracks_give_way_to_a_sure_detection(catalogue, estimator):
    belief, frame = one_box(catalogue, estimator)
    (track,) = belief.tracks
    weak = tuple(
        dataclasses.replace(track, id=i, label="mug", probability=0.001, uncontended=0.001, box=(9 * i, 0, 8, 8))
        for i in range(3)
    )
    held = SceneBelief(0, weak, 3)
    boxes = [Detection(w.box, 0.5, (("mug", 0.5),)) for w in weak] + [Detection(track.box, 0.9, (("sugar", 0.9),))]
    few = AssociationConfig(max_tracks=3)
    pairs = Associations(1, associate(held.tracks, boxes, few))
    config = BeliefConfig(CONFIG, few, AcceptanceConfig(), True, 1)
    after = update(
        held, dataclasses.replace(frame, observation=1), Detections(1, tuple(boxes)), pairs, None,
        estimator.estimator, estimator.presence, estimator.catalogue, config,
    )  # fmt: skip
    assert "sugar" in [t.label for t in after.tracks if t.accepted]
    assert len(after.tracks) <= 3
    assert {one.reason for one in after.gone} <= {"unlikely", "empty", "unseen"} and after.gone


@pytest.mark.parametrize(("p_box", "p_label"), [(-1.0, -1.0), (5.0, 0.9), (np.nan, 0.9), (0.9, np.inf)])
def test_numbers_that_are_no_probabilities_are_taken_for_the_nearest(catalogue, estimator, p_box, p_label):
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0)})
    belief = see(SceneBelief(), frame, [Detection(boxes["sugar"], p_box, (("sugar", p_label),))], estimator)
    assert len(belief.tracks) == (p_box == 5.0)
    for track in belief.tracks:
        assert 0 <= track.p_box <= 1 and 0 <= track.p_label <= 1 and 0 <= track.probability <= 1


def unlikely(belief, p):
    """The same belief, but for how probable its track is."""
    return dataclasses.replace(belief, tracks=(dataclasses.replace(belief.tracks[0], probability=p, uncontended=p),))


def test_an_unlikely_track_that_is_not_detected_ends_after_k_looks_that_could_see_it(catalogue, estimator):
    belief, frame = one_box(catalogue, estimator)
    belief = unlikely(belief, 0.4)
    counts, gone = [], []
    for k in (1, 4, 6):
        belief = see(belief, dataclasses.replace(frame, observation=k), [], estimator)
        counts.append(len(belief.tracks))
        gone += [one.reason for one in belief.gone]
    assert counts == [1, 0, 0]
    assert gone == ["unseen"]


def test_frames_that_are_missing_or_blind_are_no_misses(catalogue, estimator):
    belief, frame = one_box(catalogue, estimator)
    belief = unlikely(belief, 0.3)
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    for k in (3, 4, 9):
        belief = see(belief, dataclasses.replace(blind, observation=k), [], estimator)
        (track,) = belief.tracks
        assert track.missed == 0
    assert track.probability == pytest.approx(0.3 * 0.98**3)


def test_what_contends_keeps_its_own_evidence_until_some_settles_it(catalogue, estimator):
    """Look after look without news: a rival takes its share once, not each time."""
    frame, boxes = observe(catalogue, {"sugar": standing(catalogue, "sugar", 0.6, 0.0, yaw=0.5)})
    both = Detection(boxes["sugar"], 0.95, (("tide", 0.5), ("sugar", 0.45)))
    belief = see(SceneBelief(), frame, [both], estimator, threshold=0.0)
    tide, sugar = sorted(belief.tracks, key=lambda track: track.label, reverse=True)
    doubted = dataclasses.replace(sugar, label="sugar", probability=0.9, uncontended=0.9)
    rival = dataclasses.replace(tide, X_WO=sugar.X_WO, probability=0.9, uncontended=0.9)
    held = dataclasses.replace(belief, tracks=(doubted, rival))
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth), np.float32))
    seen = []
    for k in (1, 2, 3):
        held = see(held, dataclasses.replace(blind, observation=k), [], estimator)
        seen.append([track.probability for track in held.tracks])
    assert np.allclose(seen[0], 0.45, atol=0.06), "they reach into each other: one is true at most"
    assert np.allclose(seen[2], seen[0], atol=0.06)
    assert all(track.own_probability > 0.8 for track in held.tracks)


def test_a_full_house_takes_in_nothing_more(catalogue, estimator):
    """Not even what the box of a track that stays where it was shows."""
    belief, _ = one_box(catalogue, estimator)
    mug, boxes = observe(
        catalogue,
        {"sugar": standing(catalogue, "sugar", 0.6, 0.0), "mug": standing(catalogue, "mug", 0.6, -0.15)},
        observation=1,
    )
    wrong = Detection(boxes["mug"], 0.9, (("sugar", 0.9),))
    pairs = Associations(1, (Association(0, "sugar", 0, 0.5),))
    config = BeliefConfig(CONFIG, AssociationConfig(max_tracks=1), AcceptanceConfig(), True, 1)
    after = update(
        belief, mug, Detections(1, (wrong,)), pairs, None, estimator.estimator, estimator.presence,
        estimator.catalogue, config,
    )  # fmt: skip
    assert [track.id for track in after.tracks] == [0]


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
        see(SceneBelief(), frame, [], estimator, pairs=Associations(1, ()))
