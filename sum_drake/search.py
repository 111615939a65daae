"""The search for poses that explain a box: iterated likelihood weighting on depth renders (Sui et al. 2017, eq. 6-9).

Particles are spread over what the box allows, moved, weighted and resampled; in the end the best that differ are set
against what the object's near symmetries make of them.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sum_drake.appearance import Appearance
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import (
    Symmetry,
    rotation_from_quaternion,
    rotation_from_vector,
    super_fibonacci,
    transform,
)
from sum_drake.likelihood import (
    TERMS,
    WEIGHTS,
    Observation,
    count,
    log_likelihood,
    paper_likelihood,
    pixel_rays,
    register,
)
from sum_drake.modes import distinct, tempered
from sum_drake.particles import Particles, join, resampled, turn
from sum_drake.support import Ground
from sum_drake.types import Array, Immutable


@dataclasses.dataclass(frozen=True, eq=False)
class Sought(Immutable):
    """What is looked for, in which part of a frame, and how."""

    observation: Observation
    model: Appearance
    symmetry: Symmetry
    """As the catalogue tells it."""
    config: FilterConfig
    ground: Ground | None = None
    """What it cannot reach into, if that is known."""

    def log_prior(self, particles: Particles) -> Tensor:
        """Of poses, (n,), before anything of them is seen, up to a constant."""
        if self.ground is None:
            return torch.zeros(len(particles))
        return self.ground.log_prior(particles, self.model.p_MQs)

    @property
    def weights(self) -> tuple[float, ...]:
        """Of the likelihood's terms."""
        of = zip(TERMS, WEIGHTS, strict=True)
        return tuple(0.0 if name in self.config.without else weight for name, weight in of)

    def epsilon(self, share: float = 1.0) -> float:
        """The inlier distance when a share of the iterations is over, metres."""
        config = self.config
        return self.observation.tolerance.epsilon(_fall(config.epsilon_first, config.epsilon, share))


def start(sought: Sought, n: int, rng: np.random.Generator) -> Particles:
    """n particles spread over what the box allows."""
    observation, model = sought.observation.to("cpu"), sought.model
    v, u = torch.nonzero(observation.in_box, as_tuple=True)
    z = observation.depth[v, u]
    camera = observation.camera
    if sought.config.start == "uniform":
        R_COs = torch.from_numpy(rotation_from_quaternion(rng.normal(size=(n, 4)))).float()
        pixel = torch.from_numpy(rng.integers(len(u), size=n))
        near, far = np.quantile(z[z > 0].numpy(), [0.05, 0.95])
        depth = torch.from_numpy(rng.uniform(near, far + model.radius, n)).float()
        return Particles(R_COs, pixel_rays(camera, u[pixel], v[pixel]) * depth[:, None])
    R_COs = torch.from_numpy(rotation_from_quaternion(super_fibonacci(n, rng))).float()
    # The surface that a particle shows on the ray through its middle is put where that ray was observed.
    valid = z > 0
    u, v, z = u[valid], v[valid], z[valid]
    pixel = torch.from_numpy(rng.integers(len(u), size=n))
    p_CQs = pixel_rays(camera, u[pixel], v[pixel]) * z[pixel, None]
    rays = p_CQs / p_CQs.norm(dim=-1, keepdim=True)
    p_MPs = model.show(Particles(R_COs, p_CQs)).p_CPs.cpu() - p_CQs[:, None]
    along = (p_MPs * rays[:, None]).sum(-1)
    nearest = ((p_MPs * p_MPs).sum(-1) - along**2).argmin(-1)
    return Particles(R_COs, p_CQs - rays * along.gather(1, nearest[:, None]))


Watch = Callable[[Particles, Tensor], None]
"""Told the particles of an iteration and their log-likelihoods (n,)."""


def search(
    sought: Sought,
    particles: Particles,
    iterations: int,
    begin: float,
    rng: np.random.Generator,
    watch: Watch | None = None,
) -> tuple[Particles, Tensor]:
    """Iterated likelihood weighting. Returns the last particles, weighted by their scores, not yet resampled.

    begin: share of the schedule of noise and inlier distances that is left out.
    """
    config = sought.config
    for reach in np.geomspace(0.06, 0.03, config.warmup) if config.warmup else []:
        particles = _registered(sought, particles, float(reach))
    count_first = len(particles)
    scores = torch.zeros(0)
    for i in range(iterations):
        share = begin + (1 - begin) * i / max(iterations - 1, 1)
        epsilon = sought.epsilon(share)
        if i > 0:
            n = round(_fall(count_first, config.particles_last, i / max(iterations - 1, 1)))
            weights = tempered(scores, config.effective_share)
            best = particles[scores.argmax()[None]]
            particles = resampled(particles, weights.double().numpy(), n, rng)
            particles = _moved(sought, particles, share, rng)
            if config.effective_share > 0:
                particles = join(best, particles[1:])
        scores = score(sought, particles, epsilon)
        if watch is not None:
            watch(particles, scores)
    return particles, scores


