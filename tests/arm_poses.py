"""Scenes and configurations of the arm that several tests ask about."""

import itertools

import numpy as np

from sum_drake.kinematics import Arm
from sum_drake.planning_scene import PlanningScene, Solid

ARM = Arm()
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def block(name, p_W, half_extents):
    X_WS = np.eye(4)
    X_WS[:3, 3] = p_W
    return Solid(name, (CORNERS * half_extents,), X_WS)


def pointing_down(p_WG, yaw=0.0):
    """X_WG with the palm's x axis down."""
    c, s = np.cos(yaw), np.sin(yaw)
    X_WG = np.eye(4)
    X_WG[:3, :3] = np.column_stack([[0, 0, -1], [-s, c, 0], [c, s, 0]])
    X_WG[:3, 3] = p_WG
    return X_WG


def solve(X_WG):
    """The arm's cheapest way to put its hand at X_WG (4, 4)."""
    return ARM.solutions(X_WG, count=1)[0]


def walled_scene():
    """A wall across the table, and a block behind it."""
    return PlanningScene(solids=(block("wall", [0.6, 0.0, 0.85], [0.15, 0.02, 0.15]),
                                 block("block", [0.6, 0.2, 0.75], [0.03, 0.03, 0.05])))  # fmt: skip


def sides_of_the_wall():
    """Free configurations with the hand on one side of the wall and on the other."""
    left, right = (solve(pointing_down([0.6, y, 0.9])) for y in (0.2, -0.2))
    return left, right
