"""How well rendered points explain the observed depth in a box, for many poses at a time.

A rendered point p is compared with the point p' that the camera observed along the same ray, at the pixel p projects
to. Within epsilon of it p is an inlier (Sui et al. 2017, eq. 9). If p' lies behind p, the camera looked through where p
should be: a free-space violation. If p' lies before p, something hides p. Each point counts as many pixels as the patch
of surface that it stands for covers in the picture, so that counts compare with observed pixels, N, whatever the
resolution of the rendering.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.boxes import pixels_around
from sum_drake.depth_tolerance import PERFECT, DepthTolerance
from sum_drake.support import SUNK, Plane
from sum_drake.types import Box, Camera, Frame, Immutable

_PICTURES = ("depth", "in_box", "at_edge", "support", "beyond")


@dataclasses.dataclass(frozen=True, eq=False)
class Observation(Immutable):
    """The part of a frame around a box that poses are compared with, on the device of its tensors."""

    camera: Camera
    """Of the crop: the principal point is moved, nothing else."""
    depth: Tensor
    """(h, w) float32, metres; 0 where nothing was measured."""
    in_box: Tensor
    """(h, w) bool: in the box, and not of the plane that the object stands on."""
    at_edge: Tensor
    """(h, w) bool: the depth jumps in the 3 x 3 pixels around, so that neither side of the jump can be trusted, or what
    lies before it may have reached here."""
    support: Tensor
    """(h, w) bool: of that plane."""
    beyond: Tensor
    """(h, w) bool: farther from the box than a detector's is off."""
    box: Box
    """Its part in the picture, in pixels of the crop."""
    n: int
    """N: observed points in the box, those of the plane aside."""
    tolerance: DepthTolerance
    """Of what the sensor makes of what is in the box."""
    plane: Plane | None = None

    def to(self, device: str) -> "Observation":
        """The same on a device."""
        return dataclasses.replace(self, **{name: getattr(self, name).to(device) for name in _PICTURES})


def observe(
    frame: Frame,
    box: Box,
    *,
    margin: float = 1.0,
    tolerance: DepthTolerance = PERFECT,
    plane: Plane | None = None,
) -> Observation:
    """The crop of a frame that reaches `margin` times the box's size beyond its sides.

    `plane`: what the object stands on; what was observed of it is nothing to be explained, unless that is all there is.
    A box that covers no pixel gives N = 0.
    """
    x, y, w, h = box
    rows, columns = pixels_around(box, frame.camera, margin)
    left, top = columns.start, rows.start
    depth = np.ascontiguousarray(frame.depth[rows, columns], dtype=np.float32)
    depth = np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
    if depth.size == 0:
        left, top, depth = 0, 0, np.zeros((1, 1), dtype=np.float32)
    u, v = np.meshgrid(np.arange(depth.shape[1]) + left, np.arange(depth.shape[0]) + top)
    in_box = (x <= u) & (u < x + w) & (y <= v) & (v < y + h)
    valid = in_box & (depth > 0)
    support = np.zeros_like(in_box)
    camera = dataclasses.replace(
        frame.camera, width=depth.shape[1], height=depth.shape[0], cx=frame.camera.cx - left, cy=frame.camera.cy - top
    )
    if plane is not None:
        x_n, y_n = (np.arange(camera.width) - camera.cx) / camera.fx, (np.arange(camera.height) - camera.cy) / camera.fy
        a, b, c = plane.normal_C
        height = depth * (a * x_n[None, :] + b * y_n[:, None] + c) + plane.offset
        support = (depth > 0) & (np.abs(height) < tolerance.plane)
        if np.count_nonzero(valid & ~support) < LEAST_LEFT * np.count_nonzero(valid):
            support, plane = np.zeros_like(in_box), None
    return Observation(
        camera,
        torch.from_numpy(depth),
        torch.from_numpy(in_box & ~support),
        torch.from_numpy(_edges(depth, tolerance.jump, tolerance.bleed)),
        torch.from_numpy(support),
        torch.from_numpy(
            (np.maximum(x - u, u - x - w) > SIDE_ERROR * w) | (np.maximum(y - v, v - y - h) > SIDE_ERROR * h)
        ),
        _cut(box, frame.camera, left, top),
        int(np.count_nonzero(valid & ~support)),
        tolerance,
        plane,
    )


