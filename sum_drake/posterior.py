"""Particles of a posterior over poses whose modes are roughly known: importance sampling, then Metropolis moves.

Resample-move (Gilks and Berzuini, "Following a moving target", 2001): particles drawn about the modes are weighted by
the posterior over what they were drawn from, resampled, and moved by steps that leave the posterior as it is. Weights
alone are honest but few particles would carry them: six dimensions are wide. Moves alone would leave to each mode the
share that it began with; some of them jump between modes, so that the shares become the posterior's.
"""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sum_drake.particles import Particles, turn
from sum_drake.resampling import systematic

DRAWS = 3
"""First draws for every particle that is kept."""
MOVES = 12
"""Steps of every particle."""
JUMPS = 2
"""Every so many-th is a jump."""
WIDTHS = (1.0, 0.3)
"""Of the first draws about a mode, in turn, as shares of sigma_p and sigma_R: some modes are sharp, some are not."""
STEPS = (0.5, 0.2)
"""Of the local steps, as shares of the first draw's spread, in turn."""
EVERYWHERE = 0.2
"""Share of the first draw that is spread evenly over the modes, so that none is forgotten by chance."""
LogDensity = Callable[[Particles], Tensor]


def sample_posterior(
    log_p: LogDensity,
    modes: Particles,
    log_modes: Tensor,
    n: int,
    *,
    sigma_p: float,
    sigma_R: float,
    rng: np.random.Generator,
) -> tuple[Particles, float]:
    """n particles of equal weight, and the effective share of those that they were resampled from.

    log_p: log of the posterior up to a constant, (k,) of k particles. modes: where its mass is. log_modes: log_p of
    them, (m,), better known: what log_p is off at a mode, it is taken to be off around it. sigma_p, sigma_R: standard
    deviations of the first draw about each mode, metres and radians, on each axis.
    """
    shares = (1 - EVERYWHERE) * torch.softmax(log_modes.double(), 0) + EVERYWHERE / len(modes)
    chosen = torch.from_numpy(systematic(shares.numpy(), DRAWS * n, rng.random()))
    widths = torch.tensor(WIDTHS)
    width = widths[torch.from_numpy(rng.permutation(len(chosen)) % len(widths)), None]
    particles = _shaken(modes[chosen], width * sigma_p, width * sigma_R, rng)
    shift, angle = _distances(particles, modes)
    squared = ((shift / sigma_p) ** 2 + (angle / sigma_R) ** 2)[..., None] / widths**2
    log_q = torch.logsumexp(shares.log()[:, None] - 6 * widths.log() - squared / 2, dim=(1, 2))
    off = log_modes - log_p(modes)

    def corrected(given: Particles) -> Tensor:
        return log_p(given) + off[nearest(given, modes, sigma_p, sigma_R)]

    log_now = corrected(particles)
    weights = torch.softmax(log_now.double() - log_q, 0).numpy()
    kept = torch.from_numpy(systematic(weights, n, rng.random()))
    particles, log_now = particles[kept], log_now[kept]
    for k in range(MOVES):
        if k % JUMPS == JUMPS - 1:
            proposed, odds = _jumped(particles, modes, shares, sigma_p, sigma_R, rng)
        else:
            step = STEPS[k // JUMPS % len(STEPS)]
            proposed, odds = _shaken(particles, step * sigma_p, step * sigma_R, rng), torch.zeros(n)
        log_new = corrected(proposed)
        accepted = torch.from_numpy(np.log(rng.random(n))) < log_new - log_now + odds
        particles = Particles(
            torch.where(accepted[:, None, None], proposed.R_COs, particles.R_COs),
            torch.where(accepted[:, None], proposed.p_CMs, particles.p_CMs),
        )
        log_now = torch.where(accepted, log_new, log_now)
    return particles, float(1.0 / (weights @ weights) / len(weights))


def _shaken(
    particles: Particles, sigma_p: Tensor | float, sigma_R: Tensor | float, rng: np.random.Generator
) -> Particles:
    noise_p, noise_R = torch.from_numpy(rng.normal(size=(2, len(particles), 3))).float()
    return turn(particles, noise_R * sigma_R, noise_p * sigma_p)


def _jumped(
    particles: Particles, modes: Particles, shares: Tensor, sigma_p: float, sigma_R: float, rng: np.random.Generator
) -> tuple[Particles, Tensor]:
    """Each as far from another mode as it was from the nearest one; log odds (n,) of the way back to the way there.

    The other mode is drawn by the modes' shares.
    """
    here = nearest(particles, modes, sigma_p, sigma_R)
    there = torch.from_numpy(rng.choice(len(modes), size=len(particles), p=(shares / shares.sum()).numpy()))
    a, b = modes[here], modes[there]
    # What the data leave open belongs to the camera and the table, not to the object: the offset keeps its axes in C.
    moved = Particles(particles.R_COs @ a.R_COs.transpose(1, 2) @ b.R_COs, particles.p_CMs - a.p_CMs + b.p_CMs)
    back = nearest(moved, modes, sigma_p, sigma_R) == there
    return moved, torch.where(back, (shares[here] / shares[there]).log(), -torch.inf)


def nearest(particles: Particles, modes: Particles, sigma_p: float, sigma_R: float) -> Tensor:
    """Index (n,) of the mode that each particle is nearest to, in units of sigma_p, metres, and sigma_R, radians."""
    shift, angle = _distances(particles, modes)
    return ((shift / sigma_p) ** 2 + (angle / sigma_R) ** 2).argmin(1)


def _distances(particles: Particles, modes: Particles) -> tuple[Tensor, Tensor]:
    """Metres and radians between each particle and each mode, (n, m)."""
    cosine = (particles.R_COs.flatten(1) @ modes.R_COs.flatten(1).T - 1) / 2
    # Tenths of a millimetre at metres: what is faster squares too soon.
    shift = torch.cdist(particles.p_CMs, modes.p_CMs, compute_mode="donot_use_mm_for_euclid_dist")
    return shift, torch.arccos(cosine.clamp(-1, 1))
