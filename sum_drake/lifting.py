"""What lifting an object straight up does to its neighbours."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_closing, distance_transform_edt, minimum_filter

from sum_drake.geometry import apply
from sum_drake.objects import ObjectModel
from sum_drake.resting import outside, stands
from sum_drake.types import Array, Region

CELL = 0.005
"""Of the grid on which an object is seen from above, metres."""
BESIDE = 0.03
"""From this far away a neighbour is safe, metres; poses are off by a third of it."""
UNDER = 0.01
"""A neighbour that reaches this far over an object lies on it: by less it may only seem to."""
TOUCHES, LEANS = 0.8, 0.3
"""Probability that a neighbour stays where it is when an object is lifted beside it, or that it leans or lies on."""


@dataclasses.dataclass(frozen=True)
class Dragged:
    """A neighbour that lifting an object may move."""

    label: str
    stays: float
    """About the probability that it stays where it is."""
    falls: float = 0.0
    """And that it falls off the table if it does not."""

    @property
    def kept(self) -> float:
        """About the probability that it is on the table afterwards."""
        return 1.0 - (1.0 - self.stays) * self.falls


def overlap(model: ObjectModel, X_WO: Array, points_W: Array) -> float:
    """How far points (m, 3) reach, seen from above, over what the object sweeps while it is lifted straight up, metres.

    Negative: by how much they stay beside it; -inf where there are none, or all are below it.
    """
    p_W = apply(X_WO, outside(model))
    start = p_W[:, :2].min(0) - BESIDE - 2 * CELL
    size = np.ceil((p_W[:, :2].max(0) + BESIDE + 2 * CELL - start) / CELL).astype(int)
    lowest = np.full(size, np.inf)
    np.minimum.at(lowest, tuple(((p_W[:, :2] - start) / CELL).astype(int).T), p_W[:, 2])
    taken = binary_closing(np.isfinite(lowest))  # between the points there is surface, too,
    lowest = minimum_filter(lowest, 3)  # on top and below
    beside, nearest = distance_transform_edt(~taken, return_indices=True)
    # How deep inside: a cell at the object's edge is none.
    depth = CELL * np.where(taken, distance_transform_edt(taken) - 1, -beside)
    cells = np.floor((points_W[:, :2] - start) / CELL).astype(int)
    within = ((cells >= 0) & (cells < size)).all(1)
    i, j = cells[within].T
    above = points_W[within, 2] > lowest[nearest[0, i, j], nearest[1, i, j]]
    return float(depth[i, j][above].max(initial=-np.inf))


def stays(model: ObjectModel, X_WO: Array, neighbour: ObjectModel, X_WN: Array) -> float:
    """About the probability that a neighbour at X_WN stays where it is when the object at X_WO is lifted.

    By hand: LEANS for one that lies over the object, or that touches it and would not stand without it, TOUCHES for
    another one that touches it, 1 from BESIDE on.
    """
    reach = overlap(model, X_WO, apply(X_WN, outside(neighbour)))
    if reach < -BESIDE:
        return 1.0
    if reach > UNDER or (reach > -UNDER and not stands(neighbour, X_WN)):
        return LEANS
    return float(np.interp(-reach, [UNDER, BESIDE], [TOUCHES, 1.0]))


def falls(model: ObjectModel, X_WO: Array, table: Region) -> float:
    """About the probability that an object at X_WO (4, 4) falls off the table if it topples or rolls.

    By hand: 1 at an edge, 0 where every edge is farther off than the object is long.
    """
    inside = float((table.half_extents[:2] - np.abs(X_WO[:2, 3] - table.p_W[:2])).min())
    return float(np.clip(1.0 - inside / max(model.dimensions), 0.0, 1.0))


def dragged(
    model: ObjectModel, X_WO: Array, neighbours: Sequence[tuple[ObjectModel, Array]], table: Region
) -> tuple[Dragged, ...]:
    """The neighbours that lifting the object may move, the likeliest to be moved first."""
    found = [
        Dragged(neighbour.label, stays(model, X_WO, neighbour, X_WN), falls(neighbour, X_WN, table))
        for neighbour, X_WN in neighbours
    ]
    return tuple(sorted((one for one in found if one.stays < 1.0), key=lambda one: one.stays))