def _moved(sought: Sought, particles: Particles, share: float, rng: np.random.Generator) -> Particles:
    """The state transition of the bootstrap filter: noise, of which part is followed by a registration step."""
    config = sought.config
    n = len(particles)
    sigma_p = _fall(config.noise_translation_first, config.noise_translation, share)
    sigma_R = _fall(config.noise_rotation_first, config.noise_rotation, share)
    noise_p = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_p
    noise_R = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_R
    registered = round(config.registered * n)
    flipped = round(config.flipped * n)
    turned = turn(particles, noise_R, noise_p)
    if flipped:
        turns = _TURNS[torch.from_numpy(rng.integers(len(_TURNS), size=flipped))]
        flips = Particles(turned.R_COs[:flipped] @ turns, turned.p_CMs[:flipped])
        turned = join(flips, turned[flipped:])
    if registered:
        moved = _registered(sought, turned[:registered], 4 * sought.epsilon(share))
        turned = join(moved, turned[registered:])
    return turned


def score(sought: Sought, particles: Particles, epsilon: float, *, soft: bool = True) -> Tensor:
    """Log-likelihood of particles times their prior, (n,), on the CPU, up to a constant; the published score is without
    a prior. soft: as of `count`, for all but the published score.
    """
    observation, shown = sought.observation, sought.model.show(particles)
    if sought.config.score == "inliers":
        return paper_likelihood(count(observation, shown.p_CPs, shown.areas, epsilon), observation.n).log().cpu()
    counts = count(observation, shown.p_CPs, shown.areas, epsilon, soft=soft)
    return log_likelihood(counts, observation, sought.weights).cpu() + sought.log_prior(particles)


def rivals(sought: Sought, particles: Particles, scores: Tensor) -> Particles:
    """The best particles that differ, and what they become when they are moved and registered anew.

    The moves are those after which the object looks nearly the same, and small turns.
    """
    config = sought.config
    # Turns about an axis of revolution would fill every place. Half turns of a box fill a few, and may: each is
    # registered in a way of its own, of which the best counts.
    symmetry = dataclasses.replace(sought.symmetry, rotations=sought.symmetry.rotations[:1])
    modes = distinct(particles, scores, config.candidates, symmetry)
    few = modes[: config.candidates // 4]
    X_MNs = np.zeros((0, 4, 4)) if "near_symmetries" in config.without else sought.model.X_MNs
    turned = join(modes, _moved_in_itself(few, np.concatenate([X_MNs, _NUDGES])))
    # A turn about the middle of a mug moves its body by its handle's share: the first reach must cover that.
    for reach in (0.04, 0.03, 0.02, 0.015, 0.015):
        turned = _registered(sought, turned, reach)
    candidates = join(modes, turned)
    epsilon = sought.epsilon()
    found = distinct(candidates, score(sought, candidates, epsilon), config.candidates, symmetry)
    # Rivals are compared at their best: one that is placed less well would lose for that alone.
    tried = found
    for _ in range(4):
        tried = _registered(sought, tried, 2 * epsilon)
    both = join(found, tried)
    return distinct(both, score(sought, both, epsilon), config.candidates, symmetry)


def _about_axes(*angles: float) -> Tensor:
    turns = [rotation_from_vector(np.eye(3)[i] * np.deg2rad(angle)) for angle in angles for i in range(3)]
    return torch.from_numpy(np.stack(turns)).float()


_TURNS = _about_axes(180, 90, -90)
"""(9, 3, 3): half and quarter turns about an object's axes, which depth hardly tells apart on many a product."""
_NUDGES = transform(_about_axes(15, -15, 30, -30).double().numpy(), np.zeros((12, 3)))
"""(12, 4, 4): small turns, from which registration finds another way."""


def _moved_in_itself(particles: Particles, X_MNs: Array) -> Particles:
    """Each particle after each motion (k, 4, 4) about its middle."""
    R_MNs, p_MNs = torch.from_numpy(X_MNs[:, :3, :3].copy()).float(), torch.from_numpy(X_MNs[:, :3, 3].copy()).float()
    R_COs = particles.R_COs[:, None]
    p_CNs = particles.p_CMs[:, None] + (R_COs @ p_MNs[None, :, :, None]).squeeze(-1)
    return Particles((R_COs @ R_MNs).flatten(0, 1), p_CNs.flatten(0, 1))


def _fall(first: float, last: float, share: float) -> float:
    """From first to last, geometrically, as share goes from 0 to 1."""
    return first * (last / first) ** share if first > 0 and last > 0 else last


def _registered(sought: Sought, particles: Particles, reach: float) -> Particles:
    """After a step of registration, with points up to `reach` metres off."""
    shown = sought.model.show(particles, normals=True)
    assert shown.normals_C is not None
    p_CMs = particles.p_CMs.to(shown.p_CPs.device)
    w_C, shift_C = register(sought.observation, shown.p_CPs, shown.normals_C, p_CMs, reach)
    return turn(particles, w_C.cpu(), shift_C.cpu())
