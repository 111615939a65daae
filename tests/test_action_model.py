import numpy as np
import pytest

from sum_drake.action_model import predict
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import rotation_angle, transform
from sum_drake.types import PickPlace, PoseBelief


def action(label: str, *, released: bool = True, kind: str = "pick_place") -> PickPlace:
    place = transform(np.eye(3), np.array([0.1, -0.6, 0.8]))
    return PickPlace(0, kind, 1, label, np.eye(4), place, "cleaning_bin", 0.05, 0.05, released)


def test_action_model_is_the_mixture_of_eq_10() -> None:
    n = 20000
    belief = PoseBelief(np.tile(np.eye(4), (n, 1, 1)), np.full(n, 1 / n))
    config = FilterConfig()
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
