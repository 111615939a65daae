"""Where on the table an object can be set down: free of everything, lying stably, inside a region."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt

from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import ObjectModel
from sum_drake.resting import outside, resting
from sum_drake.types import Array, Region, readonly

PRINT = 0.015
"""Distance between the points that stand for an object seen from above, metres."""
CELL = 0.01
"""Of the grid on which distances are looked up, metres."""
LIES = 0.02
"""What is believed to be less than this above the table lies on it, metres."""
AROUND = 0.2
"""What stands farther than this from a region does not count, metres."""


@dataclasses.dataclass
class PlacingConfig:
    """How places on the table are searched for; SI units."""

    grid: float = 0.03
    """Distance between the places tried."""
    yaws: int = 6
    """Turns tried at each place, evenly spread over a full one from how the object lies."""
    margin: float = 0.03
    """Least distance, seen from above, from whatever else stands on the table: a finger goes between."""
    roomy: float = 0.08
    """More distance than this is no better."""
    border: float = 0.02
    """Least distance from the region's edge."""
    aside: float = 0.10
    """Least distance of what makes way from the object that it makes way for: the hand goes between."""
    gap: float = 0.006
    """The object is let go this far above where it would rest."""
    places: int = 40
    """At most this many are returned."""


def same_floor(region: Region, table: Region) -> bool:
    """Whether a region's bottom is the table's top."""
    return abs(region.floor_height - table.floor_height) < 0.05


def is_area(region: Region, table: Region) -> bool:
    """Whether a region is a part of the table's top, rather than a bin."""
    over = np.all(np.abs(region.p_W[:2] - table.p_W[:2]) + region.half_extents[:2] <= table.half_extents[:2] + 1e-6)
    return bool(over and same_floor(region, table))


def free_places(
    model: ObjectModel,
    X_WO: Array,
    *,
    region: Region,
    table: Region,
    taken_W: Array,
    config: PlacingConfig,
    aside_of_W: Array | None = None,
    avoid: Sequence[Region] = (),
    been_W: Sequence[Array] = (),
    within_reach: Callable[[Array], bool] = lambda _: True,
) -> tuple[Array, ...]:
    """Poses (4, 4) over a region at which the object, lowered a little, rests freely; the roomiest first, then near.

    It lies on the side that it lies on, or the next one where it leans on something.

    Args:
        X_WO: (4, 4), as it lies now.
        taken_W: (m, 3) points of all that stands on the table and is not the object.
        aside_of_W: points of an object that is to be reached afterwards: `config.aside` away from them.
        avoid: regions that it must not end in.
        been_W: (3,) places that it has been taken from: it is not brought back there.
        within_reach: whether the hand reaches an object at X_WO (4, 4).
    """
    R_W = X_WO[:3, :3]
    R_WO = resting(model, R_W)
    cloud = outside(model)
    low = float((cloud @ R_WO.T)[:, 2].min())
    rest = table.floor_height - low
    above = float(X_WO[2, 3]) - rest
    if R_WO is R_W and 0 < above < LIES:
        # It lies on the table, so its estimate is too high; that error goes with it, and cancels out.
        rest += above
    height = rest + config.gap
    room_at = _distances(taken_W, region)
    aside_at = _distances(np.empty((0, 3)) if aside_of_W is None else aside_of_W, region)
    options: list[tuple[float, float, Array]] = []
    for yaw in 2 * np.pi * np.arange(config.yaws) / config.yaws:
        R = rotation_from_vector(np.array([0.0, 0.0, yaw])) @ R_WO
        print_ = np.unique(np.round((cloud @ R.T)[:, :2] / PRINT), axis=0) * PRINT  # (f, 2): seen from above
        lower, upper = print_.min(0), print_.max(0)
        first = region.p_W[:2] - region.half_extents[:2] + config.border - lower
        last = region.p_W[:2] + region.half_extents[:2] - config.border - upper
        if np.any(last < first):
            continue
        counts = np.floor((last - first) / config.grid).astype(int) + 1
        spots = np.stack(
            np.meshgrid(*(np.linspace(a, b, n) for a, b, n in zip(first, last, counts, strict=True))), -1
        ).reshape(-1, 2)  # fmt: skip
        prints = spots[:, None] + print_  # (s, f, 2)
        room = room_at(prints).min(1)
        free = (room >= config.margin) & (aside_at(prints).min(1) >= config.aside)
        for other in avoid:
            off = np.abs(prints - other.p_W[:2]) - other.half_extents[:2]
            free &= (off.max(2) > 0).all(1)
        for p_W in been_W:
            free &= np.linalg.norm(spots - p_W[:2], axis=1) > config.aside
        way = np.linalg.norm(spots - X_WO[:2, 3], axis=1)
        for i in np.flatnonzero(free):
            X = transform(R, np.array([*spots[i], height]))
            options.append((-min(float(room[i]), config.roomy), float(way[i]) + 0.02 * min(yaw, 2 * np.pi - yaw), X))
    # Roomy enough is roomy enough: in steps of a centimetre, so that the way counts, too.
    options.sort(key=lambda option: (round(option[0] / 0.01), option[1]))
    reached = (readonly(X) for _, _, X in options if within_reach(X))
    return tuple(itertools.islice(reached, config.places))


def _distances(points_W: Array, region: Region) -> Callable[[Array], Array]:
    """Distance of places (..., 2) in a region from the nearest of points (m, 3), seen from above, to within a cell."""
    start = region.p_W[:2] - region.half_extents[:2] - AROUND
    size = np.ceil(2 * (region.half_extents[:2] + AROUND) / CELL).astype(int) + 1
    cells = np.floor((points_W[:, :2] - start) / CELL).astype(int)
    cells = cells[((cells >= 0) & (cells < size)).all(1)]
    if not len(cells):
        return lambda p: np.full(p.shape[:-1], np.inf)
    taken = np.zeros(size, dtype=bool)
    taken[tuple(cells.T)] = True
    distances = CELL * distance_transform_edt(~taken)
    return lambda p: np.asarray(distances[tuple(np.moveaxis(((p - start) / CELL).astype(int), -1, 0))])
