"""A contact sheet: what the objects of a catalogue look like, rendered by Drake's RenderEngineVtk."""

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

from sum_drake.geometry import transform
from sum_drake.objects import Catalogue, ObjectModel
from sum_drake.visual_mesh import visual_mesh

Image = NDArray[np.uint8]

_VIEWS = ((25.0, 22.0), (200.0, 35.0))
"""Azimuth from the front and elevation of the sheet's views, degrees."""


def render_model(model: ObjectModel, *, azimuth: float = 25.0, elevation: float = 22.0, size: int = 300) -> Image:
    """The object in its catalogue pose seen from `azimuth` and `elevation` (degrees), (size, size, 3) RGB.

    What is no OBJ with vertex normals is drawn faceted and grey. Raises InputError for a mesh that cannot
    be read.
    """
    lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=intensity)
        for direction, intensity in (([-0.5, 0.4, -1], 0.8), ([-0.8, -0.6, -0.2], 0.6), ([0.9, 0.2, -0.4], 0.7))
    ]
    scene_graph = SceneGraph()
    parameters = RenderEngineVtkParams(
        default_clear_color=[0.96, 0.96, 0.97], default_diffuse=[0.75, 0.76, 0.78, 1.0], lights=lights
    )
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
    geometry = GeometryInstance(RigidTransform(), visual_mesh(model), model.label)
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    geometry.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("sheet"), geometry)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())

    # Seen from where a 30 degree lens just holds the object's sphere.
    fov = np.radians(30.0)
    center = model.load_mesh().bounds.mean(0)
    a, e = np.radians([azimuth, elevation])
    backward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    R_WC = np.stack([right, np.cross(-backward, right), -backward], 1)
    p_WC = center + backward * np.linalg.norm(model.dimensions) / 2 / np.sin(fov / 2)
    core = RenderCameraCore("vtk", CameraInfo(size, size, fov), ClippingRange(0.01, 20.0), RigidTransform())
    image = query.RenderColorImage(
        ColorRenderCamera(core, False), scene_graph.world_frame_id(), RigidTransform(transform(R_WC, p_WC))
    )
    return np.array(image.data[..., :3])


def render_contact_sheet(
    catalogue: Catalogue,
    labels: Sequence[str] | None = None,
    *,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> Image:
    """Two views of each object with label, size, mass and category, five objects a row, (h, w, 3) RGB.

    progress: told how many objects of how many are drawn.
    """
    size, caption, columns = 220, 62, 5
    cells: list[NDArray[Any]] = []
    models = [catalogue[label] for label in labels or catalogue.labels]
    for model in models:
        progress("rendering objects", len(cells), len(models))
        views = [render_model(model, azimuth=a, elevation=e, size=size) for a, e in _VIEWS]
        cell = np.concatenate([np.concatenate(views, 1), np.full((caption, 2 * size, 3), 255, np.uint8)])
        extents = " x ".join(f"{1e3 * extent:.0f}" for extent in model.dimensions)
        mass = "" if model.mass is None else f", {model.mass:g} kg"
        lines = (model.label, 0.62, (20, 20, 20)), (f"{extents} mm{mass}, {model.category}", 0.45, (90, 90, 90))
        for k, (text, scale, colour) in enumerate(lines):
            at = (10, size + 22 + 25 * k)
            cv2.putText(cell, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
        cells.append(cv2.copyMakeBorder(cell, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(225, 225, 225)))
    progress("rendering objects", len(models), len(models))
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % min(columns, len(cells)))
    width = min(columns, len(cells))
    return np.concatenate([np.concatenate(cells[i : i + width], 1) for i in range(0, len(cells), width)])
