"""The referee's score: who is a false positive, how an attempt ended, and whose fault it was."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.evaluation import (
    Truth,
    digest,
    score_attempts,
    score_observation,
    summary,
    where_is,
)
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import predicted_box
from sum_drake.summary_schema import validate_summary
from sum_drake.types import (
    Array,
    Association,
    Attempt,
    Camera,
    Detection,
    Frame,
    Perception,
    PickPlace,
    PoseBelief,
    Region,
    SceneBelief,
    Track,
    readonly,
)

REGIONS = {
    "table": Region("table", readonly([0.7, 0.0, 0.9]), readonly([0.25, 0.35, 0.2])),
    "left": Region("left", readonly([0.12, 0.62, 0.5]), readonly([0.18, 0.18, 0.1])),
    "right": Region("right", readonly([0.12, -0.62, 0.5]), readonly([0.18, 0.18, 0.1])),
}
GOAL = {"sugar": "left", "tide": "right", "mug": "left", "soup_can": "leave"}
TABLE, LEFT, RIGHT, FLOOR = (0.7, 0.1, 0.76), (0.1, 0.6, 0.45), (0.1, -0.6, 0.45), (0.5, 0.6, 0.05)


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def at(*p: float, turn: float = 0.0) -> Array:
    return transform(rotation_from_vector(np.array([0.0, 0.0, turn])), np.array(p))


def truth(observation: int, **places: tuple[float, float, float]) -> Truth:
    return Truth(observation, tuple((label, at(*p)) for label, p in places.items()))


def attempt(step: int, label: str, region: str, *, reason: str = "executed", moved: bool = True) -> Attempt:
    released = reason == "executed"
    action = PickPlace(step, "pick_place", 0, label, np.eye(4), np.eye(4), region, 0.03, 0.03, released)
    return Attempt(step, 0, label, region, "pick_place", reason, 10, (("ik", 3),), action if moved else None)


def frame() -> Frame:
    """From a head above the table, looking down."""
    X_WC = transform(np.diag([1.0, -1.0, -1.0]), np.array([0.7, 0.0, 1.7]))
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    return Frame(0, np.zeros((480, 640, 3), np.uint8), np.ones((480, 640), np.float32), camera, X_WC)


def perceive(*tracks: Track) -> Perception:
    return Perception(0, frame(), (), (), SceneBelief(), SceneBelief(0, tracks), None)


def track(
    catalogue: Catalogue, label: str, X_WO: Array, *, seen_at: Array | None = None, accepted: bool = True
) -> Track:
    """A track whose box is around its own estimate, or around another pose."""
    box_at = X_WO if seen_at is None else seen_at
    box = predicted_box(np.asarray(catalogue[label].load_mesh().vertices), box_at, frame())
    belief = PoseBelief(X_WO[None], np.ones(1))
    return Track(0, label, box, 0.9, 0.9, belief, X_WO, 0.8, 0.9 if accepted else 0.1, accepted, 0, 0)


def detected(catalogue: Catalogue, X_WO: Array, shape: str, *p_labels: tuple[str, float]) -> Detection:
    """A detection around an object of a shape at X_WO, with the labels that it is given."""
    box = predicted_box(np.asarray(catalogue[shape].load_mesh().vertices), X_WO, frame())
    return Detection(box, 0.9, p_labels)


def observe(catalogue: Catalogue, detections: list[Detection], fed: list[tuple[int, Track, bool]]) -> Perception:
    """An observation of these detections; fed: index of a detection, the track it feeds, whether that is new."""
    next_id = 5
    associations, tracks = [], []
    for index, one, new in fed:
        id = next_id if new else one.id
        next_id += new
        associations.append(Association(index, one.label, None if new else id, 0.5))
        tracks.append(dataclasses.replace(one, id=id, box=detections[index].box))
    prior, posterior = SceneBelief(-1, (), 5), SceneBelief(0, tuple(tracks), next_id)
    return Perception(0, frame(), tuple(detections), tuple(associations), prior, posterior, None)


# False detections.


def test_false_detections_are_listed_with_what_became_of_them(catalogue: Catalogue) -> None:
    here, there, away = at(*TABLE), at(0.7, -0.2, 0.76), at(0.5, 0.3, 0.76)
    detections = [
        detected(catalogue, here, "sugar", ("sugar", 0.8), ("tide", 0.1)),  # right
        detected(catalogue, there, "tide", ("mug", 0.6), ("tide", 0.3)),  # a tide, taken for a mug
        detected(catalogue, away, "mug", ("mug", 0.5)),  # nothing is there: rejected
        detected(catalogue, at(0.9, 0.3, 0.76), "mug", ("toy", 0.4)),  # nothing is there: believed
        detected(catalogue, at(0.9, -0.3, 0.76), "mug", ("ranch", 0.03)),  # nothing is there: too improbable
    ]
    fed = [
        (0, track(catalogue, "sugar", here), False),
        (0, track(catalogue, "tide", here, accepted=False), True),
        (1, track(catalogue, "mug", there, accepted=False), True),
        (1, track(catalogue, "tide", there), True),
        (2, dataclasses.replace(track(catalogue, "mug", away, accepted=False), id=3), False),
        (3, track(catalogue, "toy", at(0.9, 0.3, 0.76)), True),
    ]
    row = score_observation(
        observe(catalogue, detections, fed), Truth(0, (("sugar", here), ("tide", there))), catalogue
    )
    found = [(one["label"], one["fate"], one["accepted_as"]) for one in row["false_detections"]]
    assert found == [
        ("mug", "corrected", "tide"),
        ("mug", "rejected", None),
        ("toy", "accepted", "toy"),
        ("ranch", "unused", None),
    ]
    first = row["false_detections"][0]
    assert first["box"] == list(detections[1].box)
    assert first["probability"] == pytest.approx(0.9 * 0.6)


def test_a_box_on_what_shows_of_a_hidden_object_is_right_where_the_estimate_is(catalogue: Catalogue) -> None:
    here = at(*TABLE)
    whole = detected(catalogue, here, "sugar", ("sugar", 0.8))
    x, y, w, h = whole.box
    part = dataclasses.replace(whole, box=(x, y, w, 0.3 * h))
    truth_here = Truth(0, (("sugar", here),))
    near = observe(catalogue, [part], [(0, track(catalogue, "sugar", at(0.72, 0.1, 0.76)), True)])
    assert score_observation(near, truth_here, catalogue)["false_detections"] == []
    far = observe(catalogue, [part], [(0, track(catalogue, "sugar", at(0.5, -0.3, 0.76), accepted=False), True)])
    (row,) = score_observation(far, truth_here, catalogue)["false_detections"]
    assert row["fate"] == "rejected"


# Where things are.


@pytest.mark.parametrize(
    ("p", "place"),
    [
        (TABLE, "table"),
        ((0.95, 0.38, 0.74), "table"),  # On the table, outside the area where things are poured.
        (LEFT, "left"),
        ((0.12, 0.62, 0.66), "left"),  # On the heap in a full bin.
        ((0.12, 0.62, 0.05), "floor"),  # Under the bin.
        ((0.12, 0.82, 0.45), "floor"),  # Beside it.
        (FLOOR, "floor"),
    ],
)
def test_where_is(p: tuple[float, float, float], place: str) -> None:
    assert where_is(at(*p), REGIONS) == place


@given(st.permutations(["table", "corner", "tray", "left"]))
def test_of_regions_in_regions_the_smallest_counts(order: list[str]) -> None:
    """A corner of the table, and a tray in it, are places of their own, in whatever order they are listed."""
    all_regions = {
        "corner": Region("corner", readonly([0.8, 0.2, 0.8]), readonly([0.1, 0.1, 0.1])),
        "tray": Region("tray", readonly([0.8, 0.2, 0.75]), readonly([0.05, 0.05, 0.05])),
        **REGIONS,
    }
    regions = {name: all_regions[name] for name in order}
    places = [where_is(at(x, 0.2, 0.75), regions) for x in (0.6, 0.72, 0.8)]
    assert places == ["table", "corner", "tray"]


# Observations.


def test_a_right_track_is_true_and_its_error_measured(catalogue: Catalogue) -> None:
    X_WO = at(0.7, 0.1, 0.8)
    estimate = at(0.703, 0.104, 0.8, turn=0.2)
    row = score_observation(perceive(track(catalogue, "mug", estimate)), Truth(0, (("mug", X_WO),)), catalogue)
    assert (row["tracks"], row["false_positives"], row["true_tracks_accepted"]) == (1, 0, 1)
    assert row["poses"][0]["translation_error_m"] == pytest.approx(0.005)
    assert row["poses"][0]["rotation_error_rad"] == pytest.approx(0.2)
    assert row["poses"][0]["visible_share"] is None


@settings(max_examples=20)
@given(turn=st.floats(-3.0, 3.0))
def test_errors_forgive_symmetry(turn: float) -> None:
    """A can turned about its axis is the same can."""
    catalogue = load_catalogue()
    estimate = at(0.7, 0.1, 0.8, turn=turn)
    row = score_observation(
        perceive(track(catalogue, "soup_can", estimate)), truth(0, soup_can=(0.7, 0.1, 0.8)), catalogue
    )
    assert row["poses"][0]["rotation_error_rad"] == pytest.approx(0.0, abs=1e-6)


def test_a_wrong_label_is_a_false_positive_and_counts_as_rejected_only_if_it_was(catalogue: Catalogue) -> None:
    """The box holds the sugar; the tide stands elsewhere, and there is no mug."""
    scene = truth(0, sugar=(0.7, 0.1, 0.8), tide=(0.55, -0.25, 0.85))
    for accepted in (False, True):
        for label in ("tide", "mug"):
            seen = track(catalogue, label, at(0.7, 0.1, 0.8), accepted=accepted)
            row = score_observation(perceive(seen), scene, catalogue)
            assert row["false_positives"] == 1
            assert row["false_positives_rejected"] == (not accepted)
            assert row["true_tracks_accepted"] == 0
            assert (row["poses"][0]["translation_error_m"] is None) == (label == "mug")


def test_a_right_box_with_a_wrong_pose_is_no_false_positive_of_the_detector(catalogue: Catalogue) -> None:
    X_WO = at(0.7, 0.1, 0.8)
    lost = track(catalogue, "sugar", at(0.7, -0.1, 0.8), seen_at=X_WO)
    row = score_observation(perceive(lost), Truth(0, (("sugar", X_WO),)), catalogue)
    assert row["false_positives"] == 0 and row["true_tracks"] == 1
    assert row["poses"][0]["translation_error_m"] == pytest.approx(0.2)


def test_a_strip_of_a_hidden_object_is_true_where_its_pose_is_right(catalogue: Catalogue) -> None:
    """Of a half-hidden object only a strip shows: its box overlaps little with the whole object's."""
    X_WO = at(0.7, 0.1, 0.8)
    shown = Truth(0, (("tide", X_WO),), (("tide", 0.3),))
    for estimate, is_true in ((at(0.7, 0.13, 0.8), True), (at(0.7, 0.3, 0.8), False)):
        seen = track(catalogue, "tide", estimate, seen_at=X_WO)
        x, y, w, h = seen.box
        strip = dataclasses.replace(seen, box=(x, y, 0.3 * w, h))
        row = score_observation(perceive(strip), shown, catalogue)
        assert row["true_tracks"] == is_true and row["false_positives"] == (not is_true)
        assert row["poses"][0]["visible_share"] == 0.3


