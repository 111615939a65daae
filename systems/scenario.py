"""A run as data: one typed record, read from YAML, in the manner of Drake's hardware_sim."""

import dataclasses
import math
import typing
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed
from pydrake.multibody.parsing import ModelDirective
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder

from sum_drake import robot
from sum_drake.assets import MODELS, InputError, asset, one_line
from sum_drake.association import AssociationConfig
from sum_drake.belief import ACCEPT_BY, AcceptanceConfig
from sum_drake.detection import weights
from sum_drake.detection.proposers import LEARNED, PROPOSERS
from sum_drake.detection.simulated import SimulatedDetectorConfig
from sum_drake.faults import KINDS, NEED_ABSENT, FaultConfig
from sum_drake.filter_config import FILTERS
from sum_drake.grasping import GraspConfig
from sum_drake.objects import CATALOGUE, Catalogue, load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.placing import PlacingConfig, same_floor
from sum_drake.prospects import POLICIES
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig
from sum_drake.systems.object_detector import ObjectDetectorConfig
from sum_drake.systems.pouring import PouringConfig
from sum_drake.task_config import TaskConfig
from sum_drake.types import LEAVE, Region, readonly
from sum_drake.yamlio import parse_yaml

SCENARIOS = MODELS / "scenarios" / "sorting.yaml"
DETECTORS = ("ObjectDetector", "SimulatedDetector")
MAX_OBJECTS = 15


@dataclasses.dataclass
class ObjectsConfig:
    """What is poured."""

    count: int = 5
    """How many objects, 1 to 15; drawn from the catalogue by the seed unless `labels` names them."""
    labels: list[str] = dataclasses.field(default_factory=list)
    """The objects to pour; empty draws `count` of them."""


@dataclasses.dataclass
class RegionConfig:
    """An axis-aligned box in the world where objects may be or may go."""

    p_W: list[float] = dataclasses.field(default_factory=list)
    """Its centre, metres."""
    half_extents: list[float] = dataclasses.field(default_factory=list)
    """Half its sides, metres."""


@dataclasses.dataclass
class Scenario:
    """Everything that a sorting run depends on."""

    random_seed: int = 0
    """Seed of every random draw of the run."""
    simulation_duration: float = 900.0
    """The run stops after this much simulated time at the latest, seconds."""
    plant_config: MultibodyPlantConfig = dataclasses.field(default_factory=MultibodyPlantConfig)
    """Step, solver and contact model of the station's plant, and of the pour."""
    directives: list[ModelDirective] = dataclasses.field(default_factory=list)
    """Robot, table and bins."""
    cameras: dict[str, HeadCameraConfig] = dataclasses.field(default_factory=dict)
    """The cameras by name; the robot looks with `head_camera`."""
    depth_noise: DepthNoiseConfig = dataclasses.field(default_factory=DepthNoiseConfig)
    """What the depth sensor does to the truth; the pose filter's tolerances follow from it."""
    catalogue: str = ""
    """File of the catalogue of objects; empty is the package's. A relative path starts at the scenario's file."""
    objects: ObjectsConfig = dataclasses.field(default_factory=ObjectsConfig)
    """What is poured."""
    pouring: PouringConfig = dataclasses.field(default_factory=PouringConfig)
    """How it is poured."""
    detector: str = "ObjectDetector"
    """Which detector looks at the pictures: ObjectDetector, or SimulatedDetector, which reads the label image."""
    object_detector: ObjectDetectorConfig = dataclasses.field(default_factory=ObjectDetectorConfig)
    """Weights and threshold of ObjectDetector."""
    simulated_detector: SimulatedDetectorConfig = dataclasses.field(default_factory=SimulatedDetectorConfig)
    """Error rates of SimulatedDetector."""
    sigma_c: float = 0.1
    """Labels below this share of a box's most confident one are dropped (Sui et al. 2017, eq. 5)."""
    association: AssociationConfig = dataclasses.field(default_factory=AssociationConfig)
    """Matching, spawning and ending of tracks."""
    filter: str = "default"
    """Pose estimation: `paper` as published, or `default`."""
    acceptance: AcceptanceConfig = dataclasses.field(default_factory=AcceptanceConfig)
    """When a track counts as an object."""
    unique_labels: bool = True
    """At most one accepted object of a label, as the paper assumes."""
    task: TaskConfig = dataclasses.field(default_factory=TaskConfig)
    """Which object is next, and when the run is over."""
    grasp: GraspConfig = dataclasses.field(default_factory=GraspConfig)
    """Grasp candidates and their ranking."""
    pick: PickConfig = dataclasses.field(default_factory=PickConfig)
    """Planning of one pick and place."""
    placing: PlacingConfig = dataclasses.field(default_factory=PlacingConfig)
    """Free places on the table."""
    regions: dict[str, RegionConfig] = dataclasses.field(default_factory=dict)
    """Where objects may go, by name; `table` is where they are poured."""
    goal: dict[str, str] = dataclasses.field(default_factory=dict)
    """Label or category -> region, or `leave`; a label goes before its category."""
    faults: list[FaultConfig] = dataclasses.field(default_factory=list)
    """What goes wrong, besides what does so by itself."""

    def region(self, name: str) -> Region:
        """The region of that name as a value."""
        config = self.regions[name]
        return Region(name, readonly(config.p_W), readonly(config.half_extents))


