import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.geometry import rotation_from_vector, symmetry_group, transform
from sum_drake.modes import distinct, expected_hits, near_share, tempered
from sum_drake.particles import Particles

NONE = symmetry_group("none")


def turned(*degrees):
    """Poses that are turned about z by so much."""
    return np.stack([transform(rotation_from_vector(np.radians([0, 0, a])), np.zeros(3)) for a in degrees])


def test_a_handle_out_of_sight_is_best_guessed_in_the_middle():
    """Nine turns are about as likely; that of the highest likelihood lies at an end."""
    p = np.linspace(0.12, 0.1, 9)
    hits = expected_hits(turned(*range(-32, 33, 8)), p / p.sum(), NONE)
    assert 2 <= hits.argmax() <= 6


def test_a_clear_winner_wins():
    assert expected_hits(turned(0, 90, 95, 100), np.array([0.8, 0.1, 0.06, 0.04]), NONE).argmax() == 0
    assert expected_hits(turned(0, 12), np.array([0.7, 0.3]), NONE).argmax() == 0


def test_symmetric_turns_are_one():
    X_WOs, p = turned(0, 180, 90), np.full(3, 1 / 3)
    assert near_share(X_WOs[0], X_WOs, p, NONE) == pytest.approx(1 / 3)
    assert near_share(X_WOs[0], X_WOs, p, symmetry_group("twofold_z")) == pytest.approx(2 / 3)
    assert near_share(X_WOs[0], X_WOs, p, symmetry_group("revolution")) == pytest.approx(1)


@given(st.lists(st.floats(-50, 50), min_size=2, max_size=60), st.floats(0.1, 0.9))
def test_tempered_weights_have_the_effective_sample_size_asked_for(logs, share):
    w = tempered(torch.tensor(logs), share).numpy()
    assert w.sum() == pytest.approx(1)
    assert np.all(np.diff(w[np.argsort(logs)]) >= -1e-12), "the likelier the heavier"
    size = 1 / (w**2).sum()
    best = np.count_nonzero(np.array(logs, np.float32) == np.max(np.array(logs, np.float32)))
    assert size >= min(share * len(logs), len(logs)) * 0.99 or size == pytest.approx(best, rel=0.05)


def test_what_is_impossible_weighs_nothing():
    w = tempered(torch.tensor([-torch.inf, 0.0, -torch.inf, 0.0]), 0.0)
    np.testing.assert_allclose(w, [0, 0.5, 0, 0.5])
    np.testing.assert_allclose(tempered(torch.full((4,), -torch.inf), 0.15), 0.25)


def test_what_symmetry_makes_equal_is_one_mode():
    R_COs = torch.from_numpy(turned(0, 45, 180, 90)[:, :3, :3]).float()
    particles, scores = Particles(R_COs, torch.zeros(4, 3)), torch.tensor([4.0, 3.0, 2.0, 1.0])
    for name, modes in (("none", 4), ("twofold_z", 3), ("fourfold_z", 2), ("revolution", 1)):
        assert len(distinct(particles, scores, 9, symmetry_group(name))) == modes, name


def test_distinct_modes_differ_and_come_best_first():
    R = torch.tensor(turned(0, 4, 30, 34, 90)[:, :3, :3]).float()
    particles = Particles(R, torch.zeros(5, 3))
    kept = distinct(particles, torch.tensor([0.1, 0.5, 0.9, 0.2, 0.3]), 4, NONE)
    R_COs = kept.R_COs.numpy()
    angles = np.degrees(np.arctan2(R_COs[:, 1, 0], R_COs[:, 0, 0])).round().tolist()
    assert angles == [30, 4, 90]
