"""Do the best-ranked grasps hold? A free-flying hand picks single objects off a table in physics.

The hand is `robot.HAND` as boxes on three driven slides, so that nothing but the grasp is on trial: no arm, no
planning, no perception unless `--noise` asks for a pose error. Each object is dropped at a random orientation, comes
to rest, and is grasped, lifted by 15 cm and held.

    python benchmarks/grasps_quick.py --poses 4 --grasps 2
"""

import argparse
import contextlib
import dataclasses
import time

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from sum_drake.geometry import apply, inverse, rotation_angle, rotation_from_vector, transform
from sum_drake.grasp_ranking import rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates, surface
from sum_drake.objects import Catalogue, ObjectModel, load_catalogue
from sum_drake.parsing import make_parser
from sum_drake.robot import HAND
from sum_drake.types import Array, PoseBelief

TABLE = 0.7
LIFT = 0.15
FORCE = 60.0


def _proximity(friction: float, *, rigid: bool) -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(dissipation=5.0, friction=CoulombFriction(friction, friction), properties=properties)
    if rigid:
        AddRigidHydroelasticProperties(1.0, properties)
    else:
        AddCompliantHydroelasticProperties(0.02, 1e7, properties)
    return properties


class World:
    """A table, one object, and a hand at a fixed orientation on three slides."""

    def __init__(self, model: ObjectModel, R_WG: Array) -> None:
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=0.004, contact_model="hydroelastic_with_fallback", discrete_contact_approximation="sap"
        )
        plant, _ = AddMultibodyPlant(config, builder)
        self.plant = plant
        ground = RigidTransform([0.6, 0.0, TABLE - 0.5])
        plant.RegisterCollisionGeometry(
            plant.world_body(), ground, Box(1.0, 1.0, 1.0), "table", _proximity(0.5, rigid=True)
        )
        assert model.sdf is not None
        instance = make_parser(plant).AddModels(str(model.sdf))[0]
        self.object: RigidBody = plant.get_body(plant.GetBodyIndices(instance)[0])
        self._add_hand(plant, R_WG)
        plant.Finalize()
        self.instance: ModelInstanceIndex = instance
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())

    def _add_hand(self, plant: MultibodyPlant, R_WG: Array) -> None:
        hand = plant.AddModelInstance("hand")
        # The slides run along G's axes, from a frame at the world's origin that is turned as G is.
        frame = plant.AddFrame(
            FixedOffsetFrame("start", plant.world_frame(), RigidTransform(RotationMatrix(R_WG), [0, 0, 0]))
        )
        for axis in range(3):
            inertia = SpatialInertia(0.5, np.zeros(3), UnitInertia.SolidSphere(0.1))
            parent = plant.AddRigidBody(f"slide_{axis}", hand, inertia)
            joint = plant.AddJoint(PrismaticJoint(f"slide_{axis}", frame, parent.body_frame(), np.eye(3)[axis]))
            plant.AddJointActuator(f"slide_{axis}", joint, 1e4).set_controller_gains(PdControllerGains(p=2e4, d=600.0))
            frame = parent.body_frame()
        half = HAND.pad_thickness / 2
        size = Box(HAND.pad_x[1] - HAND.pad_x[0], HAND.pad_thickness, 2 * HAND.pad_half_width)
        palm = Box(HAND.palm_x[1] - HAND.palm_x[0], 2 * HAND.palm_half[0], 2 * HAND.palm_half[1])
        X_GP = RigidTransform([np.mean(HAND.palm_x), 0.0, 0.0])
        plant.RegisterCollisionGeometry(parent, X_GP, palm, "palm", _proximity(0.5, rigid=True))
        for name, sign in (("left", 1.0), ("right", -1.0)):
            inertia = SpatialInertia(0.08, np.zeros(3), UnitInertia.SolidSphere(0.02))
            finger = plant.AddRigidBody(name, hand, inertia)
            plant.RegisterCollisionGeometry(
                finger, RigidTransform([0.0, sign * half, 0.0]), size, name, _proximity(0.9, rigid=False)
            )
            joint = plant.AddJoint(
                PrismaticJoint(name, parent.body_frame(), finger.body_frame(), [0.0, sign, 0.0], 0.0, HAND.gap_max / 2)
            )
            plant.AddJointActuator(name, joint, FORCE).set_controller_gains(PdControllerGains(p=1e4, d=1500.0))
        left, right = plant.GetJointByName("left"), plant.GetJointByName("right")
        plant.AddCouplerConstraint(left, right, 1.0)
        plant.set_gravity_enabled(hand, False)
        self.R_WG = R_WG

    def X_WO(self) -> Array:
        return np.asarray(self.plant.EvalBodyPoseInWorld(self.context, self.object).GetAsMatrix4())

    def X_WG(self) -> Array:
        body = self.plant.GetBodyByName("slide_2")
        return np.asarray(self.plant.EvalBodyPoseInWorld(self.context, body).GetAsMatrix4())

    def gap(self) -> float:
        return float(sum(self.plant.GetJointByName(name).get_translation(self.context) for name in ("left", "right")))

    def start(self, X_WO: Array, p_WG: Array, gap: float) -> None:
        """Puts object and hand somewhere."""
        self.plant.SetFreeBodyPose(self.context, self.object, RigidTransform(X_WO))
        p_G = self.R_WG.T @ p_WG
        for axis in range(3):
            self.plant.GetJointByName(f"slide_{axis}").set_translation(self.context, p_G[axis])
        for name in ("left", "right"):
            self.plant.GetJointByName(name).set_translation(self.context, gap / 2)
        self._command(p_WG, gap)

    def _command(self, p_WG: Array, gap: float) -> None:
        q = np.concatenate([self.R_WG.T @ p_WG, [gap / 2, gap / 2]])
        port = self.plant.get_desired_state_input_port(self.plant.GetModelInstanceByName("hand"))
        port.FixValue(self.context, np.concatenate([q, np.zeros(5)]))

    def move(self, start: Array, goal: Array, gap: float, duration: float) -> None:
        """Drives the hand from start to goal along a line, smoothly."""
        began = self.simulator.get_context().get_time()
        steps = max(1, round(duration / 0.02))
        for i in range(1, steps + 1):
            s = i / steps
            self._command(start + (3 * s**2 - 2 * s**3) * (goal - start), gap)
            self.simulator.AdvanceTo(began + s * duration)


