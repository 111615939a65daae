"""What a summary says of faults."""

import dataclasses

import numpy as np
import pytest
from scenes import X_WC, observe, standing

from sum_drake.assets import InputError
from sum_drake.evaluation import Truth
from sum_drake.faults import FaultConfig, HandAct, absent_labels, false_detection, score_faults
from sum_drake.geometry import iou
from sum_drake.objects import load_catalogue
from sum_drake.types import (
    Attempt,
    Gone,
    Perception,
    PickPlace,
    PoseBelief,
    Region,
    SceneBelief,
    Track,
    readonly,
)

TABLE = Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25]))
REGIONS = {"table": TABLE, "bin": Region("bin", readonly([0.12, 0.62, 0.47]), readonly([0.2, 0.2, 0.18]))}
EYE = readonly(np.eye(4))


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def frame(catalogue):
    return observe(catalogue, {})[0]


def track(id, label, X_WO, p=0.9, accepted=True):
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    return Track(id, label, (0, 0, 9, 9), 0.9, 0.9, belief, readonly(X_WO), 0.8, p, accepted, 0, 0)


class Story:
    """Observations, what is believed after each, and where everything is."""

    def __init__(self, catalogue, frame):
        self.catalogue, self.frame = catalogue, frame
        self.perceptions, self.truths = [], []

    def look(self, tracks, X_WOs, gone=()):
        step = len(self.truths)
        prior = self.perceptions[-1].posterior if self.perceptions else SceneBelief()
        belief = SceneBelief(step, tuple(tracks), 9, tuple(gone))
        frame = dataclasses.replace(self.frame, observation=step)
        self.perceptions.append(Perception(step, frame, (), (), prior, belief, None))
        self.truths.append(Truth(step, tuple(X_WOs.items())))

    def told(self, fault, *, label="", acts=(), attempts=()):
        (row,) = score_faults(
            [fault], [label], acts, self.perceptions, attempts, self.truths, REGIONS, self.catalogue
        )  # fmt: skip
        return row


@pytest.fixture
def story(catalogue, frame):
    return Story(catalogue, frame)


def test_what_was_swept_is_found_again_after_so_many_looks(story, catalogue):
    here, there = standing(catalogue, "mug", 0.6, 0.1), standing(catalogue, "mug", 0.7, -0.1)
    story.look([track(0, "mug", here)], {"mug": here})
    story.look([track(0, "mug", here)], {"mug": there})
    acts = [HandAct(0, "swept", 0, 3.0, "mug")]
    row = story.told(FaultConfig("swept", 0), acts=acts)
    assert (row["happened"], row["object"], row["dealt_with_after"]) == (True, "mug", None)
    assert row["belief"] == "accepted where it is not, 0.90"
    story.look([track(0, "mug", there)], {"mug": there})
    row = story.told(FaultConfig("swept", 0), acts=acts)
    assert (row["dealt_with_after"], row["belief"]) == (2, "found again, 0.90")


def test_a_blind_look_in_between_settles_nothing(story, catalogue):
    here, there = standing(catalogue, "mug", 0.6, 0.1), standing(catalogue, "mug", 0.7, -0.1)
    story.look([track(0, "mug", here)], {"mug": here})
    story.look([track(0, "mug", there)], {"mug": there})
    story.look([track(0, "mug", there, accepted=False)], {"mug": there})
    blind = dataclasses.replace(
        story.perceptions[-1].frame, depth=readonly(np.zeros_like(story.frame.depth), np.float32)
    )
    story.perceptions[-1] = dataclasses.replace(story.perceptions[-1], frame=blind)
    story.look([track(0, "mug", there)], {"mug": there})
    row = story.told(FaultConfig("swept", 0), acts=[HandAct(0, "swept", 0, 3.0, "mug")])
    assert (row["dealt_with_after"], row["belief"]) == (1, "found again, 0.90")


def test_what_was_taken_is_declared_gone_with_its_reason(story, catalogue):
    X_WO = standing(catalogue, "mug", 0.6, 0.1)
    story.look([track(0, "mug", X_WO)], {"mug": X_WO})
    story.look([], {}, [Gone(0, "mug", 1, "empty")])
    row = story.told(FaultConfig("taken", 0), acts=[HandAct(0, "taken", 0, 3.0, "mug")])
    assert (row["dealt_with_after"], row["belief"]) == (1, "gone: empty")


def test_what_fell_may_be_believed_in_only_where_it_lies(story, catalogue):
    here, floor = standing(catalogue, "mug", 0.6, 0.1), standing(catalogue, "mug", 0.5, -0.75)
    floor[2, 3] = 0.05
    story.look([track(0, "mug", here)], {"mug": here})
    story.look([track(0, "mug", here)], {"mug": floor})
    acts = [HandAct(0, "swept", 0, 3.0, "mug")]
    assert story.told(FaultConfig("swept", 0), acts=acts)["dealt_with_after"] is None
    story.look([track(1, "mug", floor)], {"mug": floor})
    row = story.told(FaultConfig("swept", 0), acts=acts)
    assert (row["dealt_with_after"], row["belief"]) == (2, "found where it fell, 0.90")


def test_a_fault_that_never_came_is_told_as_such(story):
    story.look([], {})
    for kind in ("swept", "slipped", "dropped"):
        row = story.told(FaultConfig(kind, 0))
        assert (row["happened"], row["dealt_with_after"]) == (False, None)
        assert row["belief"] == "it did not come to it"
    assert not story.told(FaultConfig("camera", 5))["happened"]


