"""The belief over an object's pose: iterated likelihood weighting on depth renders, and the action model.

Sui et al. 2017, eq. 4 and 6 to 10. `PoseEstimator` turns a box with a label into weighted particles; `predict` moves
particles through an action of the robot. Two presets of `FilterConfig` share all of it: "paper", as published, and
"default", which proposes more of its particles where the posterior has its mass.
"""

import dataclasses
import threading
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sum_drake.assets import InputError
from sum_drake.geometry import inverse, rotation_error, rotation_from_quaternion, rotation_from_vector, transform
from sum_drake.likelihood import (
    Counts,
    Observation,
    confidence,
    count,
    likelihood,
    observe,
    paper_likelihood,
    register,
)
from sum_drake.rendering import Atlas, DepthRenderer, Surface, mesh_arrays, see_surface, view_rotations
from sum_drake.resampling import systematic
from sum_drake.types import Array, Box, Camera, Frame, Immutable, PickPlace, PoseBelief, readonly

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


FILTERS = ("default", "paper")
"""Names of the presets."""


_CHOICES = {"render": ("views", "each"), "start": ("surface", "uniform"), "score": ("difference", "inliers")}


@dataclasses.dataclass
class FilterConfig:
    """Settings of the pose filter, metres and radians. The defaults are the preset "default", see `filter_config`."""

    render: str = "views"
    """"views": look up what a pose shows among renders from many directions; "each": render every particle anew."""
    start: str = "surface"
    """"surface": particles begin with a point of theirs on one that was observed in the box, turned evenly all ways;
    "uniform": anywhere on the rays of the box within the observed depths, turned at random."""
    score: str = "difference"
    """What particles are weighted by. "difference": (I - F) / N, inliers less points in observed free space; the
    estimate then gets `likelihood.confidence`. "inliers": I / N, eq. 8, for both."""
    particles: int = 2500
    """At the start."""
    particles_last: int = 250
    """In the last iteration; their number falls geometrically."""
    iterations: int = 10
    """Of weighting and resampling."""
    warmup: int = 4
    """Registration steps that all particles take before the first weighting."""
    registered: float = 0.7
    """Share of particles proposed by a registration step from their own render, after a little noise."""
    flipped: float = 0.1
    """Share of particles proposed by a half or quarter turn about an axis of the object, through its middle."""
    fresh: float = 0.25
    """Share of particles started from the box when there is a prior to go on from."""
    tracking_particles: int = 300
    """At the start, when there is a prior to go on from."""
    tracking_iterations: int = 3
    """The same for iterations."""
    epsilon_first: float = 0.01
    """Inlier distance of the first iteration; falls geometrically."""
    epsilon: float = 0.007
    """Inlier distance of the last iteration."""
    noise_translation_first: float = 0.01
    """Standard deviation, on each axis, of the transition noise of the first iteration; falls geometrically."""
    noise_translation: float = 0.002
    """The same for the last iteration."""
    noise_rotation_first: float = 0.2
    """The same for rotation vectors, first iteration."""
    noise_rotation: float = 0.03
    """The same, last iteration."""
    effective_share: float = 0.15
    """Weights are raised to the power at which their effective sample size is this share of the particles; 0: as is."""
    candidates: int = 8
    """Modes that are turned, registered and compared by exact renders at the end; 0: the best particle is taken."""
    sharpness: float = 60.0
    """Of the posterior that the belief is drawn from: it is proportional to exp(sharpness * likelihood)."""
    w_place: float = 0.8
    """w1 of eq. 10: probability that a pick and place did what it should. The paper leaves it open."""
    sigma_place: float = 0.04
    """sigma1 of eq. 10."""
    sigma_stay: float = 0.02
    """sigma2 of eq. 10."""
    sigma_other: float = 0.01
    """sigma3 of eq. 10."""
    radians_per_metre: float = 10.0
    """Rotation noise of the action model per metre of sigma, which the paper leaves open: .04 m go with .4 rad."""


