"""report.html of `sum-drake bench pose`: tables, the paper's plots, and the estimates that are farthest off."""

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake import page
from sum_drake.bench.aims import figure_table
from sum_drake.bench.pose_figures import AIMS, BOUNDS, PoseRow, stated, within
from sum_drake.bench.pose_methods import ABOUT
from sum_drake.bench.pose_scenes import PoseScene
from sum_drake.bench.pose_trials import Corrected
from sum_drake.bench.pose_trials_report import paper_plots, papers_part
from sum_drake.drawing import draw_depth, draw_poses
from sum_drake.objects import Catalogue
from sum_drake.plots import Series, line_plot

WORST = 24
"""Estimates shown."""
VISIBLE_EDGES = (0.3, 0.5, 0.7, 0.95, 1.01)
"""Bins of the visible share."""
SceneOf = Callable[[int], PoseScene]
"""The scene of a seed."""


def report_page(
    every: Sequence[PoseRow],
    found: Mapping[str, float],
    scene_of: SceneOf,
    catalogue: Catalogue,
    looks: Sequence[Corrected],
    why_not: str = "",
) -> str:
    """The page.

    every: rows of all methods; found: their figures; catalogue: the true meshes; looks: at the scenes of the paper's
    experiment; why_not: why there is none.
    """
    rows = [row for row in every if not row.detected]
    methods = list(dict.fromkeys(row.method for row in rows))
    instances = {(row.scene, row.label): row.wrong_box for row in rows}
    wrong = sum(instances.values())
    told = [name for name in AIMS if np.isfinite(found.get(name, np.nan))]
    parts = [
        "<h1>Poses</h1>",
        page.tiles([(_title(name), f"{found[name]:.3f}") for name in told]),
        *papers_part([row for row in every if row.detected], found, looks, why_not, catalogue),
        "<h2>In boxes that are off, with two cameras</h2>",
        f"<p>{len(instances) - wrong} instances of which at least 30 % is visible, and {wrong} boxes with a wrong "
        f"label, in {len({scene for scene, _ in instances})} poured scenes that nothing was tuned on; half are seen by "
        "a structured-light camera, whose noise was in tuning as well, half by a wide stereo camera, whose noise was "
        "not. The estimators know meshes of 1,000 faces that are "
        "up to 2 % larger or smaller than what the sensor saw, with vertices up to 3 mm off, and boxes that are up to "
        "10 % off. Symmetric orientations count as equal.</p>",
        page.table(
            ("method", *(name.replace("_", ", ") for name in BOUNDS), "2 cm, 20 deg, less than .7 visible", "ADD-S AUC",
             "median shift", "median turn", "CPU s", "renders"),
            [_method_row(name, found) for name in methods],
        ),
        page.table(("method", "what it is"), [(page.text(name), page.text(ABOUT[name])) for name in methods]),
        "<h2>Aims</h2>",
        figure_table({name: found[name] for name in told}, AIMS),
        "<h3>Within a rotation bound, at four translation bounds</h3>",
        f'<div class="plots">{"".join(paper_plots(rows, methods))}</div>',
        "<h2>By visible share, sensor and object</h2>",
        page.table(("", "instances", *methods), _breakdown(rows, methods)),
        "<h2>How far the stated probability can be trusted</h2>",
        "<p>That the object is there, and within 2 cm and 20 degrees of the estimate; in bins of equal mass, wrong "
        "boxes among them.</p>",
        f'<div class="plots">{_reliability_plot(rows, methods)}</div>',
        page.table(
            ("method", "stated on average", "in wrong boxes", "calibration error", "Brier score", "of the mean alone"),
            [_trust_row(name, found) for name in methods if f"{name}.brier" in found],
        ),
        "<h2>The default filter's worst estimates</h2>",
        '<p class="legend">Over the depth that was observed: green, the truth; red, the estimate; white, the box.</p>',
        _gallery([row for row in rows if row.method == "default" and not row.wrong_box], scene_of, catalogue),
    ]  # fmt: skip
    return page.page("Poses", parts)


def _title(name: str) -> str:
    return name.removeprefix("default.").replace("_", " ")


