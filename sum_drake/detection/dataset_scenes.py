"""The scenes of the data set: drawn from a seed, rendered by RenderEngineVtk, annotated from its label image.

Three kinds of scene: the sorting station itself, with the robot, its table, bins and head camera (a quarter of the
scenes, none in `shift`); a table of any look onto which things are poured; the same with things tossed. Lights,
shading, colours and textures hold for a scene, since an engine's lights are fixed; camera, exposure, colour balance,
blur, noise and compression differ by view.

What the splits train, validation and test have in common, and `shift` never shows:

==========  =========================================  ===================================================
            train, validation, test                    shift
==========  =========================================  ===================================================
lights      1 to 4, directional or points, nearly      1 to 3 spots, each of a strong colour
            white
shading     Phong, or plain PBR (3 of 10 scenes)       PBR with cast shadows and filmic tone mapping
textures    `textures.TRAIN`                           `textures.SHIFT`
shapes      `distractors.TRAIN`                        `distractors.SHIFT`
==========  =========================================  ===================================================

Common to all are a weak light at the camera, plain colours and the objects themselves. An environment map would be one
more shading; in software its preparation takes minutes a scene.
"""

import dataclasses
import functools
import threading
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    Box,
    Rgba,
)
from pydrake.math import RigidTransform

from sum_drake import robot
from sum_drake.detection.arrangement import TABLE, Body, Ground, pour, toss
from sum_drake.detection.dataset import (
    AnnotatedImage,
    AnnotatedObject,
    EncodedImage,
    encode_depth,
    scene_entropy,
)
from sum_drake.detection.developing import develop, jpeg
from sum_drake.detection.distractors import box, drake_mesh, draw_distractor
from sum_drake.detection.looks import direction, draw_look
from sum_drake.detection.scene_rendering import (
    SENSOR,
    Part,
    SceneRenderer,
    ShownScene,
    body_of,
    home_state,
    station_ground,
    station_parts,
)
from sum_drake.detection.textures import draw_color, draw_texture
from sum_drake.geometry import inverse, mask_box, rotation_from_vector, transform
from sum_drake.look import station_look
from sum_drake.objects import Catalogue, ObjectModel
from sum_drake.rendering import DepthRenderer
from sum_drake.sensor import DepthNoiseConfig, add_depth_noise
from sum_drake.types import Array, Camera
from sum_drake.visual_mesh import visual_mesh

WIDTH, HEIGHT = 640, 480
MAX_OBJECTS = 15
TABLE_CENTER = (0.7, 0.0)
"""Of tables other than the station's: x and y in W, metres."""


def render_scene(catalogue: Catalogue, split: str, seed: int, index: int, views: int) -> list[AnnotatedImage]:
    """Pictures of scene `index` of a split: a function of the arguments; fewer views are the first of more.

    Raises InputError for an unknown split and RuntimeError where nothing can be rendered.
    """
    images = render_encoded(catalogue, split, seed, index, views)
    return [image.decode(f"{split}/{index:05d}/{view}") for view, image in enumerate(images)]


def render_encoded(catalogue: Catalogue, split: str, seed: int, index: int, views: int) -> list[EncodedImage]:
    """The same as bytes, as they are written to disk."""
    entropy = scene_entropy(seed, split, index)
    scene = _draw_scene(catalogue, np.random.default_rng([*entropy, 0]), shift=split == "shift")
    renderer = SceneRenderer(scene)
    return [_take(scene, renderer, catalogue, np.random.default_rng([*entropy, 1 + view])) for view in range(views)]


def render_empty_station(catalogue: Catalogue, seed: int, views: int) -> list[AnnotatedImage]:
    """Pictures of the station in its own light with nothing on its table."""
    scene = _Scene((), station_parts(), station_look(), True, True, station_ground(1))
    renderer = SceneRenderer(scene)
    taken = [_take(scene, renderer, catalogue, np.random.default_rng([seed, view])) for view in range(views)]
    return [image.decode(f"empty/{view}") for view, image in enumerate(taken)]


# --- what is in a scene ----------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True, eq=False)
class _Scene(ShownScene):
    """All that the views of a scene share."""

    station: bool
    own_light: bool
    """Whether it is the station in its own light, whose pictures need no developing."""
    ground: Ground