def load_scenario(
    file: Path | None = None,
    name: str | None = None,
    text: str | None = None,
    *,
    seed: int | None = None,
    objects: int | None = None,
    catalogue: Catalogue | None = None,
) -> Scenario:
    """The scenario `name` (default: the first) of a file of scenarios, with the fields of `text` (YAML) put over it.

    A scenario of another file goes over the package's first one. A `goal` is not merged with the one below it. `seed`,
    `objects`, a count, and `catalogue` go over all; a count does not go with `objects.labels`.

    Raises InputError for a file that cannot be read, an unknown name, key, label, region, filter, detector or policy,
    a catalogue that cannot be used, and for values of another type or out of range.
    """
    file = SCENARIOS if file is None else file
    scenarios = _yaml_mapping(_read(file), str(file))
    if name is None:
        name = next(iter(scenarios), "")
    if name not in scenarios:
        raise InputError(f"scenario {name!r}: not in {file}; expected one of {', '.join(map(str, scenarios))}")
    where = f"scenario {name!r} of {file}"
    defaults = Scenario() if file == SCENARIOS else load_scenario()
    scenario = _typed(scenarios[name], where, defaults)
    _make_paths_whole(scenario, file.parent)
    if text is not None:
        scenario = _typed(_yaml_mapping(text, "--scenario-text"), "--scenario-text", scenario)
        _make_paths_whole(scenario, Path())
        where += " with --scenario-text"
    if seed is not None:
        scenario.random_seed = seed
    if catalogue is None:
        catalogue = catalogue_of(scenario, where)
    else:
        scenario.catalogue = _whole_path(str(catalogue.path), Path(), CATALOGUE)
    if objects is not None:
        if scenario.objects.labels:
            raise InputError(f"--objects {objects}: {where} lists objects.labels; expected one or the other")
        _check_count(objects, "--objects", catalogue)
        scenario.objects = ObjectsConfig(count=objects)
    _validate(scenario, where, catalogue)
    return scenario


def catalogue_of(scenario: Scenario, where: str = "scenario") -> Catalogue:
    """The catalogue that a scenario names. where: names the scenario in errors. Raises InputError."""
    try:
        return load_catalogue(Path(scenario.catalogue) if scenario.catalogue else None)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _make_paths_whole(scenario: Scenario, folder: Path) -> None:
    """Makes the paths that a scenario names hold wherever it is read. folder: where relative ones start."""
    scenario.catalogue = _whole_path(scenario.catalogue, folder, CATALOGUE)
    detector = scenario.object_detector
    detector.weights = _whole_path(detector.weights, folder, weights.DEFAULT)


