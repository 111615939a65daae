"""Poses of what labelled boxes of one frame hold: the estimator of the sorting robot, without robot or scene."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from sum_drake.belief import Estimator
from sum_drake.boxes import distance, measured
from sum_drake.drawing import Image, draw_perception
from sum_drake.existence import track_probability
from sum_drake.filtering import PoseEstimate, PoseRequest
from sum_drake.frame_folder import LabelledBox
from sum_drake.geometry import inverse, transform
from sum_drake.objects import Catalogue
from sum_drake.types import (
    Array,
    Box,
    Camera,
    Detection,
    Frame,
    Immutable,
    Perception,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)

LEAST_MODE = 0.02
"""Probability of a mode that is told."""
SMALLEST, LARGEST = 0.12, 4.0
"""Diagonal of a box at the depth in it, as a share of its object's: what is less or more is of another unit."""


@dataclasses.dataclass(frozen=True, eq=False)
class Mode(Immutable):
    """A pose among rivals."""

    X_CO: Array
    """(4, 4)."""
    probability: float
    """Share of the belief that is nearest to it."""


@dataclasses.dataclass(frozen=True, eq=False)
class Estimate(Immutable):
    """What is made of one box."""

    label: str
    box: Box
    X_CO: Array
    """(4, 4)."""
    probability: float
    """That the object is there and within 2 cm and 20 degrees of X_CO."""
    accepted: bool
    score: float
    """Likelihood of the pose, in [0, 1]."""
    translation_std_m: float
    rotation_std_rad: float
    effective_sample_size: float
    """Share of the draws that the belief was made from, in [0, 1]."""
    mode_entropy_nats: float
    """Of the modes' probabilities."""
    modes: tuple[Mode, ...]
    """The rival poses, likeliest first; none where nothing could be estimated."""
    message: str
    """Why nothing could be estimated; empty where something was."""


def estimate_frame(
    frame: Frame,
    boxes: Sequence[LabelledBox],
    catalogue: Catalogue,
    estimator: Estimator,
    *,
    seed: int,
    threshold: float = 0.5,
) -> list[Estimate]:
    """One estimate a box, in their order. A box that nothing can be said of has probability 0 and says why.

    Several boxes may hold objects of one label. threshold: least probability of what is accepted.
    """
    problems = [_problem(frame, one, catalogue) for one in boxes]
    asked = [i for i, problem in enumerate(problems) if not problem]
    requests = [PoseRequest(boxes[i].label, boxes[i].box, np.random.default_rng([seed, i])) for i in asked]
    found = dict(zip(asked, estimator.estimate_all(frame, requests), strict=True))
    return [
        _estimate(frame, one, found[i], threshold) if i in found else _nothing(frame, one, problems[i])
        for i, one in enumerate(boxes)
    ]


def _problem(frame: Frame, one: LabelledBox, catalogue: Catalogue) -> str:
    """Why a box cannot be looked into; empty where it can."""
    if one.label not in catalogue:
        return f"the catalogue has no '{one.label}'; expected one of {', '.join(catalogue.labels)}"
    x, y, w, h = one.box
    if w <= 0 or h <= 0:
        return "the box is empty"
    if x >= frame.camera.width or y >= frame.camera.height or x + w <= 0 or y + h <= 0:
        return f"the box lies outside the picture of {frame.camera.width} x {frame.camera.height} pixels"
    if not len(measured(frame, one.box)):
        return "no depth was measured in the box"
    across = np.hypot(w / frame.camera.fx, h / frame.camera.fy) * distance(frame, one.box)
    ratio = across / float(np.linalg.norm(catalogue[one.label].dimensions))
    if SMALLEST <= ratio <= LARGEST:
        return ""
    return (
        f"the box, at the depth in it, is {ratio:.2g} times as large as the object; expected a box about it, and depth "
        "(camera.json's depth_scale) and meshes in metres"
    )


def pose_probability(p_box: float, p_label: float, found: PoseEstimate) -> float:
    """P(the object is there, and within 2 cm and 20 degrees of the estimate), from p(b | z) and p(o | b, z)."""
    return track_probability(p_box, p_label, found.likelihood, dict(found.features))


def _estimate(frame: Frame, one: LabelledBox, found: PoseEstimate, threshold: float) -> Estimate:
    features = dict(found.features)
    probability = pose_probability(one.score, 1.0, found)
    if found.likelihood == 0.0:
        return _nothing(frame, one, "too little depth was measured in the box, or nothing in it is explained")
    likely = found.modes.probabilities >= LEAST_MODE
    return Estimate(
        one.label,
        one.box,
        readonly(inverse(frame.X_WC) @ found.X_WO),
        probability,
        probability >= threshold,
        found.likelihood,
        features["translation_std_m"],
        features["rotation_std_rad"],
        features["effective_sample_size"],
        features["mode_entropy_nats"],
        tuple(
            Mode(readonly(inverse(frame.X_WC) @ X_WO), float(p))
            for X_WO, p in zip(found.modes.X_WOs[likely], found.modes.probabilities[likely], strict=True)
        ),
        "",
    )


def _nothing(frame: Frame, one: LabelledBox, problem: str) -> Estimate:
    """The object stands somewhere on the ray through the box's middle, turned anyhow."""
    X_CO = transform(np.eye(3), _middle(one.box, frame.camera))
    return Estimate(one.label, one.box, readonly(X_CO), 0.0, False, 0.0, 1.0, float(np.pi), 0.0, 0.0, (), problem)


def _middle(box: Box, camera: Camera) -> Array:
    x, y, w, h = box
    return np.array([(x + w / 2 - camera.cx) / camera.fx, (y + h / 2 - camera.cy) / camera.fy, 1.0])


def draw_estimates(frame: Frame, estimates: Sequence[Estimate], catalogue: Catalogue) -> Image:
    """The frame's picture with the outlines of what was estimated, as of a run's observation; (h, w, 3) RGB."""
    tracks = tuple(
        Track(
            id=i,
            label=one.label,
            box=one.box,
            p_box=one.probability,
            p_label=1.0,
            belief=PoseBelief(readonly((frame.X_WC @ one.X_CO)[None]), readonly(np.ones(1))),
            X_WO=readonly(frame.X_WC @ one.X_CO),
            likelihood=one.score,
            probability=one.probability,
            accepted=one.accepted,
            born=0,
            seen=0,
        )
        for i, one in enumerate(estimates)
        if not one.message
    )
    detections = tuple(Detection(one.box, 1.0, ((one.label, 1.0),)) for one in estimates)
    belief = SceneBelief(0, tracks, len(tracks))
    scale = max(1, round(1280 / frame.camera.width))
    return draw_perception(Perception(0, frame, detections, (), SceneBelief(), belief, None), catalogue, scale=scale)


def estimates_table(estimates: Sequence[Estimate]) -> str:
    """Aligned text, a line an estimate."""
    if not estimates:
        return "nothing detected"
    width = max(14, *(len(one.label) for one in estimates))
    lines = [f"{'label':{width}} {'p':>5} {'score':>5}  {'x, y, z in the camera, m':24}  spread"]
    for one in estimates:
        place = ", ".join(f"{value:.3f}" for value in one.X_CO[:3, 3])
        spread = f"{1e3 * one.translation_std_m:.1f} mm, {np.degrees(one.rotation_std_rad):.0f} deg"
        said = f"{place:24}  {spread}" if not one.message else one.message
        lines.append(f"{one.label:{width}} {one.probability:5.2f} {one.score:5.2f}  {said}")
    return "\n".join(lines)
