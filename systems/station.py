"""The station: everything that exists without the robot's mind: physics, drives, and the head camera."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    MakeRenderEngineVtk,
    RenderCameraCore,
    Role,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import ModelDirective, ModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.sensors import RgbdSensor

from sum_drake import robot
from sum_drake.assets import InputError, asset, one_line
from sum_drake.drives import DAMPING, STIFFNESS
from sum_drake.look import station_look
from sum_drake.parsing import make_parser
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig, camera_from_info, make_camera_info
from sum_drake.systems.camera_pose import CameraPose
from sum_drake.systems.depth_noise import DepthNoise
from sum_drake.types import Array


def default_plant_config() -> MultibodyPlantConfig:
    """SAP at 4 ms with hydroelastic contact, point contact where a shape has no hydroelastic model."""
    return MultibodyPlantConfig(
        time_step=0.004, contact_model="hydroelastic_with_fallback", discrete_contact_approximation="sap"
    )


def make_station(
    *,
    plant_config: MultibodyPlantConfig,
    directives: Sequence[ModelDirective],
    camera: HeadCameraConfig,
    noise: DepthNoiseConfig,
    objects: Mapping[str, tuple[str, Array]],
    seed: int,
) -> Diagram:
    """The simulated robot in its scene, as a diagram named "station".

    .. pydrake_system::

        name: station
        input_ports:
        - fetch.desired_state
        output_ports:
        - fetch.state
        - fetch.effort
        - head_camera.color_image
        - head_camera.depth_image
        - head_camera.label_image
        - head_camera.X_WC
        - truth.body_poses

    fetch.desired_state and fetch.effort follow `robot.JOINTS`, fetch.state follows `robot.STATE_JOINTS`. Nothing is
    rendered unless an image is asked for. The default context is home: see `set_home`. truth.body_poses is for the
    referee alone.

    Args:
        plant_config: time step and contact model.
        directives: the scene; one model instance of it is named "fetch".
        camera: the head camera.
        noise: errors of its depth.
        objects: by label, the SDF file (path or package://sum_drake URI) of one free body, and its first pose X_WO
            (4, 4).
        seed: of the depth noise.

    Raises:
        InputError: a model that cannot be read, or a scene without the robot.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(plant_config, builder)
    # Before any geometry, so that a mesh that cannot be drawn is found while its model is read.
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(station_look()))
    fetch = _add_scene(plant, directives)
    for label, (path, X_WO) in objects.items():
        _add_object(plant, label, path, X_WO)
    _add_drives(plant, fetch)
    plant.Finalize()

    info = make_camera_info(camera)
    optical = plant.GetFrameByName("head_camera_optical_frame", fetch)
    core = RenderCameraCore("vtk", info, ClippingRange(0.05, 10.0), RigidTransform())
    rgbd = builder.AddNamedSystem(
        "head_camera",
        RgbdSensor(
            parent_id=plant.GetBodyFrameIdOrThrow(optical.body().index()),
            X_PB=optical.GetFixedPoseInBodyFrame(),
            color_camera=ColorRenderCamera(core),
            depth_camera=DepthRenderCamera(core, DepthRange(camera.depth_min, camera.depth_max)),
        ),
    )
    builder.Connect(scene_graph.get_query_output_port(), rgbd.query_object_input_port())
    depth_noise = builder.AddNamedSystem(
        "depth_noise", DepthNoise(camera=camera_from_info(info), config=noise, seed=seed)
    )
    builder.Connect(rgbd.depth_image_32F_output_port(), depth_noise.GetInputPort("depth_image"))
    camera_pose = builder.AddNamedSystem("camera_pose", CameraPose(X_WB=_base_pose(plant, fetch)))
    builder.Connect(plant.get_state_output_port(fetch), camera_pose.GetInputPort("state"))

    builder.ExportInput(plant.get_desired_state_input_port(fetch), "fetch.desired_state")
    builder.ExportOutput(plant.get_state_output_port(fetch), "fetch.state")
    builder.ExportOutput(plant.get_net_actuation_output_port(fetch), "fetch.effort")
    builder.ExportOutput(rgbd.color_image_output_port(), "head_camera.color_image")
    builder.ExportOutput(depth_noise.GetOutputPort("noisy_depth_image"), "head_camera.depth_image")
    builder.ExportOutput(rgbd.label_image_output_port(), "head_camera.label_image")
    builder.ExportOutput(camera_pose.GetOutputPort("X_WC"), "head_camera.X_WC")
    builder.ExportOutput(plant.get_body_poses_output_port(), "truth.body_poses")
    station = builder.Build()
    station.set_name("station")
    return station


