"""The sorting diagram: station, perception, planner, controller, log and referee, wired together."""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.parsing import FlattenModelDirectives, ModelDirective, ModelDirectives, PackageMap
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import LogVectorOutput

from sum_drake import belief
from sum_drake.assets import MODELS, InputError, one_line
from sum_drake.attempting import Attempting
from sum_drake.belief import BeliefConfig, Estimator
from sum_drake.costs import Costs
from sum_drake.detection.inference import Detector, load_detector
from sum_drake.faults import REPEATED, false_detection
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue
from sum_drake.planning_scene import PlanningScene
from sum_drake.presence import PresenceCheck
from sum_drake.recovering import Recovering
from sum_drake.robot import arm_positions
from sum_drake.runlog import RunLogWriter
from sum_drake.seeds import derive
from sum_drake.sensor import make_camera
from sum_drake.systems.arm_controller import PERIOD, ArmController
from sum_drake.systems.camera_fault import CameraFault
from sum_drake.systems.data_associator import DataAssociator
from sum_drake.systems.detection_fault import DetectionFault, Mistake
from sum_drake.systems.frame_assembler import FrameAssembler
from sum_drake.systems.grip_fault import GripFault
from sum_drake.systems.object_detector import Detect, ObjectDetector
from sum_drake.systems.pouring import draw_labels, pour
from sum_drake.systems.referee import Referee
from sum_drake.systems.run_log import RunLog
from sum_drake.systems.scenario import Scenario
from sum_drake.systems.scene_estimator import SceneEstimator, UpdateBelief
from sum_drake.systems.simulated_detector import SimulatedDetector
from sum_drake.systems.sorting_planner import CarryOn, Decide, Retreat, Shake, SortingPlanner
from sum_drake.systems.station import make_station, object_bodies, object_render_labels
from sum_drake.task import Look, Pick, SortingTask, Stop
from sum_drake.types import (
    Array,
    Associations,
    Attempt,
    Detection,
    Detections,
    Frame,
    Motion,
    Perception,
    PickPlace,
    Region,
    SceneBelief,
)

POLL = 0.1
"""How often the systems look at each other's counters, seconds of simulated time."""
SETTLE = 0.5
"""How long arm and objects rest before an observation, seconds."""


def bind_perception(
    scenario: Scenario, catalogue: Catalogue, costs: Costs, pose_estimator: Estimator | None = None
) -> UpdateBelief:
    """`belief.update` with its estimator, which keeps its render engines warm, and the scenario's configuration."""
    estimator = pose_estimator or PoseEstimator(catalogue, filter_config(scenario.filter), noise=scenario.depth_noise)
    presence = PresenceCheck(catalogue, noise=scenario.depth_noise)
    # Not the scenario itself: it says what was poured, and from which seed.
    config = BeliefConfig(
        filter_config(scenario.filter),
        scenario.association,
        scenario.acceptance,
        scenario.unique_labels,
        derive(scenario.random_seed, "estimation"),
        scenario.region("table"),
    )

    def update(
        held: SceneBelief, frame: Frame, detections: Detections, associations: Associations, action: PickPlace | None
    ) -> SceneBelief:
        with costs.of("perception"):
            return belief.update(held, frame, detections, associations, action, estimator, presence, catalogue, config)

    return update