def test_a_track_that_was_not_seen_is_no_hypothesis_of_this_observation(catalogue: Catalogue) -> None:
    """What was carried off leaves its track behind for a while."""
    gone = dataclasses.replace(track(catalogue, "sugar", at(0.7, 0.1, 0.8), accepted=False), seen=-1)
    row = score_observation(perceive(gone), truth(0, sugar=LEFT), catalogue)
    assert (row["tracks"], row["false_positives"], row["true_tracks"]) == (1, 0, 0)
    assert row["poses"][0]["seen"] is False


def test_truth_of_another_observation_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(ValueError, match="observation 3"):
        score_observation(perceive(), truth(3), catalogue)


# Attempts.


def outcome(made: Attempt, before: Truth, after: Truth) -> tuple[str, str | None]:
    (row,) = score_attempts([made], [before, after], regions=REGIONS, goal=GOAL, slips=[None])
    return row["outcome"], row["object"]


START = {"sugar": TABLE, "tide": (0.6, -0.2, 0.8)}


@pytest.mark.parametrize(
    ("made", "ends", "expected"),
    [
        (attempt(0, "sugar", "left"), {"sugar": LEFT}, ("sorted", "sugar")),
        (attempt(0, "sugar", "left"), {"sugar": RIGHT}, ("missorted", "sugar")),
        (attempt(0, "sugar", "left"), {"sugar": FLOOR}, ("dropped", "sugar")),
        (attempt(0, "sugar", "left", reason="lost_in_transport"), {"sugar": (0.6, 0.2, 0.75)}, ("dropped", "sugar")),
        (attempt(0, "sugar", "left", reason="empty_hand"), {"sugar": (0.72, 0.1, 0.76)}, ("slipped", "sugar")),
        (attempt(0, "sugar", "left", reason="empty_hand"), {}, ("missed", "sugar")),
        (attempt(0, "sugar", "left", reason="empty_hand"), {"tide": FLOOR}, ("missed", "sugar")),
        (attempt(0, "sugar", "left", reason="unexpected_effort"), {}, ("aborted", "sugar")),
        (attempt(0, "sugar", "left", reason="tracking_error"), {"sugar": FLOOR}, ("dropped", "sugar")),
        (attempt(0, "sugar", "left", reason="no_grasp", moved=False), {}, ("infeasible", None)),
        # The tide was taken for the sugar, carried to the sugar's bin: wrong, or lost on the way.
        (attempt(0, "sugar", "left"), {"tide": LEFT}, ("missorted", "tide")),
        (attempt(0, "sugar", "left"), {"tide": FLOOR}, ("dropped", "tide")),
        # The sugar was taken for a mug, which goes to the same bin.
        (attempt(0, "mug", "left"), {"sugar": LEFT}, ("sorted", "sugar")),
        (attempt(0, "mug", "left", reason="empty_hand"), {}, ("missed", None)),
    ],
)  # fmt: skip
def test_outcomes(made: Attempt, ends: dict[str, tuple[float, float, float]], expected: tuple[str, str | None]) -> None:
    assert outcome(made, truth(0, **START), truth(1, **(START | ends))) == expected


