"""Draws the README's picture from a run folder: what the camera saw and was believed, and the arm at work.

    python docs/draw_run.py runs/1 docs/run.png --attempt 1

The robot is drawn at the joint angles that were logged, the objects where the belief had them: from the log alone.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from sum_drake.drawing import draw_perception
from sum_drake.geometry import inverse
from sum_drake.kinematics import Arm
from sum_drake.objects import load_catalogue
from sum_drake.parsing import make_parser
from sum_drake.robot import ARM_JOINTS
from sum_drake.runlog_reader import RunRecord, read_run_log

SIZE = (960, 720)


def look_at(p_WC: np.ndarray, p_WT: np.ndarray) -> RigidTransform:
    """X_WC of a camera at p_WC that looks at p_WT."""
    z = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    X_WC = np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), p_WC
    return RigidTransform(X_WC)


def draw_robot(record: RunRecord, attempt: int) -> np.ndarray:
    """(h, w, 3): the robot half a second after it has lifted the object of an executed attempt."""
    catalogue, arm = load_catalogue(), Arm()
    executed = [(time, a) for time, a in record.attempts if a.action is not None]
    time_end, tried = executed[attempt]
    perception = record.perceptions[tried.step]
    columns = [record.joint_names.index(joint.name) for joint in ARM_JOINTS]
    during = (record.joint_times > perception.frame.time) & (record.joint_times < time_end)
    qs = record.joint_positions[during][:, columns]
    # The hand passes the grasp, then rises: the picture is taken at the highest point soon after.
    X_WGs = arm.forward_many(qs)
    at_grasp = int(np.argmin(np.linalg.norm(X_WGs[:, :3, 3] - tried.action.X_WG_pick[:3, 3], axis=-1)))
    lifted = at_grasp + int(np.argmax(X_WGs[at_grasp : at_grasp + 60, 2, 3] > X_WGs[at_grasp, 2, 3] + 0.12))

    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    lights = [
        LightParameter(type="directional", direction=(-0.8, -0.4, -1.0), intensity=0.55, frame="world"),
        LightParameter(type="directional", direction=(0.1, -0.8, -0.6), intensity=0.3, frame="world"),
        LightParameter(type="directional", direction=(0.0, 0.0, 1.0), intensity=0.55, frame="camera"),
    ]
    scene_graph.AddRenderer(
        "vtk", MakeRenderEngineVtk(RenderEngineVtkParams(default_clear_color=[0.93] * 3, lights=lights))
    )
    make_parser(plant).AddModelsFromUrl("package://sum_drake/scenes/sorting.dmd.yaml")
    for track in perception.posterior.tracks:
        if not track.accepted:
            continue
        X_WO = track.X_WO
        if track.id == tried.track:
            X_WO = X_WGs[lifted] @ inverse(tried.action.X_WG_pick) @ X_WO
        (instance,) = make_parser(plant).AddModels(str(catalogue[track.label].sdf))
        (body,) = plant.GetBodyIndices(instance)
        plant.SetDefaultFloatingBaseBodyPose(plant.get_body(body), RigidTransform(X_WO))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    fetch = plant.GetModelInstanceByName("fetch")  # its positions are in the order of the log, as the station's are
    plant.SetPositions(plant.GetMyContextFromRoot(root), fetch, record.joint_positions[during][lifted])
    core = RenderCameraCore("vtk", CameraInfo(*SIZE, np.radians(42)), ClippingRange(0.05, 10.0), RigidTransform())
    X_WC = look_at(np.array([2.0, 1.25, 1.6]), np.array([0.3, 0.0, 0.72]))
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
    image = query.RenderColorImage(ColorRenderCamera(core), scene_graph.world_frame_id(), X_WC)
    return np.array(image.data[:, :, :3])


def main() -> None:
    """Reads the log, draws, writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--attempt", type=int, default=0, help="which executed attempt")
    options = parser.parse_args()
    record = read_run_log(options.run / "run.mcap")
    executed = [a for _, a in record.attempts if a.action is not None]
    believed = draw_perception(record.perceptions[executed[options.attempt].step], load_catalogue())
    robot = draw_robot(record, options.attempt)
    height = robot.shape[0]
    believed = cv2.resize(
        believed, (height * believed.shape[1] // believed.shape[0], height), interpolation=cv2.INTER_AREA
    )
    both = np.concatenate([believed, np.full((height, 8, 3), 255, np.uint8), robot], axis=1)
    cv2.imwrite(str(options.picture), cv2.cvtColor(both, cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()
