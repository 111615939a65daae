"""What a camera sees of an object at many poses: looked up among renders from all sides, or rendered anew."""

import dataclasses
import functools
import threading
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.near_symmetry import near_symmetries
from sum_drake.particles import Particles
from sum_drake.rendering import Atlas, fibonacci_sphere, mesh_arrays, see_surface, view_rotations
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


_DIRECTIONS = 400
"""In which outermost points are looked for, some 10 degrees apart."""
_POINTS = 200_000
"""Points of all particles together that are looked at in a step, when points are looked up."""


class Appearance(Protocol):
    """An object as the filter sees it."""

    p_OM: Array
    """(3,): the object's middle, that particles are the poses of."""
    radius: float
    """Of a ball about M that holds the object, metres."""
    p_MQs: Tensor
    """(k, 3): its outermost points, on the CPU."""
    X_MNs: Array
    """(k, 4, 4): motions after which the object looks nearly as before."""

    def show(self, particles: Particles, *, normals: bool = False) -> Shown:
        """What is seen of each particle; where asked for, with normals."""


class ViewedFromAllSides:
    """Renders once from many directions, then looks up: no render a particle. What is seen is on the device."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64], *, device: str = "cpu") -> None:
        surface = see_surface(vertices, faces)
        self.X_MNs, _ = near_symmetries(vertices, faces, surface.p_OM)
        self.p_OM, self.radius = surface.p_OM, surface.radius
        self.p_MQs = _outermost(vertices, self.p_OM)
        self._views = _view_table(len(surface.directions), device)
        # (views, 3, k): all x lie together, which is several times faster to gather and to count.
        self._points = torch.tensor(surface.points, device=device).transpose(1, 2).contiguous()
        self._normals = torch.tensor(surface.normals, device=device).transpose(1, 2).contiguous()
        self._thinned = functools.lru_cache(maxsize=2)(self._every)
        self._areas = torch.tensor(surface.areas, device=device)

    def show(self, particles: Particles, *, normals: bool = False) -> Shown:
        """What is seen of each particle; where asked for, with normals."""
        device = self._points.device
        R_COs, p_CMs = particles.R_COs.to(device), particles.p_CMs.to(device)
        # The more particles, the fewer points of each: many rough looks find more than a few fine ones.
        every = max(1, len(particles) * self._points.shape[2] // _POINTS)
        rays_O = (_rays(p_CMs)[:, None] @ R_COs).squeeze(1)
        view = self._views.nearest(rays_O)
        points, normals_O = self._thinned(every)
        p_CPs = torch.bmm(R_COs, points.index_select(0, view)) + p_CMs[..., None]
        normals_C = torch.bmm(R_COs, normals_O.index_select(0, view)).transpose(1, 2) if normals else None
        return Shown(p_CPs.transpose(1, 2), normals_C, every * self._areas[view][:, None])

    def _every(self, k: int) -> tuple[Tensor, Tensor]:
        """Every k-th point of each view, and its normal."""
        return self._points[..., ::k].contiguous(), self._normals[..., ::k].contiguous()


@functools.cache
def _view_table(views: int, device: str) -> "_ViewTable":
    """Of the directions that `see_surface` looks from, the same for all objects."""
    return _ViewTable(fibonacci_sphere(views), device)


class _ViewTable:
    """Which of unit vectors (v, 3) is nearest, looked up by latitude and longitude: about the nearest."""

    LATITUDES, LONGITUDES = 128, 256
    """Cells of 1.4 degrees; views are some 6 apart."""

    def __init__(self, directions: Array, device: str) -> None:
        latitudes = ((torch.arange(self.LATITUDES) + 0.5) / self.LATITUDES - 0.5) * torch.pi
        longitudes = ((torch.arange(self.LONGITUDES) + 0.5) / self.LONGITUDES * 2 - 1) * torch.pi
        up, round_ = torch.meshgrid(latitudes, longitudes, indexing="ij")
        middles = torch.stack([up.cos() * round_.cos(), up.cos() * round_.sin(), up.sin()], -1).view(-1, 3)
        self._view = (middles @ torch.tensor(directions).float().T).argmax(-1).to(device)

    def nearest(self, rays: Tensor) -> Tensor:
        """Index (n,) of the nearest direction to unit vectors (n, 3)."""
        x, y, z = rays.unbind(-1)
        row = ((torch.asin(z.clamp(-1, 1)) / torch.pi + 0.5) * self.LATITUDES).long().clamp(0, self.LATITUDES - 1)
        column = ((torch.atan2(y, x) / torch.pi + 1) / 2 * self.LONGITUDES).long().clamp(0, self.LONGITUDES - 1)
        return self._view[row * self.LONGITUDES + column]


class RenderedAnew:
    """Renders every particle, many in one picture of tiles. tile, columns and limit as of `rendering.Atlas`.

    What is seen is on the device; VTK renders on the CPU all the same.
    """

    def __init__(
        self,
        vertices: Array,
        faces: NDArray[np.int64],
        *,
        tile: int = 32,
        columns: int = 9,
        limit: int = 300,
        device: str = "cpu",
    ) -> None:
        self._device = device
        self.X_MNs = np.zeros((0, 4, 4))
        self._atlas = Atlas(vertices, faces, tile=tile, columns=columns, limit=limit)
        self.p_OM, self.radius = self._atlas.p_OM, self._atlas.pixel * tile / 2.02
        self.p_MQs = _outermost(vertices, self.p_OM)

    @property
    def rendered(self) -> int:
        """Poses that were rendered so far."""
        return self._atlas.rendered

    def show(self, particles: Particles, *, normals: bool = False) -> Shown:
        """What is seen of each particle, without normals."""
        R_COs, p_CMs = particles.R_COs, particles.p_CMs
        R_CVs = torch.from_numpy(view_rotations(_rays(p_CMs).double().numpy())).float()
        R_VOs = R_CVs.transpose(1, 2) @ R_COs
        points, seen = self._atlas.points(R_VOs.double().numpy())
        p_VPs, areas = torch.from_numpy(points).to(self._device), torch.from_numpy(seen).to(self._device)
        p_CPs = torch.bmm(R_CVs.to(self._device), p_VPs.transpose(1, 2))
        p_CPs = (p_CPs + p_CMs.to(self._device)[..., None]).transpose(1, 2)
        return Shown(p_CPs, None, areas * self._atlas.pixel**2)


def _outermost(vertices: Array, p_OM: Array) -> Tensor:
    """Of vertices (v, 3), those that lie farthest out in some direction, about M: what touches a plane, nearly."""
    farthest = np.unique((fibonacci_sphere(_DIRECTIONS) @ vertices.T).argmax(axis=1))
    return torch.from_numpy(vertices[farthest] - p_OM).float()


def _rays(p_CMs: Tensor) -> Tensor:
    rays: Tensor = p_CMs / p_CMs.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    return rays


class Appearances:
    """The appearances of a catalogue's objects, each made when it is first asked for; `device` is torch's.

    Use it from the thread that made it: VTK renders wrongly elsewhere, which raises RuntimeError here.
    """

    def __init__(self, catalogue: "Catalogue", render: str, *, device: str = "cpu") -> None:
        self.render, self.device = render, device
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
            self._made[label] = made(*mesh_arrays(self._catalogue, label), device=self.device)
        return self._made[label]