def bind_task(scenario: Scenario, catalogue: Catalogue, costs: Costs) -> tuple[Decide, Retreat, CarryOn, Shake]:
    """The task's decisions, the ways back after a failed pick and on after a stop, and how to shake something off.

    On the robot's own model of itself and the table.
    """
    arm, scene = Arm(), PlanningScene(flat_directives(scenario.directives))
    regions = {name: scenario.region(name) for name in scenario.regions}
    seed = derive(scenario.random_seed, "planning")
    attempting = Attempting(
        catalogue=catalogue,
        arm=arm,
        scene=scene,
        regions=regions,
        goal=scenario.goal,
        config=scenario.task,
        grasp_config=scenario.grasp,
        pick_config=scenario.pick,
        placing_config=scenario.placing,
        seed=seed,
    )
    task = SortingTask(attempting, regions=regions, config=scenario.task)
    recovering = Recovering(
        catalogue=catalogue,
        arm=arm,
        scene=scene,
        regions=regions,
        clear_height=scenario.task.clear_height,
        max_points=scenario.task.max_obstacle_points,
        config=scenario.pick,
        seed=seed,
    )

    def decide(perception: Perception, attempts: Sequence[Attempt], looks: int, q: Array) -> Pick | Look | Stop:
        with costs.of("planning"):
            return task.decide(perception, attempts, looks, q)

    def retreat(perception: Perception, q: Array, motion: int, pick: Pick | None) -> Motion:
        with costs.of("planning"):
            return recovering.retreat(perception, q, motion, pick)

    def carry_on(perception: Perception, pick: Pick, q: Array, motion: int) -> Motion:
        with costs.of("planning"):
            return recovering.carry_on(perception, pick, q, motion)

    def shake(perception: Perception, pick: Pick, q: Array, motion: int, times: int) -> Motion:
        with costs.of("planning"):
            return recovering.shake(perception, pick, q, motion, times)

    return decide, retreat, carry_on, shake


def check_detector(scenario: Scenario, catalogue: Catalogue) -> None:
    """Raises InputError where `make_sorting` would for the detector's sake: what takes no time comes first."""
    if scenario.detector == "ObjectDetector":
        _load_detector(scenario, catalogue)


def _load_detector(scenario: Scenario, catalogue: Catalogue) -> Detector:
    config = scenario.object_detector
    return load_detector(
        Path(config.weights) if config.weights else None,
        labels=catalogue.labels,
        proposer=config.proposer,
        sigma_c=scenario.sigma_c,
        threshold=config.threshold,
    )


def bind_detector(scenario: Scenario, catalogue: Catalogue, costs: Costs) -> Detect:
    """The trained detector of the catalogue's labels. Raises InputError for weights that cannot be used."""
    detector = _load_detector(scenario, catalogue)

    def detect(color: NDArray[np.uint8], depth: NDArray[np.float32]) -> tuple[Detection, ...]:
        with costs.of("perception"):
            return detector(color, depth)

    return detect


def _object_detector(scenario: Scenario, catalogue: Catalogue, station: Diagram, costs: Costs) -> ObjectDetector:
    return ObjectDetector(detect=bind_detector(scenario, catalogue, costs))


def _simulated_detector(scenario: Scenario, catalogue: Catalogue, station: Diagram, costs: Costs) -> SimulatedDetector:
    return SimulatedDetector(
        objects=object_render_labels(station),
        labels=catalogue.labels,
        sigma_c=scenario.sigma_c,
        config=scenario.simulated_detector,
        seed=derive(scenario.random_seed, "detection"),
    )


DETECTORS = {"ObjectDetector": _object_detector, "SimulatedDetector": _simulated_detector}
"""Makes the system that a scenario names as its detector."""


def _scene_estimator(
    scenario: Scenario, catalogue: Catalogue, costs: Costs, pose_estimator: Estimator | None
) -> SceneEstimator:
    return SceneEstimator(update_belief=bind_perception(scenario, catalogue, costs, pose_estimator), period=POLL)


def _sorting_planner(scenario: Scenario, catalogue: Catalogue, costs: Costs) -> SortingPlanner:
    decide, retreat, carry_on, shake = bind_task(scenario, catalogue, costs)
    return SortingPlanner(
        decide=decide, retreat=retreat, carry_on=carry_on, shake=shake, period=POLL, settle_time=SETTLE
    )


REPLACEABLE = ("object_detector", "data_associator", "scene_estimator", "sorting_planner", "arm_controller")
"""Parts of the robot's mind for which `make_sorting` takes a system with the same ports: see docs/extending.md."""


SEGMENTS = {"slipped": "lift", "dropped": "transport"}
"""Of the faults of the fingers: the segment in which they let go."""