def _draw_scene(catalogue: Catalogue, rng: np.random.Generator, *, shift: bool) -> _Scene:
    kind = rng.choice(["station", "poured", "tossed"], p=[0.0, 0.55, 0.45] if shift else [0.25, 0.4, 0.35])
    count = int(rng.integers(1, min(MAX_OBJECTS, len(catalogue)) + 1)) if rng.random() > 0.03 else 0
    labels = [catalogue.labels[i] for i in rng.permutation(len(catalogue))[:count]]
    others = int(rng.integers(0, 5))
    if kind == "station" and rng.random() < 0.6:
        others = 0
    shapes = [draw_distractor(rng, shift=shift) for _ in range(others)]
    textures = [draw_texture(rng, shift=shift) for _ in range(others)]
    bodies = [body_of(catalogue[label]) for label in labels]
    bodies += [Body(float(rng.uniform(0.1, 0.6)), (shape.vertices,)) for shape in shapes]
    ground = station_ground(len(bodies)) if kind == "station" else _draw_ground(len(bodies), str(kind), rng)
    order = rng.permutation(len(bodies))
    arrange = toss if kind == "tossed" else pour
    found = arrange([bodies[i] for i in order], ground, rng)
    X_WOs = dict(zip(order.tolist(), found, strict=True))

    objects = tuple(
        (label, visual_mesh(catalogue[label]), X_WO) for i, label in enumerate(labels) if (X_WO := X_WOs[i]) is not None
    )
    parts = [
        Part(drake_mesh(shape, texture), RigidTransform(X_WO))
        for i, (shape, texture) in enumerate(zip(shapes, textures, strict=True), len(labels))
        if (X_WO := X_WOs[i]) is not None
    ]
    if kind == "station":
        parts += station_parts()
        own_light = bool(rng.random() < 0.5)  # There the detector will work.
    else:
        parts += _draw_room(ground, rng, shift=shift)
        own_light = False
    look = station_look() if own_light else draw_look(rng, np.array([*TABLE_CENTER, TABLE]), shift=shift)
    return _Scene(objects, tuple(parts), look, kind == "station", own_light, ground)


def _draw_ground(count: int, kind: str, rng: np.random.Generator) -> Ground:
    center, half = np.array(TABLE_CENTER), rng.uniform([0.3, 0.4], [0.6, 0.8])
    area = max(count, 1) * rng.uniform(0.006, 0.03) * (2.0 if kind == "tossed" else 1.0)
    aspect = rng.uniform(0.6, 1.6)
    region = np.clip(np.sqrt(area) / 2 * np.array([aspect, 1 / aspect]), 0.06, half - 0.1)
    return Ground(center, half, center + rng.uniform(-1, 1, 2) * 0.5 * (half - 0.05 - region), region)


def _draw_room(ground: Ground, rng: np.random.Generator, *, shift: bool) -> list[Part]:
    """A table with a textured top, on legs or on a cabinet, a floor, and now and then walls."""

    def plain(size: ArrayLike, p: ArrayLike) -> Part:
        return Part(Box(np.array(size)), RigidTransform(np.array(p)), Rgba(*draw_color(rng), 1.0))

    def textured(size: ArrayLike, p: ArrayLike) -> Part:
        texture = draw_texture(rng, shift=shift, size=512)
        return Part(drake_mesh(box(*np.array(size)), texture), RigidTransform(np.array(p)))

    (cx, cy), (hx, hy) = ground.center, ground.half
    thick = rng.uniform(0.02, 0.06)
    high = TABLE - thick
    parts = [textured([2 * hx, 2 * hy, thick], [cx, cy, TABLE - thick / 2])]
    if rng.random() < 0.5:
        parts.append(plain([2 * hx - 0.06, 2 * hy - 0.06, high], [cx, cy, high / 2]))
    else:
        corners = [(sx * (hx - 0.05), sy * (hy - 0.05)) for sx in (-1, 1) for sy in (-1, 1)]
        parts += [plain([0.05, 0.05, high], [cx + x, cy + y, high / 2]) for x, y in corners]
    far = rng.uniform(2.3, 3.5)
    floor = textured if rng.random() < 0.7 else plain
    parts.append(floor([2 * far, 2 * far, 0.02], [cx, cy, -0.01]))
    if rng.random() < 0.6:
        for axis, sign in ((0, -1), (0, 1), (1, -1), (1, 1)):
            p, size = np.array([cx, cy, 1.25]), np.array([2 * far, 2 * far, 2.5])
            p[axis] += sign * far
            size[axis] = 0.02
            wall = textured if rng.random() < 0.5 else plain
            parts.append(wall(size, p))
    return parts


