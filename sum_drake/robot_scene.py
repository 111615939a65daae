"""A user's own robot among the obstacles of a planning problem, as planning asks for it."""

import dataclasses
import functools
from typing import Any

import numpy as np

from sum_drake.checked_scene import CheckedScene, JointSpace
from sum_drake.collision_model import Skeleton
from sum_drake.planning_problems import PlanningProblem, problem_checker
from sum_drake.types import Array
from sum_drake.user_robot import UserRobot

RAMP = 0.5
"""Seconds that a joint is taken to need to full speed: a URDF tells no acceleration."""


@dataclasses.dataclass(frozen=True, eq=False)
class RobotScene(CheckedScene):
    """The robot of a problem, whose joints move as `joints` says; all others stay at 0."""

    joints: JointSpace
    checker: Any
    skeleton: Skeleton

    @staticmethod
    def of(robot: UserRobot, problem: PlanningProblem) -> "RobotScene":
        """The joints are the problem's, from the base outwards, whatever order the problem names them in."""
        depth = {robot.base: 0}
        left = list(robot.joints)
        while left:
            left, waiting = [], left
            for joint in waiting:
                if joint.parent in depth:
                    depth[joint.child] = depth[joint.parent] + 1
                else:
                    left.append(joint)
        of = {joint.name: depth[joint.child] for joint in robot.joints}
        names = tuple(sorted(problem.joints, key=lambda name: (of[name], name)))
        lower, upper, velocity = robot.limits(names)
        checker = problem_checker(robot, problem)
        space = JointSpace(names, lower, upper, velocity, velocity / RAMP)
        return RobotScene(space, checker, Skeleton.of(checker, names))

    @property
    def space(self) -> JointSpace:
        """The problem's joints."""
        return self.joints

    @functools.cached_property
    def q_full(self) -> Array:
        """All joints at 0."""
        return np.zeros(self.checker.plant().num_positions())