def thinned(observation: Observation, *, margin: float = 0.35, pixels: int = 8000) -> Observation:
    """The part up to `margin` times the box's size beyond its sides, every k-th pixel of it: at most about `pixels`.

    Enough to tell well-placed poses apart, and a render of it costs no more for a box that fills the picture.
    """
    x, y, w, h = observation.box
    camera = observation.camera
    rows, columns = pixels_around(observation.box, camera, margin)
    left, top, height, width = columns.start, rows.start, rows.stop - rows.start, columns.stop - columns.start
    if width < 2 or height < 2:
        return observation
    step = max(1, round((width * height / pixels) ** 0.5))
    told = (observation.in_box & (observation.depth > 0))[top : rows.stop, left : columns.stop]
    if int(told[::step, ::step].sum()) < 0.5 * int(told.sum()) / step**2:  # of depth on a grid of its own
        step = 1
    kept = {
        name: getattr(observation, name)[top : rows.stop : step, left : columns.stop : step].contiguous()
        for name in _PICTURES
    }
    height, width = kept["depth"].shape
    return Observation(
        **kept,
        camera=Camera(
            width, height, camera.fx / step, camera.fy / step, (camera.cx - left) / step, (camera.cy - top) / step
        ),
        box=((x - left) / step, (y - top) / step, w / step, h / step),
        n=int((kept["in_box"] & (kept["depth"] > 0)).sum()),
        tolerance=observation.tolerance,
        plane=observation.plane,
    )


def _cut(box: Box, camera: Camera, left: int, top: int) -> Box:
    """The part of a box that is in the picture, where alone things are seen to end, in pixels from (left, top)."""
    x, y, w, h = box
    u, v = min(max(x, 0.0), camera.width), min(max(y, 0.0), camera.height)
    return u - left, v - top, max(min(x + w, camera.width) - u, 0.0), max(min(y + h, camera.height) - v, 0.0)


LEAST_LEFT = 0.03
"""Where less of a box than this is left without the plane, the object lies in it: a lid, a sheet."""


def _edges(depth: NDArray[np.float32], jump: float, bleed: int) -> NDArray[np.bool_]:
    padded = np.pad(depth, 1, mode="edge")
    around = [padded[i : i + depth.shape[0], j : j + depth.shape[1]] for i in range(3) for j in range(3)]
    nearest = np.min([np.where(a > 0, a, np.inf) for a in around], axis=0)
    edges = np.asarray(np.max(around, axis=0) - nearest > jump)
    for shift in range(2, bleed + 2):
        right = np.where(depth[:, shift:] > 0, depth[:, shift:], np.inf)
        edges[:, :-shift] |= depth[:, :-shift] - right > jump
    return edges


def pixel_rays(camera: Camera, u: Tensor, v: Tensor) -> Tensor:
    """Points at depth 1 that pixels show, (..., 3)."""
    x, y = (u.float() - camera.cx) / camera.fx, (v.float() - camera.cy) / camera.fy
    return torch.stack([x, y, torch.ones_like(x)], -1)


@dataclasses.dataclass(frozen=True, eq=False)
class Counts:
    """Rendered points of each pose by what became of them, in pixels, (n,) each."""

    inliers: Tensor
    """I, inside the box only."""
    close: Tensor
    """Of them, each weighed 1 - (2 d / epsilon)^2, those within half of epsilon."""
    free_space: Tensor
    """F: where none can be: in front of what was observed, edges aside, under the plane, or far beyond the box."""
    occluded: Tensor
    """Behind what was observed."""
    rendered: Tensor
    """R: all that fall on a pixel with an observation."""
    sides: Tensor
    """(n, 4): left, top, right and bottom of what was matched, in or about the box; infinite where nothing was."""