def resting_pose(model: ObjectModel, rng: np.random.Generator) -> Array:
    """X_WO after a drop at a random orientation."""
    for _ in range(5):
        with contextlib.suppress(RuntimeError):  # thin plates now and then explode in hydroelastic contact
            return _dropped(model, rng)
    raise RuntimeError(f"{model.label} does not come to rest")


def _dropped(model: ObjectModel, rng: np.random.Generator) -> Array:
    R = Rotation.random(rng=rng).as_matrix()
    lowest = (surface(model, 0.003).p_OQs @ R.T)[:, 2].min()
    world = World(model, np.eye(3))
    far = np.array([0.0, 0.0, 5.0])
    world.start(transform(R, np.array([0.6, 0.0, TABLE - lowest + 0.02])), far, 0.1)
    world.move(far, far, 0.1, 2.5)
    if np.abs(world.plant.GetVelocities(world.context)).max() > 0.1:
        raise RuntimeError("still moving")
    return world.X_WO()


@dataclasses.dataclass
class Trial:
    held: bool
    slip: float
    turn: float
    gap: float


def pick(model: ObjectModel, X_WO: Array, X_WG: Array, gap: float) -> Trial:
    """Approach, close, lift and hold; slip and turn of the object in the hand between closing and the end."""
    world = World(model, X_WG[:3, :3])
    goal = X_WG[:3, 3]
    pre = goal - 0.1 * X_WG[:3, 0]
    world.start(X_WO, pre, gap)
    world.move(pre, goal, gap, 0.8)
    world.move(goal, goal, 0.0, 1.0)
    X_GO = inverse(world.X_WG()) @ world.X_WO()
    closed = world.gap()
    up = goal + np.array([0.0, 0.0, LIFT])
    world.move(goal, up, 0.0, 1.2)
    world.move(up, up, 0.0, 0.6)
    X_GO_end = inverse(world.X_WG()) @ world.X_WO()
    slip = float(np.linalg.norm(X_GO_end[:3, 3] - X_GO[:3, 3]))
    turn = float(rotation_angle(X_GO[:3, :3].T @ X_GO_end[:3, :3]))
    p_OQs = surface(model, 0.003).p_OQs
    held = apply(world.X_WO(), p_OQs)[:, 2].min() > TABLE + 0.01 and bool(world.X_WO()[2, 3] - X_WO[2, 3] > 0.02)
    return Trial(bool(held), slip, turn, closed)


def evaluate(catalogue: Catalogue, labels: list[str], poses: int, grasps: int, noise: float, seed: int) -> None:
    config = GraspConfig()
    held = firm = trials = 0
    for number, label in enumerate(labels):
        model = catalogue[label]
        candidates = grasp_candidates(model, config=config, seed=0)
        lines = []
        for pose in range(poses):
            rng = np.random.default_rng([seed, number, pose])
            X_WO = resting_pose(model, rng)
            belief = PoseBelief(X_WO @ _noise(rng, 100, 0.003, 0.05), np.full(100, 0.01))
            X_WO_believed = X_WO @ _noise(rng, 1, noise, 10 * noise)[0]
            ranked = rank_grasps(
                candidates, model=model, X_WO=X_WO_believed, belief=belief, points_W=np.zeros((0, 3)),
                table_height=TABLE, config=config,
            )  # fmt: skip
            results = [
                pick(model, X_WO, ranked.X_WGs[i], float(ranked.gaps[i]))
                for i in range(min(grasps, len(ranked.grasps)))
            ]
            held += sum(r.held for r in results)
            firm += sum(r.held and r.slip < 0.02 and r.turn < np.radians(15) for r in results)
            trials += grasps
            shown = " ".join(
                f"{'ok' if r.held else 'LOST'}({1e3 * r.slip:.0f}mm {np.degrees(r.turn):.0f}°)" for r in results
            )
            rejected = {k: v for k, v in ranked.rejected_by if v}
            lines.append(f"   pose {pose}: {len(ranked.grasps):3d} left, rejected {rejected}: {shown or 'NO GRASP'}")
        print(f"{label}: {len(candidates)} candidates", *lines, sep="\n", flush=True)
    print(f"held {held}, of them firmly {firm} (slip < 2 cm, turn < 15°), of {trials}")


def _noise(rng: np.random.Generator, count: int, metres: float, radians: float) -> Array:
    return transform(rotation_from_vector(rng.normal(0, radians, (count, 3))), rng.normal(0, metres, (count, 3)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--labels", nargs="*")
    parser.add_argument("--poses", type=int, default=3, help="resting poses an object")
    parser.add_argument("--grasps", type=int, default=1, help="best-ranked grasps tried at each")
    parser.add_argument("--noise", type=float, default=0.0, help="standard deviation of the pose error, metres")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    catalogue = load_catalogue()
    began = time.process_time()
    evaluate(
        catalogue, arguments.labels or list(catalogue.labels), arguments.poses, arguments.grasps, arguments.noise,
        arguments.seed,
    )  # fmt: skip
    print(f"{time.process_time() - began:.0f} CPU s")
