"""What the drives of the arm have to give for a motion, by the robot's own model of itself."""

import dataclasses
import functools

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, JacobianWrtVariable, MultibodyForces
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.systems.framework import Context

from sum_drake.assets import asset
from sum_drake.parsing import add_packages, parser_allowed
from sum_drake.robot import ARM_JOINTS, FETCH_URDF
from sum_drake.types import Array, Immutable

GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclasses.dataclass(frozen=True, eq=False)
class ArmDynamics(Immutable):
    """Inverse dynamics of torso and arm. The links weigh nothing: the drives bear that by themselves."""

    def efforts(self, q: Array, v: Array, a: Array, mass: float = 0.0) -> Array:
        """(8,): forces and torques of ARM_JOINTS at positions, speeds and accelerations (8,) each.

        mass: of what the hand holds, kilograms; it acts as a point between the fingers.
        """
        model = _model()
        plant, context = model.plant, model.context
        full = np.zeros((3, plant.num_velocities()))
        full[:, model.order] = q, v, a
        plant.SetPositions(context, full[0])
        plant.SetVelocities(context, full[1])
        efforts = plant.CalcInverseDynamics(context, full[2], MultibodyForces(plant))
        if mass > 0.0:
            world = plant.world_frame()
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, model.hand, np.zeros(3), world, world
            )
            efforts = efforts + mass * J.T @ (J @ full[2] - GRAVITY)
        return np.asarray(efforts[model.order])

    def hanging(self, q: Array, efforts: Array) -> float:
        """Mass that hangs on the hand of an arm at rest, kilograms; less than nothing where the hand is pushed upwards.

        By least squares, from measured efforts (8,) of ARM_JOINTS at q (8,). Each drive's counts as a share of what it
        can give, as its error does; a thing that hangs pulls where it hangs, wherever its own middle is.
        """
        limit = np.array([joint.effort for joint in ARM_JOINTS])
        of_one_kilogram = self.efforts(q, np.zeros(len(q)), np.zeros(len(q)), 1.0) / limit
        return float(of_one_kilogram @ (efforts / limit) / (of_one_kilogram @ of_one_kilogram))


@dataclasses.dataclass(frozen=True, eq=False)
class _Model:
    """The robot alone; context is a part of root, which is of diagram."""

    diagram: RobotDiagram
    root: Context
    plant: MultibodyPlant
    context: Context
    order: Array
    """Where each of ARM_JOINTS stands in the plant's positions and velocities."""
    hand: Frame


@functools.lru_cache(maxsize=1)
def _model() -> _Model:
    with parser_allowed():
        builder = RobotDiagramBuilder(time_step=0.0)
    add_packages(builder.parser()).AddModels(str(asset(FETCH_URDF)))
    plant = builder.plant()
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    order = np.array([plant.GetJointByName(joint.name).velocity_start() for joint in ARM_JOINTS])
    context = plant.GetMyMutableContextFromRoot(root)
    return _Model(diagram, root, plant, context, order, plant.GetFrameByName("gripper_link"))