def _method_row(name: str, found: Mapping[str, float]) -> list[str]:
    shares = [*(f"within_{bound}" for bound in BOUNDS), "within_2cm_20deg_low_visibility", "adds_auc"]
    return [
        page.text(name),
        *(_number(found[f"{name}.{share}"]) for share in shares),
        f"{1e3 * found[f'{name}.median_translation_m']:.1f} mm",
        f"{found[f'{name}.median_rotation_deg']:.1f} deg",
        f"{found[f'{name}.cpu_s_per_object']:.2f}",
        f"{found[f'{name}.renders_per_object']:,.0f}",
    ]


def _trust_row(name: str, found: Mapping[str, float]) -> list[str]:
    told = ("mean_probability", "mean_probability_in_wrong_boxes", "calibration_error", "brier", "brier_of_the_mean")
    return [page.text(name), *(_number(found[f"{name}.{one}"]) for one in told)]


def _reliability_plot(rows: Sequence[PoseRow], methods: Sequence[str]) -> str:
    share = (0.0, 1.0)
    lines = [Series("", share, share, dashed=True)]
    for name in methods:
        of = [row for row in rows if row.method == name]
        if all(np.isfinite(row.probability) for row in of):
            found = stated(of)
            lines.append(Series(name, found.stated, found.observed, dots=True))
    return line_plot(
        lines,
        title="Stated and observed",
        x_label="stated probability",
        y_label="share that is right",
        x_range=share,
        y_range=share,
        size=(525, 330),
    )


def _breakdown(rows: Sequence[PoseRow], methods: Sequence[str]) -> list[list[str]]:
    own = [row for row in rows if not row.wrong_box]
    groups: dict[str, list[PoseRow]] = {}
    for low, high in itertools.pairwise(VISIBLE_EDGES):
        groups[f"visible {low:g} to {min(high, 1):g}"] = [row for row in own if low <= row.visible_share < high]
    for sensor in sorted({row.sensor for row in own}):
        groups[sensor.replace("_", " ")] = [row for row in own if row.sensor == sensor]
    for label in sorted({row.label for row in own}):
        groups[label] = [row for row in own if row.label == label]
    return [
        [
            page.text(name),
            str(len({(row.scene, row.label) for row in group})),
            *(_number(within([row for row in group if row.method == m], *BOUNDS["2cm_20deg"])) for m in methods),
        ]
        for name, group in groups.items()
    ]


def _gallery(rows: Sequence[PoseRow], scene_of: SceneOf, catalogue: Catalogue) -> str:
    scene = functools.lru_cache(maxsize=4)(scene_of)
    worst = sorted(rows, key=lambda row: (-row.adds_m, row.scene, row.label, row.seed))[:WORST]
    figures = []
    for row in worst:
        words = (
            f"scene {row.scene}, {row.label}: {1e3 * row.translation_m:.0f} mm, {row.rotation_deg:.0f} deg, "
            f"{row.visible_share:.0%} visible, {row.sensor.replace('_', ' ')}, stated probability {row.probability:.2f}"
        )
        shown = page.picture(_picture(row, scene(row.scene), catalogue), words)
        figures.append(f"<figure>{shown}<figcaption>{page.text(words)}</figcaption></figure>")
    return f'<div class="gallery">{"".join(figures)}</div>'


def _picture(row: PoseRow, scene: PoseScene, catalogue: Catalogue) -> NDArray[np.uint8]:
    """The part of the scene about the box."""
    (instance,) = (one for one in scene.instances if one.label == row.label)
    poses = [(instance.X_WO, (60, 220, 90))]
    if row.X_WO:
        poses.append((np.array(row.X_WO), (250, 60, 50)))
    image = draw_poses(draw_depth(scene.frame.depth), scene.frame, catalogue[row.label], poses)
    scale = image.shape[1] / scene.frame.camera.width
    x, y, w, h = (round(scale * side) for side in instance.box)
    cv2.rectangle(image, (x, y), (x + w, y + h), (255, 255, 255), 1)
    margin = max(w, h)
    left, top = max(0, x - margin), max(0, y - margin)
    return np.ascontiguousarray(image[top : y + h + margin, left : x + w + margin])


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.3f}"
