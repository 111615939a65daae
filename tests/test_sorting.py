"""The diagram as a whole: its wiring, what may reach whom, and one short run."""

import contextlib
import gc
import types
from collections.abc import Mapping

import numpy as np
import pytest
from detectors import write_untrained
from pydrake.common.value import Value
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPortIndex, LeafSystem, OutputPortIndex, System
from scenes import standing

from sum_drake.assets import InputError
from sum_drake.faults import absent_labels
from sum_drake.objects import load_catalogue
from sum_drake.runlog import RunLogWriter
from sum_drake.summary_schema import validate_summary
from sum_drake.systems import sorting
from sum_drake.systems.data_associator import DataAssociator
from sum_drake.systems.episode import run
from sum_drake.systems.object_detector import ObjectDetector
from sum_drake.systems.ports import unpack
from sum_drake.systems.scenario import DETECTORS, ObjectsConfig, Scenario, load_scenario
from sum_drake.systems.sorting import make_sorting, pour_scene
from sum_drake.systems.station import make_station, set_home
from sum_drake.systems.verdict import score
from sum_drake.types import Array

SYSTEMS = {
    "station", "frame_assembler", "object_detector", "data_associator", "scene_estimator", "sorting_planner",
    "arm_controller", "referee", "run_log", "executed_state", "executed_effort",
}  # fmt: skip
# What a robot may know of the simulation, by the port of the station's subsystem that it comes from. Everything else,
# the query object, body poses, contact results and reaction forces among it, is truth.
SENSORS = {
    ("head_camera", "color_image"), ("depth_noise", "noisy_depth_image"), ("camera_pose", "X_WC"),
    ("plant", "fetch_state"), ("plant", "fetch_net_actuation"),
}  # fmt: skip
LABEL_IMAGE = ("head_camera", "label_image")
INSIDE_THE_CAMERA_POSE = {("plant", "fetch_state")}


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def scenario(catalogue):
    return load_scenario(seed=3, objects=2, catalogue=catalogue)


@pytest.fixture(scope="module")
def X_WOs(catalogue):
    """The poured poses: truth."""
    return {"sugar": standing(catalogue, "sugar", 0.55, 0.1)}


@pytest.fixture(scope="module")
def diagram(scenario, catalogue, X_WOs, tmp_path_factory):
    """With everything in it, the log too."""
    with contextlib.ExitStack() as stack:
        file = tmp_path_factory.mktemp("run") / "run.mcap"
        yield make_sorting(scenario, X_WOs, catalogue, open_log=lambda: stack.enter_context(RunLogWriter(file)))


def sources(diagram: Diagram, system: System) -> list[tuple[System, str]]:
    """System and port name behind each connected input of a system of the diagram."""
    found = []
    for (target, _), (source, index) in diagram.connection_map().items():
        if target.get_name() == system.get_name():
            found.append((source, source.get_output_port(index).get_name()))
    return found


def origin(diagram: Diagram, port: str) -> tuple[str, str]:
    """Subsystem and port of a diagram that an exported output stands for."""
    index = diagram.GetOutputPort(port).get_index()
    system, inner = diagram.get_output_port_locator(OutputPortIndex(index))
    return system.get_name(), system.get_output_port(inner).get_name()


def leaks(diagram: Diagram, X_WOs: Mapping[str, Array]) -> list[str]:
    """Every way by which truth reaches a system other than the referee."""
    found = []
    station = diagram.GetSubsystemByName("station")
    inner = {(s.get_name(), p) for s, p in sources(station, station.GetSubsystemByName("camera_pose"))}
    found += [f"camera_pose reads {port}" for port in inner - INSIDE_THE_CAMERA_POSE]
    for system in diagram.GetSystems():
        if system.get_name() in ("station", "referee"):
            continue
        for source, port in sources(diagram, system):
            if source.get_name() == "referee":
                found.append(f"{system.get_name()} reads the referee")
            if source.get_name() != "station":
                continue
            at = origin(station, port)
            simulated_detector = type(system).__name__ == "SimulatedDetector"
            if at not in SENSORS and not (at == LABEL_IMAGE and simulated_detector):
                found.append(f"{system.get_name()} reads {port}, which is {at}")
        found += [f"{system.get_name()} holds {what}" for what in truth_held_by(system, station, X_WOs)]
    return found


