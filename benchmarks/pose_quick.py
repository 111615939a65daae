"""Pose accuracy and cost of the filter's presets on cluttered tables, in minutes: `python benchmarks/pose_quick.py`.

Scenes are poured in simulation; their depth is rendered and goes through the sensor's noise model; boxes are those of
the visible part, each side jittered by 10 %.
"""

import argparse
import dataclasses
import json
import time

import numpy as np
from pydrake.multibody.parsing import LoadModelDirectives
from pydrake.multibody.plant import MultibodyPlantConfig

from sum_drake.assets import asset
from sum_drake.filter_config import FilterConfig, filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import inverse, pose_error, transform
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, add_depth_noise, make_camera
from sum_drake.systems.pouring import PouringConfig, pour
from sum_drake.types import Array, Box, Frame, readonly

DIRECTIVES = "package://sum_drake/scenes/sorting.dmd.yaml"
TABLE = 0.70
"""Height of the table's top in it, metres."""


@dataclasses.dataclass(frozen=True)
class Instance:
    """One object of a scene, as it truly is."""

    label: str
    X_WO: Array
    box: Box
    visible: float


def look_at(p_WC: Array, p_WT: Array) -> Array:
    """X_WC (4, 4) of a camera at p_WC that looks at p_WT, with the picture's top up."""
    z = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], -1), p_WC)


def pour_scene(catalogue: Catalogue, seed: int, count: int) -> dict[str, Array]:
    """Poses by label of `count` objects of the catalogue, poured in simulation."""
    rng = np.random.default_rng([seed, 7])
    labels = [str(label) for label in rng.permutation(catalogue.labels)[:count]]
    return pour(
        objects=[catalogue[label] for label in labels],
        directives=LoadModelDirectives(str(asset(DIRECTIVES))).directives,
        plant_config=MultibodyPlantConfig(
            time_step=0.004, contact_model="hydroelastic_with_fallback", discrete_contact_approximation="sap"
        ),
        config=PouringConfig(),
        seed=seed,
    )


def observe_scene(
    catalogue: Catalogue, renderer: DepthRenderer, X_WOs: dict[str, Array], seed: int
) -> tuple[Frame, list[Instance]]:
    """A noisy frame of objects on the table, and those of them of which at least 300 pixels are seen."""
    rng = np.random.default_rng([seed, 8])
    camera = make_camera(HeadCameraConfig())
    X_WC = look_at(np.array([0.1, 0.0, 1.35]), np.array([0.6, 0.0, 0.72]))
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1) @ X_WC[:3, :3].T
    table = (TABLE - X_WC[2, 3]) / rays[..., 2]
    depth = np.where(table > 0, table, 0.0)
    owner = np.full(depth.shape, -1)
    alone = []
    for i, (label, X_WO) in enumerate(X_WOs.items()):
        z = renderer.depth(label, inverse(X_WC) @ X_WO, camera)
        alone.append(int((z > 0).sum()))
        nearer = (z > 0) & ((depth == 0) | (z < depth))
        depth, owner = np.where(nearer, z, depth), np.where(nearer, i, owner)
    noisy = add_depth_noise(depth.astype(np.float32), camera, rng, DepthNoiseConfig())
    frame = Frame(0, np.zeros((*depth.shape, 3), np.uint8), noisy, camera, readonly(X_WC))
    instances = []
    for i, (label, X_WO) in enumerate(X_WOs.items()):
        rows, columns = np.nonzero(owner == i)
        if len(rows) < 300:
            continue
        x, y = float(columns.min()), float(rows.min())
        w, h = float(np.ptp(columns)) + 1, float(np.ptp(rows)) + 1
        shift = rng.uniform(-0.1, 0.1, 4) * [w, h, w, h]
        box = (x + shift[0], y + shift[1], w + shift[2] - shift[0], h + shift[3] - shift[1])
        instances.append(Instance(label, X_WO, box, len(rows) / alone[i]))
    return frame, instances


def evaluate(config: FilterConfig, seeds: range, count: int, *, verbose: bool = False) -> dict[str, float]:
    """Shares within (1 cm, 10), (2 cm, 20), (5 cm, 30 degrees), symmetry-aware, and CPU seconds an object."""
    catalogue = load_catalogue()
    renderer = DepthRenderer(catalogue)
    estimator = PoseEstimator(catalogue, config)
    rows = []
    for seed in seeds:
        frame, instances = observe_scene(catalogue, renderer, pour_scene(catalogue, seed, count), seed)
        for i, instance in enumerate(instances):
            rng = np.random.default_rng([seed, i, 1])
            estimator.warm(instance.label)
            begin = time.process_time()
            estimate = estimator.estimate(frame, instance.box, instance.label, rng=rng)
            cost = time.process_time() - begin
            p, angle = pose_error(estimate.X_WO, instance.X_WO, catalogue[instance.label].symmetry)
            rows.append((float(p), float(np.rad2deg(angle)), instance.visible, cost))
            if verbose:
                print(
                    f"{seed:3d} {instance.label:12s} visible {instance.visible:.2f}  {1000 * p:6.1f} mm "
                    f"{np.rad2deg(angle):6.1f} deg  likelihood {estimate.likelihood:.2f}  {cost:.2f} s"
                )
    table = np.array(rows)
    right = (table[:, 0] < 0.02) & (table[:, 1] < 20)
    hidden = table[:, 2] < 0.7
    return {
        "instances": len(table),
        "within_1cm_10deg": float(((table[:, 0] < 0.01) & (table[:, 1] < 10)).mean()),
        "within_2cm_20deg": float(right.mean()),
        "within_5cm_30deg": float(((table[:, 0] < 0.05) & (table[:, 1] < 30)).mean()),
        "within_2cm_20deg_low_visibility": float(right[hidden].mean()) if hidden.any() else float("nan"),
        "cpu_s_per_object": float(table[:, 3].mean()),
    }


def main() -> None:
    """Prints one JSON line a preset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--scenes", type=int, default=5)
    parser.add_argument("--objects", type=int, default=6)
    parser.add_argument("--presets", nargs="+", default=["default"])
    parser.add_argument("--set", nargs="*", default=[], metavar="FIELD=VALUE", help="changes to the preset")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.scenes)
    for name in arguments.presets:
        config = filter_config(name)
        for change in arguments.set:
            field, value = change.split("=")
            setattr(config, field, type(getattr(config, field))(value))
        figures = evaluate(config, seeds, arguments.objects, verbose=arguments.verbose)
        print(json.dumps({"preset": name, **{key: round(value, 3) for key, value in figures.items()}}), flush=True)


if __name__ == "__main__":
    main()
