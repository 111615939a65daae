"""A film of a run, rendered afterwards from its log alone: a WebM that browsers play."""

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectivesFromString, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from sum_drake.assets import InputError, one_line
from sum_drake.drawing import Image
from sum_drake.objects import Catalogue
from sum_drake.parsing import make_parser
from sum_drake.robot import JOINTS
from sum_drake.storyboard import Shot, Storyboard
from sum_drake.types import Array
from sum_drake.visual_mesh import visual_mesh

SIZE = (480, 360)
FPS = 10.0
SCENE = "directives: [{add_directives: {file: 'package://sum_drake/scenes/sorting.dmd.yaml'}}]"
_EYE, _TARGET = (1.75, 1.3, 2.2), (0.3, 0.02, 0.72)


def film(
    board: Storyboard,
    catalogue: Catalogue,
    joint_names: tuple[str, ...],
    *,
    directives: str = SCENE,
    size: tuple[int, int] = SIZE,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Image]:
    """The storyboard's pictures, (h, w, 3) RGB each, for a size (w, h).

    Args:
        joint_names: of the positions in each shot.
        directives: YAML of the model directives that make the scene, the robot among them.
        progress: told how many pictures of how many are done.

    Raises InputError for a scene that cannot be read, or without these joints.
    """
    stage = _Stage(board.labels, catalogue, joint_names, directives, size)
    for i, shot in enumerate(board.shots):
        yield _captioned(stage.render(shot), shot.caption)
        if progress is not None:
            progress(i + 1, len(board.shots))


class _Stage:
    """Robot and scene, and a copy of each object that ever appears."""

    def __init__(
        self,
        labels: Mapping[int, str],
        catalogue: Catalogue,
        joint_names: tuple[str, ...],
        directives: str,
        size: tuple[int, int],
    ) -> None:
        builder = DiagramBuilder()
        self._plant, self._graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        lights = [
            LightParameter(type="directional", direction=(-0.8, -0.4, -1.0), intensity=0.55, frame="world"),
            LightParameter(type="directional", direction=(0.1, -0.8, -0.6), intensity=0.3, frame="world"),
            LightParameter(type="directional", direction=(0.0, 0.0, 1.0), intensity=0.55, frame="camera"),
        ]
        parameters = RenderEngineVtkParams(default_clear_color=[0.93] * 3, lights=lights)
        self._graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
        try:
            ProcessModelDirectives(LoadModelDirectivesFromString(directives), make_parser(self._plant))
            self._plant.Finalize()
            self._first = [self._position_of(name) for name in joint_names]
        except (RuntimeError, ValueError) as error:
            raise InputError(f"the scene cannot be made: {one_line(error)}; expected the run's own") from None
        source = self._graph.RegisterSource("believed")
        self._frames = {}
        for id, label in labels.items():
            self._frames[id] = self._graph.RegisterFrame(source, GeometryFrame(f"track{id}"))
            copy = GeometryInstance(RigidTransform(), visual_mesh(catalogue[label]), f"track{id}")
            properties = PerceptionProperties()
            properties.AddProperty("label", "id", RenderLabel(1))
            copy.set_perception_properties(properties)
            self._graph.RegisterGeometry(source, self._frames[id], copy)
        self._port = builder.ExportInput(self._graph.get_source_pose_port(source), "believed")
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        info = CameraInfo(*size, np.radians(42.0))
        core = RenderCameraCore("vtk", info, ClippingRange(0.05, 10.0), RigidTransform())
        self._camera, self._X_WC = ColorRenderCamera(core), RigidTransform(look_at(np.array(_EYE), np.array(_TARGET)))

    def _position_of(self, name: str) -> int:
        """Index of a joint in the plant's positions."""
        known = {joint.name for joint in JOINTS}
        joint: Any = self._plant.GetJointByName(name)
        if name not in known or joint.num_positions() != 1:
            raise ValueError(f"joint {name} is none of the robot's")
        return int(joint.position_start())

    def render(self, shot: Shot) -> Image:
        context = self._plant.GetMyMutableContextFromRoot(self._context)
        q = self._plant.GetPositions(context)
        q[self._first] = shot.positions
        self._plant.SetPositions(context, q)
        poses = FramePoseVector()
        away = RigidTransform([0.0, 0.0, -100.0])
        for id, frame in self._frames.items():
            poses.set_value(frame, RigidTransform(shot.X_WOs[id]) if id in shot.X_WOs else away)
        self._diagram.get_input_port(self._port).FixValue(self._context, poses)
        query = self._graph.get_query_output_port().Eval(self._graph.GetMyContextFromRoot(self._context))
        image = query.RenderColorImage(self._camera, self._graph.world_frame_id(), self._X_WC)
        return np.array(image.data[:, :, :3])


def look_at(p_WC: Array, p_WT: Array) -> Array:
    """X_WC (4, 4) of a camera at p_WC that looks at p_WT, the world's up towards the top of the picture."""
    z = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    X_WC = np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), p_WC
    return X_WC


def _captioned(image: Image, caption: str) -> Image:
    height = image.shape[0]
    band = image[height - 24 :]
    band[:] = (0.25 * band + 0.75 * np.array([24, 28, 32])).astype(np.uint8)
    at = (8, height - 8)
    cv2.putText(image, caption, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return image


def webm(images: Iterator[Image], *, fps: float = FPS) -> bytes:
    """Pictures (h, w, 3), RGB, of one size as a VP8 film; b"" for none. The same pictures give the same bytes.

    Raises RuntimeError where OpenCV has no VP8.
    """
    with tempfile.TemporaryDirectory() as folder:
        path, writer = Path(folder) / "film.webm", None
        for image in images:
            if writer is None:
                with _quiet():
                    fourcc = cv2.VideoWriter.fourcc(*"VP80")
                    writer = cv2.VideoWriter(str(path), fourcc, fps, (image.shape[1], image.shape[0]))
                if not writer.isOpened():
                    raise RuntimeError("OpenCV cannot write VP8 here; expected a build with FFmpeg")
            writer.write(np.ascontiguousarray(image[..., ::-1]))
        if writer is None:
            return b""
        writer.release()
        return _without_chance(path.read_bytes())


def _without_chance(data: bytes) -> bytes:
    """A WebM without the number that its writer drew for its track."""
    mark = data.find(b"\x73\xc5\x88", 0, 4096)  # TrackUID, eight bytes long
    if mark < 0:
        return data
    drawn = data[mark + 3 : mark + 11]
    return data[:4096].replace(drawn, (1).to_bytes(8, "big")) + data[4096:]


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Within, nothing gets to standard error: FFmpeg's own code warns there of a tag that WebM does not use."""
    kept = os.dup(2)
    try:
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