def move(label: str, to: tuple[float, float, float], reason: str = "executed") -> Attempt:
    made = attempt(0, label, "table", reason=reason)
    assert made.action is not None
    action = dataclasses.replace(made.action, kind="move", X_WO_place=at(*to))
    return dataclasses.replace(made, kind="move", action=action, why="in the way")


ASIDE = (0.7, -0.2, 0.76)


@pytest.mark.parametrize(
    ("made", "ends", "expected"),
    [
        (move("sugar", ASIDE), {"sugar": (0.73, -0.2, 0.72)}, ("moved", "sugar")),
        (move("sugar", ASIDE), {"sugar": (0.7, 0.05, 0.76)}, ("dropped", "sugar")),
        (move("sugar", ASIDE), {"sugar": FLOOR}, ("dropped", "sugar")),
        (move("sugar", ASIDE), {}, ("dropped", "sugar")),
        (move("sugar", ASIDE, "empty_hand"), {}, ("missed", "sugar")),
        (move("sugar", ASIDE, "empty_hand"), {"sugar": (0.74, 0.1, 0.76)}, ("slipped", "sugar")),
        # The tide was taken for the sugar; or pushed while the sugar was moved.
        (move("sugar", ASIDE), {"tide": ASIDE}, ("moved", "tide")),
        (move("sugar", ASIDE), {"sugar": ASIDE, "tide": (0.5, -0.2, 0.8)}, ("moved", "sugar")),
    ],
)  # fmt: skip
def test_outcomes_of_moves(
    made: Attempt, ends: dict[str, tuple[float, float, float]], expected: tuple[str, str | None]
) -> None:
    assert outcome(made, truth(0, **START), truth(1, **(START | ends))) == expected


