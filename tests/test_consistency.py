import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import observe, standing

from sum_drake.consistency import conflicts, contended, penetration
from sum_drake.geometry import transform
from sum_drake.objects import load_catalogue
from sum_drake.presence import PresenceCheck
from sum_drake.types import PoseBelief, Track, readonly

share = st.floats(0, 1)


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


def track(label, X_WO, id=0):
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    return Track(id, label, (0, 0, 1, 1), 0.9, 0.9, belief, readonly(X_WO), 0.9, 0.9, False, 0, 0)


@given(st.lists(share, min_size=1, max_size=6), st.integers(0, 2**15 - 1))
def test_contending_only_takes_away_and_keeps_the_order_of_two(p, bits):
    n = len(p)
    against = np.zeros((n, n), dtype=bool)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    for k, (i, j) in enumerate(pairs):
        against[i, j] = against[j, i] = bool(bits >> k & 1)
    found = contended(np.array(p), against)
    assert (found >= 0).all()
    assert (found <= np.array(p) + 1e-9).all()
    alone = ~against.any(axis=1)
    np.testing.assert_allclose(found[alone], np.array(p)[alone], atol=2e-6)


@given(share, share)
def test_of_two_that_exclude_each_other_one_is_true_at_most(p, q):
    found = contended(np.array([p, q]), np.array([[False, True], [True, False]]))
    assert found.sum() <= 1 + 1e-9
    assert (found[0] >= found[1]) == (p >= q) or found[0] == pytest.approx(found[1], abs=1e-5)


def test_equal_rivals_share_what_is_sure_to_be_there():
    found = contended(np.array([0.99, 0.99, 0.4]), np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]], dtype=bool))
    assert found == pytest.approx([0.4975, 0.4975, 0.4], abs=1e-3)


def test_penetration_is_how_deep_the_deepest_point_lies(catalogue):
    """Two sugar boxes side by side, moved into each other."""
    width = catalogue["sugar"].load_mesh().extents[1]
    here = track("sugar", np.eye(4))

    def at(y):
        return penetration(here, track("sugar", transform(np.eye(3), np.array([0.0, y, 0.0]))), catalogue)

    assert at(width + 0.02) == 0.0
    assert at(width - 0.02) == pytest.approx(0.02, abs=0.004)
    assert at(5.0) == 0.0


def test_neighbours_are_no_conflict_and_two_in_one_place_are(catalogue):
    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    beside = standing(catalogue, "tide", 0.6, -0.15)
    frame, _ = observe(catalogue, {"sugar": X_WO, "tide": beside})
    tracks = [track("sugar", X_WO, 0), track("tide", beside, 1), track("mustard", X_WO, 2)]
    presence = PresenceCheck(catalogue)
    explained = [presence.explained(frame, one.label, one.X_WO) for one in tracks]
    found = conflicts(tracks, explained, catalogue)
    assert found.tolist() == [[False, False, True], [False, False, False], [True, False, False]]
    assert (found == found.T).all()


def test_two_that_explain_the_same_depth_are_a_conflict_though_they_do_not_touch(catalogue):
    tracks = [track("sugar", np.eye(4)), track("tide", transform(np.eye(3), np.array([2.0, 0, 0])), 1)]
    mask = np.zeros((20, 20), dtype=bool)
    mask[5:15, 5:15] = True
    part = mask & (np.arange(20) < 13)
    assert conflicts(tracks, [mask, part], catalogue)[0, 1]
    assert not conflicts(tracks, [mask, ~mask], catalogue)[0, 1]
    assert not conflicts(tracks, [mask & False, mask & False], catalogue)[0, 1]


def brute_force(p, conflicts):
    """Shares of all sets that may be true together."""
    odds, total, found = p / (1 - p), 0.0, np.zeros(len(p))
    for chosen in itertools.product([False, True], repeat=len(p)):
        members = np.flatnonzero(chosen)
        if conflicts[np.ix_(members, members)].any():
            continue
        weight = odds[members].prod()
        total += weight
        found[members] += weight
    return found / total


@given(st.lists(st.floats(0.01, 0.99), min_size=2, max_size=6), st.integers(0, 2**15 - 1))
def test_each_counts_as_often_as_it_is_in_what_can_be_true_together(p, drawn):
    n = len(p)
    conflicts = np.zeros((n, n), dtype=bool)
    for k, (i, j) in enumerate(itertools.combinations(range(n), 2)):
        conflicts[i, j] = conflicts[j, i] = drawn >> k & 1
    np.testing.assert_allclose(contended(np.array(p), conflicts), brute_force(np.array(p), conflicts), rtol=1e-6)


def test_a_rival_that_is_refuted_itself_takes_nothing():
    chain = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], dtype=bool)
    a, b, c = contended(np.array([0.9, 0.95, 0.99]), chain)
    assert a > 0.85 and b < 0.05 and c > 0.95


def test_many_that_hang_together_are_weighed_all_the_same():
    rng = np.random.default_rng(0)
    p, conflicts = rng.uniform(0.05, 0.99, 40), np.triu(rng.random((40, 40)) < 0.3, 1)
    found = contended(p, conflicts | conflicts.T)
    assert ((found > 0) & (found <= p + 1e-12)).all()
    rest = np.argsort(-p, kind="stable")[12:]
    for i, j in np.argwhere(conflicts):
        if i in rest or j in rest:
            assert found[i] + found[j] <= 1 + 1e-9


def test_a_touch_of_a_pixel_is_no_conflict(catalogue):
    tracks = [
        track("sugar", standing(catalogue, "sugar", 0.6, 0.1)),
        track("mug", standing(catalogue, "mug", 0.6, -0.1), id=1),
    ]
    masks = np.zeros((2, 60, 60), dtype=bool)
    masks[0, :50, :50], masks[1, 49, 47:50] = True, True
    assert not conflicts(tracks, list(masks), catalogue).any()
    masks[1, 40:50, 40:50] = True
    assert conflicts(tracks, list(masks), catalogue).any()
