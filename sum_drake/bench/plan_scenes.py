"""Furniture for planning problems: shelves, cages, tables drawn at random before a robot, and where its hand goes."""

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.types import Array

DIGITS = 5
HANDS = 10
"""Poses of the hand that are drawn for a scene (of a cage, twice as many)."""
_UP = np.array([0.0, 0.0, 1.0])


class Scene:
    """Obstacles in the making, placed in a frame F: x away from the robot, z up from the floor."""

    def __init__(self, X_WF: Array) -> None:
        self.X_WF = X_WF
        self.obstacles: list[dict[str, Any]] = []

    def box(self, name: str, low: ArrayLike, high: ArrayLike, yaw: float = 0.0) -> None:
        """A box between two corners (3,) in F, turned about its own middle."""
        near, far = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        self._add(name, "box", far - near, (near + far) / 2, np.array([0.0, 0.0, yaw]))

    def cylinder(self, name: str, height: float, radius: float, p_F: Array, turn: Array | None = None) -> None:
        """A cylinder with its middle at p_F (3,), its axis along z turned by a rotation vector (3,)."""
        self._add(name, "cylinder", np.array([height, radius]), p_F, np.zeros(3) if turn is None else turn)

    def _add(self, name: str, kind: str, sizes: Array, p_F: Array, turn: Array) -> None:
        X_WO = self.X_WF @ transform(rotation_from_vector(turn), np.asarray(p_F))
        w, x, y, z = RigidTransform(X_WO).rotation().ToQuaternion().wxyz()
        self.obstacles.append(
            {
                "id": f"{name}_{len(self.obstacles)}",
                "type": kind,
                "dimensions": rounded(sizes),
                "position": rounded(X_WO[:3, 3]),
                "quat_xyzw": rounded(np.array([x, y, z, w])),
            }
        )


def rounded(values: Array) -> list[float]:
    """Numbers as a file has them."""
    # Adding 0 turns -0 into 0.
    return [float(value) + 0.0 for value in np.round(values, DIGITS)]


Drawn = tuple[Scene, list[Array], Array | None]
"""A scene, poses X_FG (4, 4) of the hand at the goal, and one X_WG (4, 4) at the start (None: the arm is folded)."""


def _before_robot(rng: np.random.Generator, near: tuple[float, float], turn: float, aside: float) -> Scene:
    """A scene whose F is on the floor ahead of the robot's base, turned and aside by some amount."""
    p_WF = np.array([rng.uniform(*near), rng.uniform(-aside, aside), 0.0])
    yaw = rng.uniform(-turn, turn) + 0.8 * np.arctan2(p_WF[1], p_WF[0])
    return Scene(transform(rotation_from_vector(np.array([0.0, 0.0, yaw])), p_WF))


def _thing(scene: Scene, rng: np.random.Generator, name: str, p_F: Array, tallest: float) -> None:
    """A box or a can that stands on p_F (3,)."""
    height = rng.uniform(0.08, min(0.28, max(tallest, 0.09)))
    if rng.random() < 0.5:
        scene.cylinder(name, height, rng.uniform(0.025, 0.05), p_F + height / 2 * _UP)
    else:
        half = np.append(rng.uniform(0.02, 0.06, 2), height / 2)
        scene.box(name, p_F + height / 2 * _UP - half, p_F + height / 2 * _UP + half, rng.uniform(-1, 1))


def _hand(p_FG: Array, yaw: float, pitch: float, roll: float) -> Array:
    """X_FG (4, 4) of a hand that points along F's x, turned sideways, downward and about its own axis."""
    R = np.eye(3)
    for turn in ([0, 0, yaw], [0, pitch, 0], [roll, 0, 0]):
        R = R @ rotation_from_vector(np.array(turn, dtype=float))
    return transform(R, p_FG)


def shelf(rng: np.random.Generator) -> Drawn:
    """A bookshelf, small or tall: sides, a back, boards, and things on them. The hand reaches between two boards."""
    scene = _before_robot(rng, (0.58, 0.74), 0.25, 0.15)
    tall = rng.random() < 0.5
    width, depth, board = rng.uniform(0.6, 1.0), rng.uniform(0.25, 0.38), 0.02
    heights = np.cumsum([rng.uniform(0.05, 0.45), *rng.uniform(0.28, 0.40, 4 if tall else 2)])
    top = heights[-1]
    for y in (-width / 2, width / 2):
        scene.box("side", [0, y - board / 2, 0], [depth, y + board / 2, top])
    scene.box("back", [depth, -width / 2 - board / 2, 0], [depth + board, width / 2 + board / 2, top])
    for height in heights:
        scene.box("board", [0, -width / 2 + board / 2, height - board], [depth, width / 2 - board / 2, height])
    hands = []
    for low, high in itertools.pairwise(heights):
        room = high - board - low
        slots = np.arange(-width / 2 + 0.09, width / 2 - 0.06, 0.13)
        kept = rng.random(len(slots)) < 0.55
        for y in slots[kept]:
            p = np.array([rng.uniform(0.10, depth - 0.07), y + rng.uniform(-0.02, 0.02), low])
            _thing(scene, rng, "thing", p, room - 0.05)
        # The hand's frame is 3 cm behind the finger tips.
        hands += [
            _hand(
                np.array([rng.uniform(0.05, depth - 0.10), rng.choice(slots) + rng.uniform(-0.06, 0.06),
                          rng.uniform(low + 0.06, high - board - 0.06)]),
                rng.uniform(-0.5, 0.5), rng.uniform(-0.25, 0.35), rng.choice([0.0, np.pi / 2]) + rng.uniform(-0.2, 0.2),
            )
            for _ in range(HANDS)
            if 0.45 < low < 1.35
        ]  # fmt: skip
    return scene, [hands[i] for i in rng.permutation(len(hands))[:HANDS]], None