def test_a_move_that_worked_is_a_trial_and_no_error() -> None:
    made, truths = move("sugar", ASIDE), [truth(0, **START), truth(1, **(START | {"sugar": ASIDE}))]
    data = make_summary([made], truths)
    validate_summary(data)
    assert (data["manipulation_trials"], data["manipulation_errors"], data["objects_missorted"]) == (1, 0, 0)
    assert data["attempts"][0]["why"] == "in the way"
    pushed = [truths[0], truth(1, sugar=ASIDE, tide=FLOOR)]
    assert make_summary([made], pushed)["manipulation_errors"] == 1, "it knocked the tide off"


def test_sweeping_another_object_off_is_told(catalogue: Catalogue) -> None:
    """As in the paper's sequence (a): the hand went for one object and swept another onto the ground."""
    rows = score_attempts(
        [attempt(0, "sugar", "left")],
        [truth(0, **START), truth(1, sugar=LEFT, tide=FLOOR)],
        regions=REGIONS, goal=GOAL, slips=[0.004],
    )  # fmt: skip
    assert rows[0]["outcome"] == "sorted" and rows[0]["knocked_off"] == ["tide"] and rows[0]["slip_m"] == 0.004


# The whole.


def make_summary(attempts: list[Attempt], truths: list[Truth], **changes: Any) -> dict[str, Any]:
    rows = score_attempts(attempts, truths, regions=REGIONS, goal=GOAL, slips=[None] * len(attempts))
    arguments: dict[str, Any] = {
        "seed": 1, "outcome": "cleared", "final": truths[-1], "regions": REGIONS, "goal": GOAL,
        "observations": [score_observation(perceive(), truth(0), load_catalogue())], "attempts": rows,
        "timing": {"wall_s": 12.5}, "digest": "0" * 64, "versions": {"drake": "1.51.1"}, "device": "cpu",
    }  # fmt: skip
    return summary(**(arguments | changes))


