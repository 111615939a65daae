"""Picks by a robot that is told where everything truly is: station, planner, controller, without eyes. For benches."""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, System
from pydrake.systems.primitives import LogVectorOutput

from sum_drake.assets import one_line
from sum_drake.executed import LimitUse, limit_use
from sum_drake.objects import Catalogue
from sum_drake.summary_schema import FAILED
from sum_drake.systems.arm_controller import ArmController
from sum_drake.systems.ports import abstract
from sum_drake.systems.referee import Referee, TruthSample
from sum_drake.systems.scenario import Scenario
from sum_drake.systems.sorting import POLL, SETTLE
from sum_drake.systems.sorting_planner import SortingPlanner
from sum_drake.systems.station import make_station, object_bodies, set_home
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import Array, Attempt, Camera, Frame, Immutable, Motion, Perception, SceneBelief, readonly

Poses = Mapping[str, Array]
"""True X_WO (4, 4) by label."""


@dataclasses.dataclass(frozen=True, eq=False)
class PickTrial(Immutable):
    """What the robot did, and what truly came of it."""

    outcome: str
    attempts: tuple[Attempt, ...]
    truth: tuple[TruthSample, ...]
    """The referee's samples: the last one tells where everything ended."""
    use: LimitUse
    """Of the robot's limits."""
    sim_time_s: float


def run_picks(
    scenario: Scenario,
    catalogue: Catalogue,
    X_WOs: Poses,
    *,
    decide: Callable[[Poses, tuple[Attempt, ...], Array], Pick | Look | Stop],
    retreat: Callable[[Poses, Array, int, Pick | None], Motion],
    carry_on: Callable[[Poses, Pick, Array, int], Motion],
    shake: Callable[[Poses, Pick, Array, int, int], Motion],
    duration: float = 120.0,
) -> PickTrial:
    """Does what `decide` says until that is to stop, or `duration` seconds of simulated time are over.

    X_WOs: of what is on the table. decide: given the true poses, the attempts so far and the arm's positions (8,).
    retreat, carry_on, shake: as of `Recovering`, but given the true poses at the last decision. A simulation that
    fails ends the trial, and its outcome says so.
    """
    told: dict[int, Poses] = {}
    builder = DiagramBuilder()
    station = builder.AddNamedSystem(
        "station",
        make_station(
            plant_config=scenario.plant_config,
            directives=scenario.directives,
            camera=scenario.cameras["head_camera"],
            noise=scenario.depth_noise,
            objects={label: (str(catalogue[label].sdf), X_WO) for label, X_WO in X_WOs.items()},
            seed=0,
        ),
    )
    planner = builder.AddNamedSystem(
        "sorting_planner",
        SortingPlanner(
            decide=lambda perception, attempts, looks, q: decide(told[perception.step], tuple(attempts), q),
            retreat=lambda perception, q, motion, pick: retreat(told[perception.step], q, motion, pick),
            carry_on=lambda perception, pick, q, motion: carry_on(told[perception.step], pick, q, motion),
            shake=lambda perception, pick, q, motion, times: shake(told[perception.step], pick, q, motion, times),
            period=POLL,
            settle_time=SETTLE,
        ),
    )
    controller = builder.AddNamedSystem("arm_controller", ArmController(step=scenario.plant_config.time_step))
    plant = station.GetSubsystemByName("plant")
    hand = int(plant.GetBodyByName("gripper_link").index())
    referee = builder.AddNamedSystem("referee", Referee(objects=object_bodies(station), hand=hand, period=POLL))
    step = scenario.plant_config.time_step
    states = LogVectorOutput(station.GetOutputPort("fetch.state"), builder, step)
    efforts = LogVectorOutput(station.GetOutputPort("fetch.effort"), builder, step)

    def connect(source: System, output: str, target: System, port: str) -> None:
        builder.Connect(source.GetOutputPort(output), target.GetInputPort(port))

    for target in (planner, controller):
        connect(station, "fetch.state", target, "robot_state")
        connect(station, "fetch.effort", target, "effort")
    connect(controller, "motion_status", planner, "motion_status")
    connect(planner, "motion", controller, "motion")
    connect(controller, "desired_state", station, "fetch.desired_state")
    connect(station, "truth.body_poses", referee, "body_poses")
    connect(planner, "observe", referee, "observe")
    connect(controller, "motion_status", referee, "motion_status")
    diagram = builder.Build()

    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    set_home(station, root)
    of_planner = planner.GetMyMutableContextFromRoot(root)
    perception = planner.GetInputPort("perception")
    perception.FixValue(of_planner, abstract())
    observe, said = planner.GetOutputPort("observe"), planner.GetOutputPort("outcome")

    def monitor(context: Context) -> EventStatus:
        mine = planner.GetMyContextFromRoot(context)
        if said.Eval(mine) or round(observe.Eval(mine)[0]) > len(told):
            return EventStatus.ReachedTermination(planner, "the planner has something to say")
        return EventStatus.Succeeded()

    simulator.set_monitor(monitor)
    outcome = ""
    try:
        simulator.Initialize()
        while not outcome and root.get_time() < duration:
            simulator.AdvanceTo(duration)
            outcome = str(said.Eval(of_planner))
            observation = len(told)
            if round(observe.Eval(of_planner)[0]) > observation:
                X_WBs = station.GetOutputPort("truth.body_poses").Eval(station.GetMyContextFromRoot(root))
                told[observation] = {k: readonly(X_WBs[i].GetAsMatrix4()) for k, i in object_bodies(station).items()}
                perception.FixValue(of_planner, abstract(_blind(observation)))
    except (Exception, SystemExit) as failure:  # Drake's failed assertions come as SystemExit
        outcome = f"{FAILED}{type(failure).__name__}: {one_line(failure)}"
    unfinished = None if outcome else planner.unfinished(of_planner)
    attempts: tuple[Attempt, ...] = planner.GetOutputPort("attempts").Eval(of_planner)
    return PickTrial(
        outcome=outcome or f"stopped: {duration:g} s of simulated time are over",
        attempts=attempts if unfinished is None else (*attempts, unfinished),
        truth=referee.samples(referee.GetMyContextFromRoot(root)),
        use=limit_use(states.FindLog(root).data().T, efforts.FindLog(root).data().T, step),
        sim_time_s=root.get_time(),
    )


def _blind(step: int) -> Perception:
    """An observation of nothing: what the planner needs is its number."""
    frame = Frame(
        step,
        readonly(np.zeros((1, 1, 3)), np.uint8),
        readonly(np.zeros((1, 1)), np.float32),
        Camera(1, 1, 1.0, 1.0, 0.0, 0.0),
        readonly(np.eye(4)),
    )
    return Perception(step, frame, (), (), SceneBelief(step - 1), SceneBelief(step), None)
