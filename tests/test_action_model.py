import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.action_model import OUTCOMES, felt, judged, predict
from sum_drake.filter_config import FilterConfig, filter_config
from sum_drake.geometry import rotation_angle, transform
from sum_drake.presence import UNKNOWN, Presence
from sum_drake.types import PickPlace, PoseBelief


def action(
    label: str, *, released: bool = True, kind: str = "pick_place", lifted: float = 0.05, held: float = 0.05
) -> PickPlace:
    place = transform(np.eye(3), np.array([0.1, -0.6, 0.8]))
    return PickPlace(0, kind, 1, label, np.eye(4), place, "cleaning_bin", lifted, held, released)


def test_action_model_is_the_mixture_of_eq_10() -> None:
    n = 20000
    belief = PoseBelief(np.tile(np.eye(4), (n, 1, 1)), np.full(n, 1 / n))
    config = filter_config("paper")
    rng = np.random.default_rng(0)
    target = predict(belief, action("tide"), is_target=True, rng=rng, config=config)
    place = action("tide").X_WO_place[:3, 3]
    placed = np.linalg.norm(target.X_WOs[:, :3, 3] - place, axis=1) < 0.4
    assert placed.mean() == pytest.approx(config.w_place, abs=0.02)
    assert target.X_WOs[placed, :3, 3].mean(0) == pytest.approx(place, abs=0.002)
    assert target.X_WOs[placed, :3, 3].std(0) == pytest.approx([0.04] * 3, rel=0.05)
    assert target.X_WOs[~placed, :3, 3].std(0) == pytest.approx([0.02] * 3, rel=0.05)
    other = predict(belief, action("tide"), is_target=False, rng=rng, config=config)
    assert other.X_WOs[:, :3, 3].std(0) == pytest.approx([0.01] * 3, rel=0.05)
    # .01 m go with .1 rad on each of three axes.
    assert np.sqrt((rotation_angle(other.X_WOs[:, :3, :3]) ** 2).mean() / 3) == pytest.approx(0.1, rel=0.05)
    kept = predict(belief, action("tide", released=False), is_target=True, rng=rng, config=config)
    assert (np.linalg.norm(kept.X_WOs[:, :3, 3], axis=1) < 0.2).all()


def test_nothing_done_changes_nothing() -> None:
    belief = PoseBelief(np.eye(4)[None], np.ones(1))
    for done in (None, action("", kind="none")):
        assert predict(belief, done, is_target=True, rng=np.random.default_rng(0), config=FilterConfig()) is belief


def test_action_model_honours_weights() -> None:
    X_WOs = np.stack([np.eye(4), transform(np.eye(3), np.array([1.0, 0, 0]))])
    belief = PoseBelief(np.repeat(X_WOs, 500, axis=0), np.repeat([0.2, 0.8], 500) / 500)
    moved = predict(belief, action("x"), is_target=False, rng=np.random.default_rng(0), config=FilterConfig())
    assert (moved.X_WOs[:, 0, 3] > 0.5).mean() == pytest.approx(0.8, abs=0.01)
    assert moved.weights == pytest.approx(np.full(1000, 1e-3))


def test_what_the_paper_leaves_out_are_further_components() -> None:
    n = 20000
    belief = PoseBelief(np.tile(np.eye(4), (n, 1, 1)), np.full(n, 1 / n))
    config = FilterConfig(by_feel=False, w_slipped=0.1, w_dropped=0.06, w_swept=0.5)
    rng = np.random.default_rng(0)
    target = predict(belief, action("tide"), is_target=True, rng=rng, config=config).X_WOs
    place = action("tide").X_WO_place[:3, 3]
    along = target[:, :2, 3] @ place[:2] / (place[:2] @ place[:2])
    turned = rotation_angle(target[:, :3, :3])
    on_the_way = (along > 0.25) & (along < 0.75)
    assert on_the_way.mean() == pytest.approx(0.03, abs=0.01)
    assert np.median(turned[on_the_way]) > 1.0
    assert (np.linalg.norm(target[:, :3, 3], axis=1) < 0.2).mean() == pytest.approx(0.1 + 0.04 + 0.01, abs=0.03)
    # What lies under the hand's way may be swept aside, what lies far from it is not.
    for y, share in ((-0.1, 0.5), (0.8, 0.0)):
        at = np.tile(transform(np.eye(3), np.array([0.0, y, 0.0])), (n, 1, 1))
        other = predict(
            PoseBelief(at, belief.weights), action("tide"), is_target=False, rng=rng, config=config
        ).X_WOs  # fmt: skip
        far = np.linalg.norm(other[:, :3, 3] - at[:, :3, 3], axis=1) > 0.045
        assert far.mean() == pytest.approx(0.84 * share, abs=0.1)


