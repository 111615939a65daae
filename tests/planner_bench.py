"""The sorting planner between ports that a test turns."""

import numpy as np
from pydrake.systems.analysis import Simulator
from test_playback import MOTION

from sum_drake.dynamics import ArmDynamics
from sum_drake.picking import PickPlan
from sum_drake.robot import VIEW
from sum_drake.systems.ports import abstract, unpack
from sum_drake.systems.sorting_planner import SortingPlanner
from sum_drake.types import (
    Attempt,
    Camera,
    Frame,
    Grasp,
    Load,
    Motion,
    MotionStatus,
    Perception,
    PoseBelief,
    SceneBelief,
    Track,
    readonly,
)

EYE = readonly(np.eye(4))
BELIEF = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
TRACK = Track(5, "mug", (0, 0, 9, 9), 0.9, 0.9, BELIEF, EYE, 0.5, 0.7, True, 0, 0)
PLAN = PickPlan(
    grasp=Grasp("mug", EYE, width=0.04, quality=0.8), X_WG=EYE, pick=MOTION, place=MOTION,
    X_WG_place=EYE, X_WO_place=EYE, grasp_candidates=20, rejected_by=(("table", 3),),
)  # fmt: skip
LOAD = Load(0.04, 0.5)
REFUSED = Attempt(0, 6, "toy", "bin", "none", "ik", 10, (("ik", 10),), None)


def perception(step):
    frame = Frame(step, np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2), np.float32), Camera(2, 2, 1, 1, 0.5, 0.5), EYE)
    return Perception(step, frame, (), (), SceneBelief(step - 1), SceneBelief(step, (TRACK,), 6), None)


class Bench:
    """The planner between ports that the test turns."""

    def __init__(self, *choices, ways_on=0, shakes=True):
        self.asked, self.shaken, self.brought_back, self.shakes = [], [], [], shakes
        choices, ways_on = list(choices), [MOTION.segments] * ways_on

        def decide(perception, attempts, looks, q):
            self.asked.append((perception.step, len(attempts), looks))
            return choices.pop(0)

        def retreat(perception, q, motion, pick):
            self.brought_back.append(pick is not None)
            return Motion(motion, MOTION.segments)

        def carry_on(perception, pick, q, motion):
            if not ways_on:
                raise RuntimeError("no way on")
            return Motion(motion, ways_on.pop(), LOAD)

        def shake(perception, pick, q, motion, times):
            if not self.shakes:
                raise RuntimeError("no way there")
            self.shaken.append((pick.track.id, times))
            return Motion(motion, MOTION.segments)

        self.planner = SortingPlanner(
            decide=decide, retreat=retreat, carry_on=carry_on, shake=shake, period=0.1, settle_time=0.5
        )
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        self.fix("perception", None)
        self.fix("motion_status", MotionStatus(-1, "", True))
        self.hand(0.1)

    def fix(self, port, value):
        self.planner.GetInputPort(port).FixValue(self.context, abstract(value))

    def hand(self, gap, hanging=0.0):
        state = np.zeros(24)
        state[:8] = VIEW
        state[8:10] = gap / 2
        self.planner.GetInputPort("robot_state").FixValue(self.context, state)
        effort = np.zeros(12)
        effort[:8] = ArmDynamics().efforts(VIEW, np.zeros(8), np.zeros(8), hanging)
        effort[-2:] = -60.0 if 0.002 < gap < 0.1 else 0.0
        self.planner.GetInputPort("effort").FixValue(self.context, effort)

    def wait(self, seconds=0.25):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def out(self, port):
        return unpack(self.planner.GetOutputPort(port).Eval(self.context))

    def look(self, step):
        """Lets the planner ask for an observation, and answers it."""
        self.wait(0.8)
        assert self.out("observe")[0] == step + 1
        self.fix("perception", perception(step))
        self.wait()

    def finish(self, stopped=""):
        self.fix("motion_status", MotionStatus(self.out("motion").id, "", True, stopped))
        self.wait()

    def rest(self):
        """Until the arm has been at rest for so long that what hangs on it is weighed."""
        self.wait(0.6)

    def carried(self, step=0):
        """An object is picked after that look, and let go at the place."""
        self.look(step)
        self.hand(0.04)
        self.finish()
        self.run("transport")
        self.run("open")

    def shake_off(self):
        """What hangs on the hand falls off over the place, and the arm comes back."""
        for segment in ("shake", "weigh", "shake"):
            self.run(segment)
        self.hand(0.1)
        self.finish()
        self.rest()

    def run(self, segment, stopped=""):
        self.fix("motion_status", MotionStatus(self.out("motion").id, segment, False, stopped))
        self.wait()