def filter_config(name: str = "default") -> FilterConfig:
    """The preset of a name. Raises InputError for an unknown one.

    "paper" is Sui et al. 2017: 625 particles, 25 iterations, likelihood I / N with epsilon = 8 mm (eq. 8, 9), weights
    normalised and resampled by importance in each iteration (eq. 7), uniform start. The paper leaves open, and we take:
    the transition noise, constant at 1 cm and .1 rad; N, the observed points in the box; the start, a pixel uniform
    over the box, a depth uniform between the nearest and the farthest observation in it (its 5th and 95th percentile)
    plus up to the object's radius, and an orientation uniform over SO(3).
    """
    if name == "default":
        return FilterConfig()
    if name == "paper":
        return FilterConfig(
            render="each",
            start="uniform",
            score="inliers",
            particles=625,
            particles_last=625,
            iterations=25,
            warmup=0,
            registered=0.0,
            flipped=0.0,
            fresh=0.0,
            tracking_particles=625,
            tracking_iterations=25,
            epsilon_first=0.008,
            epsilon=0.008,
            noise_translation_first=0.01,
            noise_translation=0.01,
            noise_rotation_first=0.1,
            noise_rotation=0.1,
            effective_share=0.0,
            candidates=0,
        )
    raise InputError(f"filter: {name!r} is unknown; expected one of {', '.join(FILTERS)}")


