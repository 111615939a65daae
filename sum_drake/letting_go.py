"""Where to let go of an object that is in the hand: over a bin, or at a place on the table."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from sum_drake.geometry import apply, inverse, rotation_from_vector, shifted
from sum_drake.grasping import surface
from sum_drake.kinematics import Arm, nearest_turns
from sum_drake.motion import cartesian_path, seconds
from sum_drake.objects import ObjectModel
from sum_drake.pick_phases import GivenUp, PhaseScenes, PickWay, along_x, first_free, met
from sum_drake.planning_scene import SPACE, Solid
from sum_drake.robot import HAND, VIEW
from sum_drake.types import Array, Region

WALL = 0.02
"""Least distance of what is let go from the walls of a bin, seen from above, metres."""


@dataclasses.dataclass(frozen=True, eq=False)
class PlaceWay:
    """One way to let go."""

    X_WG: Array
    X_WO: Array
    gap: float
    """Distance between the fingers once they have let go."""
    retreat: Array
    """(k, 8) from the release backwards."""
    lower: Array | None
    """(k, 8) from above the place to it; None where the object is let go above it."""
    fall: float
    """How far it then falls, metres."""

    @property
    def first(self) -> Array:
        """(8,): where the arm must bring the object."""
        return np.asarray(self.retreat[0] if self.lower is None else self.lower[0])


def places_over(
    arm: Arm, scenes: PhaseScenes, pick: PickWay, target: Solid, region: Region, fill: float, gaps: Sequence[float],
    rng: np.random.Generator,
) -> list[PlaceWay]:  # fmt: skip
    """Up to three ways to let go of the object over the region, at the lowest height where there is one.

    gaps: to open the fingers to; the first that the place allows is taken. Where parts of the object lie beyond a
    finger, as a handle does that it was put through, by a hand that points straight down, if there is such a way: with
    the hand aslant it would fall on the finger, and hang there.
    """
    config = scenes.config
    p_OQs, q_lift = np.concatenate(target.hulls), pick.lift[-1]
    X_GO = inverse(pick.X_WG) @ target.X_WS
    # Turned as if the arm carried the object around the shoulder, and by multiples of 30 degrees from there.
    X_WG_lift = arm.forward(q_lift)
    X_WO_lift = X_WG_lift @ X_GO
    turn = np.arctan2(region.p_W[1], region.p_W[0]) - np.arctan2(X_WO_lift[1, 3], X_WO_lift[0, 3])
    spots = np.array([(x, y) for x in (-0.7, 0.0, 0.7) for y in (-0.7, 0.0, 0.7)])[rng.permutation(9)][:3]
    attitudes = [X_WO_lift[:3, :3]]
    if gaps[0] < HAND.gap_max:
        attitudes.insert(0, _to_point_down(X_WG_lift[:3, :3]) @ X_WO_lift[:3, :3])
    stage = cause = "no_place"
    for attitude, height in itertools.product(attitudes, config.release_heights):
        options: list[tuple[float, Array, Array, Array]] = []
        for yaw in turn + np.arange(-5, 7) * np.pi / 6:
            R_WO = rotation_from_vector(np.array([0, 0, yaw])) @ attitude
            corners = p_OQs @ R_WO.T
            low, high = corners.min(0), corners.max(0)
            room = region.half_extents - (high - low) / 2 - WALL
            if (room[:2] < 0).any():
                continue
            for spot in spots:
                X_WO = np.eye(4)
                X_WO[:3, :3] = R_WO
                X_WO[:2, 3] = region.p_W[:2] + spot * room[:2] - (low + high)[:2] / 2
                X_WO[2, 3] = region.floor_height + fill + height - low[2]
                X_WG = X_WO @ inverse(X_GO)
                if stage == "no_place":
                    stage = cause = "place_out_of_reach"
                if not arm.reaches(X_WG):
                    continue
                if stage == "place_out_of_reach":
                    stage = cause = "place_ik"
                options += _ways_to_hold(arm, X_WG, X_WO, q_lift)
        options.sort(key=lambda option: option[0])
        if not options:
            continue
        qs = np.array([q for _, q, _, _ in options[:60]])
        free = pick.held.free_many(qs)
        if stage != "place_collision":
            stage, cause = "place_collision", "place_collision" + met(pick.held, qs[np.flatnonzero(~free)[:1]])
        places: list[PlaceWay] = []
        for k in np.flatnonzero(free):
            _, q, X_WG, X_WO = options[k]
            place = _let_go(arm, scenes, X_WG, X_WO, q, gaps)
            if place is not None:
                places.append(dataclasses.replace(place, fall=height))
            if len(places) == 3:
                break
        if places:
            return places
    raise GivenUp(stage, cause)


def _to_point_down(R_WG: Array) -> Array:
    """The least rotation (3, 3) after which a hand that does not point up points straight down."""
    axis = np.cross(R_WG[:, 0], [0.0, 0.0, -1.0])
    sine = np.linalg.norm(axis)
    return rotation_from_vector(axis * (np.arctan2(sine, -R_WG[2, 0]) / sine if sine > 0.0 else 0.0))


def _ways_to_hold(arm: Arm, X_WG: Array, X_WO: Array, q_lift: Array) -> list[tuple[float, Array, Array, Array]]:
    """Up to two (seconds on the way there and home, q, X_WG, X_WO)."""
    qs = arm.solutions(X_WG, near=q_lift, count=2, thorough=False)
    return [(seconds(np.stack([q_lift, q, nearest_turns(VIEW, q)]), SPACE), q, X_WG, X_WO) for q in qs]


def places_at(
    arm: Arm, scenes: PhaseScenes, pick: PickWay, target: Solid, spots: Sequence[Array], gaps: Sequence[float]
) -> list[PlaceWay]:
    """Up to three ways to set the object down at one of the spots, X_WO (4, 4), of those that are soon reached."""
    config = scenes.config
    X_GO = inverse(pick.X_WG) @ target.X_WS
    # Close to the table, which it is to rest on.
    held = scenes.close.holding(target.hulls, X_GO).with_gap(pick.held.gap)
    X_WGs = [X_WO @ inverse(X_GO) for X_WO in spots]
    stage = "place_ik" if any(map(arm.reaches, X_WGs)) else "place_out_of_reach"
    options = [
        option
        for X_WG, X_WO in zip(X_WGs, spots, strict=True)
        for option in _ways_to_hold(arm, X_WG, X_WO, pick.lift[-1])
    ]
    if not options:
        raise GivenUp(stage)
    options.sort(key=lambda option: option[0])
    qs = np.array([q for _, q, _, _ in options])
    free = held.free_many(qs)
    places: list[PlaceWay] = []
    for k in np.flatnonzero(free):
        _, q, X_WG, X_WO = options[k]
        above = cartesian_path(arm, X_WG, shifted(X_WG, np.array([0.0, 0.0, config.lower])), q)
        lower = first_free(held, above, pick.held)
        place = None if lower is None else _let_go(arm, scenes, X_WG, X_WO, q, gaps)
        if lower is not None and place is not None:
            places.append(dataclasses.replace(place, lower=lower[::-1]))
        if len(places) == 3:
            break
    if not places:
        raise GivenUp("place_collision", "place_collision" + met(held, qs[np.flatnonzero(~free)[:1]]))
    return places


def _let_go(
    arm: Arm, scenes: PhaseScenes, X_WG: Array, X_WO: Array, q: Array, gaps: Sequence[float]
) -> PlaceWay | None:
    """The widest opening and the longest retreat that are free with the object released at X_WO."""
    config = scenes.config
    retreats = [cartesian_path(arm, X_WG, X_WG @ along_x(-length), q) for length in config.retreats]
    for gap in dict.fromkeys(gaps):
        opened, cleared = scenes.close.with_gap(gap), scenes.cleared.with_gap(gap)
        for paths in retreats:
            retreat = first_free(opened, paths, cleared)
            if retreat is not None:
                return PlaceWay(X_WG, X_WO, gap, retreat, None, 0.0)
    return None


def release_gap(model: ObjectModel, X_GO: Array, gap: float, clearance: float) -> float:
    """How far fingers `gap` apart can open around an object at X_GO (4, 4), then draw back along -x, metres.

    HAND.gap_max, unless parts of the object lie beyond a finger: one inside a mug must not press on the far wall.
    """
    x, y, z = apply(X_GO, surface(model, 0.003).p_OQs).T
    y = np.abs(y)
    beyond = (x < HAND.pad_x[1] + clearance) & (np.abs(z) < HAND.pad_half_width + clearance) & (y > gap / 2)
    room = y[beyond].min(initial=np.inf) - HAND.pad_thickness - clearance
    return float(np.clip(2 * room, gap, HAND.gap_max))