def _take(scene: _Scene, renderer: SceneRenderer, catalogue: Catalogue, rng: np.random.Generator) -> EncodedImage:
    """One view: a camera, what it sees, and what is on it."""
    for _ in range(10):
        camera, X_WC = _draw_camera(scene, rng)
        depth = renderer.depth(camera, X_WC)
        # Otherwise something stands right before it; after ten such places the last one will do.
        if np.mean((depth > 0) & (depth < 0.3)) < 0.02:
            break
    labels = renderer.labels(camera, X_WC)
    objects = _annotate(scene, labels, camera, X_WC, catalogue)
    degrade = rng.random() < (0.5 if scene.own_light else 1.0)
    color = renderer.color(camera, X_WC)
    data = develop(color, rng) if degrade else jpeg(color, 97)
    seen = np.where(depth >= SENSOR.depth_min, depth, 0.0)
    noisy = add_depth_noise(seen, camera, rng, DepthNoiseConfig())
    return EncodedImage(data, encode_depth(noisy), camera, objects)


def _draw_camera(scene: _Scene, rng: np.random.Generator) -> tuple[Camera, Array]:
    """Intrinsics and X_WC: at the station mostly the robot's own, else anywhere around the table."""
    head = rng.random() < (0.6 if scene.station else 0.2)
    f = SENSOR.focal_length
    if head:
        X_WC = robot.camera_pose(home_state())
        away = rng.choice([0.0, 1.0], p=[0.4, 0.6]) if scene.station else 2.0
        p = X_WC[:3, 3] + away * rng.normal(0, 0.03, 3)
        R = X_WC[:3, :3] @ rotation_from_vector(away * rng.normal(0, 0.03, 3))
        f *= 1 + away * rng.uniform(-0.08, 0.08)
        X_WC = transform(R, p)
    else:
        backward = direction(rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(20, 80)))
        middle = np.array([*scene.ground.region_center, TABLE + 0.05]) + rng.normal(0, 0.06, 3)
        X_WC = _looking(middle + rng.uniform(0.6, 1.4) * backward, middle, rng.normal(0, 0.08))
        f *= rng.uniform(0.85, 1.25)
    return Camera(WIDTH, HEIGHT, f, f, (WIDTH - 1) / 2, (HEIGHT - 1) / 2), X_WC


def _looking(p_WC: Array, p_WT: Array, roll: float) -> Array:
    """X_WC of a camera at p_WC that looks at p_WT, the world's up towards the top of the picture but for `roll`."""
    z = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R_WC = np.stack([x, np.cross(z, x), z], axis=1)
    return transform(R_WC @ rotation_from_vector(np.array([0.0, 0.0, roll])), p_WC)


# --- annotation ------------------------------------------------------------------------------------------------------


def _annotate(
    scene: _Scene, labels: NDArray[np.int16], camera: Camera, X_WC: Array, catalogue: Catalogue
) -> tuple[AnnotatedObject, ...]:
    """Box and visible share of every object of which a pixel shows."""
    X_CW, alone = inverse(X_WC), _alone(catalogue.path, catalogue.models, threading.get_ident())
    wide, margin = _wide(camera)
    found = []
    for i, (label, _, X_WO) in enumerate(scene.objects):
        own = labels == i + 1
        if not own.any():
            continue
        whole = alone.depth(label, X_CW @ X_WO, wide) > 0
        shown = np.pad(labels[::_STRIDE, ::_STRIDE] == i + 1, margin)
        share = int(np.count_nonzero(shown)) / max(int(np.count_nonzero(whole | shown)), 1)
        found.append(AnnotatedObject(label, mask_box(own), round(share, 4), int(np.count_nonzero(own))))
    return tuple(found)


_STRIDE = 2
"""Visible shares are counted on every second pixel of every second row."""


def _wide(camera: Camera) -> tuple[Camera, int]:
    """The camera with every second pixel and, on all sides, a margin of so many more."""
    margin = camera.width // _STRIDE // 4
    return Camera(
        camera.width // _STRIDE + 2 * margin, camera.height // _STRIDE + 2 * margin,
        camera.fx / _STRIDE, camera.fy / _STRIDE, camera.cx / _STRIDE + margin, camera.cy / _STRIDE + margin,
    ), margin  # fmt: skip


@functools.lru_cache(maxsize=1)
def _alone(path: Path, models: tuple[ObjectModel, ...], thread: int) -> DepthRenderer:
    """Renders objects alone. VTK's engines belong to the thread that made them."""
    return DepthRenderer(Catalogue(path, models), faces=20_000)
