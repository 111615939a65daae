"""What somebody's hand does to the objects of a running simulation, and where those wait that will be added."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import Context, Diagram

from sum_drake.faults import HAND, FaultConfig, HandAct
from sum_drake.geometry import rotation_from_quaternion, transform
from sum_drake.objects import Catalogue, ObjectModel
from sum_drake.seeds import derive
from sum_drake.systems.scenario import Scenario
from sum_drake.types import Array, Region

WAITING, TAKEN = np.array([-1.4, -1.2, 0.0]), np.array([-1.0, -1.2, 0.3])
"""On the floor behind the robot: the first places for what waits, and over it for what was taken."""
SPACING = 0.4
PUSH = 0.8
"""Speed of what is swept aside, m/s."""
DROP = 0.12
"""Height over the table from which an object is added, metres."""


def waiting_place(model: ObjectModel, place: int) -> Array:
    """X_WO (4, 4) of an object that waits at the place of that number."""
    lowest = float(np.asarray(model.load_mesh().vertices)[:, 2].min())
    return transform(np.eye(3), WAITING + np.array([0.0, SPACING * place, 0.002 - lowest]))


def act(
    index: int,
    fault: FaultConfig,
    station: Diagram,
    root: Context,
    *,
    observation: int,
    table: Region,
    model_of_added: ObjectModel | None,
    spared: str,
    place: int,
    rng: np.random.Generator,
) -> HandAct | None:
    """Sweeps, takes or adds an object, the scenario's fault `index`; None where there is none to sweep or take.

    spared: label of what the robot is about to pick. place: number of the waiting place for what is taken.
    """
    plant = station.GetSubsystemByName("plant")
    context = plant.GetMyMutableContextFromRoot(root)
    bodies = {
        plant.GetModelInstanceName(body.model_instance()): body
        for body in (plant.get_body(index) for index in sorted(plant.GetFloatingBaseBodies(), key=int))
    }
    p_WOs = {label: plant.EvalBodyPoseInWorld(context, body).translation() for label, body in bodies.items()}
    there = sorted(label for label, p_WO in p_WOs.items() if table.holds(p_WO) and label != spared)
    if fault.kind == "added":
        assert model_of_added is not None
        label = model_of_added.label
        X_WO = transform(rotation_from_quaternion(rng.normal(size=4)), _free_place(p_WOs, table, rng))
        V_WO = np.zeros(6)
    else:
        wanted = [fault.object] if fault.object in there else [] if fault.object else there
        if not wanted:
            return None
        label = str(rng.choice(wanted))
        X_WO = np.array(plant.EvalBodyPoseInWorld(context, bodies[label]).GetAsMatrix4())
        V_WO = np.zeros(6)
        if fault.kind == "swept":
            # Towards the middle, give or take a right angle: most of what is pushed stays on the table.
            inwards = np.arctan2(*(table.p_W - X_WO[:3, 3])[1::-1]) + rng.uniform(-np.pi / 2, np.pi / 2)
            V_WO = np.array([0.0, 0.0, rng.normal(0.0, 2.0), PUSH * np.cos(inwards), PUSH * np.sin(inwards), 0.0])
        else:
            X_WO = transform(np.eye(3), TAKEN + np.array([0.0, SPACING * place, 0.0]))
    body = bodies[label]
    R = RotationMatrix.ProjectToRotationMatrix(X_WO[:3, :3])
    plant.SetFloatingBaseBodyPoseInWorldFrame(context, body, RigidTransform(R, X_WO[:3, 3]))
    plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(V_WO))
    return HandAct(index, fault.kind, observation, root.get_time(), label)


def _free_place(p_WOs: dict[str, Array], table: Region, rng: np.random.Generator) -> Array:
    """The one of some places over the table that is farthest from everything on it."""
    height = table.floor_height + DROP
    places = [
        np.array([*(table.p_W[:2] + table.half_extents[:2] * rng.uniform(-0.6, 0.6, 2)), height]) for _ in range(20)
    ]
    return max(
        places, key=lambda p: min((float(np.linalg.norm(p[:2] - q[:2])) for q in p_WOs.values()), default=np.inf)
    )


class OutsideHand:
    """Somebody's hand, and what it does when: while the robot picks, after the observations that faults name.

    Where there is nothing to sweep or take then but what the robot is about to pick, it waits for the next pick.
    """

    def __init__(self, scenario: Scenario, catalogue: Catalogue, diagram: Diagram, absent: Sequence[str]) -> None:
        self.acts: list[HandAct] = []
        self.absent = tuple(absent)
        self._catalogue, self._diagram, self._table = catalogue, diagram, scenario.region("table")
        self._faults, self._tried = scenario.faults, -1
        seed = scenario.random_seed
        self._left = {
            i: np.random.default_rng(derive(seed, f"fault {i}"))
            for i, fault in enumerate(scenario.faults)
            if fault.kind in HAND
        }

    def is_due(self, observation: int, root: Context) -> bool:
        """Whether there is something to do after an observation, now that the robot picks."""
        if observation <= self._tried or not any(self._faults[i].observation <= observation for i in self._left):
            return False
        return self._target(root) is not None

    def act(self, observation: int, root: Context) -> None:
        """Does it. What the robot is about to pick is left alone."""
        self._tried = observation
        spared = self._target(root)
        for i in [i for i in self._left if self._faults[i].observation <= observation]:
            done = act(
                i,
                self._faults[i],
                self._diagram.GetSubsystemByName("station"),
                root,
                observation=observation,
                table=self._table,
                model_of_added=self._catalogue[self.absent[i]] if self.absent[i] else None,
                spared=spared or "",
                place=len(self.acts),
                rng=self._left[i],
            )
            if done is not None:
                self.acts.append(done)
                del self._left[i]

    def _target(self, root: Context) -> str | None:
        """Label of what the robot is about to pick; None where it is not."""
        planner = self._diagram.GetSubsystemByName("sorting_planner")
        under_way = planner.unfinished(planner.GetMyContextFromRoot(root))
        return None if under_way is None else str(under_way.label)