def attempt(step, label, *, released, reason="empty_hand"):
    action = PickPlace(step, "pick_place", 0, label, EYE, EYE, "bin", 0.0, 0.0, released)
    return Attempt(step, 0, label, "bin", "pick_place", reason, 1, (), action)


def test_faults_of_the_fingers_are_of_the_attempt_that_they_struck(story, catalogue):
    X_WO = standing(catalogue, "mug", 0.6, 0.1)
    for _ in range(3):
        story.look([track(0, "mug", X_WO)], {"mug": X_WO})
    attempts = [attempt(0, "toy", released=False), attempt(1, "mug", released=False, reason="lost_in_transport")]
    slipped = story.told(FaultConfig("slipped", 0), attempts=attempts)
    assert (slipped["object"], slipped["observation"]) == ("toy", 0)
    dropped = story.told(FaultConfig("dropped", 0), attempts=attempts)
    assert (dropped["object"], dropped["observation"], dropped["dealt_with_after"]) == ("mug", 1, 1)


def test_a_camera_that_failed_is_no_reason_to_forget(story, catalogue):
    X_WO = standing(catalogue, "mug", 0.6, 0.1)
    story.look([track(0, "mug", X_WO)], {"mug": X_WO})
    story.look([track(0, "mug", X_WO, accepted=False)], {"mug": X_WO})
    assert story.told(FaultConfig("camera", 1))["dealt_with_after"] is None
    story.look([track(0, "mug", X_WO)], {"mug": X_WO})
    row = story.told(FaultConfig("camera", 1))
    assert (row["dealt_with_after"], row["belief"]) == (1, "1 of 1 known before are known after")


def test_a_false_detection_that_is_believed_later_is_not_dealt_with(story, catalogue):
    X_WO = standing(catalogue, "toy", 0.6, 0.1)
    for p in (0.1, 0.9, 0.9):
        story.look([track(0, "toy", X_WO, p, accepted=p > 0.5)], {})
    row = story.told(FaultConfig("false_detection", 0), label="toy")
    assert (row["dealt_with_after"], row["belief"]) == (None, "accepted where it is not, 0.90")


def test_what_is_still_likely_is_not_given_up_though_it_is_not_accepted(story, catalogue):
    X_WO = standing(catalogue, "mug", 0.6, 0.1)
    story.look([track(0, "mug", X_WO)], {"mug": X_WO})
    story.look([track(0, "mug", X_WO, 0.8, accepted=False)], {})
    row = story.told(FaultConfig("taken", 0), acts=[HandAct(0, "taken", 0, 3.0, "mug")])
    assert (row["dealt_with_after"], row["belief"]) == (None, "held where it is not, 0.80")


def test_an_end_before_the_fault_is_not_its_own(story, catalogue):
    X_WO = standing(catalogue, "mug", 0.6, 0.1)
    story.look([track(0, "mug", X_WO)], {"mug": X_WO}, [Gone(5, "mug", 0, "unlikely")])
    story.look([], {})
    row = story.told(FaultConfig("taken", 0), acts=[HandAct(0, "taken", 0, 3.0, "mug")])
    assert (row["dealt_with_after"], row["belief"]) == (1, "not believed in")


def test_two_faults_of_one_kind_are_told_apart(catalogue, frame):
    story = Story(catalogue, frame)
    for _ in range(3):
        story.look([], {})
    attempts = [attempt(0, "toy", released=False), attempt(1, "mug", released=False)]
    rows = score_faults(
        [FaultConfig("slipped", 0), FaultConfig("slipped", 0)], ["", ""], [], story.perceptions, attempts,
        story.truths, REGIONS, catalogue,
    )  # fmt: skip
    assert [row["object"] for row in rows] == ["toy", "mug"]


def test_a_false_detection_that_is_believed_is_told(story, catalogue):
    X_WO = standing(catalogue, "toy", 0.6, 0.1)
    for _ in range(4):
        story.look([track(0, "toy", X_WO)], {})
    row = story.told(FaultConfig("false_detection", 0), label="toy")
    assert (row["dealt_with_after"], row["belief"]) == (None, "accepted where it is not, 0.90")


def test_labels_of_what_is_not_there_are_drawn_by_the_seed():
    faults = [FaultConfig("added"), FaultConfig("false_detection"), FaultConfig("taken"), FaultConfig("added", 0, "b")]
    labels = absent_labels(faults, "abcdef", "ac", 3)
    assert labels == absent_labels(faults, "abcdef", "ac", 3)
    assert labels[2:] == ["", "b"]
    assert set(labels[:2]) < set("def") and labels[0] != labels[1]
    with pytest.raises(InputError, match="b is on the table"):
        absent_labels(faults, "abcdef", "ab", 3)
    with pytest.raises(InputError, match="b is named twice"):
        absent_labels([*faults, FaultConfig("false_detection", 0, "b")], "abcdef", "ac", 3)
    with pytest.raises(InputError, match="no label is left"):
        absent_labels(faults, "abc", "ac", 3)


def test_a_false_detection_is_the_same_in_every_look_from_one_place(frame, catalogue):
    vertices = np.asarray(catalogue["toy"].load_mesh().vertices)
    one, same = (false_detection("toy", frame, TABLE, vertices, np.random.default_rng(2)) for _ in range(2))
    assert one == same
    assert iou(one.box, (0, 0, frame.camera.width, frame.camera.height))[0, 0] > 0
    assert np.array_equal(frame.X_WC, X_WC)