@dataclasses.dataclass(frozen=True, eq=False)
class PoseEstimate(Immutable):
    """What the filter makes of one box and label."""

    belief: PoseBelief
    X_WO: Array
    """(4, 4): the best pose."""
    likelihood: float
    """Of the best pose, in [0, 1]; 0 where there was nothing to see."""
    features: tuple[tuple[str, float], ...]
    """inliers, free_space, occluded, rendered, observed (pixels, of the best pose), effective_sample_size (of the
    belief, as a share), translation_std_m, rotation_std_rad, runner_up (likelihood of the best pose that differs)."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Particles:
    """Poses in the camera's frame, by the object's middle M, about which it turns."""

    R_COs: Tensor
    """(n, 3, 3)."""
    p_CMs: Tensor
    """(n, 3)."""

    def __len__(self) -> int:
        return len(self.p_CMs)

    def __getitem__(self, index: "Tensor | slice") -> "_Particles":
        return _Particles(self.R_COs[index], self.p_CMs[index])


def _join(*parts: _Particles) -> _Particles:
    return _Particles(torch.cat([p.R_COs for p in parts]), torch.cat([p.p_CMs for p in parts]))


@dataclasses.dataclass(frozen=True, eq=False)
class _Shown:
    """What the camera sees of each particle."""

    p_CPs: Tensor
    """(n, k, 3)."""
    normals_C: Tensor | None
    """(n, k, 3)."""
    areas: Tensor
    """(n, k) or (n, 1)."""


_POINTS = 200_000
"""Points of all particles together that are looked at in a step, when points are looked up."""


class _Model:
    """An object as the filter sees it: its looks from all sides, on torch."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64], render: str) -> None:
        self.surface: Surface | None = None
        self.atlas: Atlas | None = None
        if render == "views":
            self.surface = surface = see_surface(vertices, faces)
            self.p_OM, self.radius = surface.p_OM, surface.radius
            self._directions = torch.tensor(surface.directions)
            self._points = torch.tensor(surface.points)
            self._normals = torch.tensor(surface.normals)
            self._areas = torch.tensor(surface.areas)
        else:
            self.atlas = Atlas(vertices, faces)
            self.p_OM, self.radius = self.atlas.p_OM, self.atlas.pixel * self.atlas.tile / 2.02
        self.half_extents = torch.tensor(np.ptp(vertices, axis=0) / 2, dtype=torch.float32)

    def show(self, particles: _Particles) -> _Shown:
        """What is seen of each particle."""
        R_COs, p_CMs = particles.R_COs, particles.p_CMs
        rays_C = p_CMs / p_CMs.norm(dim=-1, keepdim=True).clamp(min=1e-6)
        if self.atlas is None:
            # The more particles, the fewer points of each: many rough looks find more than a few fine ones.
            every = max(1, len(particles) * self._points.shape[1] // _POINTS)
            rays_O = (rays_C[:, None] @ R_COs).squeeze(1)
            view = (rays_O @ self._directions.T).argmax(-1)
            p_CPs = self._points[:, ::every][view] @ R_COs.transpose(1, 2) + p_CMs[:, None]
            normals_C = self._normals[:, ::every][view] @ R_COs.transpose(1, 2)
            return _Shown(p_CPs, normals_C, every * self._areas[view][:, None])
        R_CVs = _view_rotations(rays_C)
        R_VOs = R_CVs.transpose(1, 2) @ R_COs
        points, seen = self.atlas.points(R_VOs.double().numpy())
        n = len(particles)
        p_CPs = torch.from_numpy(points).view(n, -1, 3) @ R_CVs.transpose(1, 2) + p_CMs[:, None]
        return _Shown(p_CPs, None, torch.from_numpy(seen).view(n, -1) * self.atlas.pixel**2)


class PoseEstimator:
    """Estimates poses of a catalogue's objects, one box and label at a time; keeps what it rendered of each label.

    Use it from the thread that made it: VTK renders wrongly elsewhere, which raises RuntimeError here.
    """

    def __init__(self, catalogue: "Catalogue", config: FilterConfig) -> None:
        for field, known in _CHOICES.items():
            if getattr(config, field) not in known:
                expected = " or ".join(map(repr, known))
                raise InputError(f"filter.{field}: {getattr(config, field)!r} is unknown; expected {expected}")
        if config.render == "each" and (config.warmup > 0 or config.registered > 0 or config.candidates > 0):
            raise InputError("filter: registration needs the normals that render: views has; render: each has none")
        self._catalogue = catalogue
        self._config = config
        self._models: dict[str, _Model] = {}
        self._renderer = DepthRenderer(catalogue)
        self._thread = threading.get_ident()

    def warm(self, label: str) -> None:
        """Renders what `estimate` will want of a label, which takes a second or two, once."""
        self._model(label)

    def _model(self, label: str) -> _Model:
        if threading.get_ident() != self._thread:
            raise RuntimeError("a PoseEstimator was used outside the thread that made it, where VTK renders wrongly")
        if label not in self._models:
            self._models[label] = _Model(*mesh_arrays(self._catalogue, label), self._config.render)
        return self._models[label]

    def estimate(
        self,
        frame: Frame,
        box: Box,
        label: str,
        *,
        rng: np.random.Generator,
        prior: PoseBelief | None = None,
    ) -> PoseEstimate:
        """The pose belief of an object `label` in `box`, world frame.

        Without a prior the search starts from the box. A prior, already moved by the action model (`predict`), is
        refined in a few iterations, among them a share of fresh particles, so that a prior which the box contradicts
        is given up. A box without a valid observation gives likelihood 0 and the prior, or a wide belief.

        Raises InputError for a label that the catalogue lacks, RuntimeError in another thread than the constructor's.
        """
        model = self._model(label)
        observation = observe(frame, box)
        if observation.n == 0:
            return _nothing_seen(frame, box, model, prior, rng, self._config.particles_last)
        config = self._config
        if prior is None:
            particles = self._start(observation, model, config.particles, rng)
            particles, scores = self._search(observation, model, particles, config.iterations, 0.0, rng)
        else:
            held = _resampled(_to_camera(prior, frame, model), prior.weights, config.tracking_particles, rng)
            fresh = self._start(observation, model, int(config.fresh * config.tracking_particles), rng)
            particles = _join(held[len(fresh) :], fresh)
            # Tracking starts half-way down the schedule of noise: the prior is near, or else of no use.
            particles, scores = self._search(observation, model, particles, config.tracking_iterations, 0.5, rng)
        return self._conclude(frame, observation, label, model, particles, scores, rng)

    def _start(self, observation: Observation, model: _Model, n: int, rng: np.random.Generator) -> _Particles:
        """Particles spread over what the box allows."""
        v, u = torch.nonzero(observation.in_box, as_tuple=True)
        z = observation.depth[v, u]
        camera = observation.camera
        if self._config.start == "uniform":
            R_COs = torch.from_numpy(rotation_from_quaternion(rng.normal(size=(n, 4)))).float()
            pixel = torch.from_numpy(rng.integers(len(u), size=n))
            near, far = np.quantile(z[z > 0].numpy(), [0.05, 0.95])
            depth = torch.from_numpy(rng.uniform(near, far + model.radius, n)).float()
            return _Particles(R_COs, _rays(camera, u[pixel], v[pixel]) * depth[:, None])
        R_COs = torch.from_numpy(rotation_from_quaternion(super_fibonacci(n, rng))).float()
        # The surface that a particle shows on the ray through its middle is put where that ray was observed.
        valid = z > 0
        u, v, z = u[valid], v[valid], z[valid]
        pixel = torch.from_numpy(rng.integers(len(u), size=n))
        p_CQs = _rays(camera, u[pixel], v[pixel]) * z[pixel, None]
        rays = p_CQs / p_CQs.norm(dim=-1, keepdim=True)
        p_MPs = model.show(_Particles(R_COs, p_CQs)).p_CPs - p_CQs[:, None]
        along = (p_MPs * rays[:, None]).sum(-1)
        nearest = (p_MPs - along[..., None] * rays[:, None]).norm(dim=-1).argmin(-1)
        return _Particles(R_COs, p_CQs - rays * along.gather(1, nearest[:, None]))

    def _search(
        self,
        observation: Observation,
        model: _Model,
        particles: _Particles,
        iterations: int,
        begin: float,
        rng: np.random.Generator,
    ) -> tuple[_Particles, Tensor]:
        """Iterated likelihood weighting. Returns the last particles, weighted by their scores, not yet resampled."""
        config = self._config
        for reach in np.geomspace(0.06, 0.03, config.warmup) if config.warmup else []:
            particles = _registered(observation, model, particles, float(reach))
        count_first = len(particles)
        scores = torch.zeros(0)
        for i in range(iterations):
            share = begin + (1 - begin) * i / max(iterations - 1, 1)
            epsilon = _fall(config.epsilon_first, config.epsilon, share)
            if i > 0:
                n = round(_fall(count_first, config.particles_last, i / max(iterations - 1, 1)))
                weights = _weights(scores, config.effective_share)
                best = particles[scores.argmax()[None]]
                particles = _resampled(particles, weights.double().numpy(), n, rng)
                particles = self._moved(observation, model, particles, share, epsilon, rng)
                if config.effective_share > 0:
                    particles = _join(best, particles[1:])
            scores = self._score(observation, model.show(particles), epsilon)
        return particles, scores

    def _moved(
        self,
        observation: Observation,
        model: _Model,
        particles: _Particles,
        share: float,
        epsilon: float,
        rng: np.random.Generator,
    ) -> _Particles:
        """The state transition of the bootstrap filter: noise, of which part is followed by a registration step."""
        config = self._config
        n = len(particles)
        sigma_p = _fall(config.noise_translation_first, config.noise_translation, share)
        sigma_R = _fall(config.noise_rotation_first, config.noise_rotation, share)
        noise_p = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_p
        noise_R = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_R
        registered = round(config.registered * n)
        flipped = round(config.flipped * n)
        turned = _turn(particles, noise_R, noise_p)
        if flipped:
            turns = _TURNS[torch.from_numpy(rng.integers(len(_TURNS), size=flipped))]
            flips = _Particles(turned.R_COs[:flipped] @ turns, turned.p_CMs[:flipped])
            turned = _join(flips, turned[flipped:])
        if registered:
            moved = _registered(observation, model, turned[:registered], 4 * epsilon)
            turned = _join(moved, turned[registered:])
        return turned

    def _score(self, observation: Observation, shown: _Shown, epsilon: float) -> Tensor:
        if self._config.score == "inliers":
            return paper_likelihood(count(observation, shown.p_CPs, shown.areas, epsilon), observation.n)
        return likelihood(count(observation, shown.p_CPs, shown.areas, epsilon, soft=True), observation.n)

    def _conclude(
        self,
        frame: Frame,
        observation: Observation,
        label: str,
        model: _Model,
        particles: _Particles,
        scores: Tensor,
        rng: np.random.Generator,
    ) -> PoseEstimate:
        config = self._config
        symmetry = self._catalogue[label].symmetry
        if config.candidates == 0:
            # As published: the weighted particles are the belief, the most likely one the estimate.
            best, weights, runner_up = particles[scores.argmax()[None]], _weights(scores, 0.0), 0.0
            counts = self._exact(observation, label, model, best)
        else:
            modes = _modes(particles, scores, config.candidates)
            few = modes[: config.candidates // 2]
            turned = _join(modes, *(_Particles(few.R_COs @ turn, few.p_CMs) for turn in _SPINS))
            # A turn about the middle of a mug moves its body by its handle's share: the first reach must cover that.
            for reach in (0.04, 0.03, 0.02, 0.015, 0.015):
                turned = _registered(observation, model, turned, reach)
            candidates = _join(modes, turned)
            rough = self._score(observation, model.show(candidates), config.epsilon)
            modes = _modes(candidates, rough, config.candidates)
            counts = self._exact(observation, label, model, modes)
            exact = likelihood(counts, observation.n)
            order = exact.argsort(descending=True, stable=True)
            modes, exact = modes[order], exact[order]
            counts = Counts(*(getattr(counts, f.name)[order] for f in dataclasses.fields(counts)))
            best = modes[:1]
            runner_up = float(exact[1]) if len(exact) > 1 else 0.0
            particles, weights = self._posterior(observation, model, modes, exact, rng)
        value = (paper_likelihood if config.score == "inliers" else confidence)(counts, observation.n)
        X_WOs = _to_world(particles, frame, model)
        X_WO = _to_world(best, frame, model)[0]
        p = weights.double().numpy()
        p = p / p.sum()
        shift = np.sqrt(p @ ((X_WOs[:, :3, 3] - X_WO[:3, 3]) ** 2).sum(-1))
        angle = np.sqrt(p @ rotation_error(X_WOs[:, :3, :3], X_WO[:3, :3], symmetry) ** 2)
        features = {
            "inliers": float(counts.inliers[0]),
            "free_space": float(counts.free_space[0]),
            "occluded": float(counts.occluded[0]),
            "rendered": float(counts.rendered[0]),
            "observed": float(observation.n),
            "effective_sample_size": float(1.0 / (p @ p) / len(p)),
            "translation_std_m": float(shift),
            "rotation_std_rad": float(angle),
            "runner_up": runner_up,
        }
        return PoseEstimate(
            PoseBelief(readonly(X_WOs), readonly(p)),
            readonly(X_WO),
            float(np.clip(float(value[0]), 0.0, 1.0)),
            tuple(features.items()),
        )

    def _exact(self, observation: Observation, label: str, model: _Model, particles: _Particles) -> Counts:
        """Counts from a render of each pose by itself, at the observation's own pixels."""
        camera = observation.camera
        v, u = np.mgrid[: camera.height, : camera.width]
        rays = _rays(camera, torch.from_numpy(u), torch.from_numpy(v)).view(-1, 3)
        rows = []
        for X_CO in _poses(particles, model):
            depth = torch.from_numpy(self._renderer.depth(label, X_CO, camera)).view(-1)
            seen = depth > 0
            p_CPs = (rays[seen] * depth[seen, None])[None]
            areas = (depth[seen] ** 2 / (camera.fx * camera.fy))[None]
            c = count(observation, p_CPs, areas, self._config.epsilon)
            rows.append(torch.stack([c.inliers[0], c.free_space[0], c.occluded[0], c.rendered[0]]))
        return Counts(*torch.stack(rows).unbind(-1))

    def _posterior(
        self, observation: Observation, model: _Model, modes: _Particles, exact: Tensor, rng: np.random.Generator
    ) -> tuple[_Particles, Tensor]:
        """Weighted particles of the posterior, proportional to exp(sharpness * likelihood), around the modes.

        Registration makes an optimiser of the filter, whose particles say nothing of how sure it is. So the belief is
        drawn anew, by importance sampling from a mixture of Gaussians about the modes.
        """
        config = self._config
        n = config.particles_last
        sigma_p, sigma_R = 3 * config.noise_translation, 2 * config.noise_rotation
        shares = torch.softmax(config.sharpness * (exact - exact.max()), 0) * 0.8 + 0.2 / len(exact)
        chosen = torch.from_numpy(systematic(shares.double().numpy(), n, rng.random()))
        noise_p = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_p
        noise_R = torch.from_numpy(rng.normal(size=(n, 3))).float() * sigma_R
        # The mode itself stays among the particles.
        noise_p[0] = noise_R[0] = 0
        drawn = _turn(modes[chosen], noise_R, noise_p)
        score = likelihood(count(observation, *_points(model.show(drawn)), config.epsilon), observation.n)
        shift = (drawn.p_CMs[:, None] - modes.p_CMs).norm(dim=-1) / sigma_p  # (n, modes)
        cosine = (torch.einsum("nij,mij->nm", drawn.R_COs, modes.R_COs) - 1) / 2
        angle = torch.arccos(cosine.clamp(-1, 1)) / sigma_R
        log_q = torch.logsumexp(shares.log() - (shift**2 + angle**2) / 2, dim=1)
        return drawn, torch.softmax(config.sharpness * score - log_q, 0)


def predict(
    belief: PoseBelief,
    action: PickPlace | None,
    *,
    is_target: bool,
    rng: np.random.Generator,
    config: FilterConfig,
) -> PoseBelief:
    """The belief after an action, before the next observation (Sui et al. 2017, eq. 10).

    The action's target is at the action's X_WO_place with sigma_place, with probability w_place, or else still where
    it was, with sigma_stay; the latter for certain when the hand was not opened at the place. Any other object is where
    it was, with sigma_other. None, or an action of kind "none": nothing was touched, and the belief is
    returned as it is. Noise is on positions, and on rotation vectors by radians_per_metre.
    """
    if action is None or action.kind == "none":
        return belief
    n = len(belief.weights)
    X_WOs = belief.X_WOs[systematic(belief.weights, n, rng.random())]
    sigma = np.full(n, config.sigma_other)
    if is_target:
        placed = rng.random(n) < (config.w_place if action.released else 0.0)
        X_WOs[placed] = action.X_WO_place
        sigma = np.where(placed, config.sigma_place, config.sigma_stay)
    X_WOs[:, :3, 3] += sigma[:, None] * rng.normal(size=(n, 3))
    turn = config.radians_per_metre * sigma[:, None] * rng.normal(size=(n, 3))
    X_WOs[:, :3, :3] = rotation_from_vector(turn) @ X_WOs[:, :3, :3]
    return PoseBelief(readonly(X_WOs), readonly(np.full(n, 1.0 / n)))


def super_fibonacci(n: int, rng: np.random.Generator) -> Array:
    """n unit quaternions (n, 4) spread evenly over all rotations, from a random start (Alexa, CVPR 2022)."""
    phi, psi = np.sqrt(2.0), 1.533751168755204288118041
    s = np.arange(n) + 0.5
    r, R = np.sqrt(s / n), np.sqrt(1 - s / n)
    a, b = 2 * np.pi * s / phi, 2 * np.pi * s / psi
    spiral = np.stack([r * np.sin(a), r * np.cos(a), R * np.sin(b), R * np.cos(b)], -1)
    # One random rotation for all: the product of unit quaternions is an isometry.
    w, x, y, z = rng.normal(size=4)
    q = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    turned: Array = spiral @ (q / np.linalg.norm(q[0])).T
    return turned


def _about_axes(*angles: float) -> Tensor:
    turns = [rotation_from_vector(np.eye(3)[i] * np.deg2rad(angle)) for angle in angles for i in range(3)]
    return torch.from_numpy(np.stack(turns)).float()


_TURNS = _about_axes(180, 90, -90)
"""(9, 3, 3): half and quarter turns about an object's axes, which depth hardly tells apart on many a product."""
_ENDS = torch.stack([torch.eye(3), *_about_axes(180)[[1, 2, 0]]])
_SPINS = torch.cat(
    [_about_axes(*range(0, 360, 30))[axis::3] @ end for axis in range(3) for end in (_ENDS[0], _ENDS[1 + axis])]
)[1:]
"""(71, 3, 3): all twelfths of a turn about each axis, either end up."""


def _fall(first: float, last: float, share: float) -> float:
    """From first to last, geometrically, as share goes from 0 to 1."""
    return first * (last / first) ** share if first > 0 and last > 0 else last


def _points(shown: _Shown) -> tuple[Tensor, Tensor]:
    return shown.p_CPs, shown.areas


def _rays(camera: Camera, u: Tensor, v: Tensor) -> Tensor:
    """Points at depth 1 that pixels show, (..., 3)."""
    x, y = (u.float() - camera.cx) / camera.fx, (v.float() - camera.cy) / camera.fy
    return torch.stack([x, y, torch.ones_like(x)], -1)


def _rotations(w: Tensor) -> Tensor:
    return torch.from_numpy(rotation_from_vector(w.double().numpy())).float()


def _turn(particles: _Particles, w_C: Tensor, shift_C: Tensor) -> _Particles:
    """Turned about their middles by rotation vectors in C, then shifted."""
    return _Particles(_rotations(w_C) @ particles.R_COs, particles.p_CMs + shift_C)


def _registered(observation: Observation, model: _Model, particles: _Particles, reach: float) -> _Particles:
    shown = model.show(particles)
    assert shown.normals_C is not None
    return _turn(particles, *register(observation, shown.p_CPs, shown.normals_C, particles.p_CMs, reach))


def _view_rotations(rays: Tensor) -> Tensor:
    return torch.from_numpy(view_rotations(rays.double().numpy())).float()


def _weights(scores: Tensor, effective_share: float) -> Tensor:
    """Normalised weights (n,): the scores, raised to the power that gives the effective sample size asked for."""
    s = scores.double()
    if float(s.max()) <= 0:
        return torch.full_like(s, 1.0 / len(s))
    if effective_share <= 0:
        return s / s.sum()
    logs = (s / s.max()).clamp(min=1e-12).log()
    low, high = 0.0, 1000.0
    for _ in range(30):
        power = (low + high) / 2
        w = torch.softmax(power * logs, 0)
        if 1.0 / float((w * w).sum()) > effective_share * len(w):
            low = power
        else:
            high = power
    return torch.softmax(low * logs, 0)


def _resampled(particles: _Particles, weights: Array, n: int, rng: np.random.Generator) -> _Particles:
    # In random order, so that any part of them is as good as another.
    return particles[torch.from_numpy(rng.permutation(systematic(weights, n, rng.random())))]


def _modes(particles: _Particles, scores: Tensor, limit: int) -> _Particles:
    """The best particles that differ by over 1 cm or 10 degrees from each better one, at most `limit`."""
    order = scores.argsort(descending=True, stable=True)[:400]
    left = particles[order]
    chosen: list[int] = []
    free = np.ones(len(order), dtype=bool)
    while len(chosen) < limit and free.any():
        i = int(free.argmax())
        chosen.append(i)
        near = (left.p_CMs - left.p_CMs[i]).norm(dim=-1) < 0.01
        aligned = (torch.einsum("nij,ij->n", left.R_COs, left.R_COs[i]) - 1) / 2 > np.cos(np.deg2rad(10))
        free &= ~(near & aligned).numpy()
        free[i] = False
    return left[torch.tensor(chosen)]


def _poses(particles: _Particles, model: _Model) -> Array:
    """X_COs (n, 4, 4)."""
    R_COs = particles.R_COs.double().numpy()
    # Single precision and many small turns leave them a little off: back onto SO(3).
    u, _, vt = np.linalg.svd(R_COs)
    R_COs = u @ vt
    return transform(R_COs, particles.p_CMs.double().numpy() - R_COs @ model.p_OM)


def _to_world(particles: _Particles, frame: Frame, model: _Model) -> Array:
    return np.asarray(frame.X_WC @ _poses(particles, model))


def _to_camera(belief: PoseBelief, frame: Frame, model: _Model) -> _Particles:
    X_COs = inverse(frame.X_WC) @ belief.X_WOs
    p_CMs = X_COs[:, :3, :3] @ model.p_OM + X_COs[:, :3, 3]
    return _Particles(torch.from_numpy(X_COs[:, :3, :3].copy()).float(), torch.from_numpy(p_CMs).float())


def _nothing_seen(
    frame: Frame, box: Box, model: _Model, prior: PoseBelief | None, rng: np.random.Generator, n: int
) -> PoseEstimate:
    if prior is not None:
        best = prior.X_WOs[int(np.argmax(prior.weights))]
        belief = prior
    else:
        x, y, w, h = box
        u, v = x + rng.random(n) * max(w, 1.0), y + rng.random(n) * max(h, 1.0)
        rays = _rays(frame.camera, torch.from_numpy(u), torch.from_numpy(v)).double().numpy()
        p_CMs = torch.from_numpy(rays * rng.uniform(0.4, 2.0, (n, 1))).float()
        R_COs = torch.from_numpy(rotation_from_quaternion(rng.normal(size=(n, 4)))).float()
        X_WOs = _to_world(_Particles(R_COs, p_CMs), frame, model)
        best, belief = X_WOs[0], PoseBelief(readonly(X_WOs), readonly(np.full(n, 1.0 / n)))
    names = ("inliers", "free_space", "occluded", "rendered", "observed", "effective_sample_size")
    spread = belief.X_WOs[:, :3, 3].std(axis=0)
    features = (
        *((name, 0.0) for name in names),
        ("translation_std_m", float(np.linalg.norm(spread))),
        ("rotation_std_rad", float(np.pi)),
        ("runner_up", 0.0),
    )
    return PoseEstimate(belief, readonly(best), 0.0, features)
