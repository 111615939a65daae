"""How a pick with true poses is done and judged, in processes of their own: see `plan_picks`."""

import contextlib
import dataclasses
import functools
import itertools
import json
import time
from collections.abc import Sequence

import numpy as np

from sum_drake import robot
from sum_drake.attempting import region_of
from sum_drake.bench.plan_picks import CLUTTER, Picked
from sum_drake.carrying import Carrying
from sum_drake.evaluation import where_is
from sum_drake.geometry import apply, inverse
from sum_drake.grasp_ranking import rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue, ObjectModel, sample_surface
from sum_drake.picking import PickPlan, plan_pick_place
from sum_drake.planning_scene import PlanningScene
from sum_drake.retreat import plan_retreat
from sum_drake.seeds import derive
from sum_drake.shaking import plan_shaking
from sum_drake.systems.pick_trial import PickTrial, Poses, run_picks
from sum_drake.systems.pouring import draw_labels, pour
from sum_drake.systems.referee import TruthSample, transport_slip
from sum_drake.systems.scenario import Scenario, load_scenario
from sum_drake.systems.sorting import flat_directives
from sum_drake.task import Look, Pick, Stop
from sum_drake.types import Array, Attempt, Box, Motion, PoseBelief, Track, readonly

MOVED = 0.03
"""An object that moves by more than this in the hand has left it, metres."""
OBSTACLE_POINTS = 3000
"""Points on the surfaces of what the hand must not touch."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Robot:
    """What the robot knows of itself and of the place."""

    catalogue: Catalogue
    scenario: Scenario
    arm: Arm
    scene: PlanningScene


_robot: _Robot
"""This process's, in those that measure."""


def start_worker(catalogue: Catalogue) -> None:
    """Makes ready to measure in this process."""
    global _robot
    scenario = scenario_for(catalogue)
    _robot = _Robot(catalogue, scenario, Arm(), PlanningScene(flat_directives(scenario.directives)))


def scenario_for(catalogue: Catalogue) -> Scenario:
    """The sorting scenario in which every label of a catalogue, whatever its category, has a region to go to."""
    usual = load_scenario()
    bins = sorted(set(usual.goal.values()))
    goal = {
        label: usual.goal.get(model.category, bins[i % len(bins)]) for i, (label, model) in enumerate(catalogue.items())
    }
    text = json.dumps({"goal": goal, "objects": {"count": min(CLUTTER, len(catalogue))}})  # which is YAML, too
    return load_scenario(text=text, catalogue=catalogue)


def measure_pick(setting: str, seed: int, label: str) -> Picked:
    """What came of a task of `pick_tasks`."""
    start = time.process_time()
    rng = np.random.default_rng(seed)
    catalogue, scenario = _robot.catalogue, _robot.scenario
    labels = (label,) if setting == "alone" else draw_labels(catalogue, min(CLUTTER, len(catalogue)), rng)
    X_WOs = pour(
        objects=[catalogue[each] for each in labels],
        directives=flat_directives(scenario.directives),
        plant_config=scenario.plant_config,
        config=scenario.pouring,
        seed=seed,
    )
    order = [labels[i] for i in rng.permutation(len(labels))]
    deciding = _Deciding(_robot, order, seed)
    trial = run_picks(
        scenario,
        catalogue,
        X_WOs,
        decide=deciding.decide,
        retreat=deciding.retreat,
        carry_on=deciding.carry_on,
        shake=deciding.shake,
    )
    picked = judge(setting, seed, order, X_WOs, trial, _robot)
    return dataclasses.replace(picked, planning_cpu_s=deciding.cpu_s, cpu_s=time.process_time() - start)


