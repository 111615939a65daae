"""A posed scene as a camera sees it: colour, perfect depth, and which object each pixel shows.

Textured, by RenderEngineVtk, without a plant: what the detector is trained on, and tables that nobody touches.
"""

import dataclasses
import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    Role,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from sum_drake import robot
from sum_drake.assets import MODELS
from sum_drake.detection.arrangement import Body, Ground
from sum_drake.detection.developing import Picture
from sum_drake.objects import ObjectModel
from sum_drake.parsing import make_parser
from sum_drake.sensor import HeadCameraConfig
from sum_drake.types import Array, Camera

SENSOR = HeadCameraConfig()
NOT_OURS = RenderLabel(10_000)
"""In the label image: whatever is no object of the catalogue."""


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """Something to be drawn that is no object of the catalogue."""

    shape: Shape
    X_WG: RigidTransform
    color: Rgba | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class ShownScene:
    """What there is to see."""

    objects: tuple[tuple[str, Mesh, Array], ...]
    """Label, mesh, X_WO (4, 4)."""
    surroundings: tuple[Part, ...]
    look: RenderEngineVtkParams


def _render_graph(scene: ShownScene) -> tuple[SceneGraph, Any]:
    """A SceneGraph that holds the scene, object i with render label i + 1, and its context."""
    graph = SceneGraph()
    graph.AddRenderer("vtk", MakeRenderEngineVtk(scene.look))
    source = graph.RegisterSource("scene")

    def register(name: str, shape: Shape, X_WG: RigidTransform, label: RenderLabel, color: Rgba | None) -> None:
        geometry = GeometryInstance(X_WG, shape, name)
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", label)
        if color is not None:
            properties.AddProperty("phong", "diffuse", color)
        geometry.set_perception_properties(properties)
        graph.RegisterAnchoredGeometry(source, geometry)

    for i, (label, mesh, X_WO) in enumerate(scene.objects):
        register(label, mesh, RigidTransform(X_WO), RenderLabel(i + 1), None)
    for i, part in enumerate(scene.surroundings):
        register(f"part{i}", part.shape, part.X_WG, NOT_OURS, part.color)
    return graph, graph.CreateDefaultContext()


class SceneRenderer:
    """Pictures of one scene, by an engine of its own."""

    def __init__(self, scene: ShownScene) -> None:
        self._graph, self._context = _render_graph(scene)
        self._query = self._graph.get_query_output_port().Eval(self._context)

    def depth(self, camera: Camera, X_WC: Array) -> Array:
        """Perfect z-depth (h, w) within the sensor's range, 0 beyond."""
        drake = DepthRenderCamera(self._core(camera), DepthRange(0.05, SENSOR.depth_max))
        image = self._query.RenderDepthImage(drake, SceneGraph.world_frame_id(), RigidTransform(X_WC)).data[..., 0]
        return np.where(np.isfinite(image), image, 0.0)

    def color(self, camera: Camera, X_WC: Array) -> Picture:
        drake = ColorRenderCamera(self._core(camera), False)
        image = self._query.RenderColorImage(drake, SceneGraph.world_frame_id(), RigidTransform(X_WC)).data
        return np.asarray(image[..., :3] / np.float32(255), dtype=np.float32)

    def labels(self, camera: Camera, X_WC: Array) -> NDArray[np.int16]:
        drake = ColorRenderCamera(self._core(camera), False)
        image = self._query.RenderLabelImage(drake, SceneGraph.world_frame_id(), RigidTransform(X_WC)).data
        return np.array(image[..., 0])

    def _core(self, camera: Camera) -> RenderCameraCore:
        # RenderEngineVtk puts the centre of pixel i at i + .5.
        info = CameraInfo(camera.width, camera.height, camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5)
        return RenderCameraCore("vtk", info, ClippingRange(0.05, 10.0), RigidTransform())


# --- the station -----------------------------------------------------------------------------------------------------


def body_of(model: ObjectModel) -> Body:
    mass = model.mass if model.mass is not None else 400.0 * float(np.prod(model.dimensions))
    return Body(mass, tuple(np.asarray(piece.vertices) for piece in model.load_collision()))


def station_ground(count: int) -> Ground:
    """The station's table, and the region that its own pour aims at (`systems/pouring.py`)."""
    half_y = float(np.clip(count * 0.016 / 0.6, 0.13, 0.36))
    return Ground(np.array([0.72, 0.0]), np.array([0.30, 0.45]), np.array([0.60, 0.0]), np.array([0.15, half_y]))


@functools.cache
def station_parts() -> tuple[Part, ...]:
    """The station's table, bins, floor and robot, which waits where it looks from."""
    plant, graph = AddMultibodyPlant(MultibodyPlantConfig(time_step=0.004), DiagramBuilder())
    directives = LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml"))
    ProcessModelDirectives(directives, make_parser(plant))
    home = robot.desired_state(robot.VIEW, robot.HAND.gap_max)[: len(robot.JOINTS)]
    for joint, position in zip(robot.JOINTS, home, strict=True):
        plant.GetJointByName(joint.name).set_default_positions([position])
    plant.Finalize()
    context, inspector = plant.CreateDefaultContext(), graph.model_inspector()
    parts = []
    for geometry in inspector.GetAllGeometryIds(Role.kPerception):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        X_WG = plant.EvalBodyPoseInWorld(context, body) @ inspector.GetPoseInFrame(geometry)
        properties = inspector.GetPerceptionProperties(geometry)
        color = properties.GetProperty("phong", "diffuse") if properties.HasProperty("phong", "diffuse") else None
        parts.append(Part(inspector.GetShape(geometry), X_WG, color))
    return tuple(parts)


def home_state() -> Array:
    """The measured state (24,) of a robot that waits at VIEW."""
    order = {joint.name: i for i, joint in enumerate(robot.JOINTS)}
    desired = robot.desired_state(robot.VIEW, robot.HAND.gap_max)
    positions = [desired[order[joint.name]] for joint in robot.STATE_JOINTS]
    return np.concatenate([positions, np.zeros(len(positions))])
