"""Scenes on which poses are measured: what the sensor sees is not what the estimator is told.

Objects are poured; what is observed is rendered from their true meshes and goes through a depth sensor's noise, in half
of the scenes that of a stereo camera, which is another one in scenes for tuning than in the bench's. The estimator gets
other meshes (1,000 faces, up to 2 % larger or smaller, vertices up to 3 mm off) and boxes whose sides are off by up to
10 %, a few of them another object's. It gets no masks, and no pose to start from.
"""

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sum_drake.detection.arrangement import TABLE, Body, Ground, pour
from sum_drake.geometry import inverse, mask_box, transform
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer, coarse, mesh_arrays
from sum_drake.seeds import derive
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, add_depth_noise, make_camera
from sum_drake.types import Array, Box, Camera, Frame, Immutable, readonly

STEREO = DepthNoiseConfig(
    axial_constant=0.0008, axial_quadratic=0.0035, baseline=0.05, disparity_step=0.0625, lateral=0.6, edge_erosion=3,
    edge_dropout=0.6, grazing_start=1.15, grazing_end=1.4, dropout=0.01,
)  # fmt: skip
"""A stereo camera: noise that grows faster with distance, foregrounds eroded on one side, more holes."""
WIDE_STEREO = DepthNoiseConfig(
    axial_constant=0.0005, axial_quadratic=0.0045, baseline=0.095, disparity_step=0.1, lateral=0.8, edge_erosion=2,
    edge_dropout=0.7, grazing_start=1.1, grazing_end=1.35, dropout=0.02,
)  # fmt: skip
"""Another, of the bench's scenes alone."""
SENSORS = {"structured_light": DepthNoiseConfig(), "stereo": STEREO, "wide_stereo": WIDE_STEREO}
FIRST_SCENE = 1000
"""Seed of the bench's first scene; those before are for tuning."""
LEAST_VISIBLE, LEAST_PIXELS = 0.3, 300
WRONG_BOXES = 0.05
"""Share of instances that are given another object's box."""
JITTER = 0.1
"""Most that a side of a box is off, as a share of the box's size."""


@dataclasses.dataclass(frozen=True, eq=False)
class Instance(Immutable):
    """One object of a scene."""

    label: str
    X_WO: Array
    """(4, 4): truth."""
    box: Box
    """As a detector would give it."""
    visible_share: float
    wrong_box: bool
    """Whether the box is that of another object."""


@dataclasses.dataclass(frozen=True, eq=False)
class PoseScene(Immutable):
    """What was observed of one scene, and what is in it."""

    seed: int
    frame: Frame
    instances: tuple[Instance, ...]
    sensor: str
    """One of SENSORS."""


def pose_scene(catalogue: Catalogue, renderer: DepthRenderer, seed: int) -> PoseScene:
    """A scene of 5 to 10 objects. catalogue: the true meshes; renderer: of the same."""
    rng = np.random.default_rng([derive(seed, "pose scene")])
    labels = [catalogue.labels[i] for i in rng.permutation(len(catalogue))[: int(rng.integers(5, 11))]]
    X_WOs = _pour(catalogue, labels, rng)
    camera, X_WC = make_camera(HeadCameraConfig()), viewpoint(rng)
    depth, owner, alone = _compose(renderer, X_WOs, camera, X_WC)
    sensor = "structured_light" if seed % 2 == 0 else "stereo" if seed < FIRST_SCENE else "wide_stereo"
    noisy = add_depth_noise(depth, camera, rng, SENSORS[sensor])
    frame = Frame(0, np.zeros((*depth.shape, 3), np.uint8), noisy, camera, readonly(X_WC))
    boxes = {
        label: mask_box(owner == i) for i, label in enumerate(X_WOs) if np.count_nonzero(owner == i) >= LEAST_PIXELS
    }
    instances = []
    for i, (label, X_WO) in enumerate(X_WOs.items()):
        share = float(np.count_nonzero(owner == i)) / max(alone[i], 1)
        others = [other for other in boxes if other != label]
        wrong = bool(rng.random() < WRONG_BOXES)
        jitter = rng.uniform(-JITTER, JITTER, 4)
        of = others[int(rng.integers(len(others)))] if wrong and others else label
        if label in boxes and share >= LEAST_VISIBLE:
            instances.append(Instance(label, X_WO, _jittered(boxes[of], jitter), share, of != label))
    return PoseScene(seed, frame, tuple(instances), sensor)