def test_summary_of_a_run() -> None:
    """One slip, then sorted; tide taken for a mug; the mug swept into the wrong bin; the can left alone."""
    start = {"sugar": TABLE, "tide": (0.6, -0.2, 0.8), "mug": (0.6, 0.2, 0.75), "soup_can": (0.8, 0.0, 0.75)}
    truths = [
        truth(0, **start),
        truth(1, **(start | {"sugar": (0.75, 0.1, 0.76)})),
        truth(2, **(start | {"sugar": LEFT})),
        truth(3, **(start | {"sugar": LEFT, "tide": LEFT, "mug": RIGHT})),
    ]
    attempts = [
        attempt(0, "sugar", "left", reason="empty_hand"),
        attempt(1, "tide", "right", reason="no_grasp", moved=False),
        attempt(1, "sugar", "left"),
        attempt(2, "mug", "left"),
    ]
    attempts[3] = attempt(2, "soup_can", "left")
    data = make_summary(attempts, truths)
    validate_summary(data)
    json.dumps(data, allow_nan=False)
    assert (data["objects_total"], data["objects_sorted"], data["completion_ratio"]) == (3, 1, pytest.approx(1 / 3))
    assert [row["place"] for row in data["objects"]] == ["left", "left", "right", "table"]
    assert data["objects_missorted"] == 2
    assert data["missorted_by"] == {"perception": 1, "manipulation": 1}
    assert data["manipulation_trials"] == 3
    # The slip, and the last trial because it knocked the mug off; its own wrong bin was the belief's fault.
    assert data["manipulation_errors"] == 2
    assert data["timing"]["wall_s"] == 12.5 and data["timing"]["planning_cpu_s"] is None


def test_a_right_label_in_the_wrong_bin_is_the_hands_fault() -> None:
    data = make_summary([attempt(0, "sugar", "left")], [truth(0, **START), truth(1, **(START | {"sugar": RIGHT}))])
    assert data["missorted_by"] == {"perception": 0, "manipulation": 1}
    assert data["manipulation_errors"] == 1


def test_the_digest_tells_the_last_bit(catalogue: Catalogue) -> None:
    def make(x: float, place: float = 0.1, reason: str = "executed") -> str:
        seen = perceive(track(catalogue, "sugar", at(x, 0.1, 0.8)))
        return digest([seen], [attempt(0, "sugar", "left", reason=reason)], truth(1, sugar=(0.1, place, 0.45)))

    assert make(0.7) == make(0.7)
    assert len({make(0.7), make(float(np.nextafter(0.7, 1))), make(0.7, 0.2), make(0.7, reason="empty_hand")}) == 4