def truth_held_by(system: System, station: Diagram, X_WOs: Mapping[str, Array]) -> list[str]:
    """What a Python system holds of the truth, through closures, containers and objects.

    That is the station, a part of it, the mapping of the poured poses, or one of these, be it a copy; and the scenario,
    whose objects and seed say what was poured and how.
    """
    parts = [station, *station.GetSystems()]
    truth = {id(part): part.get_name() for part in parts} | {id(X_WOs): "the poured poses"}
    # Drake keeps a diagram and its systems alive together through attributes of its own, which are no way in for us.
    own = {name: value for name, value in vars(system).items() if not name.startswith("_pydrake_internal")}
    seen, waiting, found = set(), [own], []
    while waiting:
        value = waiting.pop()
        if id(value) in seen or isinstance(value, types.ModuleType | type):
            continue
        seen.add(id(value))
        if id(value) in truth or any(value is part for part in parts):
            found.append(truth.get(id(value), "the station"))
            continue
        if isinstance(value, Scenario | ObjectsConfig):
            found.append("the scenario")
        if isinstance(value, np.ndarray):
            found += [f"the poured pose of {label}" for label, X_WO in X_WOs.items() if np.array_equal(value, X_WO)]
        if isinstance(value, types.FunctionType):
            waiting += [cell.cell_contents for cell in value.__closure__ or ()] + list(value.__defaults__ or ())
        elif isinstance(value, types.MethodType):
            waiting += [value.__func__] if value.__self__ is system else [value.__self__, value.__func__]
        elif value is system:
            continue
        else:
            waiting += [v for v in gc.get_referents(value) if not isinstance(v, types.FrameType)]
    return found


def test_a_scenario_names_the_detectors_that_there_are():
    assert set(DETECTORS) == set(sorting.DETECTORS)


def test_every_part_of_sum_is_a_named_system(diagram):
    assert diagram.get_name() == "sorting"
    assert {system.get_name() for system in diagram.GetSystems()} == SYSTEMS


def test_truth_reaches_the_referee_and_nobody_else(diagram, X_WOs):
    assert leaks(diagram, X_WOs) == []
    referee = diagram.GetSubsystemByName("referee")
    assert ("station", "truth.body_poses") in {(s.get_name(), port) for s, port in sources(diagram, referee)}
    assert referee.num_output_ports() == 0
    assert diagram.num_output_ports() == 0


def test_the_detector_is_given_the_frame_and_nobody_the_simulators_labels(diagram):
    detector, station = diagram.GetSubsystemByName("object_detector"), diagram.GetSubsystemByName("station")
    assert isinstance(detector, ObjectDetector)
    assert [(source.get_name(), port) for source, port in sources(diagram, detector)] == [("frame_assembler", "frame")]
    read = {
        origin(station, port)
        for system in diagram.GetSystems()
        for source, port in sources(diagram, system)
        if source.get_name() == "station"
    }
    assert LABEL_IMAGE not in read


def test_the_simulated_detector_reads_labels_and_no_other_truth(catalogue, X_WOs):
    diagram = make_sorting(load_scenario(text="{detector: SimulatedDetector}", catalogue=catalogue), X_WOs, catalogue)
    assert leaks(diagram, X_WOs) == []
    detector, station = diagram.GetSubsystemByName("object_detector"), diagram.GetSubsystemByName("station")
    assert LABEL_IMAGE in {origin(station, p) for s, p in sources(diagram, detector) if s.get_name() == "station"}


def test_faults_stand_between_a_signal_and_all_who_read_it(catalogue, X_WOs):
    scenario = load_scenario(name="faults", catalogue=catalogue)
    absent = absent_labels(scenario.faults, catalogue.labels, list(X_WOs), 0)
    diagram = make_sorting(scenario, X_WOs, catalogue, absent=absent)
    faults = {"camera_fault", "detection_fault", "grip_fault"}
    assert {system.get_name() for system in diagram.GetSystems()} == (SYSTEMS | faults) - {"run_log"}
    assert leaks(diagram, X_WOs) == []
    test_every_input_is_connected(diagram)
    read = {}
    for system in diagram.GetSystems():
        for source, port in sources(diagram, system):
            read.setdefault((source.get_name(), port), set()).add(system.get_name())
    assert read["frame_assembler", "frame"] == {"camera_fault"}
    assert read["object_detector", "detections"] == {"detection_fault"}
    assert read["arm_controller", "desired_state"] == {"grip_fault"}


