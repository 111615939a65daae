"""The arm among what stands still: furniture, believed objects, and what the hand holds.

A `PlanningScene` is a value: believed objects, a held object and paddings are added by making another scene.
"""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.geometry import Convex
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import ModelDirective, ModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from sum_drake import robot
from sum_drake.assets import InputError, asset, one_line
from sum_drake.checked_scene import FINE, CheckedScene, JointSpace
from sum_drake.collision_model import Skeleton
from sum_drake.explaining import UNEXPLAINED
from sum_drake.objects import ObjectModel
from sum_drake.parsing import add_packages, parser_allowed
from sum_drake.types import Array, Immutable, readonly

SORTING = "package://sum_drake/scenes/sorting.dmd.yaml"
SPACE = JointSpace(
    tuple(joint.name for joint in robot.ARM_JOINTS),
    *robot.limits(),
    robot.velocity_limits(),
    robot.ACCELERATION,
)
_ROBOT = "fetch"
_HAND = "gripper_link"


@dataclasses.dataclass(frozen=True, eq=False)
class Solid(Immutable):
    """Something rigid, as the union of convex hulls in its own frame, and where it stands."""

    name: str
    hulls: tuple[Array, ...]
    """(n, 3) points each, n >= 4 and not flat."""
    X_WS: Array
    """(4, 4)."""
    margin: float = 0.0
    """Kept from it besides the padding of all solids, as it is not known better where it is; metres."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "hulls", tuple(readonly(hull) for hull in self.hulls))
        object.__setattr__(self, "X_WS", readonly(self.X_WS))


def solid_of(model: ObjectModel, X_WO: Array, name: str | None = None, *, margin: float = 0.0) -> Solid:
    """The collision pieces of an object at X_WO (4, 4); the convex hull of its mesh where it has none."""
    return Solid(name or model.label, _hulls(model), X_WO, margin)


@functools.lru_cache(maxsize=256)
def _hulls(model: ObjectModel) -> tuple[Array, ...]:
    return tuple(np.asarray(mesh.convex_hull.vertices, dtype=float) for mesh in model.load_collision())


def solids_of_points(points_W: Array, *, size: float = 0.02, name: str = UNEXPLAINED) -> tuple[Solid, ...]:
    """Boxes that cover points (m, 3) nothing explains, on a grid of `size` metres; neighbours are merged into one.

    One solid, or none where there are no points.
    """
    boxes = {
        tuple(cell): np.array([cell, cell + 1]) for cell in np.unique(np.floor(points_W / size).astype(int), axis=0)
    }
    for axis in (2, 0, 1):  # runs along z, then runs of equal runs along x, then y
        merged: dict[tuple[int, ...], Array] = {}
        others = [a for a in range(3) if a != axis]
        last: dict[tuple[int, ...], Array] = {}
        for _, box in sorted(boxes.items(), key=lambda item: (item[0][axis], item[0])):
            key = tuple(int(v) for v in box[:, others].ravel())
            before = last.get(key)
            if before is not None and before[1, axis] == box[0, axis]:
                before[1, axis] = box[1, axis]
            else:
                last[key] = merged[tuple(int(v) for v in box[0])] = box
        boxes = merged
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    hulls = tuple(size * np.where(corners, box[1], box[0]) for box in boxes.values())
    return (Solid(name, hulls, np.eye(4)),) if hulls else ()


@dataclasses.dataclass(frozen=True, eq=False)
class PlanningScene(CheckedScene):
    """The robot among what stands still: the scene's furniture, believed objects, and what the hand holds.

    Every q is (8,), ARM_JOINTS. Head at VIEW_HEAD, fingers `gap` apart.
    """

    directives: str | Sequence[ModelDirective] = SORTING
    """The furniture and a model named "fetch": a path, a package://sum_drake URI, or directives as Drake reads them."""
    solids: tuple[Solid, ...] = ()
    gap: float = robot.HAND.gap_max
    checker: SceneGraphCollisionChecker = None
    """Made from the rest, in about .3 CPU seconds; scenes derived from this one share or clone it."""
    skeleton: Any = None
    """A Skeleton, made with the checker; scenes derived from this one share it."""

    def __post_init__(self) -> None:
        """Raises InputError where the directives cannot be loaded."""
        if self.checker is None:
            object.__setattr__(self, "checker", _make_checker(self.directives, self.solids, self.names))
            object.__setattr__(self, "skeleton", Skeleton.of(self.checker, SPACE.names))

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Of the solids, in order; those of equal name are numbered: tide, tide#2."""
        given = [solid.name for solid in self.solids]
        counts = [given[: i + 1].count(name) for i, name in enumerate(given)]
        return tuple(f"{name}#{count}" if count > 1 else name for name, count in zip(given, counts, strict=True))

    def with_solids(self, solids: Sequence[Solid]) -> "PlanningScene":
        """The same furniture with these solids, nothing held, no padding."""
        return PlanningScene(self.directives, tuple(solids), self.gap)

    def with_gap(self, gap: float) -> "PlanningScene":
        """The same scene with the fingers `gap` metres apart."""
        return dataclasses.replace(self, gap=gap)

    def padded(self, *, furniture: float, solids: float, self_distance: float = 0.0) -> "PlanningScene":
        """The same scene where the robot must keep these distances (metres) from furniture, solids and itself.

        A solid's own margin comes on top, but where no distance is asked for.
        """
        checker = self.checker.Clone()
        checker.SetPaddingAllRobotEnvironmentPairs(furniture)
        checker.SetPaddingAllRobotRobotPairs(self_distance)
        for solid, name in zip(self.solids, self.names, strict=True):
            for link in self._links(checker):
                checker.SetPaddingBetween(self._body(name), link, solids + (solid.margin if solids > 0 else 0.0))
        return dataclasses.replace(self, checker=checker)

    def ignoring(self, *names: str) -> "PlanningScene":
        """The same scene without some of its solids."""
        checker = self.checker.Clone()
        for name, link in itertools.product(names, self._links(checker)):
            checker.SetCollisionFilteredBetween(self._body(name), link, True)
        return dataclasses.replace(self, checker=checker)

    def holding(self, hulls: Sequence[Array], X_GO: Array) -> "PlanningScene":
        """The same scene with convex hulls (n, 3), given in O, fixed to the hand at X_GO; they may touch the hand."""
        checker = self.checker.Clone()
        frame = checker.plant().GetFrameByName(_HAND)
        for hull in hulls:
            shape = Convex(points=hull.T, label="held")
            checker.AddCollisionShapeToFrame("held", frame, shape, RigidTransform(X_GO))
        return dataclasses.replace(self, checker=checker)

    @staticmethod
    def _links(checker: SceneGraphCollisionChecker) -> list[BodyIndex]:
        indices = map(BodyIndex, range(checker.plant().num_bodies()))
        return [index for index in indices if checker.IsPartOfRobot(index)]

    def _body(self, name: str) -> BodyIndex:
        plant = self.checker.plant()
        return plant.GetBodyByName(name, plant.GetModelInstanceByName(f"solid::{name}")).index()

    @property
    def space(self) -> JointSpace:
        """The torso and the arm."""
        return SPACE

    @functools.cached_property
    def q_full(self) -> Array:
        """The plant's positions: torso and arm at VIEW, the head at VIEW_HEAD."""
        plant = self.checker.plant()
        q = np.empty(plant.num_positions())
        stand = (*robot.VIEW, *robot.VIEW_HEAD, self.gap / 2, self.gap / 2)
        for joint, value in zip(robot.JOINTS, stand, strict=True):
            q[plant.GetJointByName(joint.name).position_start()] = value
        return q


