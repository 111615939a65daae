"""How well rendered points explain the observed depth in a box, for many poses at a time.

A rendered point p is compared with the point p' that the camera observed along the same ray, at the pixel p projects
to. Within epsilon of it p is an inlier (Sui et al. 2017, eq. 9). If p' lies behind p, the camera looked through where p
should be: a free-space violation. If p' lies before p, something hides p. Each point counts as many pixels as the patch
of surface that it stands for covers in the picture, so that counts compare with observed pixels, N, whatever the
resolution of the rendering.
"""

import dataclasses

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.types import Box, Camera, Frame, Immutable


@dataclasses.dataclass(frozen=True, eq=False)
class Observation(Immutable):
    """The part of a frame around a box that poses are compared with."""

    camera: Camera
    """Of the crop: the principal point is moved, nothing else."""
    depth: Tensor
    """(h, w) float32, metres; 0 where nothing was measured."""
    in_box: Tensor
    """(h, w) bool."""
    at_edge: Tensor
    """(h, w) bool: the depth jumps in the 3 x 3 pixels around, so that neither side of the jump can be trusted."""
    n: int
    """N: observed points in the box."""


def observe(frame: Frame, box: Box, *, margin: float = 1.0, jump: float = 0.02) -> Observation:
    """The crop of a frame that reaches `margin` times the box's size beyond its sides.

    `jump` is the difference in depth, metres, that makes an edge. A box that covers no pixel gives N = 0.
    """
    x, y, w, h = box
    left, top = max(0, int(np.floor(x - margin * w))), max(0, int(np.floor(y - margin * h)))
    right = min(frame.camera.width, int(np.ceil(x + (1 + margin) * w)))
    bottom = min(frame.camera.height, int(np.ceil(y + (1 + margin) * h)))
    depth = np.ascontiguousarray(frame.depth[top : max(bottom, top), left : max(right, left)], dtype=np.float32)
    depth = np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
    if depth.size == 0:
        left, top, depth = 0, 0, np.zeros((1, 1), dtype=np.float32)
    u, v = np.meshgrid(np.arange(depth.shape[1]) + left, np.arange(depth.shape[0]) + top)
    in_box = (x <= u) & (u < x + w) & (y <= v) & (v < y + h)
    camera = dataclasses.replace(
        frame.camera, width=depth.shape[1], height=depth.shape[0], cx=frame.camera.cx - left, cy=frame.camera.cy - top
    )
    return Observation(
        camera,
        torch.from_numpy(depth),
        torch.from_numpy(in_box),
        torch.from_numpy(_edges(depth, jump)),
        int((in_box & (depth > 0)).sum()),
    )


def _edges(depth: NDArray[np.float32], jump: float) -> NDArray[np.bool_]:
    padded = np.pad(depth, 1, mode="edge")
    around = [padded[i : i + depth.shape[0], j : j + depth.shape[1]] for i in range(3) for j in range(3)]
    nearest = np.min([np.where(a > 0, a, np.inf) for a in around], axis=0)
    return np.asarray(np.max(around, axis=0) - nearest > jump)


def pixel_rays(camera: Camera, u: Tensor, v: Tensor) -> Tensor:
    """Points at depth 1 that pixels show, (..., 3)."""
    x, y = (u.float() - camera.cx) / camera.fx, (v.float() - camera.cy) / camera.fy
    return torch.stack([x, y, torch.ones_like(x)], -1)


@dataclasses.dataclass(frozen=True, eq=False)
class Counts:
    """Rendered points of each pose by what became of them, in pixels, (n,) each."""

    inliers: Tensor
    """I, inside the box only."""
    free_space: Tensor
    """F: in front of what was observed, not counting edges."""
    occluded: Tensor
    """Behind what was observed."""
    rendered: Tensor
    """R: all that fall on a pixel with an observation."""


def _look_up(observation: Observation, p_CPs: Tensor) -> tuple[Tensor, Tensor]:
    """Flat index (n, k) of the pixel that sees each point (n, k, 3), and whether there is one."""
    camera = observation.camera
    x, y, z = p_CPs.unbind(-1)
    scale = 1.0 / z.clamp(min=1e-3)
    # Pixel centres are integers: floor(u + .5) is the nearest.
    u = torch.floor(x * scale * camera.fx + (camera.cx + 0.5))
    v = torch.floor(y * scale * camera.fy + (camera.cy + 0.5))
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height) & (z > 1e-3)
    index = (v * camera.width + u).clamp(0, camera.width * camera.height - 1).to(torch.int64)
    return index, inside