@dataclasses.dataclass
class _Deciding:
    """One pick: of the first object in the order for which there is a plan."""

    robot: _Robot
    order: Sequence[str]
    seed: int
    cpu_s: float = 0.0

    def decide(self, X_WOs: Poses, attempts: tuple[Attempt, ...], q: Array) -> Pick | Look | Stop:
        if attempts:
            return Stop("cleared", ())
        start = time.process_time()
        refused: list[Attempt] = []
        for drags, (number, label) in itertools.product((False, True), enumerate(self.order)):
            choice = plan_pick(self.robot, X_WOs, label, q, self.seed, number, drags=drags)
            if isinstance(choice, Pick):
                self.cpu_s += time.process_time() - start
                return dataclasses.replace(choice, refused=tuple(r for r in refused if r.label != label))
            if not drags:
                refused.append(choice)
        self.cpu_s += time.process_time() - start
        return Stop("stopped: no object can be attempted", tuple(refused))

    def retreat(self, X_WOs: Poses, q: Array, motion: int, pick: Pick | None) -> Motion:
        if pick is not None:
            with contextlib.suppress(RuntimeError):
                return self._carrying(X_WOs, pick, q).plan_back(motion)
        plan = functools.partial(
            plan_retreat, arm=self.robot.arm, scene=self.robot.scene, q_now=q, motion_id=motion,
            seed=self.seed, config=self.robot.scenario.pick,
        )  # fmt: skip
        try:
            return plan(obstacles=[(self.robot.catalogue[label], X_WO) for label, X_WO in X_WOs.items()])
        except RuntimeError:
            return plan()

    def carry_on(self, X_WOs: Poses, pick: Pick, q: Array, motion: int) -> Motion:
        return self._carrying(X_WOs, pick, q).plan_on(motion)

    def _carrying(self, X_WOs: Poses, pick: Pick, q: Array) -> Carrying:
        label, known = pick.track.label, self.robot
        return Carrying(
            arm=known.arm,
            scene=known.scene,
            plan=pick.plan,
            X_WO=X_WOs[label],
            model=known.catalogue[label],
            q_now=q,
            seed=self.seed,
            config=known.scenario.pick,
            obstacles=[(known.catalogue[other], X) for other, X in X_WOs.items() if other != label],
            bin=known.scenario.region(pick.region),
        )

    def shake(self, X_WOs: Poses, pick: Pick, q: Array, motion: int, times: int) -> Motion:
        known = self.robot
        return plan_shaking(
            arm=known.arm,
            scene=known.scene,
            plan=pick.plan,
            q_now=q,
            motion_id=motion,
            times=times,
            seed=self.seed,
            config=known.scenario.pick,
            obstacles=[(known.catalogue[other], X) for other, X in X_WOs.items() if other != pick.track.label],
        )


def plan_pick(
    known: _Robot, X_WOs: Poses, label: str, q: Array, seed: int, number: int, *, drags: bool = False
) -> Pick | Attempt:
    """A plan for the object called `label`, or the attempt given up before anything moved."""
    catalogue, scenario = known.catalogue, known.scenario
    model, X_WO = catalogue[label], X_WOs[label]
    region = region_of(label, scenario.goal, catalogue)
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    others = [(catalogue[other], X) for other, X in X_WOs.items() if other != label]
    points_W = surface_points(others)
    ranked = rank_grasps(
        grasp_candidates(model, config=scenario.grasp, seed=0),
        model=model,
        X_WO=X_WO,
        belief=belief,
        points_W=points_W,
        table_height=scenario.region("table").floor_height,
        config=scenario.grasp,
        reaches=known.arm.reaches,
    )
    plan = plan_pick_place(
        arm=known.arm,
        scene=known.scene,
        ranked=ranked,
        X_WO=X_WO,
        model=model,
        region=scenario.region(region),
        q_now=q,
        obstacles=others,
        points_W=points_W,
        seed=derive(seed, f"plan {number}"),
        config=scenario.pick,
        drags=drags,
    )
    if isinstance(plan, PickPlan):
        box: Box = (0.0, 0.0, 1.0, 1.0)
        return Pick(plan, Track(number, label, box, 1.0, 1.0, belief, X_WO, 1.0, 1.0, True, 0, 0), region, ())
    return Attempt(0, number, label, region, "none", plan.reason, plan.grasp_candidates, plan.rejected_by, None)


def surface_points(objects: Sequence[tuple[ObjectModel, Array]]) -> Array:
    """Points (n, 3) in W on the surfaces of objects, evenly shared among them."""
    if not objects:
        return np.empty((0, 3))
    count = OBSTACLE_POINTS // len(objects)
    return np.concatenate(
        [apply(X_WO, sample_surface(model, count, np.random.default_rng(0))[0]) for model, X_WO in objects]
    )