def set_home(station: Diagram, root_context: Context) -> None:
    """Puts the robot at VIEW, looking at the table with its fingers open, and every object where it began, at rest.

    Args:
        station: what `make_station` returned.
        root_context: context of the diagram that the station is, or is part of.
    """
    station.SetDefaultContext(station.GetMyMutableContextFromRoot(root_context))


def object_bodies(station: Diagram) -> dict[str, int]:
    """Label -> index into truth.body_poses, for the referee."""
    plant = station.GetSubsystemByName("plant")
    bodies = (plant.get_body(index) for index in sorted(plant.GetFloatingBaseBodies(), key=int))
    return {plant.GetModelInstanceName(body.model_instance()): int(body.index()) for body in bodies}


def object_render_labels(station: Diagram) -> dict[int, str]:
    """Value in head_camera.label_image -> label, for the simulated detector."""
    plant = station.GetSubsystemByName("plant")
    inspector = station.GetSubsystemByName("scene_graph").model_inspector()
    labels = {}
    for label, index in object_bodies(station).items():
        frame = plant.GetBodyFrameIdOrThrow(BodyIndex(index))
        for geometry in inspector.GetGeometries(frame, Role.kPerception):
            labels[int(inspector.GetPerceptionProperties(geometry).GetProperty("label", "id"))] = label
    return labels


def _add_scene(plant: MultibodyPlant, directives: Sequence[ModelDirective]) -> ModelInstanceIndex:
    """Adds the scene; returns the robot's model instance."""
    try:
        ProcessModelDirectives(ModelDirectives(directives=list(directives)), make_parser(plant))
    except (RuntimeError, ValueError) as error:
        raise InputError(f"directives: {one_line(error)}; expected models that Drake can read") from error
    if not plant.HasModelInstanceNamed("fetch"):
        raise InputError('directives: no model instance "fetch", expected the robot under that name')
    fetch = plant.GetModelInstanceByName("fetch")
    plant.set_gravity_enabled(fetch, False)  # Its drives compensate it.
    return fetch


def _add_object(plant: MultibodyPlant, label: str, path: str, X_WO: Array) -> None:
    """Adds one free body under the name `label`, at X_WO."""
    if plant.HasModelInstanceNamed(label):
        raise InputError(f'object "{label}": the scene has a model of that name, expected another label')
    parser = make_parser(plant)
    parser.SetAutoRenaming(True)
    try:
        instances = parser.AddModels(str(asset(path)))
        if len(instances) != 1:
            raise RuntimeError(f"the file has {len(instances)} models")
        bodies = plant.GetBodyIndices(instances[0])
        if len(bodies) != 1:
            raise RuntimeError(f"the model has {len(bodies)} links")
        body = plant.get_body(bodies[0])
        plant.RenameModelInstance(instances[0], label)
        plant.SetDefaultFloatingBaseBodyPose(body, _rigid(X_WO))
    except (RuntimeError, ValueError) as error:
        message = f'object "{label}": {path}: {one_line(error)}; expected an SDF file of one model with one free link'
        raise InputError(message) from error


def _rigid(X_WO: Array) -> RigidTransform:
    """X_WO (4, 4) as a RigidTransform, which would take any matrix. Raises ValueError."""
    X = np.asarray(X_WO, dtype=float)
    if X.shape != (4, 4) or not np.allclose(X[:3, :3] @ X[:3, :3].T, np.eye(3), atol=1e-6):
        raise ValueError("X_WO is no rigid motion")
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])


def _add_drives(plant: MultibodyPlant, fetch: ModelInstanceIndex) -> None:
    """PD drives in the actuators, which the contact solver treats implicitly, and the default positions."""
    try:
        for joint, p, d in zip(robot.JOINTS, STIFFNESS, DAMPING, strict=True):
            plant.GetJointActuatorByName(joint.name, fetch).set_controller_gains(PdControllerGains(p=p, d=d))
    except RuntimeError as error:
        raise InputError(
            f'directives: model "fetch": {one_line(error)}; expected the joints of robot.JOINTS'
        ) from error
    home = robot.desired_state(robot.VIEW, robot.HAND.gap_max)[: len(robot.JOINTS)]
    for joint, position in zip(robot.JOINTS, home, strict=True):
        plant.GetJointByName(joint.name, fetch).set_default_positions([position])


def _base_pose(plant: MultibodyPlant, fetch: ModelInstanceIndex) -> RigidTransform:
    """X_WB as installed: the base is welded to the world."""
    context = plant.CreateDefaultContext()
    return plant.GetFrameByName("base_link", fetch).CalcPoseInWorld(context)