def _pour(catalogue: Catalogue, labels: list[str], rng: np.random.Generator) -> dict[str, Array]:
    half = np.array([0.15, float(np.clip(len(labels) * 0.012 / 0.6, 0.13, 0.3))])
    ground = Ground(np.array([0.72, 0.0]), np.array([0.30, 0.45]), np.array([0.60, 0.0]), half)
    bodies = []
    for label in labels:
        model = catalogue[label]
        pieces = tuple(np.asarray(piece.vertices) for piece in model.load_collision())
        bodies.append(Body(model.mass if model.mass is not None else 0.3, pieces))
    found = pour(bodies, ground, rng)
    return {label: X_WO for label, X_WO in zip(labels, found, strict=True) if X_WO is not None}


def viewpoint(rng: np.random.Generator) -> Array:
    """X_WC of a camera that looks at the table's middle from the robot's side, at the height of a head."""
    azimuth, elevation = rng.uniform(-0.9, 0.9) + np.pi, np.radians(rng.uniform(30, 65))
    backward = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    p_WT = np.array([0.6, 0.0, TABLE + 0.04]) + rng.normal(0, 0.02, 3)
    z = -backward
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], -1), p_WT + rng.uniform(0.7, 1.1) * backward)


def _compose(
    renderer: DepthRenderer, X_WOs: dict[str, Array], camera: Camera, X_WC: Array
) -> tuple[NDArray[np.float32], NDArray[np.int64], list[int]]:
    """Perfect depth (h, w), whose object each pixel shows (-1: none), and how many pixels each would have alone."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1) @ X_WC[:3, :3].T
    depth = np.zeros(u.shape)
    for height, low, high in ((TABLE, (0.42, -0.45), (1.02, 0.45)), (0.0, (-9, -9), (9, 9))):
        z = (height - X_WC[2, 3]) / np.minimum(rays[..., 2], -1e-9)
        p_W = X_WC[:2, 3] + z[..., None] * rays[..., :2]
        hit = (rays[..., 2] < 0) & (p_W >= low).all(-1) & (p_W <= high).all(-1) & (depth == 0)
        depth = np.where(hit, z, depth)
    owner, alone = np.full(depth.shape, -1), []
    for i, (label, X_WO) in enumerate(X_WOs.items()):
        z = renderer.depth(label, inverse(X_WC) @ X_WO, camera)
        alone.append(int((z > 0).sum()))
        nearer = (z > 0) & ((depth == 0) | (z < depth))
        depth, owner = np.where(nearer, z, depth), np.where(nearer, i, owner)
    return np.where(depth < HeadCameraConfig().depth_max, depth, 0).astype(np.float32), owner, alone


def _jittered(box: Box, jitter: Array) -> Box:
    x, y, w, h = box
    left, top, right, bottom = jitter * [w, h, w, h]
    return x + left, y + top, w + right - left, h + bottom - top


def other_meshes(catalogue: Catalogue, folder: Path, seed: int) -> Catalogue:
    """The same objects with meshes that are a little off, written into a folder."""
    models = []
    for label in catalogue.labels:
        rng = np.random.default_rng([derive(seed, f"mesh of {label}")])
        vertices, faces = coarse(*mesh_arrays(catalogue, label), 1000)
        middle = vertices.mean(0)
        vertices = middle + (vertices - middle) * rng.uniform(0.98, 1.02)
        direction = rng.normal(size=vertices.shape)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        vertices = vertices + 0.003 * rng.random((len(vertices), 1)) * direction
        lines = ["v {:.6f} {:.6f} {:.6f}".format(*vertex) for vertex in vertices]
        lines += ["f {} {} {}".format(*face) for face in (faces + 1).tolist()]
        file = folder / f"{label}.obj"
        file.write_text("\n".join(lines) + "\n")
        models.append(dataclasses.replace(catalogue[label], mesh=file))
    return Catalogue(folder / "catalogue.yaml", tuple(models))