@pytest.mark.parametrize(("seed", "within_reach"), [(5, False), (7, True)])
def test_what_a_hand_does_and_what_fails_stands_in_the_summary(catalogue, seed, within_reach):
    # Where what is dropped onto the table comes to rest is chance: with seed 7, 12 cm within reach.
    faults = "[{kind: camera, observation: 0}, {kind: added, observation: 0, object: tea}]"
    text = f"{{objects: {{labels: [sugar]}}, faults: {faults}}}"
    scenario = load_scenario(text=text, seed=seed, catalogue=catalogue)
    episode = run(scenario, catalogue)
    summary = score(episode, scenario, catalogue, versions={}, device="cpu")
    validate_summary(summary)
    camera, added = summary["faults"]
    assert (camera["happened"], camera["dealt_with_after"]) == (True, None)
    assert camera["belief"] == "nothing was known before"
    assert (added["object"], added["happened"]) == ("tea", True)
    assert added["dealt_with_after"] in (1, 2)
    assert added["belief"].startswith("found again")
    ended = {row["label"]: row["place"] == row["goal"] for row in summary["objects"]}
    assert ended.keys() == {"sugar", "tea"} and ended["sugar"]
    assert (summary["objects_sorted"], summary["objects_total"]) == (sum(ended.values()), 2)
    assert episode.outcome == "cleared" if ended["tea"] else "tea out_of_reach" in episode.outcome
    assert ended["tea"] or not within_reach
    believed = [row["believed"] for row in summary["attempts"] if row["outcome"] == "sorted"]
    assert believed and all(max(shares, key=shares.get) == "placed" for shares in believed)


def test_an_object_that_slips_and_is_dropped_is_picked_again(catalogue):
    text = "{objects: {labels: [sugar]}, faults: [{kind: slipped, observation: 0}, {kind: dropped, observation: 1}]}"
    scenario = load_scenario(text=text, seed=5, catalogue=catalogue)
    summary = score(run(scenario, catalogue), scenario, catalogue, versions={}, device="cpu")
    slipped, dropped = summary["faults"]
    assert slipped["happened"] and dropped["happened"]
    assert {slipped["object"], dropped["object"]} == {"sugar"}
    assert slipped["dealt_with_after"] in (1, 2) and dropped["dealt_with_after"] in (1, 2)
    first, second, *_ = summary["attempts"]
    assert (first["reason"], second["reason"]) == ("empty_hand", "lost_in_transport")
    assert first["believed"]["placed"] == 0.0 and second["believed"]["placed"] < 0.2


def test_weights_that_cannot_be_used_are_named_before_anything_runs(catalogue, X_WOs, tmp_path):
    other = write_untrained(tmp_path / "other.safetensors", ("mug", "unicorn"))
    for file, words in ((tmp_path / "none", "no such file"), (other, "knows no 'tide'")):
        text = f"{{object_detector: {{weights: {file}}}}}"
        scenario = load_scenario(text=text, catalogue=catalogue)
        with pytest.raises(InputError, match=words):
            make_sorting(scenario, X_WOs, catalogue)


def test_what_cannot_be_replaced_is_named(scenario, catalogue, X_WOs):
    with pytest.raises(ValueError, match="'referee'; expected one of object_detector, "):
        make_sorting(scenario, X_WOs, catalogue, replaced={"referee": Spy()})


def test_a_replaced_part_stands_where_ours_was(scenario, catalogue, X_WOs):
    own = DataAssociator(catalogue=catalogue, config=scenario.association)
    diagram = make_sorting(scenario, X_WOs, catalogue, replaced={"data_associator": own})
    assert diagram.GetSubsystemByName("data_associator") is own
    assert {system.get_name() for system in diagram.GetSystems()} == SYSTEMS - {"run_log"}
    test_every_input_is_connected(diagram)


class Spy(LeafSystem):
    """Reads what it must not."""

    def __init__(self, held=None):
        super().__init__()
        self._decide = lambda: held
        self.DeclareAbstractInputPort("port", Value[list[RigidTransform]]())


