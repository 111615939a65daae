"""A robot among what stands still: what is free, by the compiled model, and the same as Drake's checker sees it."""

import abc
import dataclasses
import functools
import itertools
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sum_drake.collision_model import CollisionModel, Skeleton, collision_model
from sum_drake.types import Array, Immutable, readonly

if TYPE_CHECKING:
    from pydrake.planning import SceneGraphCollisionChecker

FINE = 0.005
"""Radians (and metres) between the configurations that a finished path is checked at."""


@dataclasses.dataclass(frozen=True, eq=False)
class JointSpace(Immutable):
    """The joints that planning moves, in the order of every q, from the base outwards."""

    names: tuple[str, ...]
    lower: Array
    """(n,); -inf where a joint turns without end."""
    upper: Array
    velocity: Array
    """(n,): largest speeds, 1/s."""
    acceleration: Array
    """(n,): largest accelerations, 1/s^2."""

    def __post_init__(self) -> None:
        for field in ("lower", "upper", "velocity", "acceleration"):
            object.__setattr__(self, field, readonly(getattr(self, field)))


class CheckedScene(abc.ABC):
    """What planning asks of a robot and its surroundings. Every q is (n,), in the order of `space`."""

    checker: "SceneGraphCollisionChecker"
    skeleton: Skeleton

    @property
    @abc.abstractmethod
    def space(self) -> JointSpace:
        """The joints that move."""

    @property
    @abc.abstractmethod
    def q_full(self) -> Array:
        """The plant's positions, in which the joints of `space` are written over."""

    @functools.cached_property
    def model(self) -> CollisionModel:
        """The same scene for the compiled checks."""
        return collision_model(self.checker, self.skeleton, self.q_full)

    def is_free(self, q: Array) -> bool:
        """Whether nothing touches, or comes closer than the padding, at q."""
        return self.model.is_free(q)

    def free_many(self, qs: Array) -> NDArray[np.bool_]:
        """`is_free` of qs (m, n), (m,)."""
        return self.model.free_many(qs)

    def edge_free(self, q0: Array, q1: Array, step: float = FINE) -> bool:
        """Whether the straight line from q0 to q1 is free, proven or looked at every `step` of a joint."""
        return self.model.edge_free(q0, q1, step)

    def path_free(self, qs: Array, step: float = FINE) -> bool:
        """`edge_free` of every piece of the polyline qs (k, n)."""
        return self.model.path_free(qs, step)

    def confirmed(self, qs: Array, step: float = FINE) -> bool:
        """Whether Drake finds the polyline qs (k, n) free as well, looking wherever a joint has moved by `step`."""
        self.checker.set_edge_step_size(step)
        full = self.full(qs)
        if len(full) == 1:
            return bool(self.checker.CheckConfigCollisionFree(full[0]))
        return all(self.checker.CheckEdgeCollisionFree(a, b) for a, b in itertools.pairwise(full))

    def colliding_pairs(self, q: Array) -> tuple[tuple[str, str], ...]:
        """Names of the bodies that touch, or come closer than the padding, at q: the robot's link first."""
        return tuple(sorted({(a, b): None for a, b, _ in self.depths(q)}))

    def depths(self, q: Array) -> tuple[tuple[str, str, float], ...]:
        """The same with how deep they reach into each other, padding aside, metres; deepest first."""
        checker, plant = self.checker, self.checker.plant()
        clearance = checker.CalcRobotClearance(self.full(q), max(checker.GetLargestPadding(), 0.0) + 1e-6)
        padding = np.array(checker.GetPaddingMatrix())
        found = [
            (plant.get_body(a).name(), plant.get_body(b).name(), -float(distance + padding[int(a), int(b)]))
            for a, b, distance in zip(
                clearance.robot_indices(), clearance.other_indices(), clearance.distances(), strict=True
            )
            # Drake has taken the padding off the distances.
            if distance <= 0
        ]
        return tuple(sorted(found, key=lambda one: (-one[2], one[:2])))

    @functools.cached_property
    def _order(self) -> Array:
        plant = self.checker.plant()
        return np.array([plant.GetJointByName(name).position_start() for name in self.space.names])

    def full(self, qs: Array) -> Array:
        """Positions of the whole plant (..., m) for qs (..., n)."""
        full = np.tile(self.q_full, (*np.shape(qs)[:-1], 1))
        full[..., self._order] = qs
        return full
