"""One sorting run, from the pour to the end, as a value."""

import contextlib
import dataclasses
import functools
import time
from collections.abc import Callable, Mapping

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, EventStatus

from sum_drake.assets import one_line
from sum_drake.costs import Costs
from sum_drake.executed import LimitUse, limit_use
from sum_drake.explaining import given_up
from sum_drake.faults import HandAct, absent_labels
from sum_drake.filter_config import filter_config
from sum_drake.objects import Catalogue
from sum_drake.pose_workers import PoseWorkers
from sum_drake.runlog import RunLogWriter
from sum_drake.seeds import derive
from sum_drake.summary_schema import FAILED
from sum_drake.systems.arm_controller import PERIOD
from sum_drake.systems.outside_hand import OutsideHand, waiting_place
from sum_drake.systems.ports import unpack
from sum_drake.systems.referee import TruthSample
from sum_drake.systems.scenario import Scenario
from sum_drake.systems.sorting import check_detector, make_sorting, pour_scene
from sum_drake.systems.station import set_home
from sum_drake.types import Array, Attempt, Perception

Progress = Callable[[str, float, float], None]
"""Told what was done ("" between steps), the simulated time in seconds, and about which share of the job is done."""


@dataclasses.dataclass(frozen=True, eq=False)
class Episode:
    """One run, as it went and as it truly was."""

    outcome: str
    """"cleared" or "stopped: <reason>"."""
    error: BaseException | None
    """What ended the run, if it failed; the rest is what there was until then."""
    perceptions: tuple[Perception, ...]
    attempts: tuple[Attempt, ...]
    truth: tuple[TruthSample, ...]
    """The referee's samples: for the score alone."""
    costs: Mapping[str, float]
    """CPU seconds of pouring, perception, planning and simulation."""
    wall_s: float
    sim_time_s: float
    absent: tuple[str, ...] = ()
    """Of the scenario's faults, `faults.absent_labels`."""
    acts: tuple[HandAct, ...] = ()
    """What somebody's hand did."""
    limit_use: LimitUse | None = None
    """How much of its limits the robot used, sampled as often as its controller runs."""


HAND_DELAY = 0.3
"""After an observation, before a hand does something: the robot has made up its mind, seconds."""


def run(
    scenario: Scenario,
    catalogue: Catalogue,
    *,
    open_log: Callable[[], RunLogWriter] | None = None,
    progress: Progress = lambda what, sim_time, share: None,
    on_diagram: Callable[[Diagram], None] = lambda diagram: None,
    workers: int = 1,
) -> Episode:
    """Pours, then sorts until the table is clear, nothing more can be done, or the simulated time is over.

    open_log: as in `make_sorting`. on_diagram: given the diagram once it is built. workers: processes that estimate
    poses; with 1 this one does. Until the diagram is built InputError and RuntimeError (a pour that does not come to
    rest) are raised; whatever goes wrong later ends the episode, and is in it.
    """
    start, costs = time.perf_counter(), Costs()
    check_detector(scenario, catalogue)
    with contextlib.ExitStack() as stack:
        estimator = None
        if workers > 1:
            count = functools.partial(costs.add, "pose workers")
            estimator = PoseWorkers(
                catalogue, filter_config(scenario.filter), workers, noise=scenario.depth_noise, on_cpu=count
            )
            stack.callback(estimator.close)
        progress("pouring", 0.0, 0.0)
        with costs.of("pouring"):
            X_WOs = pour_scene(scenario, catalogue)
        absent = absent_labels(
            scenario.faults, catalogue.labels, list(X_WOs), derive(scenario.random_seed, "labels of faults")
        )
        waiting = {label: fault for fault, label in zip(scenario.faults, absent, strict=True) if fault.kind == "added"}
        places = {label: waiting_place(catalogue[label], i) for i, label in enumerate(waiting)}
        diagram = make_sorting(
            scenario,
            X_WOs | places,
            catalogue,
            open_log=open_log,
            costs=costs,
            pose_estimator=estimator,
            absent=absent,
        )
        on_diagram(diagram)
        hand = OutsideHand(scenario, catalogue, diagram, absent)
        return _run(scenario, diagram, len(X_WOs), costs, progress, start, hand)


