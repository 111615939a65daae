"""The belief under whatever may come: observations out of order, repeated, missing or blind, detections of anything,
actions on anything. Its state stays valid, and the same events make the same state."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenes import observe, standing
from shapes import part_of_package

from sum_drake.association import AssociationConfig, associate, expected_boxes
from sum_drake.belief import SUNK, AcceptanceConfig, BeliefConfig, update
from sum_drake.consistency import PENETRATION, penetration
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import transform
from sum_drake.jsonio import canonical
from sum_drake.presence import PresenceCheck
from sum_drake.types import Associations, Detection, Detections, PickPlace, Region, SceneBelief, readonly

LABELS = ("sugar", "mug", "soup_can")
TINY = FilterConfig(
    particles=60, particles_last=20, iterations=2, warmup=1, candidates=2, tracking_particles=30,
    tracking_iterations=1,
)  # fmt: skip
ASSOCIATION = AssociationConfig(max_tracks=12)
TABLE = Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25]))
CONFIG = BeliefConfig(TINY, ASSOCIATION, AcceptanceConfig(), True, 5, TABLE)


class World:
    """What can be seen, and what makes a belief of it."""

    def __init__(self, folder):
        self.catalogue = part_of_package(folder, LABELS)
        self.estimator, self.presence = PoseEstimator(self.catalogue, TINY), PresenceCheck(self.catalogue)
        sugar = standing(self.catalogue, "sugar", 0.6, 0.1)
        both, self.boxes = observe(self.catalogue, {"sugar": sugar, "mug": standing(self.catalogue, "mug", 0.6, -0.1)})
        empty, _ = observe(self.catalogue, {})
        blind = dataclasses.replace(both, depth=readonly(np.zeros_like(both.depth), np.float32))
        self.frames = both, empty, blind

    def after(self, events):
        """The belief after each event."""
        belief, beliefs = SceneBelief(), []
        step = 0
        for frame, later, detections, action in events:
            step = max(step + later, 0)
            seen = dataclasses.replace(self.frames[frame], observation=step)
            boxes = tuple(self.detection(*one) for one in detections)
            act = None if action is None else self.action(*action)
            expected = expected_boxes(
                belief.tracks, act, seen, lambda label: np.asarray(self.catalogue[label].load_mesh().vertices)
            )
            pairs = associate(belief.tracks, boxes, ASSOCIATION, expected)
            belief = update(
                belief, seen, Detections(step, boxes), Associations(step, pairs), act,
                self.estimator, self.presence, self.catalogue, CONFIG,
            )  # fmt: skip
            beliefs.append(belief)
        return beliefs

    def detection(self, box, labels, p_box, p_label):
        return Detection(self.boxes.get(box, box), p_box, tuple((label, p_label) for label in labels))

    @staticmethod
    def action(track, label, lifted, released):
        place = [0.12, 0.62, 0.4] if track % 2 else [0.7, 0.2, 0.75]
        X_WO_place = transform(np.eye(3), np.array(place))
        gap = 0.04 if lifted else 0.0
        X_WG = readonly(transform(np.eye(3), np.array([0.6, 0.1, 0.8])))
        return PickPlace(0, "pick_place", track, label, X_WG, readonly(X_WO_place), "bin", gap, gap, released)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return World(tmp_path_factory.mktemp("events"))


numbers = st.floats(-50, 400)
boxes = st.one_of(
    st.sampled_from(["sugar", "mug"]),
    st.tuples(numbers, numbers, numbers, numbers),
    st.just((float("nan"),) * 4),
    st.just((0.0, 0.0, 1e6, 1e6)),
)
labels = st.lists(st.sampled_from(LABELS), min_size=1, max_size=2, unique=True)
p = st.one_of(st.floats(0, 1), st.just(float("nan")))
detections = st.lists(st.tuples(boxes, labels, p, p), max_size=3)
actions = st.one_of(st.none(), st.tuples(st.integers(-1, 9), st.sampled_from(LABELS), st.booleans(), st.booleans()))
events = st.lists(st.tuples(st.integers(0, 2), st.integers(-1, 2), detections, actions), min_size=1, max_size=5)


def check(world, belief, before):
    ids = [track.id for track in belief.tracks]
    assert len(set(ids)) == len(ids) <= ASSOCIATION.max_tracks
    assert all(0 <= id < belief.next_id for id in ids)
    assert belief.observation >= before.observation and belief.next_id >= before.next_id
    for track in belief.tracks:
        assert 0.0 <= track.probability <= 1.0
        assert np.isfinite(track.X_WO).all() and np.isfinite(track.belief.X_WOs).all()
        assert track.belief.weights.sum() == pytest.approx(1.0)
        assert track.born <= track.seen <= belief.observation
    accepted = [track.label for track in belief.tracks if track.accepted]
    assert len(set(accepted)) == len(accepted)
    for i, track in enumerate(kept := [track for track in belief.tracks if track.accepted]):
        assert dict(track.features)["sunk_m"] <= SUNK
        assert all(penetration(track, other, world.catalogue) <= PENETRATION for other in kept[:i])
    gone = {one.track for one in belief.gone}
    assert not gone & set(ids) and all(id < belief.next_id for id in gone)
    if belief.believed is not None:
        assert sum(share for _, share in belief.believed.outcomes) == pytest.approx(1.0)


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(events)
def test_whatever_comes_the_belief_stays_valid(world, drawn):
    before = SceneBelief()
    for belief in world.after(drawn):
        check(world, belief, before)
        before = belief


@settings(max_examples=3)
@given(events)
def test_the_same_events_make_the_same_belief(world, drawn):
    assert canonical(world.after(drawn)) == canonical(world.after(drawn))


def test_what_is_repeated_or_comes_late_changes_nothing(world):
    sugar = [("sugar", ("sugar",), 0.9, 0.9)]
    first, again, late = world.after([(0, 1, sugar, None), (0, 0, [], None), (1, -1, [], None)])
    assert first.tracks and again is first and late is first


def test_five_hundred_detections_are_the_surest_few(world):
    rng = np.random.default_rng(0)
    many = [
        ((*rng.uniform(0, 200, 2), *rng.uniform(5, 60, 2)), ("mug",), float(p_box), 0.9)
        for p_box in rng.uniform(0.1, 1.0, 500)
    ]  # fmt: skip
    (belief,) = world.after([(0, 1, many, None)])
    check(world, belief, SceneBelief())
    assert len(belief.tracks) == ASSOCIATION.max_tracks
    surest = sorted((one[2] for one in many), reverse=True)[: ASSOCIATION.max_tracks]
    assert sorted((track.p_box for track in belief.tracks), reverse=True) == surest


def test_an_action_whose_target_is_not_believed_in_is_an_observation_like_others(world):
    sugar = [("sugar", ("sugar",), 0.9, 0.9)]
    *_, belief = world.after([(0, 1, sugar, None), (0, 1, sugar, (7, "mug", True, True))])
    assert [track.label for track in belief.tracks] == ["sugar"]
    assert belief.believed is None
