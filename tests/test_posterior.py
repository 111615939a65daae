"""Beliefs beside posteriors that are known: in closed form, and of shapes whose ambiguity is known."""

import numpy as np
import pytest
import torch
import trimesh
from scenes import observe, standing
from shapes import write_model

from sum_drake.estimates import pose_probability
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import rotation_angle, rotation_from_vector
from sum_drake.objects import Catalogue
from sum_drake.particles import Particles
from sum_drake.posterior import sample_posterior

SIGMA_P, SIGMA_R = 0.002, 0.05


def particles(turns, p_CMs):
    """Turned by rotation vectors (n, 3), at (n, 3)."""
    R_COs = rotation_from_vector(np.array(turns, float))
    return Particles(torch.from_numpy(R_COs).float(), torch.tensor(np.array(p_CMs), dtype=torch.float32))


def gaussian(given, mean, sigma_p=SIGMA_P, sigma_R=SIGMA_R):
    """Log density about one pose."""
    shift = (given.p_CMs - mean.p_CMs).norm(dim=-1) / sigma_p
    cosine = (torch.einsum("nij,ij->n", given.R_COs, mean.R_COs[0]) - 1) / 2
    return -(shift**2 + (torch.arccos(cosine.clamp(-1, 1)) / sigma_R) ** 2) / 2


def sample(log_p, modes, seed, n=500, masses=None):
    masses = torch.full((len(modes),), 1 / len(modes)) if masses is None else torch.tensor(masses)
    found, effective = sample_posterior(
        log_p, modes, masses, n, sigma_p=0.003, sigma_R=0.1, rng=np.random.default_rng(seed)
    )
    assert len(found) == n
    assert 0 < effective <= 1
    return found