def no_hand_could(model: ObjectModel, X_WO: Array, *, table_height: float, config: GraspConfig) -> bool:
    """Whether an object that lies alone at X_WO (4, 4) offers no grasp at all to a free-flying hand of this shape.

    Of ten times as many candidates as the robot looks at, approached from any side but from below, none is left that
    keeps clear of the table and holds by friction.
    """
    thorough = dataclasses.replace(
        config, samples=3 * config.samples, candidates=10 * config.candidates, directions=16, max_tilt=np.pi / 2
    )
    ranked = rank_grasps(
        grasp_candidates(model, config=thorough, seed=1),
        model=model,
        X_WO=X_WO,
        belief=PoseBelief(X_WO[None], np.ones(1)),
        points_W=np.empty((0, 3)),
        table_height=table_height,
        config=thorough,
    )
    return not ranked.grasps


def judge(setting: str, seed: int, order: Sequence[str], X_WOs: Poses, trial: PickTrial, known: _Robot) -> Picked:
    """What a trial came to, by where everything truly went."""
    regions = {name: known.scenario.region(name) for name in known.scenario.regions}
    goal = functools.partial(region_of, goal=known.scenario.goal, catalogue=known.catalogue)
    final = dict(trial.truth[-1].X_WOs)
    executed = next((attempt for attempt in trial.attempts if attempt.action is not None), None)
    given_up = tuple((a.label, a.reason) for a in trial.attempts if a.action is None)
    label = order[0] if executed is None else executed.label
    place = where_is(final[label], regions)
    succeeded = executed is not None and place == goal(label)
    knocked_off = tuple(k for k in X_WOs if k != label and where_is(final[k], regions) != "table")
    use, arm = trial.use, len(robot.ARM_JOINTS)
    told = next((a for a in trial.attempts if a.label == label), None)
    if succeeded:
        phase, cause = "", ""
    elif trial.outcome.startswith("stopped: failed"):
        phase, cause = "simulation", trial.outcome
    elif executed is None:
        phase, cause = "plan", "cut_off" if told is None else told.reason
    else:
        phase, cause = failed_phase(trial.truth, label), executed.reason
    return Picked(
        setting=setting,
        seed=seed,
        label=label,
        succeeded=succeeded,
        place=place,
        phase=phase,
        cause=cause,
        hopeless=phase == "plan"
        and setting == "alone"
        and no_hand_could(
            known.catalogue[label],
            X_WOs[label],
            table_height=regions["table"].floor_height,
            config=known.scenario.grasp,
        ),
        refused=given_up if executed is not None else given_up[1:],
        knocked_off=knocked_off,
        pushed_m=max((_moved(X_WOs[k], final[k]) for k in X_WOs if k != label), default=0.0),
        grasp_candidates=0 if told is None else told.grasp_candidates,
        rejected_by=() if told is None else tuple((k, n) for k, n in told.rejected_by if n),
        slip_m=transport_slip(trial.truth, label),
        slip_from_grasp_m=transport_slip(trial.truth, label, since="close"),
        motion_s=trial.sim_time_s,
        position_use=float(use.position[:arm].max()),
        speed_use=float(use.speed.max()),
        acceleration_use=float(use.acceleration.max()),
        effort_use=float(use.effort[:arm].max()),
        violations=use.violations,
        X_WO=readonly(X_WOs[label]),
    )


def failed_phase(truth: Sequence[TruthSample], label: str) -> str:
    """The segment after which the object was no longer in the hand: grasp, lift, transport, release.

    Or motion, where the hand never closed.
    """
    last = {sample.segment: sample for sample in truth}
    if "close" not in last:
        return "motion"
    if "lift" in last:
        first = next(sample for sample in truth if sample.segment == "lift")
        raised = dict(last["lift"].X_WOs)[label][2, 3] - dict(first.X_WOs)[label][2, 3]
        hand = last["lift"].X_WG[2, 3] - first.X_WG[2, 3]
        if raised < 0.5 * hand:
            most = max(dict(s.X_WOs)[label][2, 3] for s in truth if s.segment == "lift")
            return "lift" if most - dict(first.X_WOs)[label][2, 3] > 0.02 else "grasp"
    if "transport" not in last:
        return "grasp" if "lift" not in last else "lift"
    held = next(sample for sample in truth if sample.segment == "transport")
    moved = np.linalg.norm(_in_hand(last["transport"], label) - _in_hand(held, label))
    return "transport" if moved > MOVED else "release"


def _moved(X_WO: Array, X_WO_after: Array) -> float:
    return float(np.linalg.norm(X_WO_after[:3, 3] - X_WO[:3, 3]))


def _in_hand(sample: TruthSample, label: str) -> Array:
    """p_GO (3,) of an object."""
    return np.asarray((inverse(sample.X_WG) @ dict(sample.X_WOs)[label])[:3, 3])
