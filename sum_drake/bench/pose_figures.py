"""What `sum-drake bench pose` makes of what it measured: figures, and the curves of the paper's plots."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sum_drake.bench.aims import Aims
from sum_drake.geometry import apply, pose_error, symmetry_group
from sum_drake.objects import ObjectModel, sample_surface
from sum_drake.reliability import Reliability, reliability
from sum_drake.types import Array

BOUNDS = {"1cm_10deg": (0.01, 10.0), "2cm_20deg": (0.02, 20.0), "5cm_30deg": (0.05, 30.0)}
"""Metres and degrees."""
LOW_VISIBILITY = 0.7
"""Instances of which less is visible."""
AUC_LIMIT = 0.1
"""ADD-S at which an estimate is worth nothing, metres (Xiang et al., "PoseCNN", 2018)."""
PAPER_BOUNDS = (0.01, 0.05, 0.10, 0.20)
"""Translation bounds of the paper's four plots, metres."""
DEGREES = np.linspace(0.0, 180.0, 91)
"""Rotation bounds of their x axis."""
DRAWS = 10_000
"""Of a bootstrap."""
AIMS: Aims = {
    "default.within_2cm_20deg": ("at least", 0.90),
    "default.within_2cm_20deg_low_visibility": ("at least", 0.70),
    "default.within_1cm_10deg": ("at least", 0.85),
    "default.cpu_s_per_object": ("at most", 1.0),
    **{f"trials.lead_{100 * metres:.0f}cm_low95": ("at least", 0.001) for metres in PAPER_BOUNDS},
}
"""What the figures are to reach."""


@dataclasses.dataclass(frozen=True)
class PoseRow:
    """One estimate of one instance."""

    method: str
    scene: int
    label: str
    seed: int
    sensor: str
    visible_share: float
    wrong_box: bool
    translation_m: float
    rotation_deg: float
    """Smallest over the object's symmetry group."""
    raw_rotation_deg: float
    """Of the two orientations as they are."""
    adds_m: float
    """Mean distance of the true surface's points to the nearest of the estimate's."""
    probability: float
    """Of the estimate; nan where the method gives none."""
    cpu_s: float
    renders: int
    """Poses that were rendered."""
    X_WO: list[list[float]]
    """The estimate, 4 x 4; empty where there is none."""
    detected: bool = False
    """Whether it is of the paper's experiment, in the trained detector's box."""


def adds(model: ObjectModel, X_WA: Array, X_WB: Array, points: int = 1000) -> float:
    """ADD-S of two poses, metres: mean distance of points of the surface at A to the nearest at B (Hinterstoisser)."""
    from scipy.spatial import cKDTree

    p_OQs, _ = sample_surface(model, points, np.random.default_rng(0))
    distance, _ = cKDTree(apply(X_WB, p_OQs)).query(apply(X_WA, p_OQs))
    return float(distance.mean())


def errors(model: ObjectModel, X_WO: Array, X_true: Array) -> tuple[float, float, float, float]:
    """Translation, metres; rotation and raw rotation, degrees; ADD-S, metres."""
    shift, angle = pose_error(X_WO, X_true, model.symmetry)
    _, raw = pose_error(X_WO, X_true, symmetry_group("none"))
    return float(shift), float(np.degrees(angle)), float(np.degrees(raw)), adds(model, X_true, X_WO)


def figures(rows: Sequence[PoseRow]) -> dict[str, float]:
    """METHOD.NAME -> value. Shares are of the instances in a box of their own; nan where there are none."""
    trials, rows = [row for row in rows if row.detected], [row for row in rows if not row.detected]
    found: dict[str, float] = {}
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method and not row.wrong_box]
        hidden = [row for row in own if row.visible_share < LOW_VISIBILITY]
        for name, bounds in BOUNDS.items():
            found[f"{method}.within_{name}"] = within(own, *bounds)
            found[f"{method}.raw_within_{name}"] = within(own, *bounds, raw=True)
        found[f"{method}.within_2cm_20deg_low_visibility"] = within(hidden, *BOUNDS["2cm_20deg"])
        for sensor in sorted({row.sensor for row in own}):
            of = [row for row in own if row.sensor == sensor]
            found[f"{method}.within_2cm_20deg_{sensor}"] = within(of, *BOUNDS["2cm_20deg"])
        found[f"{method}.adds_auc"] = _mean([max(0.0, 1 - row.adds_m / AUC_LIMIT) for row in own])
        found[f"{method}.adds_within_1cm"] = _mean([row.adds_m < 0.01 for row in own])
        found[f"{method}.median_translation_m"] = _median([row.translation_m for row in own])
        found[f"{method}.median_rotation_deg"] = _median([row.rotation_deg for row in own])
        found[f"{method}.cpu_s_per_object"] = _mean([row.cpu_s for row in own])
        found[f"{method}.renders_per_object"] = _mean([row.renders for row in own])
        every = [row for row in rows if row.method == method]
        if all(np.isfinite(row.probability) for row in every):
            right = np.array([is_right(row) for row in every])
            found[f"{method}.mean_probability"] = _mean([row.probability for row in every])
            found[f"{method}.mean_probability_in_wrong_boxes"] = _mean([r.probability for r in every if r.wrong_box])
            found[f"{method}.calibration_error"] = stated(every).error
            found[f"{method}.brier"] = _mean([(row.probability - is_right(row)) ** 2 for row in every])
            found[f"{method}.brier_of_the_mean"] = float(right.mean() * (1 - right.mean()))
    return found | (trial_figures(trials) if trials else {})