def _whole_path(path: str, folder: Path, default: Path) -> str:
    """A path that holds wherever it is read; "" for the package's own file."""
    whole = (folder / asset(path)).resolve()
    return "" if not path or whole == default.resolve() else str(whole)


def dump_scenario(scenario: Scenario) -> str:
    """The resolved scenario as YAML that `load_scenario` reads, under the name `resolved`."""
    return str(yaml_dump_typed(scenario, child_name="resolved"))


def _read(file: Path) -> str:
    try:
        return file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"scenario file {file}: {error}; expected a YAML file of scenarios") from error


def _yaml_mapping(text: str, where: str) -> dict[str, Any]:
    data = parse_yaml(text, where)
    if not isinstance(data, dict):
        raise InputError(f"{where}: {type(data).__name__} at the top; expected a mapping")
    return data


def _typed(data: Any, where: str, defaults: Scenario) -> Scenario:
    _check_types(data, Scenario, where)
    if isinstance(data, dict) and "goal" in data:  # a goal is given whole; merged, the old one could not be left out
        defaults = dataclasses.replace(defaults, goal={})
    try:
        scenario: Scenario = yaml_load_typed(schema=Scenario, data=yaml.safe_dump(data), defaults=defaults)
    except Exception as error:  # Drake raises AssertionError, RuntimeError or ValueError without saying where.
        raise InputError(f"{where}: {one_line(error)}; expected the types of Scenario's fields") from error
    return scenario


_SCALARS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}


def _check_types(data: Any, schema: Any, where: str) -> None:
    """Names the first key that is unknown or of another type with its path, which Drake's loader does not.

    What it does not know (optional fields, variants) is left to that loader.
    """
    kind, inner, fields = typing.get_origin(schema) or schema, typing.get_args(schema), _fields(schema)
    if (fields or kind is dict) and not isinstance(data, dict):
        raise InputError(f"{where}: {data!r}; expected a mapping")
    if fields:
        for key, value in data.items():
            if key not in fields:
                raise InputError(f"{where}: unknown key {key!r}; expected one of {', '.join(fields)}")
            _check_types(value, fields[key], f"{where}: {key}")
    elif kind is dict:
        for key, value in data.items():
            _check_types(value, inner[1], f"{where}: {key}")
    elif kind is list:
        if not isinstance(data, list):
            raise InputError(f"{where} is {data!r}; expected a list")
        for index, value in enumerate(data):
            _check_types(value, inner[0], f"{where}: number {index + 1}")
    elif kind in _SCALARS and not _reads_as(data, kind):
        raise InputError(f"{where} is {data!r}; expected {_SCALARS[kind]}")


def _fields(schema: Any) -> dict[str, Any]:
    """Types of a record's fields by name, whether it is a dataclass or one of Drake's; empty for what is no record."""
    if dataclasses.is_dataclass(schema):
        return {field.name: field.type for field in dataclasses.fields(schema)}
    return {field.name: field.type for field in getattr(schema, "__fields__", ())}


def _reads_as(value: Any, kind: Any) -> bool:
    """Whether Drake's loader takes a YAML value for a bool, int, float or str."""
    if isinstance(value, bool):
        return kind is bool
    if isinstance(value, str) and kind in (int, float):  # to YAML 1e-3 is text
        try:
            kind(value)
        except ValueError:
            return False
        return True
    return isinstance(value, int | float if kind is float else kind)


def _check_count(count: int, where: str, catalogue: Catalogue) -> None:
    most = min(MAX_OBJECTS, len(catalogue))
    if not 1 <= count <= most:
        why = f", as many as {catalogue.path} has" if most == len(catalogue) else ""
        raise InputError(f"{where}: {count} objects; expected 1 to {most}{why}")


