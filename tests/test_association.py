import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scenes import observe
from scipy.optimize import linear_sum_assignment

from sum_drake.association import AssociationConfig, associate, associate_frame, greedy_matches, matching_scores
from sum_drake.objects import load_catalogue
from sum_drake.types import Detection, Detections, PoseBelief, SceneBelief, Track, readonly

CATALOGUE = load_catalogue()

BELIEF = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))


def track(id, label, box):
    return Track(id, label, box, 0.9, 0.9, BELIEF, BELIEF.X_WOs[0], 0.5, 0.5, True, 0, 0)


def detection(box, **p_labels):
    return Detection(box, 0.9, tuple(p_labels.items()))


scores = st.integers(0, 6).flatmap(
    lambda rows: st.integers(0, 6).flatmap(
        lambda columns: st.lists(
            st.lists(st.floats(0, 1), min_size=columns, max_size=columns), min_size=rows, max_size=rows
        ).map(lambda lists: np.array(lists).reshape(rows, columns))
    )
)


@given(scores, st.floats(0, 1))
def test_greedy_matches_are_one_to_one_above_the_threshold_and_best_first(matrix, threshold):
    matches = greedy_matches(matrix, threshold)
    rows, columns = [i for i, _ in matches], [j for _, j in matches]
    assert len(set(rows)) == len(rows)
    assert len(set(columns)) == len(columns)
    values = [matrix[i, j] for i, j in matches]
    assert values == sorted(values, reverse=True)
    assert all(value >= threshold and value > 0 for value in values)
    # Nothing more could be matched.
    left = np.delete(np.delete(matrix, rows, 0), columns, 1)
    assert not np.any((left >= threshold) & (left > 0))


@given(scores)
def test_greedy_reaches_half_of_the_best_assignment_at_least(matrix):
    greedy = sum(matrix[i, j] for i, j in greedy_matches(matrix, 0.0))
    best = matrix[linear_sum_assignment(matrix, maximize=True)].sum()
    assert best / 2 - 1e-9 <= greedy <= best + 1e-9


def test_score_is_the_product_of_overlap_and_confidences():
    matrix, pairs = matching_scores([track(0, "mug", (0, 0, 10, 10))], [detection((0, 0, 10, 20), mug=0.8, tide=0.1)])
    assert pairs == [(0, "mug"), (0, "tide")]
    np.testing.assert_allclose(matrix, [[0.5 * 0.9 * 0.8, 0.0]])


def test_one_box_feeds_rival_tracks_of_different_labels():
    tracks = [track(3, "shampoo", (0, 0, 10, 10)), track(4, "clorox", (1, 0, 10, 10))]
    pairs = associate(tracks, [detection((0, 0, 10, 10), shampoo=0.6, clorox=0.3)], AssociationConfig())
    assert [(p.detection, p.label, p.track) for p in pairs] == [(0, "shampoo", 3), (0, "clorox", 4)]


def test_an_object_seen_elsewhere_spawns_a_new_track():
    pairs = associate([track(3, "mug", (0, 0, 10, 10))], [detection((100, 0, 10, 10), mug=0.9)], AssociationConfig())
    assert [(p.label, p.track) for p in pairs] == [("mug", None)]


def test_unsure_boxes_spawn_nothing_and_an_empty_picture_is_no_error():
    config = AssociationConfig(spawn_threshold=0.5)
    assert associate([], [detection((0, 0, 10, 10), mug=0.4)], config) == ()
    assert associate([track(1, "mug", (0, 0, 5, 5))], [], config) == ()


def test_the_better_of_two_boxes_continues_the_track_and_the_other_spawns():
    boxes = [detection((3, 0, 10, 10), mug=0.9), detection((0, 0, 10, 10), mug=0.9)]
    pairs = associate([track(7, "mug", (0, 0, 10, 10))], boxes, AssociationConfig())
    assert [(p.detection, p.track) for p in pairs] == [(0, None), (1, 7)]


def test_where_there_is_room_for_few_the_surest_spawn():
    boxes = [detection((50 * i, 0, 10, 10), mug=0.1 * i) for i in range(1, 9)]
    held = [track(7, "toy", (0, 90, 10, 10))]
    pairs = associate(held, boxes, AssociationConfig(max_tracks=4))
    assert [pair.detection for pair in pairs] == [5, 6, 7]
    assert associate(held * 4, boxes, AssociationConfig(max_tracks=4)) == ()


def test_a_confidence_that_is_no_number_is_none():
    box = (0, 0, 10, 10)
    broken = Detection(box, float("nan"), (("mug", 0.9),))
    assert associate([track(7, "mug", box)], [broken], AssociationConfig()) == ()


def test_without_carrying_every_box_spawns_whatever_was_held():
    held = SceneBelief(0, (track(4, "mug", (0, 0, 10, 10)),), 5)
    found = Detections(1, (detection((0, 0, 10, 10), mug=0.9),))
    frame, _ = observe(CATALOGUE, {}, observation=1)
    pairs = [
        associate_frame(held, frame, found, None, lambda label: np.zeros((1, 3)), AssociationConfig(carry=carry)).pairs
        for carry in (True, False)
    ]
    assert [[pair.track for pair in of] for of in pairs] == [[4], [None]]


def test_a_track_is_expected_where_the_action_was_to_put_it():
    box, place = (0, 0, 10, 10), (200, 0, 10, 10)
    held = [track(7, "mug", box)]
    assert associate(held, [detection(place, mug=0.9)], AssociationConfig())[0].track is None
    assert associate(held, [detection(place, mug=0.9)], AssociationConfig(), [[box, place]])[0].track == 7