def _mistakes(scenario: Scenario, catalogue: Catalogue, absent: Sequence[str]) -> dict[int, tuple[Mistake, ...]]:
    """What the detector falsely sees, by observation."""
    found: dict[int, tuple[Mistake, ...]] = {}
    if not any(fault.kind == "false_detection" for fault in scenario.faults):
        return found
    for i, (fault, label) in enumerate(zip(scenario.faults, absent, strict=True)):
        if fault.kind != "false_detection":
            continue
        mistake = functools.partial(
            _false_detection,
            label,
            scenario.region("table"),
            np.asarray(catalogue[label].load_mesh().vertices),
            derive(scenario.random_seed, f"fault {i}"),
        )
        for observation in range(fault.observation, fault.observation + REPEATED):
            found[observation] = (*found.get(observation, ()), mistake)
    return found


def _false_detection(label: str, table: Region, vertices: Array, seed: int, frame: Frame) -> Detection:
    return false_detection(label, frame, table, vertices, np.random.default_rng(seed))


def make_sorting(
    scenario: Scenario,
    X_WOs: Mapping[str, Array],
    catalogue: Catalogue,
    *,
    open_log: Callable[[], RunLogWriter] | None = None,
    costs: Costs | None = None,
    pose_estimator: Estimator | None = None,
    absent: Sequence[str] = (),
    replaced: Mapping[str, System] | None = None,
) -> Diagram:
    """Station, perception, planner, controller, log and referee in one diagram.

    X_WOs: label -> (4, 4) pose of each object on the table. open_log: called once all else has been made, for where the
    log goes; without it there is none. pose_estimator: with the scenario's filter; default: one in this process.
    absent: of the scenario's faults, `faults.absent_labels`. replaced: systems that stand in the place of ours, by
    name, of REPLACEABLE; the ports that ours is connected by are theirs, too. Raises InputError for a scene or a
    catalogue that cannot be used, ValueError for a name that is not among REPLACEABLE.
    """
    others = dict(replaced or {})
    for name in others:
        if name not in REPLACEABLE:
            raise ValueError(f"replaced: {name!r}; expected one of {', '.join(REPLACEABLE)}")

    def add(name: str, make: Callable[[], System]) -> System:
        """Ours is not made where another stands in its place."""
        return builder.AddNamedSystem(name, others[name] if name in others else make())

    costs = Costs() if costs is None else costs
    seed = scenario.random_seed
    builder = DiagramBuilder()
    station = builder.AddNamedSystem(
        "station",
        make_station(
            plant_config=scenario.plant_config,
            directives=scenario.directives,
            camera=scenario.cameras["head_camera"],
            noise=scenario.depth_noise,
            objects={label: (str(catalogue[label].sdf), X_WO) for label, X_WO in X_WOs.items()},
            seed=derive(seed, "depth noise"),
        ),
    )
    frames = builder.AddNamedSystem(
        "frame_assembler", FrameAssembler(camera=make_camera(scenario.cameras["head_camera"]))
    )
    detector = add("object_detector", lambda: DETECTORS[scenario.detector](scenario, catalogue, station, costs))
    associator = add("data_associator", lambda: DataAssociator(catalogue=catalogue, config=scenario.association))
    estimator = add("scene_estimator", lambda: _scene_estimator(scenario, catalogue, costs, pose_estimator))
    planner = add("sorting_planner", lambda: _sorting_planner(scenario, catalogue, costs))
    controller = add("arm_controller", lambda: ArmController(step=scenario.plant_config.time_step))
    plant = station.GetSubsystemByName("plant")
    referee = builder.AddNamedSystem(
        "referee",
        Referee(
            objects=object_bodies(station),
            hand=int(plant.GetBodyByName("gripper_link").index()),
            period=POLL,
        ),
    )

    def connect(source: System, output: str, target: System, port: str | None = None) -> None:
        builder.Connect(source.GetOutputPort(output), target.GetInputPort(output if port is None else port))

    connect(station, "head_camera.color_image", frames, "color_image")
    connect(station, "head_camera.depth_image", frames, "depth_image")
    connect(station, "head_camera.X_WC", frames, "X_WC")
    connect(planner, "observe", frames)
    # What goes wrong on a signal stands between its source and whoever reads it.
    frame, detections, desired = (frames, "frame"), (detector, "detections"), (controller, "desired_state")
    blind = {fault.observation for fault in scenario.faults if fault.kind == "camera"}
    if blind:
        camera_fault = builder.AddNamedSystem("camera_fault", CameraFault(observations=blind))
        connect(*frame, camera_fault)
        frame = camera_fault, "faulty_frame"
    connect(*frame, detector, "frame")
    if isinstance(detector, SimulatedDetector):
        connect(station, "head_camera.label_image", detector, "label_image")
    mistakes = _mistakes(scenario, catalogue, absent)
    if mistakes:
        detection_fault = builder.AddNamedSystem("detection_fault", DetectionFault(mistakes=mistakes))
        connect(*frame, detection_fault, "frame")
        connect(*detections, detection_fault)
        detections = detection_fault, "faulty_detections"
    connect(*detections, associator, "detections")
    connect(*frame, associator, "frame")
    connect(estimator, "scene_belief", associator)
    connect(planner, "executed_action", associator)
    connect(planner, "observe", estimator)
    connect(*frame, estimator, "frame")
    connect(*detections, estimator, "detections")
    connect(associator, "associations", estimator)
    connect(planner, "executed_action", estimator)
    connect(estimator, "perception", planner)
    connect(station, "fetch.state", planner, "robot_state")
    connect(station, "fetch.effort", planner, "effort")
    connect(controller, "motion_status", planner)
    connect(planner, "motion", controller)
    connect(station, "fetch.state", controller, "robot_state")
    connect(station, "fetch.effort", controller, "effort")
    loose = tuple((f.observation, SEGMENTS[f.kind]) for f in scenario.faults if f.kind in SEGMENTS)
    if loose:
        step = scenario.plant_config.time_step
        grip_fault = builder.AddNamedSystem("grip_fault", GripFault(faults=loose, period=POLL, step=step))
        connect(*desired, grip_fault)
        connect(controller, "motion_status", grip_fault)
        connect(planner, "observe", grip_fault)
        connect(station, "fetch.state", grip_fault, "robot_state")
        desired = grip_fault, "faulty_desired_state"
    connect(*desired, station, "fetch.desired_state")
    for what in ("state", "effort"):  # of what was done, for the account of the robot's limits
        LogVectorOutput(station.GetOutputPort(f"fetch.{what}"), builder, PERIOD).set_name(f"executed_{what}")
    connect(station, "truth.body_poses", referee, "body_poses")
    connect(planner, "observe", referee)
    connect(controller, "motion_status", referee)
    if open_log is not None:
        writer = open_log()
        arm = Arm()
        log = builder.AddNamedSystem(
            "run_log", RunLog(writer=writer, hand=lambda state: arm.forward(arm_positions(state)))
        )
        connect(estimator, "perception", log)
        connect(planner, "attempts", log)
        connect(station, "fetch.state", log, "joint_state")
        connect(planner, "observe", log)
        connect(controller, "motion_status", log)
        connect(planner, "outcome", log)
        connect(planner, "motion", log)
    diagram = builder.Build()
    diagram.set_name("sorting")
    return diagram


def flat_directives(directives: Sequence[ModelDirective]) -> list[ModelDirective]:
    """The same scene without nested files."""
    packages = PackageMap.MakeEmpty()
    packages.Add("sum_drake", str(MODELS))
    try:
        nested = ModelDirectives(directives=list(directives))
        flat: list[ModelDirective] = FlattenModelDirectives(nested, packages).directives
    except RuntimeError as error:
        raise InputError(f"directives: {one_line(error)}; expected files of model directives") from error
    return flat


def pour_scene(scenario: Scenario, catalogue: Catalogue) -> dict[str, Array]:
    """Label -> settled X_WO (4, 4) of the scenario's objects; a function of its seed."""
    seed = derive(scenario.random_seed, "pouring")
    labels = scenario.objects.labels or draw_labels(catalogue, scenario.objects.count, np.random.default_rng(seed))
    return pour(
        objects=[catalogue[label] for label in labels],
        directives=flat_directives(scenario.directives),
        plant_config=scenario.plant_config,
        config=scenario.pouring,
        seed=seed,
    )