@pytest.mark.parametrize("seed", range(3))
def test_the_spread_is_the_posteriors(seed):
    mean = particles([[0.3, -0.2, 1.0]], [[0.1, 0.0, 0.9]])
    found = sample(lambda q: gaussian(q, mean), mean, seed)
    np.testing.assert_allclose(found.p_CMs.std(0), SIGMA_P, rtol=0.25)
    np.testing.assert_allclose(found.p_CMs.mean(0), mean.p_CMs[0], atol=SIGMA_P / 3)
    angle = rotation_angle((found.R_COs @ mean.R_COs[0].T).double().numpy())
    assert np.sqrt((angle**2).mean() / 3) == pytest.approx(SIGMA_R, rel=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_modes_get_the_mass_they_are_given_and_a_spread_of_their_own(seed):
    """One narrow, one wide, and one that is none; what is said of heights between them does not matter."""
    modes = particles([[0, 0, 0], [0, 0, np.pi], [np.pi / 2, 0, 0]], [[0, 0, 1]] * 3)

    def log_p(q):
        return torch.logaddexp(gaussian(q, modes[:1]) + 30.0, gaussian(q, modes[1:2], 2 * SIGMA_P, 2 * SIGMA_R))

    found = sample(log_p, modes, seed, 1500, (0.75, 0.25, 0.0))
    turned = rotation_angle(found.R_COs.double().numpy())
    assert (turned < 0.5).mean() == pytest.approx(0.75, abs=0.001)
    assert (turned > np.pi - 0.5).mean() == pytest.approx(0.25, abs=0.001)
    for near, sigma in ((turned < 0.5, SIGMA_P), (turned > np.pi - 0.5, 2 * SIGMA_P)):
        np.testing.assert_allclose(found.p_CMs[torch.from_numpy(near)].std(0), sigma, rtol=0.25)


def test_particles_stay_nearest_to_their_mode_where_modes_overlap():
    modes = particles([[0, 0, 0]] * 2, [[0, 0, 1], [0.004, 0, 1]])
    found = sample(lambda q: gaussian(q, modes[:1]), modes, 0, 1000, (0.5, 0.5))
    assert (found.p_CMs[:, 0] < 0.002).float().mean() == pytest.approx(0.5, abs=0.001)


def test_a_ring_is_filled_from_a_dozen_points_of_it():
    angles = (0.0, 0.5, 0.8, 1.5, 2.2, 2.4, 3.1, 3.7, 4.2, 4.9, 5.3, 5.8)
    modes = particles([[0, 0, a] for a in angles], [[0, 0, 1]] * len(angles))

    def log_p(q):
        tilt = torch.arccos(q.R_COs[:, 2, 2].clamp(-1, 1)) / SIGMA_R
        return -(tilt**2 + ((q.p_CMs - modes.p_CMs[0]).norm(dim=-1) / SIGMA_P) ** 2) / 2

    octants = np.zeros(8)
    for seed in range(4):
        R = sample(log_p, modes, seed).R_COs.numpy()
        octants += np.histogram(np.arctan2(R[:, 1, 0], R[:, 0, 0]), 8, (-np.pi, np.pi))[0]
    assert octants.min() > 0.4 * octants.mean()


def test_the_same_seed_draws_the_same():
    mean = particles([[0.3, -0.2, 1.0]], [[0.1, 0.0, 0.9]])
    a, b = (sample(lambda q: gaussian(q, mean), mean, 5) for _ in "ab")
    assert torch.equal(a.R_COs, b.R_COs) and torch.equal(a.p_CMs, b.p_CMs)


def _box(extents, middle):
    made = trimesh.creation.box(extents)
    made.apply_translation(middle)
    return made


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    """A can, and a bar with an arm at each end that is the same after half a turn, and after no other."""
    folder = tmp_path_factory.mktemp("shapes")
    bar = [_box([0.16, 0.04, 0.06], [0, 0, 0]), _box([0.04, 0.05, 0.06], [0.06, 0.045, 0]),
           _box([0.04, 0.05, 0.06], [-0.06, -0.045, 0])]  # fmt: skip
    meshes = {
        "can": trimesh.creation.cylinder(radius=0.035, height=0.10, sections=64),
        "ess": trimesh.util.concatenate(bar),
    }
    return Catalogue(folder / "objects.yaml", tuple(write_model(folder, name, mesh) for name, mesh in meshes.items()))


@pytest.fixture(scope="module")
def estimator(shapes):
    """Of shapes whose symmetry it is not told."""
    return PoseEstimator(shapes, filter_config())


def seen(shapes, estimator, label, seed):
    X_WO = standing(shapes, label, 0.6, 0.02, 0.7)
    frame, boxes = observe(shapes, {label: X_WO}, seed)
    return X_WO, estimator.estimate(frame, boxes[label], label, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(3))
def test_a_twofold_shape_has_two_modes_of_like_mass(shapes, estimator, seed):
    X_WO, estimate = seen(shapes, estimator, "ess", seed)
    R = X_WO[:3, :3]
    for modes, weights in (
        (estimate.belief.X_WOs, estimate.belief.weights),
        (estimate.modes.X_WOs, estimate.modes.probabilities),
    ):
        turned = rotation_angle(R.T @ modes[:, :3, :3])
        half = rotation_angle(R.T @ modes[:, :3, :3] @ rotation_from_vector(np.array([0, 0, np.pi])))
        masses = [weights[angle < np.radians(20)].sum() for angle in (turned, half)]
        assert min(masses) > 0.15
        assert sum(masses) > 0.75
    # One of two that are alike is right half of the time, and it says so.
    assert 0.2 < dict(estimate.features)["near_share"] < 0.8
    assert estimate.likelihood > 0.9
    assert pose_probability(0.99, 1.0, estimate) < 0.8, "however well it explains the depth"


def test_a_can_has_a_ring(shapes, estimator):
    octants = np.zeros(8)
    for seed in range(2):
        X_WO, estimate = seen(shapes, estimator, "can", seed)
        R, p = estimate.belief.X_WOs[:, :3, :3], estimate.belief.weights
        assert p[np.abs(R[:, 2, 2]) > np.cos(np.radians(15))].sum() > 0.8  # it stands
        assert np.linalg.norm(p @ estimate.belief.X_WOs[:, :3, 3] - X_WO[:3, 3]) < 0.01
        octants += np.histogram(np.arctan2(R[:, 1, 0], R[:, 0, 0]), 8, (-np.pi, np.pi), weights=p)[0]
    assert octants.min() > 0.25 * octants.mean()