def trial_figures(rows: Sequence[PoseRow]) -> dict[str, float]:
    """Of the paper's experiment: trials.METHOD.NAME, and how far the default filter leads.

    area_5cm: the mean height of a method's curve in the paper's plot for 5 cm, over rotation bounds of 0 to 180
    degrees. lead_5cm: how much larger the default filter's is than the best baseline's; low95: the lower end of its
    95 % interval, by bootstrap over scenes.
    """
    found: dict[str, float] = {
        "trials.scenes": len({row.scene for row in rows}),
        "trials.true_positives": len({(row.scene, row.label) for row in rows}),
    }
    methods = list(dict.fromkeys(row.method for row in rows))
    for method in methods:
        own = [row for row in rows if row.method == method]
        found[f"trials.{method}.within_2cm_20deg"] = within(own, *BOUNDS["2cm_20deg"])
        for metres in PAPER_BOUNDS:
            found[f"trials.{method}.area_{100 * metres:.0f}cm"] = float(curve(own, metres, DEGREES).mean())
    rivals = [method for method in methods if method.startswith("fpfh")]
    if "default" in methods and rivals:
        for metres in PAPER_BOUNDS:
            areas = {method: _areas(rows, method, metres) for method in ("default", *rivals)}
            name = f"trials.lead_{100 * metres:.0f}cm"
            found[name], found[f"{name}_low95"] = _lead(areas)
    return found


def _areas(rows: Sequence[PoseRow], method: str, metres: float) -> Array:
    """Of each scene (n, 2): the sum of the areas of a method's estimates, and how many they are."""
    own = sorted((row for row in rows if row.method == method), key=lambda row: row.scene)
    groups = [list(group) for _, group in itertools.groupby(own, key=lambda row: row.scene)]
    return np.array([[curve(group, metres, DEGREES).mean() * len(group), len(group)] for group in groups])


def _lead(areas: dict[str, Array]) -> tuple[float, float]:
    """The default filter's lead over the best of the others, and the lower end of its interval."""
    n = len(areas["default"])
    drawn = np.random.default_rng(0).integers(0, n, (DRAWS, n))
    drawn = np.concatenate([np.arange(n)[None], drawn])  # the scenes as they are come first
    shares = {method: (sums := of[drawn].sum(1))[:, 0] / sums[:, 1] for method, of in areas.items()}
    leads = shares["default"] - np.max([share for method, share in shares.items() if method != "default"], axis=0)
    return float(leads[0]), float(np.quantile(leads[1:], 0.025)) if n > 1 else float("nan")


def is_right(row: PoseRow) -> bool:
    """Whether the object is where the estimate says, within 2 cm and 20 degrees; another object's box does not help."""
    metres, degrees = BOUNDS["2cm_20deg"]
    return row.translation_m < metres and row.rotation_deg < degrees


def stated(rows: Sequence[PoseRow]) -> Reliability:
    """Of the probabilities of estimates, those in wrong boxes among them."""
    return reliability([row.probability for row in rows], [is_right(row) for row in rows])


def within(rows: Sequence[PoseRow], metres: float, degrees: float, *, raw: bool = False) -> float:
    """Share of estimates with both errors below a bound."""
    return _mean(
        [row.translation_m < metres and (row.raw_rotation_deg if raw else row.rotation_deg) < degrees for row in rows]
    )


def curve(rows: Sequence[PoseRow], metres: float, degrees: Array) -> Array:
    """Share (n,) of a method's estimates within a translation bound and rotation bounds (n,): the paper's figure 5."""
    own = [row for row in rows if not row.wrong_box]
    return curve_of([row.translation_m for row in own], [row.rotation_deg for row in own], metres, degrees)


def curve_of(translation_m: ArrayLike, rotation_deg: ArrayLike, metres: float, degrees: Array) -> Array:
    """The same (n,) of errors (m,); nan where there are none."""
    near = np.where(np.asarray(translation_m, float) < metres, np.asarray(rotation_deg, float), np.inf)
    return (near < degrees[:, None]).mean(1) if len(near) else np.full(len(degrees), np.nan)


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else float("nan")