def _look_up(observation: Observation, p_CPs: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Column, row and flat index (n, k) of the pixel that sees each point (n, k, 3), and whether there is one."""
    camera = observation.camera
    x, y, z = p_CPs.unbind(-1)
    scale = 1.0 / z.clamp(min=1e-3)
    # Pixel centres are integers: floor(u + .5) is the nearest.
    u = torch.floor(x * scale * camera.fx + (camera.cx + 0.5))
    v = torch.floor(y * scale * camera.fy + (camera.cy + 0.5))
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height) & (z > 1e-3)
    index = (v * camera.width + u).clamp(0, camera.width * camera.height - 1).to(torch.int32)
    return u, v, index, inside


def _picked(picture: Tensor, index: Tensor) -> Tensor:
    """picture (h, w) at flat indices (n, k)."""
    return picture.view(-1).index_select(0, index.view(-1)).view(index.shape)


def _picked_flags(observation: Observation, index: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """At flat indices: in the box; at an edge; beyond the box and not support; beyond the box or support."""
    beyond, support = observation.beyond, observation.support
    # Packed, so that memory is looked up once.
    flags = observation.in_box.to(torch.uint8) + 2 * observation.at_edge + 4 * (beyond & ~support)
    packed = _picked((flags + 8 * (beyond | support)).to(torch.uint8), index)
    return (packed & 1).bool(), (packed & 2).bool(), (packed & 4).bool(), (packed & 8).bool()


def count(observation: Observation, p_CPs: Tensor, areas: Tensor, epsilon: float, *, soft: bool = False) -> Counts:
    """Compares rendered points p_CPs (n, k, 3), in C, with the observation.

    `areas` (n, k) or (n, 1) are the square metres across the line of sight that points stand for, 0 for no point.
    `epsilon` is the inlier distance in metres; `soft` lets an inlier count 1 - (d / epsilon)^2, which tells apart
    poses that a count cannot.
    """
    camera = observation.camera
    column, row, index, inside = _look_up(observation, p_CPs)
    x, y, z = p_CPs.unbind(-1)
    z_observed = _picked(observation.depth, index)
    in_box, at_edge, elsewhere, not_it = _picked_flags(observation, index)
    scale = 1 / z.clamp(min=1e-3)
    pixels = areas * (camera.fx * camera.fy) * scale * scale
    pixels = torch.where(inside & (z_observed > 0), pixels, 0.0)
    # Both points are on one ray: they are as far apart as their depths, times the ray's length per depth.
    gap = (z - z_observed) * ((x * x + y * y + z * z).sqrt() * scale)
    near = gap.abs() < epsilon
    match = pixels * (near & in_box)
    close = pixels * in_box * (1 - (2 * gap / epsilon) ** 2).clamp(min=0)
    if soft:
        match = match * (1 - (gap / epsilon) ** 2)
    # What is seen of an object is in its box.
    impossible = ((gap <= -epsilon) & ~at_edge) | (near & elsewhere)
    if observation.plane is not None:
        a, b, c = map(float, observation.plane.normal_C)
        impossible = impossible | ((a * x + b * y + c * z + observation.plane.offset < -SUNK) & ~near)
    shown = near & (pixels > 0) & ~not_it
    infinite = p_CPs.new_tensor(torch.inf)
    return Counts(
        match.sum(-1),
        close.sum(-1),
        (pixels * impossible).sum(-1),
        (pixels * (gap >= epsilon)).sum(-1),
        pixels.sum(-1),
        torch.stack(
            [
                torch.where(shown, column, infinite).amin(-1),
                torch.where(shown, row, infinite).amin(-1),
                torch.where(shown, column + 1, -infinite).amax(-1),
                torch.where(shown, row + 1, -infinite).amax(-1),
            ],
            -1,
        ),
    )


def count_picture(observation: Observation, depth: NDArray[np.float32], epsilon: float) -> Counts:
    """`count` of one pose, from a render (h, w) of it at the observation's own pixels; 0 where it shows nothing."""
    camera = observation.camera
    v, u = (torch.from_numpy(index) for index in np.nonzero(depth))
    z = torch.from_numpy(depth[depth > 0])
    if not len(z):
        return count(observation, torch.ones(1, 1, 3), torch.zeros(1, 1), epsilon)
    p_CPs = pixel_rays(camera, u, v) * z[:, None]
    return count(observation, p_CPs[None], (z**2 / (camera.fx * camera.fy))[None], epsilon)


def paper_likelihood(counts: Counts, n: int) -> Tensor:
    """I / N, Sui et al. 2017, eq. 8, with N the observed points in the box."""
    return counts.inliers / max(n, 1)


TERMS = ("explained", "close", "contradicted", "sides")
"""What the log-likelihood is made of, see `terms`."""
WEIGHTS = 7.6, 6.0, -15.0, -1.1
"""Of the terms. Pixels are no independent witnesses: what a box full of them says was fitted, by a conditional logit
over the rival modes of poured scenes, then changed by hand. `benchmarks/mode_fit.py` fits them again and tells what
either choose on scenes that neither was fitted on."""
BELIEF = 4.0
"""Power of the likelihood that beliefs follow: the weights, which were fitted to choose by, are too unsure. Chosen on
poured scenes and judged on others (`benchmarks/mode_fit.py`)."""
SIDE_ERROR, SIDE_CAP = 0.15, 4.0
"""Standard deviation of a side of a box, as a share of its size, and the most that one side can say."""


def terms(counts: Counts, observation: Observation) -> Tensor:
    """(n, 4), of each pose: inliers, close ones and impossible pixels over N, and how far off the box's sides are.

    What a shape nearly allows, as a box of almost square section that is turned by a quarter, explains as much, but
    less closely.

    Hidden points count neither way. Each side of the box should be where what is seen of the object ends, give or take
    a detector's error; a side that is far off says no more than that the box is wrong.
    """
    n = max(observation.n, 1)
    x, y, w, h = observation.box
    box = counts.sides.new_tensor([x, y, x + w, y + h])
    size = counts.sides.new_tensor([w, h, w, h]).clamp(min=1.0)
    off = ((counts.sides - box) / (size * SIDE_ERROR)) ** 2 / 2
    of_n = [counts.inliers / n, counts.close / n, counts.free_space / n]
    return torch.stack([*of_n, off.clamp(max=SIDE_CAP).sum(-1)], -1)


def log_likelihood(counts: Counts, observation: Observation, weights: Sequence[float] = WEIGHTS) -> Tensor:
    """log p(z, b | q) up to a constant, (n,): the weighted sum of `terms`."""
    found = terms(counts, observation)
    return found @ found.new_tensor(weights)


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
    _, _, index, inside = _look_up(observation, p_CPs)
    z = p_CPs[..., 2]
    z_observed = _picked(observation.depth, index)
    ratio = z_observed / z.clamp(min=1e-3)
    p_MQs = p_CPs - p_CMs[:, None]
    (x, y, w), (a, b, c) = p_MQs.unbind(-1), normals_C.unbind(-1)
    gap = (normals_C * p_CPs).sum(-1) * (ratio - 1)  # distance of the observed point from the tangent plane
    distance = z_observed - z
    weight = (1 - (distance / reach) ** 2).clamp(min=0) ** 2
    telling = ~(observation.at_edge | observation.support)
    weight = weight * (inside & (z_observed > 0) & _picked(telling, index))
    J = torch.stack([y * c - w * b, w * a - x * c, x * b - y * a, a, b, c], dim=1)  # (n, 6, k): p x n, n
    weighted = J * weight[:, None]
    A = weighted @ J.transpose(1, 2)
    g = (weighted @ gap[..., None]).squeeze(-1)
    # Rotations are compared with shifts at the size of the object, so that one damping serves both.
    size_squared = (p_MQs * p_MQs).sum(-1).mean(-1, keepdim=True).clamp(min=1e-8)
    damping = torch.cat([size_squared.expand(-1, 3), torch.ones_like(p_CMs)], dim=-1)
    trust = 0.02 * weight.sum(-1) + 1.0
    step = torch.linalg.solve(A + torch.diag_embed(damping * trust[:, None]), g)
    limit = torch.stack([step[:, :3].norm(dim=-1) / 0.5, step[:, 3:].norm(dim=-1) / reach]).amax(0).clamp(min=1)
    step = step / limit[:, None]
    return step[:, :3], step[:, 3:]
