"""Ways for an arm whose attempt did not go as planned: back, on with what is held, over its place to shake it off."""

import contextlib
import dataclasses
import functools
from collections.abc import Mapping
from typing import TypedDict

import numpy as np

from sum_drake.carrying import Carrying
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue, ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.placing import is_area
from sum_drake.planning_scene import PlanningScene
from sum_drake.retreat import plan_retreat
from sum_drake.shaking import plan_shaking
from sum_drake.standing import not_of, standing_points, thin
from sum_drake.task import Pick
from sum_drake.types import Array, Motion, Perception, Region


class _Around(TypedDict):
    """What a way goes around, as planners take it."""

    obstacles: list[tuple[ObjectModel, Array]]
    points_W: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Recovering:
    """Plans them around what was last seen and believed."""

    catalogue: Catalogue
    arm: Arm
    scene: PlanningScene
    regions: Mapping[str, Region]
    clear_height: float
    """What stands less than this above the table is not seen as an object, metres."""
    max_points: int
    """Depth points kept as obstacles."""
    config: PickConfig
    seed: int

    def retreat(self, perception: Perception, q: Array, motion: int, pick: Pick | None = None) -> Motion:
        """From where the arm is, (8,), back to the viewing pose with an open hand, under the given motion id.

        With the object of `pick` in its hand, past where that was taken, where it is put down, if there is a way; else,
        and over the bin that it is to end in, it is let go where the arm is. Goes around what was last seen. What was
        pushed about since then may be anywhere, the hand itself may stand where something was: where that leaves no
        way, only table, bins and robot count.
        Raises RuntimeError where even then there is none.
        """
        if pick is not None:
            with contextlib.suppress(RuntimeError):
                return self._carrying(perception, pick, q, motion).plan_back(motion)
        around = self._around(perception, pick)
        plan = functools.partial(
            plan_retreat,
            arm=self.arm,
            scene=self.scene,
            q_now=q,
            motion_id=motion,
            seed=int(np.random.SeedSequence([self.seed, motion]).generate_state(1)[0]),
            config=self.config,
        )
        try:
            return plan(**around)
        except RuntimeError:
            return plan()

    def carry_on(self, perception: Perception, pick: Pick, q: Array, motion: int) -> Motion:
        """From where the arm was stopped, (8,), with the object of `pick` in its hand, to where it is let go.

        Raises RuntimeError where there is no free way.
        """
        return self._carrying(perception, pick, q, motion).plan_on(motion)

    def _carrying(self, perception: Perception, pick: Pick, q: Array, motion: int) -> Carrying:
        region = self.regions[pick.region]
        return Carrying(
            arm=self.arm,
            scene=self.scene,
            plan=pick.plan,
            X_WO=pick.track.X_WO,
            model=self.catalogue[pick.track.label],
            q_now=q,
            seed=int(np.random.SeedSequence([self.seed, motion]).generate_state(1)[0]),
            config=self.config,
            **self._around(perception, pick),
            bin=None if is_area(region, self.regions["table"]) else region,
        )

    def shake(self, perception: Perception, pick: Pick, q: Array, motion: int, times: int) -> Motion:
        """From where the arm is, (8,), with the object of `pick` on its opened hand, to where it was to be, and back.

        times: how often that was tried before. Raises RuntimeError where there is no free way.
        """
        return plan_shaking(
            arm=self.arm,
            scene=self.scene,
            plan=pick.plan,
            q_now=q,
            motion_id=motion,
            times=times,
            seed=int(np.random.SeedSequence([self.seed, motion]).generate_state(1)[0]),
            config=self.config,
            **self._around(perception, pick),
        )

    def _around(self, perception: Perception, held: Pick | None) -> _Around:
        """What was seen and believed to stand there, but for what the hand has taken from it."""
        points_W = standing_points(perception.frame, self.regions["table"], self.clear_height)
        others = [t for t in perception.posterior.tracks if t.accepted]
        if held is not None:
            points_W = not_of(points_W, self.catalogue[held.track.label], held.track.X_WO)
            others = [t for t in others if t.id != held.track.id]
        return {
            "obstacles": [(self.catalogue[t.label], t.X_WO) for t in others],
            "points_W": thin(points_W, self.max_points),
        }
