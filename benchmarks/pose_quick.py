"""Pose accuracy and cost of the filter's presets on cluttered tables, in minutes: `python benchmarks/pose_quick.py`.

Scenes are made without physics: objects rest on a random stable face of their convex hull (a quarter of them in any
orientation, as if leaning), close together, some behind others. Depth goes through the sensor's noise model; boxes are
those of the visible part, each side jittered by 10 %.
"""

import argparse
import dataclasses
import json
import time

import numpy as np

from sum_drake.filtering import FilterConfig, PoseEstimator, filter_config
from sum_drake.geometry import apply, inverse, pose_error, rotation_from_quaternion, rotation_from_vector, transform
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import DepthRenderer, view_rotations
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, add_depth_noise, make_camera
from sum_drake.types import Array, Box, Frame, readonly

TABLE = 0.70


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


def resting_rotation(vertices: Array, rng: np.random.Generator) -> Array:
    """A rotation (3, 3) in which the mesh stands on a face of its convex hull, likelier the larger the face."""
    import trimesh

    if rng.random() < 0.25:
        return rotation_from_quaternion(rng.normal(size=4))
    hull = trimesh.Trimesh(vertices).convex_hull
    face = rng.choice(len(hull.faces), p=hull.area_faces / hull.area)
    down = np.swapaxes(view_rotations(-hull.face_normals[face][None])[0], 0, 1)
    return rotation_from_vector(np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)])) @ down


def make_scene(catalogue: Catalogue, renderer: DepthRenderer, seed: int, count: int) -> tuple[Frame, list[Instance]]:
    """A noisy frame of `count` objects, and those of them of which at least 300 pixels are seen."""
    rng = np.random.default_rng([seed, 7])
    labels = [str(label) for label in rng.permutation(catalogue.labels)[:count]]
    camera = make_camera(HeadCameraConfig())
    X_WC = look_at(np.array([0.1, 0.0, 1.35]), np.array([0.6, 0.0, 0.72]))
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1) @ X_WC[:3, :3].T
    table = (TABLE - X_WC[2, 3]) / rays[..., 2]
    depth = np.where(table > 0, table, 0.0)
    owner = np.full(depth.shape, -1)
    placed: list[tuple[str, Array, Array, Array]] = []
    for label in labels:
        mesh = catalogue[label].load_mesh()
        vertices = np.asarray(mesh.vertices)
        for attempt in range(200):
            R = resting_rotation(vertices, rng)
            reach = 0.10 + 0.02 * count + 0.001 * attempt
            p = np.array([0.62, 0.0, 0.0]) + rng.uniform(-reach, reach, 3) * [0.6, 0.8, 0]
            p[2] = TABLE - (vertices @ R.T)[:, 2].min()
            points_W = vertices @ R.T + p
            # Boxes in the other's frame stand for the shapes: near enough for clutter that does not interpenetrate.
            free = all(
                not _meets(points_W, X, low, high) and not _meets(apply(X, _box(low, high)), transform(R, p),
                                                                  vertices.min(0), vertices.max(0))
                for _, X, low, high in placed
            )  # fmt: skip
            if free:
                placed.append((label, transform(R, p), vertices.min(0), vertices.max(0)))
                break
    alone = []
    for i, (label, X_WO, _, _) in enumerate(placed):
        z = renderer.depth(label, inverse(X_WC) @ X_WO, camera)
        alone.append(int((z > 0).sum()))
        nearer = (z > 0) & ((depth == 0) | (z < depth))
        depth, owner = np.where(nearer, z, depth), np.where(nearer, i, owner)
    noisy = add_depth_noise(depth.astype(np.float32), camera, rng, DepthNoiseConfig())
    frame = Frame(0, np.zeros((*depth.shape, 3), np.uint8), noisy, camera, readonly(X_WC))
    instances = []
    for i, (label, X_WO, _, _) in enumerate(placed):
        rows, columns = np.nonzero(owner == i)
        if len(rows) < 300:
            continue
        x, y = float(columns.min()), float(rows.min())
        w, h = float(np.ptp(columns)) + 1, float(np.ptp(rows)) + 1
        shift = rng.uniform(-0.1, 0.1, 4) * [w, h, w, h]
        box = (x + shift[0], y + shift[1], w + shift[2] - shift[0], h + shift[3] - shift[1])
        instances.append(Instance(label, X_WO, box, len(rows) / alone[i]))
    return frame, instances


def _box(low: Array, high: Array) -> Array:
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 6).T, indexing="ij"), -1)
    return grid.reshape(-1, 3)


def _meets(points_W: Array, X_WO: Array, low: Array, high: Array) -> bool:
    p = apply(inverse(X_WO), points_W)
    return bool(((p > low + 0.004) & (p < high - 0.004)).all(axis=1).any())


def evaluate(config: FilterConfig, seeds: range, count: int, *, verbose: bool = False) -> dict[str, float]:
    """Shares within (1 cm, 10), (2 cm, 20), (5 cm, 30 degrees), symmetry-aware, and CPU seconds an object."""
    catalogue = load_catalogue()
    renderer = DepthRenderer(catalogue)
    estimator = PoseEstimator(catalogue, config)
    rows = []
    for seed in seeds:
        frame, instances = make_scene(catalogue, renderer, seed, count)
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
