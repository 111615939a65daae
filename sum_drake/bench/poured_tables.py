"""Tables that are looked at again and again, as the sorting robot's camera does, while things on them change.

Objects of the catalogue, and others that no label fits, are poured onto the station's table. A look renders colour and
depth through a sensor's noise. There is no robot in motion and no plant between looks: what changes is said, and what
nothing holds falls.
"""

import dataclasses
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Mesh

from sum_drake import robot
from sum_drake.bench.pose_scenes import viewpoint
from sum_drake.detection.arrangement import TABLE, Body, Ground, pour, settle
from sum_drake.detection.developing import jpeg
from sum_drake.detection.distractors import drake_mesh, draw_distractor
from sum_drake.detection.scene_rendering import (
    SceneRenderer,
    ShownScene,
    body_of,
    home_state,
    station_ground,
    station_parts,
)
from sum_drake.detection.textures import draw_texture
from sum_drake.look import station_look
from sum_drake.objects import Catalogue
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, add_depth_noise, make_camera
from sum_drake.types import Array, Frame, Immutable, Region, readonly
from sum_drake.visual_mesh import visual_mesh

TABLE_TOP = Region("table", readonly(np.array([0.72, 0.0, TABLE + 0.25])), readonly(np.array([0.30, 0.45, 0.25])))
"""The station's."""
SETTLING = 1.5
"""Seconds that what was let go gets to come to rest."""


@dataclasses.dataclass(frozen=True, eq=False)
class Thing(Immutable):
    """Something on the table."""

    name: str
    """An object's label, or one of its own for what no label fits."""
    is_object: bool
    """Whether the catalogue has it."""
    body: Body
    mesh: Mesh
    X_WO: Array
    """(4, 4)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Table(Immutable):
    """What truly is there."""

    ground: Ground
    things: tuple[Thing, ...]

    @property
    def X_WOs(self) -> dict[str, Array]:
        """Poses of the catalogue's objects, by label."""
        return {thing.name: thing.X_WO for thing in self.things if thing.is_object}


def pour_table(catalogue: Catalogue, rng: np.random.Generator, *, objects: int, others: int = 0) -> Table:
    """A table onto which so many objects of different labels, and so many other things, were poured; some may roll off.

    Of the other things half have shapes and textures that the detector was not trained on.
    """
    labels = [catalogue.labels[i] for i in rng.permutation(len(catalogue))[:objects]]
    things = [
        Thing(label, True, body_of(catalogue[label]), visual_mesh(catalogue[label]), np.eye(4)) for label in labels
    ]
    for i in range(others):
        shift = bool(i % 2)
        shape, texture = draw_distractor(rng, shift=shift), draw_texture(rng, shift=shift)
        body = Body(float(rng.uniform(0.1, 0.6)), (shape.vertices,))
        things.append(Thing(f"other{i}", False, body, drake_mesh(shape, texture), np.eye(4)))
    things = [things[i] for i in rng.permutation(len(things))]
    ground = station_ground(len(things))
    found = pour([thing.body for thing in things], ground, rng, duration=SETTLING)
    return _table(ground, things, found)


def changed(
    table: Table,
    X_WOs: Mapping[str, Array | None],
    *,
    velocities: Mapping[str, Array] | None = None,
    added: tuple[Thing, ...] = (),
) -> Table:
    """The table after things were put elsewhere (None: taken away), pushed or added, once all is at rest again.

    velocities: (6,) of turning and of moving, in W. What falls off the table is gone. Raises RuntimeError where the
    simulation fails.
    """
    kept = [thing for thing in (*table.things, *added) if X_WOs.get(thing.name, thing.X_WO) is not None]
    starts = [thing.X_WO if (X_WO := X_WOs.get(thing.name)) is None else X_WO for thing in kept]
    names = [thing.name for thing in kept]
    pushed = {names.index(name): V for name, V in (velocities or {}).items() if name in names}
    found = settle([thing.body for thing in kept], starts, table.ground, velocities=pushed, duration=SETTLING)
    return _table(table.ground, kept, found)


def _table(ground: Ground, things: list[Thing], X_WOs: list[Array | None]) -> Table:
    left = [
        dataclasses.replace(thing, X_WO=X_WO)
        for thing, X_WO in zip(things, X_WOs, strict=True)
        if X_WO is not None
    ]  # fmt: skip
    return Table(ground, tuple(left))


@dataclasses.dataclass(frozen=True, eq=False)
class Sight(Immutable):
    """One look at a table."""

    frame: Frame
    owners: NDArray[np.int16]
    """(h, w): 1 + index of the table's thing that a pixel shows; other values: no thing."""


class Onlooker:
    """A camera that looks at tables from one place, through the noise of one sensor.

    head: whether from the robot's head; else from anywhere on the robot's side, at the height of one.
    """

    def __init__(self, rng: np.random.Generator, *, head: bool, noise: DepthNoiseConfig) -> None:
        self._camera, self._noise = make_camera(HeadCameraConfig()), noise
        self._X_WC = robot.camera_pose(home_state()) if head else viewpoint(rng)

    def look(self, table: Table, observation: int, rng: np.random.Generator) -> Sight:
        """Colour as a camera delivers it, depth with the sensor's noise."""
        objects = tuple((thing.name, thing.mesh, thing.X_WO) for thing in table.things)
        renderer = SceneRenderer(ShownScene(objects, station_parts(), station_look()))
        color = jpeg(renderer.color(self._camera, self._X_WC), 97)
        depth = renderer.depth(self._camera, self._X_WC)
        seen = np.where(depth >= HeadCameraConfig().depth_min, depth, 0.0)
        noisy = add_depth_noise(seen, self._camera, rng, self._noise)
        rgb = np.asarray(cv2.imdecode(np.frombuffer(color, np.uint8), cv2.IMREAD_COLOR))[..., ::-1]
        frame = Frame(
            observation, readonly(rgb, np.uint8), readonly(noisy, np.float32), self._camera, readonly(self._X_WC)
        )
        return Sight(frame, renderer.labels(self._camera, self._X_WC))
