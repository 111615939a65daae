"""The belief over an object's pose: iterated likelihood weighting on depth renders (Sui et al. 2017, eq. 4, 6 to 9).

`PoseEstimator` turns a box with a label into weighted particles. Two presets of `FilterConfig` share all of it:
"paper", as published, and "default", which proposes more of its particles where the posterior has its mass.
"""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sum_drake.appearance import Appearance, Appearances, Shown
from sum_drake.depth_tolerance import PERFECT, depth_tolerance
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import (
    rotation_error,
    rotation_from_quaternion,
    rotation_from_vector,
    super_fibonacci,
    transform,
)
from sum_drake.likelihood import (
    BELIEF,
    TERMS,
    Counts,
    Observation,
    confidence,
    count,
    count_picture,
    log_likelihood,
    observe,
    paper_likelihood,
    pixel_rays,
    register,
    terms,
    thinned,
)
from sum_drake.modes import Modes, distinct, expected_hits, near_share, tempered
from sum_drake.particles import Particles, join, poses, resampled, to_camera, to_world, turn
from sum_drake.posterior import nearest, sample_posterior
from sum_drake.rendering import DepthRenderer
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.support import support_plane
from sum_drake.types import Array, Box, Frame, Immutable, PoseBelief, readonly

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


@dataclasses.dataclass(frozen=True, eq=False)
class PoseEstimate(Immutable):
    """What the filter makes of one box and label."""

    belief: PoseBelief
    X_WO: Array
    """(4, 4): the best pose."""
    likelihood: float
    """Of the best pose, in [0, 1]; 0 where there was nothing to see."""
    modes: Modes
    """The rival poses that were compared at the end; X_WO alone where the filter compares none."""
    features: tuple[tuple[str, float], ...]
    """inliers, free_space, occluded, rendered, observed (pixels, of the best pose), effective_sample_size (share of the
    draws that the belief was made from), translation_std_m, rotation_std_rad, right_pose (share of the belief within 2
    cm and 20 degrees of the estimate), mode_entropy_nats (of the modes' probabilities)."""


@dataclasses.dataclass(frozen=True, eq=False)
class PoseRequest:
    """A box in which the pose of an object is to be estimated."""

    label: str
    box: Box
    rng: np.random.Generator
    """Of this request's own, so that it does not matter what is estimated before it or where."""
    prior: PoseBelief | None = None
    """What is believed of the object, moved by the action model; None: nothing."""