def test_what_the_hand_felt_decides_where_a_targets_particles_are() -> None:
    n = 4000
    belief = PoseBelief(np.tile(np.eye(4), (n, 1, 1)), np.full(n, 1 / n))
    place = action("tide").X_WO_place[:3, 3]
    for lifted, held, released, at_place, on_the_way in (
        (0.05, 0.05, True, 0.93, 0.05), (0.0, 0.0, True, 0.01, 0.05), (0.05, 0.0, False, 0.0, 0.68),
    ):  # fmt: skip
        done = action("tide", released=released, lifted=lifted, held=held)
        p_W = predict(belief, done, is_target=True, rng=np.random.default_rng(0), config=FilterConfig()).X_WOs[:, :3, 3]
        assert (np.linalg.norm(p_W - place, axis=1) < 0.15).mean() == pytest.approx(at_place, abs=0.04)
        along = p_W[:, :2] @ place[:2] / (place[:2] @ place[:2])
        between = (along > 0.3) & (np.linalg.norm(p_W - place, axis=1) > 0.15)
        assert between.mean() == pytest.approx(0.6 * on_the_way, abs=0.1)


SEEN = Presence(2000.0, 0.9, 0.05, 0.0)
EMPTY = Presence(2000.0, 0.02, 0.95, 0.0)
HIDDEN = Presence(1500.0, 0.0, 0.02, 0.98)


@pytest.mark.parametrize(
    ("gaps", "there", "near", "far", "outcome"),
    [
        ((0.05, 0.05), EMPTY, 0.0, 0.0, "placed"),
        ((0.05, 0.05), HIDDEN, 0.0, 0.0, "placed"),
        ((0.05, 0.05), SEEN, 0.0, 0.0, "stayed"),
        ((0.0, 0.0), SEEN, 0.0, 0.0, "stayed"),
        ((0.0, 0.0), EMPTY, 0.95, 0.0, "slipped"),
        ((0.05, 0.0), EMPTY, 0.0, 0.95, "dropped"),
        ((0.05, 0.0), EMPTY, 0.0, 0.0, "lost"),
        ((0.05, 0.05), EMPTY, 0.0, 0.97, "dropped"),
    ],
)
def test_what_became_of_a_target_is_judged_by_what_was_felt_and_seen(gaps, there, near, far, outcome) -> None:
    lifted, held = gaps
    done = action("tide", released=lifted > 0, lifted=lifted, held=held)
    p = judged(done, there, UNKNOWN, near=near, far=far)
    assert p.sum() == pytest.approx(1.0)
    assert OUTCOMES[int(p.argmax())] == outcome


def test_a_look_that_shows_nothing_does_not_say_that_the_object_left() -> None:
    done = action("tide", released=False, lifted=0.05, held=0.0)
    seeing, blind = (judged(done, UNKNOWN, UNKNOWN, near=0, far=0, blind=blind) for blind in (False, True))
    assert OUTCOMES[int(seeing.argmax())] == "lost"
    assert OUTCOMES[int(blind.argmax())] == "dropped"


def test_what_hangs_on_the_hand_was_not_placed() -> None:
    done = action("tide")
    hangs = dataclasses.replace(done, hangs=True)
    for same in (None, False):
        assert (felt(dataclasses.replace(done, hangs=same)) == felt(done)).all()
    assert felt(hangs).sum() == pytest.approx(1.0)
    assert dict(zip(OUTCOMES, felt(hangs), strict=True))["placed"] < 0.05
    for far, outcome in ((0.0, "lost"), (0.95, "dropped")):  # until it is found
        p = judged(hangs, EMPTY, UNKNOWN, near=0.0, far=far)
        assert OUTCOMES[int(p.argmax())] == outcome
    n = 4000
    belief = PoseBelief(np.tile(np.eye(4), (n, 1, 1)), np.full(n, 1 / n))
    for config, most in ((FilterConfig(), 0.05), (filter_config("paper"), 0.0)):
        moved = predict(belief, hangs, is_target=True, rng=np.random.default_rng(0), config=config).X_WOs
        off = np.linalg.norm(moved[:, :3, 3] - done.X_WO_place[:3, 3], axis=1)
        turned = rotation_angle(moved[:, :3, :3])
        assert ((off < 0.2) & (turned < 0.5)).mean() <= most


shares = st.floats(0, 1)
looks = st.builds(Presence, st.floats(0, 1e5), shares, shares, shares)


@given(looks, looks, shares, shares, st.booleans(), st.floats(0, 0.1), st.floats(0, 0.1), st.booleans())
def test_outcomes_are_a_distribution_whatever_was_felt_and_seen(there, place, near, far, released, lifted, held, hangs):
    done = action("tide", released=released, lifted=lifted, held=held)
    p = judged(dataclasses.replace(done, hangs=released and hangs), there, place, near=near, far=far)
    assert np.isfinite(p).all()
    assert (p >= 0).all()
    assert p.sum() == pytest.approx(1.0)