def _run(
    scenario: Scenario,
    diagram: Diagram,
    objects: int,
    costs: Costs,
    progress: Progress,
    start: float,
    hand: OutsideHand,
) -> Episode:
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    set_home(diagram.GetSubsystemByName("station"), root)
    watch = _Watch(diagram, objects, progress, hand)
    simulator.set_monitor(watch)
    error: BaseException | None = None

    def simulate() -> None:
        simulator.Initialize()
        simulator.AdvanceTo(scenario.simulation_duration)
        while watch.hand_is_due:
            hand.act(len(watch.perceptions) - 1, root)
            watch.hand_is_due = False
            simulator.AdvanceTo(scenario.simulation_duration)

    def end_log() -> None:
        if diagram.HasSubsystemNamed("run_log"):
            log = diagram.GetSubsystemByName("run_log")
            log.ForcedPublish(log.GetMyContextFromRoot(root))

    with costs.of("all"):
        # The log is ended whatever happened, and what went wrong first is what is told. Drake's failed assertions come
        # as SystemExit.
        for step in (simulate, end_log):
            try:
                step()
            except (Exception, SystemExit, KeyboardInterrupt) as failure:
                error = error or failure
    if isinstance(error, KeyboardInterrupt):
        raise error
    if error is not None:
        watch.outcome = f"{FAILED}{type(error).__name__}: {one_line(error)}"
    planner = diagram.GetSubsystemByName("sorting_planner")
    unfinished = None if watch.outcome else planner.unfinished(planner.GetMyContextFromRoot(root))
    seconds = dict(costs.seconds)
    seconds["simulation"] = seconds.pop("all") - seconds.get("perception", 0.0) - seconds.get("planning", 0.0)
    seconds["perception"] = seconds.get("perception", 0.0) + seconds.pop("pose workers", 0.0)
    referee = diagram.GetSubsystemByName("referee")
    return Episode(
        outcome=watch.outcome or f"stopped: {scenario.simulation_duration:g} s of simulated time are over",
        error=error,
        perceptions=tuple(watch.perceptions),
        attempts=watch.attempts if unfinished is None else (*watch.attempts, unfinished),
        truth=referee.samples(referee.GetMyContextFromRoot(root)),
        costs=seconds,
        wall_s=time.perf_counter() - start,
        sim_time_s=root.get_time(),
        absent=hand.absent,
        acts=tuple(hand.acts),
        limit_use=limit_use(_logged(diagram, root, "state"), _logged(diagram, root, "effort"), PERIOD),
    )


def _logged(diagram: Diagram, root: Context, what: str) -> Array:
    """(n, k): what the robot measured of itself."""
    samples: Array = diagram.GetSubsystemByName(f"executed_{what}").FindLog(root).data().T
    return samples


class _Watch:
    """The simulator's monitor: collects records, shows progress, ends the run when the planner says so."""

    def __init__(self, diagram: Diagram, count: int, progress: Progress, hand: OutsideHand) -> None:
        self.hand_is_due = False
        self._hand, self._observed = hand, 0.0
        self.perceptions: list[Perception] = []
        self.attempts: tuple[Attempt, ...] = ()
        self.outcome = ""
        self._diagram, self._count, self._progress, self._told = diagram, count, progress, 0.0
        planner, estimator = (
            diagram.GetSubsystemByName("sorting_planner"),
            diagram.GetSubsystemByName("scene_estimator"),
        )
        self._planner, self._estimator = planner, estimator
        self._perception = estimator.GetOutputPort("perception")
        self._outcome, self._attempts = planner.GetOutputPort("outcome"), planner.GetOutputPort("attempts")

    def __call__(self, root: Context) -> EventStatus:
        time_now = root.get_time()
        perception: Perception | None = unpack(self._perception.Eval(self._estimator.GetMyContextFromRoot(root)))
        if perception is not None and perception.step == len(self.perceptions):
            self.perceptions.append(perception)
            self._observed = time_now
            accepted = sum(track.accepted for track in perception.posterior.tracks)
            boxes = len(perception.detections)
            self._tell(f"observation {perception.step}: {boxes} detections, {accepted} objects accepted", time_now)
        context = self._planner.GetMyContextFromRoot(root)
        attempts: tuple[Attempt, ...] = self._attempts.Eval(context)
        for attempt in attempts[len(self.attempts) :]:
            said = given_up(attempt) if attempt.action is None else attempt.reason
            self._tell(f"{attempt.label} to {attempt.region}: {said}", time_now)
        self.attempts = attempts
        if time_now >= self._told + 1.0:
            self._tell("", time_now)
        self.outcome = self._outcome.Eval(context)
        if self.outcome:
            return EventStatus.ReachedTermination(self._diagram, self.outcome)
        if time_now >= self._observed + HAND_DELAY and self._hand.is_due(len(self.perceptions) - 1, root):
            self.hand_is_due = True
            return EventStatus.ReachedTermination(self._diagram, "a hand is about to do something")
        return EventStatus.Succeeded()

    def _tell(self, what: str, sim_time: float) -> None:
        placed = sum(attempt.reason == "executed" for attempt in self.attempts)
        self._told = sim_time
        self._progress(what, sim_time, min(1.0, placed / self._count))