def _validate(scenario: Scenario, where: str, catalogue: Catalogue) -> None:
    def expect(ok: bool, what: str, expected: str) -> None:
        if not ok:
            raise InputError(f"{where}: {what}; expected {expected}")

    _check_numbers(scenario, where)
    _check_count(len(scenario.objects.labels) or scenario.objects.count, where, catalogue)
    for label in scenario.objects.labels:
        expect(label in catalogue.labels, f"object label {label!r}", f"one of {', '.join(catalogue.labels)}")
    expect(len(set(scenario.objects.labels)) == len(scenario.objects.labels), "a label twice", "distinct labels")
    expect(scenario.filter in FILTERS, f"filter {scenario.filter!r}", f"one of {', '.join(FILTERS)}")
    expect(scenario.detector in DETECTORS, f"detector {scenario.detector!r}", f"one of {', '.join(DETECTORS)}")
    proposers, proposer = (LEARNED, *PROPOSERS), scenario.object_detector.proposer
    expect(proposer in proposers, f"proposer {proposer!r}", f"one of {', '.join(proposers)}")
    expect(scenario.task.policy in POLICIES, f"policy {scenario.task.policy!r}", f"one of {', '.join(POLICIES)}")
    by = scenario.acceptance.by
    expect(by in ACCEPT_BY, f"acceptance.by {by!r}", f"one of {', '.join(ACCEPT_BY)}")
    expect(0.0 < scenario.sigma_c < 1.0, f"sigma_c {scenario.sigma_c}", "a number between 0 and 1")
    expect(scenario.random_seed >= 0, f"random_seed {scenario.random_seed}", "0 or more")
    try:
        AddMultibodyPlant(scenario.plant_config, DiagramBuilder())
    except RuntimeError as error:
        raise InputError(f"{where}: plant_config: {one_line(error)}; expected what Drake's plant accepts") from error
    expect(scenario.plant_config.time_step > 0, f"time_step {scenario.plant_config.time_step}", "more than 0")
    expect("head_camera" in scenario.cameras, "no camera head_camera", "one under cameras")
    expect("table" in scenario.regions, "no region table", "one under regions")
    for name, region in scenario.regions.items():
        ok = len(region.p_W) == len(region.half_extents) == 3 and min(region.half_extents) > 0
        expect(ok, f"region {name}", "p_W and half_extents of three numbers, the latter positive")
    kinds = (*catalogue.labels, *catalogue.categories)
    for kind, region_name in scenario.goal.items():
        expect(kind in kinds, f"goal for {kind!r}", f"a label or category, one of {', '.join(kinds)}")
        places = (*(name for name in scenario.regions if name != "table"), LEAVE)
        expect(region_name in places, f"goal region {region_name!r} of {kind!r}", f"one of {', '.join(places)}")
    for name in sorted(set(scenario.goal.values()) - {LEAVE}):
        _validate_goal_region(scenario.region(name), scenario.region("table"), where)
    _validate_faults(scenario, where, catalogue)


REACH = 1.3
"""Nothing that is farther from the shoulder can be brought to, metres: the stretched arm has 1.1."""


def _validate_goal_region(region: Region, table: Region, where: str) -> None:
    """Refuses a region that is neither bin nor area of the table, or that no arm reaches."""
    over = bool(np.all(np.abs(region.p_W - table.p_W)[:2] < (region.half_extents + table.half_extents)[:2]))
    if over and not same_floor(region, table):
        raise InputError(
            f"{where}: region {region.name}: its bottom is at {region.floor_height:.3g} m, over the table, whose top "
            f"is at {table.floor_height:.3g} m; expected the same height, or a place beside the table"
        )
    # The shoulder goes up and down with the torso.
    lift = np.array([0.0, 0.0, robot.TORSO.upper / 2])
    p_WS = np.add(robot.TORSO.origin, robot.ARM[0].origin) + lift
    away = float(np.linalg.norm(np.maximum(np.abs(region.p_W - p_WS) - region.half_extents - lift, 0.0)))
    if away > REACH:
        raise InputError(
            f"{where}: region {region.name}: is out of reach, {away:.2f} m from the robot's shoulder; expected at most "
            f"{REACH:g} m"
        )