@pytest.mark.parametrize("way", ["wire", "plant", "poses", "copy of a pose", "objects"])
def test_a_planted_leak_is_found(scenario, X_WOs, way):
    builder = DiagramBuilder()
    station = builder.AddNamedSystem(
        "station",
        make_station(
            plant_config=scenario.plant_config, directives=scenario.directives,
            camera=scenario.cameras["head_camera"], noise=scenario.depth_noise, objects={}, seed=0,
        ),
    )  # fmt: skip
    held = {
        "wire": None, "plant": station.GetSubsystemByName("plant"), "poses": X_WOs,
        "copy of a pose": [{"sugar": X_WOs["sugar"].copy()}], "objects": {"scenario": scenario},
    }  # fmt: skip
    spy = builder.AddNamedSystem("spy", Spy(held[way]))
    if way == "wire":
        builder.Connect(station.GetOutputPort("truth.body_poses"), spy.GetInputPort("port"))
    (leak,) = set(leaks(builder.Build(), X_WOs))
    assert "spy" in leak
    told = {"wire": "truth.body_poses", "plant": "plant", "poses": "poured poses", "copy of a pose": "pose of sugar"}
    told["objects"] = "the scenario"
    assert told[way] in leak


def test_nothing_of_the_planner_is_made_of_the_simulated_plant(diagram, X_WOs):
    """The robot has models of its own: no perception or planning system shares a plant with the station."""
    station = diagram.GetSubsystemByName("station")
    assert isinstance(station.GetSubsystemByName("plant"), MultibodyPlant)
    assert isinstance(station.GetSubsystemByName("scene_graph"), SceneGraph)
    for name in SYSTEMS - {"station", "referee"}:
        assert truth_held_by(diagram.GetSubsystemByName(name), station, X_WOs) == []


def test_the_diagram_steps_and_observes_once_settled(diagram):
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    set_home(diagram.GetSubsystemByName("station"), root)
    planner, estimator = diagram.GetSubsystemByName("sorting_planner"), diagram.GetSubsystemByName("scene_estimator")

    def state():
        count = planner.GetOutputPort("observe").Eval(planner.GetMyContextFromRoot(root))[0]
        return count, unpack(estimator.GetOutputPort("perception").Eval(estimator.GetMyContextFromRoot(root)))

    simulator.AdvanceTo(0.45)
    assert state() == (0, None), "things have not come to rest"
    simulator.AdvanceTo(0.65)
    count, perception = state()
    assert count == 1
    assert (perception.step, perception.frame.observation, perception.posterior.observation) == (0, 0, 0)
    assert perception.frame.time > 0.5, "the picture is of the moment at which it was asked for"
    assert [track.label for track in perception.posterior.tracks if track.accepted] == ["sugar"]


def test_every_input_is_connected(diagram):
    for system in diagram.GetSystems():
        connected = {(t.get_name(), int(i)) for t, i in diagram.connection_map()}
        for i in range(system.num_input_ports()):
            assert (system.get_name(), i) in connected, system.get_input_port(InputPortIndex(i)).get_name()


def test_pouring_is_a_function_of_the_seed(scenario, catalogue):
    one, same = pour_scene(scenario, catalogue), pour_scene(scenario, catalogue)
    assert one.keys() == same.keys()
    for label, X_WO in one.items():
        np.testing.assert_array_equal(X_WO, same[label])


def test_a_short_run_ends_by_itself_and_its_record_holds_together(catalogue):
    scenario = load_scenario(text="{objects: {labels: [sugar]}}", seed=5, catalogue=catalogue)
    episode = run(scenario, catalogue)
    assert episode.outcome == "cleared"
    # Detections and associations of another observation than the frame's would have been refused: see
    # test_scene_estimator.
    for step, perception in enumerate(episode.perceptions):
        held = {perception.step, perception.frame.observation, perception.posterior.observation}
        assert held == {step}, "frame and belief of a record are of one observation"
        assert perception.prior.observation == step - 1
        assert all(track.seen <= step for track in perception.posterior.tracks)
    summary = score(episode, scenario, catalogue, versions={}, device="cpu")
    validate_summary(summary)
    assert summary["objects_sorted"] == summary["objects_total"] == 1
    assert summary["attempts"][-1]["outcome"] == "sorted"
    assert summary["limits"]["samples"] > 500
    assert summary["limits"]["violations"] == {"position": 0, "speed": 0, "effort": 0}
