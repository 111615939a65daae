"""The belief over an object's pose: iterated likelihood weighting on depth renders (Sui et al. 2017, eq. 4, 6 to 9).

`PoseEstimator` turns a box with a label into weighted particles. Two presets of `FilterConfig` share all of it:
"paper", as published, and "default", which proposes more of its particles where the posterior has its mass.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sum_drake.appearance import Appearance, Appearances
from sum_drake.boxes import distance
from sum_drake.depth_tolerance import PERFECT, depth_tolerance
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import (
    rotation_error,
    rotation_from_quaternion,
)
from sum_drake.likelihood import (
    BELIEF,
    TERMS,
    Counts,
    Observation,
    confidence,
    count_picture,
    log_likelihood,
    observe,
    paper_likelihood,
    pixel_rays,
    terms,
    thinned,
)
from sum_drake.modes import Modes, expected_hits, near_share, tempered
from sum_drake.particles import Particles, join, poses, resampled, to_camera, to_world
from sum_drake.posterior import sample_posterior
from sum_drake.rendering import DepthRenderer
from sum_drake.search import Sought, Watch, rivals, score, search, start
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.support import Ground, support_plane, table_plane
from sum_drake.types import Array, Box, Frame, Immutable, PoseBelief, Region, readonly

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


ABOUT = 0.04, 30.0
"""Metres and degrees about a mode within which a prior speaks for it: a few times what an untouched object moves."""


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
    """Of the best pose: inliers, free_space, occluded, rendered, observed (pixels), close, sides (`likelihood.terms`).
    Of the belief: effective_sample_size (share of the draws that it was made from), translation_std_m,
    rotation_std_rad, near_share (share of it within 2 cm and 20 degrees of the estimate), mode_entropy_nats (of the
    modes' probabilities)."""


@dataclasses.dataclass(frozen=True, eq=False)
class PoseRequest:
    """A box in which the pose of an object is to be estimated."""

    label: str
    box: Box
    rng: np.random.Generator
    """Of this request's own, so that it does not matter what is estimated before it or where."""
    prior: PoseBelief | None = None
    """What is believed of the object, moved by the action model; None: nothing."""
    likelihood: float = 0.0
    """Of the estimate before, in [0, 1], if there is a prior."""
    table: Region | None = None
    """What it may stand on; None: nothing is known of it."""


class PoseEstimator:
    """Estimates poses of a catalogue's objects, one box and label at a time; keeps what it rendered of each label.

    noise: of the depth sensor, which inlier distances follow from. device: torch's, where points are compared; all is
    drawn and rendered on the CPU. appearances, renderer: shared with other estimators of the same catalogue, and theirs
    is the device; default: its own. Use it from the thread that made it: VTK renders wrongly elsewhere, which raises
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
        renderer: DepthRenderer | None = None,
    ) -> None:
        self._catalogue = catalogue
        self._config = config
        self._noise = DepthNoiseConfig() if noise is None else noise
        self._appearances = appearances or Appearances(catalogue, config.render, device=device)
        self._renderer = renderer or DepthRenderer(catalogue)

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
        return [
            self.estimate(
                frame, one.box, one.label, rng=one.rng, prior=one.prior, before=one.likelihood, table=one.table
            )
            for one in requests
        ]

    def estimate(
        self,
        frame: Frame,
        box: Box,
        label: str,
        *,
        rng: np.random.Generator,
        prior: PoseBelief | None = None,
        before: float = 0.0,
        table: Region | None = None,
        watch: Callable[[PoseBelief], None] | None = None,
    ) -> PoseEstimate:
        """The pose belief of an object `label` in `box`, world frame.

        Without a prior the search starts from the box. A prior, already moved by the action model (`predict`), is
        refined in a few iterations, among them a share of fresh particles, so that a prior which the box contradicts
        is given up. Where that explains the box less well than the object was explained before (likelihood `before`),
        it is searched from scratch as well, and the likelier counts. A box without a valid observation gives
        likelihood 0 and the prior, or a wide belief. Nothing reaches into a `table` that is known, and none of it is to
        be explained, even where clutter hides it; else a plane is looked for around the box. `watch` is told the
        particles of each iteration of a search, in the world frame, with the weights that the next is drawn by.

        Raises InputError for a label that the catalogue lacks, RuntimeError in another thread than the constructor's.
        """
        model = self._appearances[label]
        config = self._config
        if not np.isfinite(box).all():
            return _nothing_seen(frame, (0.0, 0.0, 0.0, 0.0), model, prior, rng, config.particles_last)
        z = distance(frame, box)
        if np.isnan(z):
            return _nothing_seen(frame, box, model, prior, rng, config.particles_last)
        tolerance = depth_tolerance(self._noise, frame.camera, z) if config.sensor else PERFECT
        if "edges" in config.without:
            tolerance = dataclasses.replace(tolerance, jump=np.inf, bleed=0)
        plane, ground = None, None
        if config.support:
            known = None if table is None else table_plane(frame, box, table)
            plane = support_plane(frame, box, rng, tolerance=tolerance.plane, known=known)
            if table is not None and known is not None and plane is not None and "table" not in config.without:
                ground = Ground(plane, frame.X_WC, table)
        observation = observe(frame, box, tolerance=tolerance, plane=plane).to(self._appearances.device)
        if observation.n < max(tolerance.least_points, 1):
            return _nothing_seen(frame, box, model, prior, rng, config.particles_last)
        sought = Sought(observation, model, self._catalogue[label].symmetry, config, ground)

        def seen(particles: Particles, scores: Tensor) -> None:
            if watch is not None:
                weights = tempered(scores, config.effective_share).double().numpy()
                X_WOs = to_world(particles, frame, model.p_OM)
                watch(PoseBelief(readonly(X_WOs), readonly(weights / weights.sum())))

        if prior is None:
            particles = start(sought, config.particles, rng)
            return _told(frame, sought, self._search(sought, label, particles, config.iterations, 0.0, rng, seen))
        held = resampled(to_camera(prior, frame, model.p_OM), prior.weights, config.tracking_particles, rng)
        fresh = start(sought, int(config.fresh * config.tracking_particles), rng)
        particles = join(held[len(fresh) :], fresh)
        # Tracking starts half-way down the schedule of noise: the prior is near, or else of no use.
        few = dataclasses.replace(
            config,
            particles_last=config.tracking_particles_last,
            candidates=min(config.candidates, config.tracking_candidates),
        )
        again = dataclasses.replace(sought, config=few)
        tracked = self._search(again, label, particles, config.tracking_iterations, 0.5, rng, seen, held)
        if config.candidates == 0 or tracked.likelihood(config) >= before - config.tracking_loss:
            return _told(frame, sought, tracked)
        particles = start(sought, config.particles, rng)
        found = self._search(sought, label, particles, config.iterations, 0.0, rng, seen, held)
        return _told(frame, sought, max(tracked, found, key=lambda one: one.best))

    def _search(
        self,
        sought: Sought,
        label: str,
        particles: Particles,
        iterations: int,
        begin: float,
        rng: np.random.Generator,
        watch: Watch,
        held: Particles | None = None,
    ) -> "_Outcome":
        """What a search that starts with particles comes to. held: particles of the prior, if there is one."""
        particles, scores = search(sought, particles, iterations, begin, rng, watch)
        if sought.config.candidates == 0:
            return self._as_published(sought, label, particles, scores)
        return self._among_rivals(sought, label, particles, scores, rng, held)

    def _as_published(self, sought: Sought, label: str, particles: Particles, scores: Tensor) -> "_Outcome":
        """The weighted particles are the belief, the most likely one is the estimate."""
        best, weights = particles[scores.argmax()[None]], tempered(scores, 0.0)
        effective = 1.0 / (float((weights**2).sum()) * len(weights))
        looked_at = sought.observation.to("cpu")
        counts = self._exact(looked_at, label, sought.model, best)
        best_score = log_likelihood(counts, looked_at)
        return _Outcome(particles, weights, effective, best, best_score, torch.ones(1), 0, counts, looked_at)

    def _among_rivals(
        self,
        sought: Sought,
        label: str,
        particles: Particles,
        scores: Tensor,
        rng: np.random.Generator,
        held: Particles | None,
    ) -> "_Outcome":
        """Rivals are compared by exact renders and by the prior, and the belief is drawn anew about them.

        Registration makes an optimiser of the filter, whose particles say nothing of how sure it is.
        """
        config = sought.config
        modes = rivals(sought, particles, scores)
        looked_at = thinned(sought.observation).to("cpu")
        counts = self._exact(looked_at, label, sought.model, modes)
        found = log_likelihood(counts, looked_at, sought.weights) + sought.log_prior(modes)
        logs = BELIEF * found.double()
        if held is not None:
            logs = logs + torch.log(1 - config.prior_trust + config.prior_trust * _held_near(sought, modes, held))
        shares = torch.softmax(logs, 0)
        chosen = int(expected_hits(poses(modes, sought.model.p_OM), shares.numpy(), sought.symmetry).argmax())
        particles, effective = sample_posterior(
            lambda drawn: BELIEF * score(sought, drawn, sought.epsilon(), soft=False),
            modes,
            shares,
            config.particles_last,
            sigma_p=config.noise_translation,
            sigma_R=2 * config.noise_rotation,
            rng=rng,
        )
        weights = torch.full((len(particles),), 1.0 / len(particles))
        return _Outcome(particles, weights, effective, modes, found, shares, chosen, counts, looked_at)

    def _exact(self, observation: Observation, label: str, model: Appearance, particles: Particles) -> Counts:
        """Counts from a render of each pose by itself, at the observation's own pixels."""
        epsilon = observation.tolerance.epsilon(self._config.epsilon)
        rows = [
            count_picture(observation, self._renderer.depth(label, X_CO, observation.camera), epsilon)
            for X_CO in poses(particles, model.p_OM)
        ]
        return Counts(*(torch.cat([getattr(row, f.name) for row in rows]) for f in dataclasses.fields(Counts)))


def _held_near(sought: Sought, modes: Particles, held: Particles) -> Tensor:
    """(m,): share of a prior's particles about each mode."""
    X_COs, p_OM = poses(held, sought.model.p_OM), sought.model.p_OM
    even = np.full(len(X_COs), 1 / len(X_COs))
    return torch.tensor([near_share(X_CO, X_COs, even, sought.symmetry, ABOUT) for X_CO in poses(modes, p_OM)])


@dataclasses.dataclass(frozen=True, eq=False)
class _Outcome:
    """What a search came to."""

    particles: Particles
    weights: Tensor
    """(n,), of the particles."""
    effective: float
    modes: Particles
    """(m,)."""
    scores: Tensor
    """(m,): log-likelihoods of the modes, times their priors."""
    shares: Tensor
    """(m,): probabilities of the modes."""
    chosen: int
    """The mode that is the estimate."""
    counts: Counts
    """Of the modes."""
    looked_at: Observation
    """What the counts are of."""

    @property
    def of_chosen(self) -> Counts:
        """Counts of the estimate, (1,)."""
        fields = dataclasses.fields(self.counts)
        return Counts(*(getattr(self.counts, f.name)[self.chosen : self.chosen + 1] for f in fields))

    @property
    def best(self) -> float:
        """The estimate's score, to be compared with that of another search in the same observation."""
        return float(self.scores[self.chosen])

    def likelihood(self, config: FilterConfig) -> float:
        """Of the estimate, in [0, 1]."""
        told = paper_likelihood if config.score == "inliers" else confidence
        return float(np.clip(float(told(self.of_chosen, self.looked_at.n)[0]), 0.0, 1.0))


def _told(frame: Frame, sought: Sought, found: _Outcome) -> PoseEstimate:
    """The same in the world frame, and what it says of itself."""
    counts, n, symmetry, p_OM = found.counts, found.looked_at.n, sought.symmetry, sought.model.p_OM
    of_modes, p_modes = to_world(found.modes, frame, p_OM), found.shares.double().numpy()
    order = np.argsort(-p_modes, kind="stable")
    of_terms = terms(counts, found.looked_at)[order].numpy()
    counts = found.of_chosen
    _, close, _, sides = terms(counts, found.looked_at)[0].tolist()
    X_WOs, X_WO = to_world(found.particles, frame, p_OM), of_modes[found.chosen]
    p = found.weights.double().numpy()
    p = p / p.sum()
    shift = np.sqrt(p @ ((X_WOs[:, :3, 3] - X_WO[:3, 3]) ** 2).sum(-1))
    angle = np.sqrt(p @ rotation_error(X_WOs[:, :3, :3], X_WO[:3, :3], symmetry) ** 2)
    features = {
        "inliers": float(counts.inliers[0]),
        "free_space": float(counts.free_space[0]),
        "occluded": float(counts.occluded[0]),
        "rendered": float(counts.rendered[0]),
        "observed": float(n),
        "close": close,
        "sides": sides,
        "effective_sample_size": found.effective,
        "translation_std_m": float(shift),
        "rotation_std_rad": float(angle),
        "near_share": near_share(X_WO, X_WOs, p, symmetry),
        "mode_entropy_nats": float(-(p_modes * np.log(np.maximum(p_modes, 1e-300))).sum()),
    }
    return PoseEstimate(
        PoseBelief(readonly(X_WOs), readonly(p)),
        readonly(X_WO),
        found.likelihood(sought.config),
        Modes(readonly(of_modes[order]), readonly(p_modes[order]), readonly(of_terms)),
        tuple(features.items()),
    )


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
    names = ("inliers", "free_space", "occluded", "rendered", "observed", "close", "sides", "effective_sample_size")
    spread = belief.X_WOs[:, :3, 3].std(axis=0)
    features = (
        *((name, 0.0) for name in names),
        ("translation_std_m", float(np.linalg.norm(spread))),
        ("rotation_std_rad", float(np.pi)),
        ("near_share", 0.0),
        ("mode_entropy_nats", 0.0),
    )
    modes = Modes(readonly(best[None]), readonly(np.ones(1)), readonly(np.zeros((1, len(TERMS)))))
    return PoseEstimate(belief, readonly(best), 0.0, modes, features)
