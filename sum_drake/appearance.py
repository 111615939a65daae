"""What a camera sees of an object at many poses: looked up among renders from all sides, or rendered anew."""

import dataclasses
import threading
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.particles import Particles
from sum_drake.rendering import Atlas, mesh_arrays, see_surface, view_rotations
from sum_drake.types import Array

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


@dataclasses.dataclass(frozen=True, eq=False)
class Shown:
    """What the camera sees of each particle."""

    p_CPs: Tensor
    """(n, k, 3)."""
    normals_C: Tensor | None
    """(n, k, 3)."""
    areas: Tensor
    """(n, k) or (n, 1)."""


_POINTS = 200_000
"""Points of all particles together that are looked at in a step, when points are looked up."""


class Appearance(Protocol):
    """An object as the filter sees it."""

    p_OM: Array
    """(3,): the object's middle, that particles are the poses of."""
    radius: float
    """Of a ball about M that holds the object, metres."""

    def show(self, particles: Particles) -> Shown:
        """What is seen of each particle."""


class ViewedFromAllSides:
    """Renders once from many directions, then looks up: no render a particle."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64]) -> None:
        surface = see_surface(vertices, faces)
        self.p_OM, self.radius = surface.p_OM, surface.radius
        self._directions = torch.tensor(surface.directions)
        self._points = torch.tensor(surface.points)
        self._normals = torch.tensor(surface.normals)
        self._areas = torch.tensor(surface.areas)

    def show(self, particles: Particles) -> Shown:
        """What is seen of each particle, with normals."""
        R_COs, p_CMs = particles.R_COs, particles.p_CMs
        # The more particles, the fewer points of each: many rough looks find more than a few fine ones.
        every = max(1, len(particles) * self._points.shape[1] // _POINTS)
        rays_O = (_rays(p_CMs)[:, None] @ R_COs).squeeze(1)
        view = (rays_O @ self._directions.T).argmax(-1)
        p_CPs = self._points[:, ::every][view] @ R_COs.transpose(1, 2) + p_CMs[:, None]
        normals_C = self._normals[:, ::every][view] @ R_COs.transpose(1, 2)
        return Shown(p_CPs, normals_C, every * self._areas[view][:, None])


class RenderedAnew:
    """Renders every particle, many in one picture of tiles. tile, columns and limit as of `rendering.Atlas`."""

    def __init__(
        self, vertices: Array, faces: NDArray[np.int64], *, tile: int = 32, columns: int = 12, limit: int = 400
    ) -> None:
        self._atlas = Atlas(vertices, faces, tile=tile, columns=columns, limit=limit)
        self.p_OM, self.radius = self._atlas.p_OM, self._atlas.pixel * tile / 2.02

    @property
    def rendered(self) -> int:
        """Poses that were rendered so far."""
        return self._atlas.rendered

    def show(self, particles: Particles) -> Shown:
        """What is seen of each particle, without normals."""
        R_COs, p_CMs = particles.R_COs, particles.p_CMs
        R_CVs = torch.from_numpy(view_rotations(_rays(p_CMs).double().numpy())).float()
        R_VOs = R_CVs.transpose(1, 2) @ R_COs
        points, seen = self._atlas.points(R_VOs.double().numpy())
        n = len(particles)
        p_CPs = torch.from_numpy(points).view(n, -1, 3) @ R_CVs.transpose(1, 2) + p_CMs[:, None]
        return Shown(p_CPs, None, torch.from_numpy(seen).view(n, -1) * self._atlas.pixel**2)


def _rays(p_CMs: Tensor) -> Tensor:
    rays: Tensor = p_CMs / p_CMs.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    return rays


class Appearances:
    """The appearances of a catalogue's objects, each made when it is first asked for.

    Use it from the thread that made it: VTK renders wrongly elsewhere, which raises RuntimeError here.
    """

    def __init__(self, catalogue: "Catalogue", render: str) -> None:
        self.render = render
        self._catalogue = catalogue
        self._made: dict[str, Appearance] = {}
        self._thread = threading.get_ident()

    @property
    def rendered(self) -> int:
        """Poses that were rendered so far to see what particles show."""
        return sum(one.rendered for one in self._made.values() if isinstance(one, RenderedAnew))

    def __getitem__(self, label: str) -> Appearance:
        if threading.get_ident() != self._thread:
            raise RuntimeError("appearances were used outside the thread that made them, where VTK renders wrongly")
        if label not in self._made:
            made = ViewedFromAllSides if self.render == "views" else RenderedAnew
            self._made[label] = made(*mesh_arrays(self._catalogue, label))
        return self._made[label]
