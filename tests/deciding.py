"""What tests of the robot's decisions share: a table, beliefs about it, a record of tries."""

import numpy as np
from scenes import observe, standing

from sum_drake.attempting import Attempting
from sum_drake.grasping import GraspConfig
from sum_drake.kinematics import Arm
from sum_drake.objects import load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import PlanningScene
from sum_drake.robot import VIEW
from sum_drake.task import Pick, SortingTask
from sum_drake.task_config import TaskConfig
from sum_drake.types import Attempt, Perception, PickPlace, PoseBelief, Region, SceneBelief, Track, readonly

CATALOGUE = load_catalogue()
ARM = Arm()
SCENE = PlanningScene()
EYE = readonly(np.eye(4))
REGIONS = {
    "table": Region("table", readonly([0.72, 0.0, 0.95]), readonly([0.30, 0.45, 0.25])),
    "cleaning_bin": Region("cleaning_bin", readonly([0.12, -0.62, 0.47]), readonly([0.20, 0.20, 0.18])),
    "non_cleaning_bin": Region("non_cleaning_bin", readonly([0.12, 0.62, 0.47]), readonly([0.20, 0.20, 0.18])),
}
GOAL = {"cleaning": "cleaning_bin", "non-cleaning": "non_cleaning_bin"}
CONFIG = TaskConfig(policy="surest")
MOST_LIKELY = TaskConfig(policy="most_likely")
CAN = standing(CATALOGUE, "soup_can", 0.6, 0.05)


def make_attempting(**changes):
    given = {
        "catalogue": CATALOGUE, "arm": ARM, "scene": SCENE, "regions": REGIONS, "goal": GOAL, "config": CONFIG,
        "grasp_config": GraspConfig(), "pick_config": PickConfig(), "seed": 2,
    }  # fmt: skip
    return Attempting(**{**given, **changes})


def make_task(**changes):
    """A task; changes: as of `make_attempting`."""
    shared = {"regions": changes.get("regions", REGIONS), "config": changes.get("config", CONFIG)}
    return SortingTask(make_attempting(**changes), **shared)


def believe(label, X_WO, track=0, *, p_box=0.9, p_label=0.9, likelihood=0.6, accepted=True):
    """A track whose belief is spread over millimetres."""
    rng = np.random.default_rng(track)
    X_WOs = np.repeat(X_WO[None], 30, axis=0)
    X_WOs[:, :3, 3] += rng.normal(0, 0.002, (30, 3))
    belief = PoseBelief(readonly(X_WOs), readonly(np.full(30, 1 / 30)))
    return Track(track, label, (0, 0, 9, 9), p_box, p_label, belief, readonly(X_WO), likelihood, 0.8, accepted, 0, 0)


def see(X_WOs, tracks):
    """The record of an observation of the objects at X_WOs, of which `tracks` are believed."""
    frame, _ = observe(CATALOGUE, X_WOs)
    return Perception(0, frame, (), (), SceneBelief(), SceneBelief(0, tuple(tracks), len(tracks)), None)


def tried(label, *, region="non_cleaning_bin", released=True, X_OG=None):
    """A try in which something was moved."""
    action = PickPlace(0, "pick_place", 0, label, EYE, EYE, region, 0.04, 0.04, released)
    reason = "executed" if released else "empty_hand"
    return Attempt(0, 0, label, region, "pick_place", reason, 30, (), action, X_OG)


def see_can():
    """The soup can alone on the table, and believed there."""
    return see({"soup_can": CAN}, [believe("soup_can", CAN)])


def pick_can():
    """What is decided then."""
    choice = make_task().decide(see_can(), (), 0, VIEW)
    assert isinstance(choice, Pick)
    return choice