def _make_checker(
    directives: str | Sequence[ModelDirective], solids: Sequence[Solid], names: Sequence[str]
) -> SceneGraphCollisionChecker:
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    add_packages(builder.parser())
    try:
        if isinstance(directives, str):
            builder.parser().AddModels(str(asset(directives)))
        else:
            ProcessModelDirectives(ModelDirectives(directives=list(directives)), builder.parser())
        fetch = builder.plant().GetModelInstanceByName(_ROBOT)
    except RuntimeError as error:
        where = directives if isinstance(directives, str) else "directives"
        raise InputError(f"{where}: {one_line(error)}: expected model directives with a model '{_ROBOT}'") from error
    plant = builder.plant()
    for solid, name in zip(solids, names, strict=True):
        instance = plant.AddModelInstance(f"solid::{name}")
        body = plant.AddRigidBody(name, instance, SpatialInertia.NaN())
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(solid.X_WS))
        for i, hull in enumerate(solid.hulls):
            shape = Convex(points=hull.T, label=name)
            plant.RegisterCollisionGeometry(body, RigidTransform(), shape, f"{i}", CoulombFriction(1.0, 1.0))
    return SceneGraphCollisionChecker(
        model=builder.Build(), robot_model_instances=[fetch], edge_step_size=FINE, implicit_context_parallelism=False
    )