def cage(rng: np.random.Generator) -> Drawn:
    """A cage of bars on a table, with something in it that the hand reaches for between the bars."""
    scene = _before_robot(rng, (0.48, 0.62), 0.4, 0.2)
    top, size = rng.uniform(0.5, 0.8), rng.uniform([0.38, 0.42, 0.36], [0.5, 0.56, 0.5])
    edge, radius = rng.uniform(0.05, 0.12), rng.uniform(0.008, 0.014)
    half = size[1] / 2
    scene.box("table", [0, -half - edge, top - 0.04], [size[0] + 2 * edge, half + edge, top])
    for x in (0.04, size[0] + 2 * edge - 0.04):
        for y in (-half - edge + 0.04, half + edge - 0.04):
            scene.box("leg", [x - 0.03, y - 0.03, 0], [x + 0.03, y + 0.03, top - 0.04])
    near, far = edge, edge + size[0]
    gap = rng.uniform(0.17, 0.22)
    across = np.linspace(-half, half, int(size[1] // gap) + 1)
    along = np.linspace(near, far, int(size[0] // gap) + 1)
    posts = [(x, y) for x in (near, far) for y in across] + [(x, y) for x in along[1:-1] for y in (-half, half)]
    for x, y in posts:
        scene.cylinder("bar", size[2], radius, np.array([x, y, top + size[2] / 2]))
    ceiling = top + size[2]
    lying_x, lying_y = np.array([0, np.pi / 2, 0]), np.array([np.pi / 2, 0, 0])
    for z in (ceiling, top + rng.uniform(0.55, 0.7) * size[2]):
        for y in (-half, half):
            scene.cylinder("rail", size[0], radius, np.array([(near + far) / 2, y, z]), lying_x)
    scene.cylinder("rail", size[1], radius, np.array([far, 0, top + 0.6 * size[2]]), lying_y)
    for x in along:
        scene.cylinder("roof", size[1], radius, np.array([x, 0, ceiling]), lying_y)
    for y in across[1:-1]:
        scene.cylinder("roof", size[0], radius, np.array([(near + far) / 2, y, ceiling]), lying_x)
    target = np.array([rng.uniform(near + 0.16, far - 0.10), rng.uniform(-half + 0.12, half - 0.12), top])
    cube = rng.uniform(0.02, 0.03)
    corner = np.array([cube, cube, cube])
    scene.box("target", target + cube * _UP - corner, target + cube * _UP + corner, rng.uniform(-0.7, 0.7))
    hands = []
    for _ in range(2 * HANDS):
        pitch, yaw = rng.uniform(0.0, 0.9), rng.uniform(-0.7, 0.7)
        X_FG = _hand(np.zeros(3), yaw, pitch, rng.choice([0.0, np.pi / 2]) + rng.uniform(-0.3, 0.3))
        X_FG[:3, 3] = target + cube * _UP - (cube + rng.uniform(0.045, 0.08)) * X_FG[:3, 0]
        hands.append(X_FG)
    return scene, hands, None


def under_table(rng: np.random.Generator) -> Drawn:
    """A table with things on it and, on a lower board, under it, where the hand reaches."""
    scene = _before_robot(rng, (0.46, 0.62), 0.3, 0.2)
    top, slab = rng.uniform(0.68, 0.92), rng.uniform(0.02, 0.05)
    depth, width = rng.uniform(0.5, 0.8), rng.uniform(0.8, 1.4)
    scene.box("top", [0, -width / 2, top - slab], [depth, width / 2, top])
    for x in (0.04, depth - 0.04):
        for y in (-width / 2 + 0.04, width / 2 - 0.04):
            scene.box("leg", [x - 0.025, y - 0.025, 0], [x + 0.025, y + 0.025, top - slab])
    board = rng.uniform(0.08, min(0.35, top - 0.42))
    scene.box("board", [0.10, -width / 2 + 0.08, board - 0.02], [depth - 0.05, width / 2 - 0.08, board])
    for level, name in ((top, "above"), (board, "below")):
        for _ in range(rng.integers(3, 7)):
            p = np.array([rng.uniform(0.16, depth - 0.12), rng.uniform(-0.4, 0.4) * width, level])
            _thing(scene, rng, name, p, 0.28 if level == top else top - slab - board - 0.12)
    hands = [
        _hand(
            np.array([rng.uniform(0.12, 0.34), rng.uniform(-0.3, 0.3) * width,
                      rng.uniform(max(board + 0.06, 0.3), top - slab - 0.07)]),
            rng.uniform(-0.4, 0.4), rng.uniform(-0.1, 0.7), rng.choice([0.0, np.pi / 2]) + rng.uniform(-0.2, 0.2),
        )
        for _ in range(HANDS)
    ]  # fmt: skip
    above = None
    if rng.random() < 0.5:  # picked up from the table, to be put under it
        p = np.array([rng.uniform(0.1, 0.25), rng.uniform(-0.2, 0.2), top + rng.uniform(0.15, 0.3)])
        above = scene.X_WF @ _hand(p, rng.uniform(-0.3, 0.3), rng.uniform(0.2, 1.2), rng.uniform(-0.3, 0.3))
    return scene, hands, above


MAKERS: Mapping[str, Callable[[np.random.Generator], Drawn]] = {
    "shelf": shelf,
    "cage": cage,
    "under_table": under_table,
}
