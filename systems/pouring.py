"""Pours objects onto the table: a small simulation of its own, whose settled poses start the station.

Objects fall one after another, turned at random, between four walls that nobody sees. Once they lie still the walls
go, what leaned on them slumps, and once all is at rest the poses are taken: what stands on an edge is slow at first.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    GeometryId,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import (
    ModelDirective,
    ModelDirectives,
    ProcessModelDirectives,
)
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from sum_drake.assets import InputError, one_line
from sum_drake.geometry import rotation_angle
from sum_drake.objects import Catalogue, ObjectModel
from sum_drake.parsing import make_parser
from sum_drake.types import Array, readonly


@dataclasses.dataclass
class PouringConfig:
    """Where and how objects are poured. SI units."""

    support: str = "table"
    """Model of the directives that is poured onto; nothing else of the scene takes part."""
    center: list[float] = dataclasses.field(default_factory=lambda: [0.60, 0.0])
    """Middle of the poured region in the world's x and y."""
    half_x: float = 0.15
    """Half the region's extent along x: as far as the arm reaches well."""
    area_per_object: float = 0.016
    """Square metres of the region for each object; sets its extent along y. Less means denser clutter."""
    half_y_min: float = 0.13
    """Least half-extent along y, for few objects."""
    half_y_max: float = 0.36
    """Largest half-extent along y: more objects pile up."""
    drop_height: float = 0.30
    """Height of an object's lowest possible point over the table when it is let go, unless something is in the way."""
    interval: float = 0.15
    """Time between two releases."""
    settled_speed: float = 0.01
    """Speed below which an object is still, m/s."""
    settled_rate: float = 0.15
    """Turning rate below which an object is still, rad/s."""
    settled_time: float = 0.3
    """How long all objects must be still at each stage."""
    timeout: float = 6.0
    """Simulated time after which a stage that does not settle is given up."""
    rest_time: float = 2.0
    """At the end all objects must have been at rest for so long, seconds."""
    rest_moved: float = 0.0005
    """An object whose origin moved by no more than this in `rest_time` is at rest, metres,"""
    rest_turned: float = 0.01
    """if it turned by no more than this, either, radians."""
    reach_x: list[float] = dataclasses.field(default_factory=lambda: [0.45, 0.76])
    """World x between which every object's origin must come to rest."""
    reach_y: list[float] = dataclasses.field(default_factory=lambda: [-0.34, 0.34])
    """The same along y; farther out an object leaves the camera's view."""
    returns: int = 8
    """How often what fell off the table, came to rest out of reach or is pressed into another is dropped again, or what
    is not yet at rest is waited for."""
    return_height: float = 0.03
    """Height of a returned object's lowest possible point over what is below it."""
    penetration_max: float = 0.002
    """Largest overlap of two bodies at rest."""
    attempts: int = 20
    """Pours tried, each with a seed of its own, before giving up."""


class _Rejected(Exception):
    """A pour whose result cannot be used; says why."""