def _validate_faults(scenario: Scenario, where: str, catalogue: Catalogue) -> None:
    needed = len(scenario.objects.labels) or scenario.objects.count
    for number, fault in enumerate(scenario.faults, start=1):
        at = f"{where}: faults: number {number}"
        if fault.kind not in KINDS:
            raise InputError(f"{at}: kind {fault.kind!r}; expected one of {', '.join(KINDS)}")
        if fault.observation < 0:
            raise InputError(f"{at}: observation {fault.observation}; expected 0 or more")
        if fault.object and fault.object not in catalogue.labels:
            raise InputError(f"{at}: object {fault.object!r}; expected one of {', '.join(catalogue.labels)}")
        if fault.object in scenario.objects.labels and fault.kind in NEED_ABSENT:
            raise InputError(f"{at}: {fault.object} is poured; expected another object for kind {fault.kind}")
        needed += fault.kind in NEED_ABSENT
    if needed > len(catalogue):
        raise InputError(
            f"{where}: faults: need {needed} labels with the objects that are poured; expected at most "
            f"{len(catalogue)}, as many as {catalogue.path} has"
        )


_PROBABILITIES = {
    "miss_rate", "wrong_label_rate", "true_label_lost_rate", "match_threshold", "spawn_threshold", "threshold",
    "min_survival", "least_sure",
}  # fmt: skip
_AT_LEAST_ONE = {
    "max_missed", "max_tracks", "max_attempts", "max_looks", "max_obstacle_points", "samples", "directions", "depths",
    "candidates", "particles", "grasps", "searches", "budget", "attempts", "yaws", "places",
}  # fmt: skip
_NOT_NEGATIVE = {"max_moves", "max_helpers"}
_POSITIVE = {
    "simulation_duration", "speed", "straight_speed", "approach", "point_size", "close_time", "open_time", "half_x",
    "area_per_object", "drop_height", "interval", "timeout", "grid", "lower",
}  # fmt: skip


def _check_numbers(config: Any, where: str) -> None:
    """Refuses numbers that cannot be meant, by the name of their field, in a configuration and all that it holds."""
    for field in dataclasses.fields(config):
        value, at = getattr(config, field.name), f"{where}: {field.name}"
        if dataclasses.is_dataclass(value):
            _check_numbers(value, at)
        elif isinstance(value, dict):
            for key, item in value.items():
                if dataclasses.is_dataclass(item):
                    _check_numbers(item, f"{at}: {key}")
        numbers = [n for n in (value if isinstance(value, list) else [value]) if isinstance(n, int | float)]
        if not all(math.isfinite(n) for n in numbers):
            raise InputError(f"{at} is {value}; expected finite numbers")
        if field.name in _PROBABILITIES and not all(0 <= n <= 1 for n in numbers):
            raise InputError(f"{at} is {value}; expected a number from 0 to 1")
        if field.name in _AT_LEAST_ONE and not all(n >= 1 for n in numbers):
            raise InputError(f"{at} is {value}; expected 1 or more")
        if field.name in _NOT_NEGATIVE and not all(n >= 0 for n in numbers):
            raise InputError(f"{at} is {value}; expected 0 or more")
        if field.name in _POSITIVE and not all(n > 0 for n in numbers):
            raise InputError(f"{at} is {value}; expected more than 0")
        if isinstance(value, list) and field.name in ("lifts", "retreats", "release_heights") and not value:
            raise InputError(f"{at} is empty; expected at least one height")
    # What a configuration checks of itself when it is made, YAML has gone around: Drake sets the fields afterwards.
    if hasattr(config, "__post_init__"):
        try:
            config.__post_init__()
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