class PoseEstimator:
    """Estimates poses of a catalogue's objects, one box and label at a time; keeps what it rendered of each label.

    noise: of the depth sensor, which inlier distances follow from. device: torch's, where points are compared; all is
    drawn and rendered on the CPU. appearances: shared with other estimators of the same catalogue, and theirs is the
    device; default: its own. Use it from the thread that made it: VTK renders wrongly elsewhere, which raises
    RuntimeError here.
    """

    def __init__(
        self,
        catalogue: "Catalogue",
        config: FilterConfig,
        *,
        noise: DepthNoiseConfig | None = None,
        device: str = "cpu",
        appearances: Appearances | None = None,
    ) -> None:
        self._catalogue = catalogue
        self._config = config
        self._noise = DepthNoiseConfig() if noise is None else noise
        self._appearances = appearances or Appearances(catalogue, config.render, device=device)
        self._renderer = DepthRenderer(catalogue)

    @property
    def renders(self) -> int:
        """Poses that were rendered so far, those that only made ready for a label aside."""
        return self._renderer.rendered + self._appearances.rendered

    def warm(self, label: str) -> None:
        """Renders what `estimate` will want of a label, which takes a second or two, once."""
        self._appearances[label]
        self._renderer.warm(label)

    def warm_all(self, labels: Sequence[str]) -> None:
        """`warm` for each label."""
        for label in labels:
            self.warm(label)

    def estimate_all(self, frame: Frame, requests: Sequence[PoseRequest]) -> list[PoseEstimate]:
        """`estimate` for each request, in their order."""
        return [self.estimate(frame, one.box, one.label, rng=one.rng, prior=one.prior) for one in requests]

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
        model = self._appearances[label]
        config = self._config
        if not np.isfinite(box).all():
            return _nothing_seen(frame, (0.0, 0.0, 0.0, 0.0), model, prior, rng, config.particles_last)
        tolerance = depth_tolerance(self._noise, frame.camera, _distance(frame, box)) if config.sensor else PERFECT
        plane = support_plane(frame, box, rng, tolerance=tolerance.plane) if config.support else None
        observation = observe(frame, box, tolerance=tolerance, plane=plane).to(self._appearances.device)
        if observation.n < max(tolerance.least_points, 1):
            return _nothing_seen(frame, box, model, prior, rng, config.particles_last)
        if prior is None:
            particles = self._start(observation, model, config.particles, rng)
            particles, scores = self._search(observation, model, particles, config.iterations, 0.0, rng)
        else:
            held = resampled(to_camera(prior, frame, model.p_OM), prior.weights, config.tracking_particles, rng)
            fresh = self._start(observation, model, int(config.fresh * config.tracking_particles), rng)
            particles = join(held[len(fresh) :], fresh)
            # Tracking starts half-way down the schedule of noise: the prior is near, or else of no use.
            particles, scores = self._search(observation, model, particles, config.tracking_iterations, 0.5, rng)
        return self._conclude(frame, observation, label, model, particles, scores, rng)

    def _start(self, observation: Observation, model: Appearance, n: int, rng: np.random.Generator) -> Particles:
        """Particles spread over what the box allows."""
        observation = observation.to("cpu")
        v, u = torch.nonzero(observation.in_box, as_tuple=True)
        z = observation.depth[v, u]
        camera = observation.camera
        if self._config.start == "uniform":
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

    def _search(
        self,
        observation: Observation,
        model: Appearance,
        particles: Particles,
        iterations: int,
        begin: float,
        rng: np.random.Generator,
    ) -> tuple[Particles, Tensor]:
        """Iterated likelihood weighting. Returns the last particles, weighted by their scores, not yet resampled."""
        config = self._config
        for reach in np.geomspace(0.06, 0.03, config.warmup) if config.warmup else []:
            particles = _registered(observation, model, particles, float(reach))
        count_first = len(particles)
        scores = torch.zeros(0)
        for i in range(iterations):
            share = begin + (1 - begin) * i / max(iterations - 1, 1)
            epsilon = observation.tolerance.epsilon(_fall(config.epsilon_first, config.epsilon, share))
            if i > 0:
                n = round(_fall(count_first, config.particles_last, i / max(iterations - 1, 1)))
                weights = tempered(scores, config.effective_share)
                best = particles[scores.argmax()[None]]
                particles = resampled(particles, weights.double().numpy(), n, rng)
                particles = self._moved(observation, model, particles, share, epsilon, rng)
                if config.effective_share > 0:
                    particles = join(best, particles[1:])
            scores = self._score(observation, model.show(particles), epsilon)
        return particles, scores

    def _moved(
        self,
        observation: Observation,
        model: Appearance,
        particles: Particles,
        share: float,
        epsilon: float,
        rng: np.random.Generator,
    ) -> Particles:
        """The state transition of the bootstrap filter: noise, of which part is followed by a registration step."""
        config = self._config
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
            moved = _registered(observation, model, turned[:registered], 4 * epsilon)
            turned = join(moved, turned[registered:])
        return turned

    def _score(self, observation: Observation, shown: Shown, epsilon: float, *, soft: bool = True) -> Tensor:
        """Log-likelihood of what is shown, (n,), on the CPU. soft: as of `count`, for all but the published score."""
        if self._config.score == "inliers":
            return paper_likelihood(count(observation, shown.p_CPs, shown.areas, epsilon), observation.n).log().cpu()
        return log_likelihood(count(observation, shown.p_CPs, shown.areas, epsilon, soft=soft), observation).cpu()

    def _conclude(
        self,
        frame: Frame,
        observation: Observation,
        label: str,
        model: Appearance,
        particles: Particles,
        scores: Tensor,
        rng: np.random.Generator,
    ) -> PoseEstimate:
        config = self._config
        epsilon = observation.tolerance.epsilon(config.epsilon)
        symmetry = self._catalogue[label].symmetry
        if config.candidates == 0:
            # As published: the weighted particles are the belief, the most likely one the estimate.
            modes, weights = particles[scores.argmax()[None]], tempered(scores, 0.0)
            looked_at = observation.to("cpu")
            effective = 1.0 / (float((weights**2).sum()) * len(weights))
            shares, chosen = np.ones(1), 0
            counts = self._exact(looked_at, label, model, modes)
        else:
            modes = self._rivals(observation, model, particles, scores)
            looked_at = thinned(observation).to("cpu")
            counts = self._exact(looked_at, label, model, modes)
            # Registration makes an optimiser of the filter, whose particles say nothing of how sure it is: the belief
            # is drawn anew.
            particles, effective = sample_posterior(
                lambda drawn: BELIEF * self._score(observation, model.show(drawn), epsilon, soft=False),
                modes,
                BELIEF * log_likelihood(counts, looked_at),
                config.particles_last,
                sigma_p=config.noise_translation,
                sigma_R=2 * config.noise_rotation,
                rng=rng,
            )
            weights = torch.full((len(particles),), 1.0 / len(particles))
            cell = nearest(particles, modes, config.noise_translation, 2 * config.noise_rotation)
            shares = np.bincount(cell.numpy(), minlength=len(modes)) / len(particles)
            # By the softer likelihood, which the belief's own would be too sure for.
            soft = torch.softmax(log_likelihood(counts, looked_at), 0).double().numpy()
            chosen = int(expected_hits(poses(modes, model.p_OM), soft, symmetry).argmax())
        rivals = to_world(modes, frame, model.p_OM)
        order = np.argsort(-shares, kind="stable")
        told = Modes(
            readonly(rivals[order]), readonly(shares[order]), readonly(terms(counts, looked_at)[order].numpy())
        )
        counts = Counts(*(getattr(counts, f.name)[chosen : chosen + 1] for f in dataclasses.fields(counts)))
        value = (paper_likelihood if config.score == "inliers" else confidence)(counts, looked_at.n)
        X_WOs, X_WO = to_world(particles, frame, model.p_OM), rivals[chosen]
        p = weights.double().numpy()
        p = p / p.sum()
        shift = np.sqrt(p @ ((X_WOs[:, :3, 3] - X_WO[:3, 3]) ** 2).sum(-1))
        angle = np.sqrt(p @ rotation_error(X_WOs[:, :3, :3], X_WO[:3, :3], symmetry) ** 2)
        features = {
            "inliers": float(counts.inliers[0]),
            "free_space": float(counts.free_space[0]),
            "occluded": float(counts.occluded[0]),
            "rendered": float(counts.rendered[0]),
            "observed": float(looked_at.n),
            "effective_sample_size": effective,
            "translation_std_m": float(shift),
            "rotation_std_rad": float(angle),
            "right_pose": near_share(X_WO, X_WOs, p, symmetry),
            "mode_entropy_nats": float(-(shares[shares > 0] * np.log(shares[shares > 0])).sum()),
        }
        return PoseEstimate(
            PoseBelief(readonly(X_WOs), readonly(p)),
            readonly(X_WO),
            float(np.clip(float(value[0]), 0.0, 1.0)),
            told,
            tuple(features.items()),
        )

    def _rivals(self, observation: Observation, model: Appearance, particles: Particles, scores: Tensor) -> Particles:
        """The best particles that differ, and what they become when they are moved and registered anew.

        The moves are those after which the object looks nearly the same, and small turns.
        """
        config = self._config
        modes = distinct(particles, scores, config.candidates)
        few = modes[: config.candidates // 4]
        turned = join(modes, _moved_in_itself(few, np.concatenate([model.X_MNs, _NUDGES])))
        # A turn about the middle of a mug moves its body by its handle's share: the first reach must cover that.
        for reach in (0.04, 0.03, 0.02, 0.015, 0.015):
            turned = _registered(observation, model, turned, reach)
        candidates = join(modes, turned)
        epsilon = observation.tolerance.epsilon(config.epsilon)
        rivals = distinct(candidates, self._score(observation, model.show(candidates), epsilon), config.candidates)
        # Rivals are compared at their best: one that is placed less well would lose for that alone.
        tried = rivals
        for _ in range(4):
            tried = _registered(observation, model, tried, 2 * epsilon)
        both = join(rivals, tried)
        return distinct(both, self._score(observation, model.show(both), epsilon), config.candidates)

    def _exact(self, observation: Observation, label: str, model: Appearance, particles: Particles) -> Counts:
        """Counts from a render of each pose by itself, at the observation's own pixels."""
        epsilon = observation.tolerance.epsilon(self._config.epsilon)
        rows = [
            count_picture(observation, self._renderer.depth(label, X_CO, observation.camera), epsilon)
            for X_CO in poses(particles, model.p_OM)
        ]
        return Counts(*(torch.cat([getattr(row, f.name) for row in rows]) for f in dataclasses.fields(Counts)))


def _distance(frame: Frame, box: Box) -> float:
    """Lower quartile of the depth in a box, metres, since what is looked for has its background behind it; 1 where
    nothing was measured."""
    x, y, w, h = box
    top, bottom = (int(np.clip(np.ceil(v), 0, frame.camera.height)) for v in (y, y + h))
    left, right = (int(np.clip(np.ceil(u), 0, frame.camera.width)) for u in (x, x + w))
    depth = frame.depth[top:bottom, left:right]
    seen = depth[np.isfinite(depth) & (depth > 0)]
    return float(np.quantile(seen, 0.25)) if len(seen) else 1.0


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


def _registered(observation: Observation, model: Appearance, particles: Particles, reach: float) -> Particles:
    shown = model.show(particles, normals=True)
    assert shown.normals_C is not None
    p_CMs = particles.p_CMs.to(shown.p_CPs.device)
    w_C, shift_C = register(observation, shown.p_CPs, shown.normals_C, p_CMs, reach)
    return turn(particles, w_C.cpu(), shift_C.cpu())


def _nothing_seen(
    frame: Frame, box: Box, model: Appearance, prior: PoseBelief | None, rng: np.random.Generator, n: int
) -> PoseEstimate:
    if prior is not None:
        best = prior.X_WOs[int(np.argmax(prior.weights))]
        belief = prior
    else:
        x, y, w, h = box
        u, v = x + rng.random(n) * max(w, 1.0), y + rng.random(n) * max(h, 1.0)
        rays = pixel_rays(frame.camera, torch.from_numpy(u), torch.from_numpy(v)).double().numpy()
        p_CMs = torch.from_numpy(rays * rng.uniform(0.4, 2.0, (n, 1))).float()
        R_COs = torch.from_numpy(rotation_from_quaternion(rng.normal(size=(n, 4)))).float()
        X_WOs = to_world(Particles(R_COs, p_CMs), frame, model.p_OM)
        best, belief = X_WOs[0], PoseBelief(readonly(X_WOs), readonly(np.full(n, 1.0 / n)))
    names = ("inliers", "free_space", "occluded", "rendered", "observed", "effective_sample_size")
    spread = belief.X_WOs[:, :3, 3].std(axis=0)
    features = (
        *((name, 0.0) for name in names),
        ("translation_std_m", float(np.linalg.norm(spread))),
        ("rotation_std_rad", float(np.pi)),
        ("right_pose", 0.0),
        ("mode_entropy_nats", 0.0),
    )
    modes = Modes(readonly(best[None]), readonly(np.ones(1)), readonly(np.zeros((1, len(TERMS)))))
    return PoseEstimate(belief, readonly(best), 0.0, modes, features)
