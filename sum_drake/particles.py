"""Many poses of one object at a time, on torch: how they are spread, turned, resampled and told apart."""

import dataclasses

import numpy as np
import torch
from torch import Tensor

from sum_drake.geometry import inverse, rotation_from_vector, transform
from sum_drake.resampling import systematic
from sum_drake.types import Array, Frame, PoseBelief


@dataclasses.dataclass(frozen=True, eq=False)
class Particles:
    """Poses in the camera's frame, by the object's middle M, about which it turns."""

    R_COs: Tensor
    """(n, 3, 3)."""
    p_CMs: Tensor
    """(n, 3)."""

    def __len__(self) -> int:
        return len(self.p_CMs)

    def __getitem__(self, index: "Tensor | slice") -> "Particles":
        return Particles(self.R_COs[index], self.p_CMs[index])


def join(*parts: Particles) -> Particles:
    """One after the other."""
    return Particles(torch.cat([p.R_COs for p in parts]), torch.cat([p.p_CMs for p in parts]))


def _rotations(w: Tensor) -> Tensor:
    return torch.from_numpy(rotation_from_vector(w.double().numpy())).float()


def turn(particles: Particles, w_C: Tensor, shift_C: Tensor) -> Particles:
    """Turned about their middles by rotation vectors in C, then shifted."""
    return Particles(_rotations(w_C) @ particles.R_COs, particles.p_CMs + shift_C)


def resampled(particles: Particles, weights: Array, n: int, rng: np.random.Generator) -> Particles:
    """n of them, drawn by their weights (eq. 7)."""
    # In random order, so that any part of them is as good as another.
    return particles[torch.from_numpy(rng.permutation(systematic(weights, n, rng.random())))]


def poses(particles: Particles, p_OM: Array) -> Array:
    """X_COs (n, 4, 4) of an object whose middle is at p_OM (3,)."""
    R_COs = particles.R_COs.double().numpy()
    # Single precision and many small turns leave them a little off: back onto SO(3).
    u, _, vt = np.linalg.svd(R_COs)
    R_COs = u @ vt
    return transform(R_COs, particles.p_CMs.double().numpy() - R_COs @ p_OM)


def to_world(particles: Particles, frame: Frame, p_OM: Array) -> Array:
    """X_WOs (n, 4, 4)."""
    return np.asarray(frame.X_WC @ poses(particles, p_OM))


def to_camera(belief: PoseBelief, frame: Frame, p_OM: Array) -> Particles:
    """The particles of a belief in the world, as a frame's camera sees them."""
    X_COs = inverse(frame.X_WC) @ belief.X_WOs
    p_CMs = X_COs[:, :3, :3] @ p_OM + X_COs[:, :3, 3]
    return Particles(torch.from_numpy(X_COs[:, :3, :3].copy()).float(), torch.from_numpy(p_CMs).float())