def count(observation: Observation, p_CPs: Tensor, areas: Tensor, epsilon: float, *, soft: bool = False) -> Counts:
    """Compares rendered points p_CPs (n, k, 3), in C, with the observation.

    `areas` (n, k) or (n, 1) are the square metres across the line of sight that points stand for, 0 for no point.
    `epsilon` is the inlier distance in metres; `soft` lets an inlier count 1 - (d / epsilon)^2, which tells apart
    poses that a count cannot.
    """
    camera = observation.camera
    index, inside = _look_up(observation, p_CPs)
    z = p_CPs[..., 2]
    z_observed = observation.depth.view(-1)[index]
    pixels = areas * (camera.fx * camera.fy) / z.clamp(min=1e-3) ** 2
    pixels = torch.where(inside & (z_observed > 0), pixels, 0.0)
    # Both points are on one ray: they are as far apart as their depths, times the ray's length per depth.
    gap = (z - z_observed) * ((p_CPs * p_CPs).sum(-1).sqrt() / z.clamp(min=1e-3))
    near = gap.abs() < epsilon
    match = pixels * near * observation.in_box.view(-1)[index]
    if soft:
        match = match * (1 - (gap / epsilon) ** 2)
    return Counts(
        match.sum(-1),
        (pixels * ((gap <= -epsilon) & ~observation.at_edge.view(-1)[index])).sum(-1),
        (pixels * (gap >= epsilon)).sum(-1),
        pixels.sum(-1),
    )


def paper_likelihood(counts: Counts, n: int) -> Tensor:
    """I / N, Sui et al. 2017, eq. 8, with N the observed points in the box."""
    return counts.inliers / max(n, 1)


def likelihood(counts: Counts, n: int) -> Tensor:
    """(I - F) / N, cut at 0: what is explained, less what is contradicted; hidden points count neither way."""
    return ((counts.inliers - counts.free_space) / max(n, 1)).clamp(min=0)


def confidence(counts: Counts, n: int) -> Tensor:
    """(I - F) / sqrt(N (R - .7 O)) in [0, 1]: a likelihood that compares across objects and labels.

    Its square is the share of the box that is explained times the share of the object's visible part that was found.
    A hidden point weighs .3, so that a pose that hides from the data does not win.
    """
    shown = (counts.rendered - 0.7 * counts.occluded).clamp(min=1)
    return ((counts.inliers - counts.free_space) / (max(n, 1) * shown).sqrt()).clamp(0, 1)


def register(
    observation: Observation, p_CPs: Tensor, normals_C: Tensor, p_CMs: Tensor, reach: float
) -> tuple[Tensor, Tensor]:
    """One point-to-plane step of every pose towards the observation: rotation vectors and shifts, (n, 3) each, in C.

    p_CPs, normals_C (n, k, 3): points that the pose shows, with their normals; p_CMs (n, 3): the point each pose turns
    about. Points farther than `reach` metres from what was observed along their ray, or observed at an edge, count
    nothing (Tukey's biweight). Turn about M first, then shift. Directions that the data leave free, as a turn about an
    axis of revolution, are damped to nothing.
    """
    index, inside = _look_up(observation, p_CPs)
    z = p_CPs[..., 2]
    z_observed = observation.depth.view(-1)[index]
    ratio = z_observed / z.clamp(min=1e-3)
    p_MQs = p_CPs - p_CMs[:, None]
    gap = (normals_C * p_CPs).sum(-1) * (ratio - 1)  # distance of the observed point from the tangent plane
    distance = z_observed - z
    weight = (1 - (distance / reach) ** 2).clamp(min=0) ** 2
    weight = weight * (inside & (z_observed > 0) & ~observation.at_edge.view(-1)[index])
    (x, y, w), (a, b, c) = p_MQs.unbind(-1), normals_C.unbind(-1)
    J = torch.stack([y * c - w * b, w * a - x * c, x * b - y * a, a, b, c], dim=-1)  # (n, k, 6): p x n, n
    weighted = J * weight[..., None]
    A = weighted.transpose(1, 2) @ J
    g = (weighted.transpose(1, 2) @ gap[..., None]).squeeze(-1)
    # Rotations are compared with shifts at the size of the object, so that one damping serves both.
    size_squared = (p_MQs * p_MQs).sum(-1).mean(-1, keepdim=True).clamp(min=1e-8)
    damping = torch.cat([size_squared.expand(-1, 3), torch.ones_like(p_CMs)], dim=-1)
    trust = 0.02 * weight.sum(-1) + 1.0
    step = torch.linalg.solve(A + torch.diag_embed(damping * trust[:, None]), g)
    limit = torch.stack([step[:, :3].norm(dim=-1) / 0.5, step[:, 3:].norm(dim=-1) / reach]).amax(0).clamp(min=1)
    step = step / limit[:, None]
    return step[:, :3], step[:, 3:]
