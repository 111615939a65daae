"""Particles of a posterior over poses whose modes are known: importance sampling, then Metropolis moves.

Resample-move (Gilks and Berzuini, "Following a moving target", 2001): particles drawn about the modes are weighted by
the posterior over what they were drawn from, resampled, and moved by steps that leave the posterior as it is. Weights
alone are honest but few particles would carry them: six dimensions are wide.

What each mode's surroundings hold altogether is given, not found: a mode's height is known from an exact render, but
its volume only from the cheaper likelihood of many poses, whose errors are larger than what tells modes apart. Volumes
made what is stated of an estimate come true less often (`benchmarks/mode_fit.py` has what came of heights alone).
"""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sum_drake.particles import Particles, turn
from sum_drake.resampling import systematic

DRAWS = 3
"""First draws for every particle that is kept."""
MOVES = 6
"""Steps of every particle."""
WIDTHS = (1.0, 0.3)
"""Of the first draws about a mode, in turn, as shares of sigma_p and sigma_R: some modes are sharp, some are not."""
STEPS = (0.5, 0.2)
"""Of the steps, as shares of the first draw's spread, in turn."""
EVERYWHERE = 0.2
"""Share of the first draw that is spread evenly over the modes, so that those of little mass are drawn well as well."""
LogDensity = Callable[[Particles], Tensor]


def sample_posterior(
    log_p: LogDensity,
    modes: Particles,
    masses: Tensor,
    n: int,
    *,
    sigma_p: float,
    sigma_R: float,
    rng: np.random.Generator,
) -> tuple[Particles, float]:
    """n particles of equal weight, and the effective share of those that they were resampled from.

    log_p: log of the posterior about each mode, up to a constant of the mode's own, (k,) of k particles. masses: (m,),
    which sum to 1, of what is nearer to each mode than to the others. sigma_p, sigma_R: standard deviations of the
    first draw about each mode, metres and radians, on each axis.
    """
    shares = (1 - EVERYWHERE) * masses + EVERYWHERE / len(modes)
    cell = torch.from_numpy(systematic(shares.numpy(), DRAWS * n, rng.random()))
    widths = torch.tensor(WIDTHS)
    width = widths[torch.from_numpy(rng.permutation(len(cell)) % len(widths)), None]
    particles = _shaken(modes[cell], width * sigma_p, width * sigma_R, rng)
    squared = _squared(particles, modes, sigma_p, sigma_R)
    log_q = torch.logsumexp(-6 * widths.log() - squared.gather(1, cell[:, None]) / widths**2 / 2, dim=1)
    log_now = log_p(particles)
    own = squared.argmin(1) == cell
    weights = torch.zeros(len(cell), dtype=torch.float64)
    for k, mass in enumerate(masses):
        drawn = own & (cell == k)
        weights[drawn] = mass * torch.softmax((log_now[drawn] - log_q[drawn]).double(), 0)
    weights /= weights.sum()
    kept = torch.from_numpy(systematic(weights.numpy(), n, rng.random()))
    particles, log_now, cell = particles[kept], log_now[kept], cell[kept]
    for k in range(MOVES):
        step = STEPS[k % len(STEPS)]
        proposed = _shaken(particles, step * sigma_p, step * sigma_R, rng)
        log_new = log_p(proposed)
        stays = _squared(proposed, modes, sigma_p, sigma_R).argmin(1) == cell
        accepted = stays & (torch.from_numpy(np.log(rng.random(n))) < log_new - log_now)
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


def _squared(particles: Particles, modes: Particles, sigma_p: float, sigma_R: float) -> Tensor:
    """Squared distances (n, m) of particles and modes, in units of sigma_p, metres, and sigma_R, radians."""
    cosine = (particles.R_COs.flatten(1) @ modes.R_COs.flatten(1).T - 1) / 2
    # Tenths of a millimetre at metres: what is faster squares too soon.
    shift = torch.cdist(particles.p_CMs, modes.p_CMs, compute_mode="donot_use_mm_for_euclid_dist")
    return (shift / sigma_p) ** 2 + (torch.arccos(cosine.clamp(-1, 1)) / sigma_R) ** 2