def draw_labels(catalogue: Catalogue, count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """`count` different labels in random order. Raises InputError for a count that the catalogue cannot give."""
    if not 1 <= count <= len(catalogue):
        raise InputError(f"{count} objects from {catalogue.path}: expected a count from 1 to {len(catalogue)}")
    return tuple(catalogue.labels[i] for i in rng.permutation(len(catalogue))[:count])


def pour(
    *,
    objects: Sequence[ObjectModel],
    directives: Sequence[ModelDirective],
    plant_config: MultibodyPlantConfig,
    config: PouringConfig,
    seed: int,
) -> dict[str, Array]:
    """Settled poses X_WO (4, 4) by label, a function of the arguments alone.

    Raises InputError for an object without a simulation model or a support that the directives do not hold, and
    RuntimeError when no attempt comes to a usable rest.
    """
    labels = [model.label for model in objects]
    if len(set(labels)) < len(labels):
        raise InputError(f"objects to pour are {', '.join(labels)}: expected every label once")
    for model in objects:
        if model.sdf is None:
            raise InputError(f"object '{model.label}' has no sdf in the catalogue: expected one for simulation")
    reasons = []
    for attempt in range(config.attempts):
        try:
            return _Pour(objects, directives, plant_config, config).run(np.random.default_rng([seed, attempt]))
        except _Rejected as reason:
            reasons.append(str(reason))
    raise RuntimeError(f"pouring {', '.join(labels)} with seed {seed} failed {len(reasons)} times: {reasons[-1]}")


class _Pour:
    """One attempt's plant and walls."""

    def __init__(
        self,
        objects: Sequence[ObjectModel],
        directives: Sequence[ModelDirective],
        plant_config: MultibodyPlantConfig,
        config: PouringConfig,
    ) -> None:
        self._config = config
        self._objects = objects
        builder = DiagramBuilder()
        self._plant: MultibodyPlant
        self._scene_graph: SceneGraph
        self._plant, self._scene_graph = AddMultibodyPlant(plant_config, builder)
        parser = make_parser(self._plant)
        ProcessModelDirectives(ModelDirectives(directives=_only(directives, config.support)), parser)
        self._parked: set[int] = set()
        self._instances = [parser.AddModels(str(model.sdf))[0] for model in objects]
        self._top = _top(self._plant, self._scene_graph, config.support)
        half_y = len(objects) * config.area_per_object / (4 * config.half_x)
        self._half = np.array([config.half_x, np.clip(half_y, config.half_y_min, config.half_y_max)])
        self._walls = self._add_walls()
        self._plant.Finalize()
        self._diagram: Diagram = builder.Build()

    def _add_walls(self) -> tuple[list[GeometryId], list[GeometryId]]:
        """Walls about the region: the two across x, the two across y."""
        height, thickness = 3.0, 0.2
        properties = ProximityProperties()
        # Hydroelastic, since boxes that lean on point contacts rock for ever; slippery, so that little does lean.
        AddRigidHydroelasticProperties(properties)
        AddContactMaterial(friction=CoulombFriction(0.05, 0.05), properties=properties)
        walls: tuple[list[GeometryId], list[GeometryId]] = ([], [])
        for axis in (0, 1):
            for sign in (-1.0, 1.0):
                p = np.array([*self._config.center, self._top + height / 2])
                p[axis] += sign * (self._half[axis] + thickness / 2)
                size = np.array([2.0, 2.0, height])
                size[axis] = thickness
                wall = self._plant.RegisterCollisionGeometry(
                    self._plant.world_body(), RigidTransform(p), Box(*size), f"wall_{axis}{sign:+.0f}", properties
                )
                walls[axis].append(wall)
        return walls

    def run(self, rng: np.random.Generator) -> dict[str, Array]:
        """Pours, settles, takes the walls away, settles again, checks."""
        simulator = Simulator(self._diagram)
        context = simulator.get_mutable_context()
        plant_context = self._plant.GetMyMutableContextFromRoot(context)
        for i in range(len(self._objects)):
            self._park(plant_context, i)
        simulator.Initialize()
        for i in rng.permutation(len(self._objects)).tolist():
            self._release(plant_context, i, rng, self._config.drop_height)
            _advance(simulator, self._config.interval)
        self._settle(simulator, plant_context, "between the walls")
        scene_context = self._scene_graph.GetMyMutableContextFromRoot(context)
        # The walls at the sides go first: what leans slumps along the table rather than over its edge.
        for axis, gone in ((1, "after the walls at the sides went"), (0, "after all walls went")):
            for wall in self._walls[axis]:
                self._scene_graph.RemoveRole(scene_context, self._plant.get_source_id(), wall, Role.kProximity)
            self._settle(simulator, plant_context, gone)
        for _ in range(self._config.returns):
            astray = {*self._astray(plant_context), *(upper for upper, _ in self._overlaps(context))}
            for i in sorted(astray):
                self._release(plant_context, i, rng, self._config.return_height)
                _advance(simulator, self._config.interval)
            if astray:
                self._settle(simulator, plant_context, "after what went astray was put back")
            elif moving := self._moving(simulator, plant_context):
                self._settle(simulator, plant_context, f"after {moving}")
            else:
                break
        else:
            self._check(context, plant_context)
            if moving := self._moving(simulator, plant_context):
                raise _Rejected(moving)
        self._check(context, plant_context)
        return {
            model.label: readonly(self._pose(plant_context, instance).GetAsMatrix4())
            for model, instance in zip(self._objects, self._instances, strict=True)
        }

    def _park(self, context: Context, index: int) -> None:
        """Puts an object into free fall far away and apart from the others, touching nothing."""
        self._place(context, self._instances[index], np.array([1.0, 0, 0, 0]), np.array([20.0 + 2 * index, 20.0, 50.0]))
        self._parked.add(index)

    def _astray(self, context: Context) -> list[int]:
        """Objects that fell off or lie out of reach."""
        config, astray = self._config, []
        for i, instance in enumerate(self._instances):
            x, y, _ = self._pose(context, instance).translation()
            within = config.reach_x[0] <= x <= config.reach_x[1] and config.reach_y[0] <= y <= config.reach_y[1]
            if i in self._parked or not within:
                astray.append(i)
        return astray

    def _place(self, context: Context, instance: object, quaternion: Array, p_WO: Array) -> None:
        self._plant.SetPositions(context, instance, np.concatenate([quaternion, p_WO]))
        self._plant.SetVelocities(context, instance, np.zeros(6))

    def _pose(self, context: Context, instance: object) -> RigidTransform:
        return self._plant.EvalBodyPoseInWorld(context, self._plant.get_body(self._plant.GetBodyIndices(instance)[0]))

    def _release(self, context: Context, index: int, rng: np.random.Generator, height: float) -> None:
        """Lets an object go `height` over a random place, turned at random, above all that fell before it."""
        config = self._config
        radii = [np.linalg.norm(model.dimensions) / 2 for model in self._objects]
        quaternion = rng.normal(size=4)
        margin = np.minimum(0.7 * self._half, min(self._objects[index].dimensions) / 2 + 0.02)
        x, y = np.array(config.center) + rng.uniform(-1, 1, 2) * (self._half - margin)
        p_WO = np.array([x, y, self._top + height + radii[index]])
        # A sphere about the object stays clear of the spheres about those still in the air below.
        others = [
            (self._pose(context, instance).translation(), radius)
            for k, (instance, radius) in enumerate(zip(self._instances, radii, strict=True))
            if k != index
        ]
        while any(np.linalg.norm(p_WO - p) < radii[index] + radius for p, radius in others):
            p_WO[2] += 0.02
        self._place(context, self._instances[index], quaternion / np.linalg.norm(quaternion), p_WO)
        self._parked.discard(index)

    def _settle(self, simulator: Simulator, context: Context, stage: str) -> None:
        """Simulates until all objects have been still for long enough; what falls off is parked."""
        config, step = self._config, 0.05
        start, still, moving = simulator.get_context().get_time(), 0.0, ""
        while still < config.settled_time - 1e-9:
            now = simulator.get_context().get_time()
            if now - start > config.timeout:
                raise _Rejected(f"after {config.timeout:g} s {stage} {moving}")
            _advance(simulator, step)
            moving = ""
            for i, (model, instance) in enumerate(zip(self._objects, self._instances, strict=True)):
                if i in self._parked:
                    continue
                velocity = self._plant.GetVelocities(context, instance)  # angular, then linear
                rate, speed = np.linalg.norm(velocity[:3]), np.linalg.norm(velocity[3:])
                if not np.isfinite(rate + speed):
                    raise _Rejected(f"the motion of {model.label} blew up {stage}")
                if rate > config.settled_rate or speed > config.settled_speed:
                    moving = f"{model.label} moves at {speed:.3f} m/s, {rate:.2f} rad/s"
                if self._pose(context, instance).translation()[2] < self._top:
                    self._park(context, i)
            still = 0.0 if moving else still + step

    def _moving(self, simulator: Simulator, context: Context) -> str:
        """Simulates on for as long as all must be at rest; which objects were not, in words, "" where all were."""
        config = self._config
        before = [self._pose(context, instance) for instance in self._instances]
        _advance(simulator, config.rest_time)
        moving = []
        for model, instance, X_WB in zip(self._objects, self._instances, before, strict=True):
            X_BO = X_WB.InvertAndCompose(self._pose(context, instance))
            moved, turned = np.linalg.norm(X_BO.translation()), rotation_angle(X_BO.rotation().matrix())
            if not (moved <= config.rest_moved and turned <= config.rest_turned):
                moving.append(model.label)
        return f"{', '.join(moving)} went on moving" if moving else ""

    def _check(self, root: Context, context: Context) -> None:
        """Nothing out of reach, nothing inside anything else."""
        astray = [self._objects[i].label for i in self._astray(context)]
        if astray:
            raise _Rejected(f"{', '.join(astray)} fell off the {self._config.support} or came to rest out of reach")
        for _, words in self._overlaps(root):
            raise _Rejected(words)

    def _overlaps(self, root: Context) -> list[tuple[int, str]]:
        """Pairs that overlap by more than they may: the object that lies higher, and words."""
        query = self._scene_graph.get_query_output_port().Eval(self._scene_graph.GetMyContextFromRoot(root))
        inspector, context = query.inspector(), self._plant.GetMyContextFromRoot(root)
        heights = [self._pose(context, instance).translation()[2] for instance in self._instances]
        found = []
        for pair in query.ComputePointPairPenetration():
            if pair.depth <= self._config.penetration_max:
                continue
            bodies = [self._plant.GetBodyFromFrameId(inspector.GetFrameId(g)) for g in (pair.id_A, pair.id_B)]
            instances = [body.model_instance() for body in bodies]
            objects = [self._instances.index(k) for k in instances if k in self._instances]
            names = " and ".join(body.name() for body in bodies)
            found.append((max(objects, key=lambda i: heights[i]), f"{names} overlap by {pair.depth * 1e3:.1f} mm"))
        return found


def _advance(simulator: Simulator, duration: float) -> None:
    """Simulates on; a state that Drake cannot step from rejects the attempt."""
    try:
        simulator.AdvanceTo(simulator.get_context().get_time() + duration)
    except (RuntimeError, SystemExit) as error:  # the latter is how a failed DRAKE_DEMAND reaches Python
        raise _Rejected(f"the simulation broke down: {one_line(error)}") from error


def _only(directives: Sequence[ModelDirective], model: str) -> list[ModelDirective]:
    """The directives that add one model and fix it in place."""
    kept = [
        directive
        for directive in directives
        if (directive.add_model is not None and directive.add_model.name == model)
        or (directive.add_weld is not None and directive.add_weld.child.startswith(f"{model}::"))
    ]
    if not any(directive.add_model is not None for directive in kept):
        raise InputError(f"the scene's directives add no model '{model}': expected the one to pour onto")
    return kept


def _top(plant: MultibodyPlant, scene_graph: SceneGraph, model: str) -> float:
    """World z of the highest face of a welded model's collision boxes."""
    inspector = scene_graph.model_inspector()
    heights = []
    instance = plant.GetModelInstanceByName(model)
    for index in plant.GetBodyIndices(instance):
        body = plant.get_body(index)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            shape = inspector.GetShape(geometry)
            if isinstance(shape, Box):
                heights.append(inspector.GetPoseInFrame(geometry).translation()[2] + shape.height() / 2)
    if not heights:
        raise InputError(
            f"model '{model}' has no collision box: expected one whose upper face is the surface to pour on"
        )
    return float(max(heights))
