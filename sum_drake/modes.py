"""Rival poses of one object: which of them differ, what each is worth, and which is likeliest to be right."""

import dataclasses

import numpy as np
import torch
from torch import Tensor

from sum_drake.geometry import Symmetry, pose_error, rotation_error
from sum_drake.particles import Particles
from sum_drake.types import Array, Immutable

RIGHT = 0.02, 20.0
"""Metres and degrees within which a pose is right."""
WANTED = (RIGHT, (0.01, 10.0), (0.005, 4.0))
"""What an estimate should be within, as often as can be: the coarse bound decides between rivals that lie apart, the
finer ones between those that lie together."""


@dataclasses.dataclass(frozen=True, eq=False)
class Modes(Immutable):
    """Rival poses of one object, likeliest first."""

    X_WOs: Array
    """(m, 4, 4), m >= 1."""
    probabilities: Array
    """(m,), which sum to 1: of the belief, what is nearer to the mode than to the others."""
    terms: Array
    """(m, 4): what their likelihood is made of, `likelihood.TERMS`."""


def distinct(particles: Particles, scores: Tensor, limit: int, symmetry: Symmetry) -> Particles:
    """The best particles that differ by over 1 cm or 10 degrees from each better one, at most `limit`.

    What symmetry makes equal does not differ.
    """
    order = scores.argsort(descending=True, stable=True)[:400]
    left = particles[order]
    R_COs = left.R_COs.double().numpy()
    chosen: list[int] = []
    free = np.ones(len(order), dtype=bool)
    while len(chosen) < limit and free.any():
        i = int(free.argmax())
        chosen.append(i)
        near = ((left.p_CMs - left.p_CMs[i]).norm(dim=-1) < 0.01).numpy()
        free &= ~(near & (rotation_error(R_COs, R_COs[i], symmetry) < np.deg2rad(10)))
        free[i] = False
    return left[torch.tensor(chosen)]


def near_share(X_WO: Array, X_WOs: Array, p: Array, symmetry: Symmetry, bound: tuple[float, float] = RIGHT) -> float:
    """Share of poses (n, 4, 4) with weights p (n,) that are within a bound, metres and degrees, of X_WO (4, 4)."""
    shift, angle = pose_error(X_WOs, X_WO, symmetry)
    return float(p @ ((shift < bound[0]) & (angle < np.radians(bound[1]))))


def expected_hits(X_WOs: Array, p: Array, symmetry: Symmetry) -> Array:
    """How many of the bounds WANTED each of poses (m, 4, 4) keeps, (m,), if pose i is the true one with p (m,).

    The likeliest pose need not be the best estimate: of a mug whose handle is out of sight, that is the pose in the
    middle of all that are possible.
    """
    return np.array([sum(near_share(X_WO, X_WOs, p, symmetry, bound) for bound in WANTED) for X_WO in X_WOs])


def tempered(logs: Tensor, effective_share: float) -> Tensor:
    """Normalised weights (n,) of log-likelihoods, to the power that gives the effective sample size asked for; 0: to 1.

    A likelihood of nothing has weight 0, unless all have.
    """
    logs = logs.double()
    if not bool(torch.isfinite(logs).any()):
        return torch.full_like(logs, 1.0 / len(logs))
    logs = (logs - logs.max()).clamp(min=-1e4)
    if effective_share <= 0:
        return torch.softmax(logs, 0)
    low, high = 0.0, 1000.0
    for _ in range(40):
        power = (low + high) / 2
        w = torch.softmax(power * logs, 0)
        if 1.0 / float((w * w).sum()) > effective_share * len(w):
            low = power
        else:
            high = power
    return torch.softmax(low * logs, 0)
