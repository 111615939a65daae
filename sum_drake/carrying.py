"""Ways of an arm that was stopped while it carried something: on to where it was going, or back to where it was."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from sum_drake import timing
from sum_drake.geometry import inverse, shifted
from sum_drake.kinematics import Arm
from sum_drake.motion import NoPath, cartesian_path, plan_path
from sum_drake.objects import ObjectModel
from sum_drake.pick_config import PickConfig
from sum_drake.pick_phases import comes_clear, opening, timed, unexplained
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene, solid_of, solids_of_points
from sum_drake.retreat import plan_retreat
from sum_drake.types import Array, Motion, Region, Segment

HEIGHTS = (0.25, 0.2, 0.15, 0.1, 0.05)
"""How far the hand rises first, metres: as far as it can. What it met it did not know of, so that it stays above it."""
MORE_ROOM = 0.02
"""Kept from all that is believed, besides the usual paddings, metres: where the object hangs is not known."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Carrying:
    """An arm that was stopped with an object in its hand, at rest, and what is believed to be around it.

    plan: of the pick; X_WO: (4, 4), where the object was taken from; q_now: (8,); points_W: (n, 3), seen and not of it;
    bin: where it is to end, if that is a bin.
    """

    arm: Arm
    scene: PlanningScene
    plan: PickPlan
    X_WO: Array
    model: ObjectModel
    q_now: Array
    seed: int
    config: PickConfig
    obstacles: Sequence[tuple[ObjectModel, Array]] = ()
    points_W: Array | None = None
    bin: Region | None = None

    def plan_on(self, motion_id: int) -> Motion:
        """Up, around everything to where `plan` lets go, and on as planned; what is in its bin is let go where it is.

        Whatever was met there lies in the bin, too, and will be met again. Raises RuntimeError where there is no way.
        """
        if self.is_in_bin:
            return plan_retreat(
                arm=self.arm,
                scene=self.scene,
                q_now=self.q_now,
                motion_id=motion_id,
                seed=self.seed,
                config=self.config,
                obstacles=self.obstacles,
                points_W=self.points_W,
            )
        release = self.plan.place
        way = self._over(release.segments[0].trajectory.positions[-1])
        return Motion(motion_id, (*way, *release.segments[1:]), release.load)

    def plan_back(self, motion_id: int) -> Motion:
        """Up, around everything to above where the object was taken from, and down to there, where it is let go.

        Then the hand goes back as it came, which was free. An object that cannot be brought away is not dropped on the
        floor: from where it was it may be taken by another grasp. Raises RuntimeError where there is no such way, and
        over its bin, in which it is better off.
        """
        if self._is_over_bin:
            raise RuntimeError("it is over its bin")
        came = {segment.name: segment for segment in self.plan.pick.segments}
        segments = (
            *self._over(came["lift"].trajectory.positions[-1]),
            _back(came["lift"], "lower", 0.0),
            opening(came["close"].trajectory.positions[-1], came["reach"].gap, self.config),
            _back(came["reach"], "retreat", came["reach"].gap),
            _back(came["approach"], "return", came["approach"].gap),
        )
        return Motion(motion_id, segments, self.plan.place.load)

    @property
    def is_in_bin(self) -> bool:
        """Whether the object, as it was gripped, is in its bin by now."""
        return self.bin is not None and self.bin.holds(self._p_WO)

    @property
    def _is_over_bin(self) -> bool:
        """Whether it is over its bin, or in it."""
        off = None if self.bin is None else np.abs(self._p_WO - self.bin.p_W)[:2] - self.bin.half_extents[:2]
        return off is not None and bool((off <= 0).all())

    @property
    def _p_WO(self) -> Array:
        return np.asarray((self.arm.forward(self.q_now) @ inverse(self.plan.X_WG) @ self.X_WO)[:3, 3])

    def _over(self, q_there: Array) -> tuple[Segment, Segment]:
        """Straight up, as far as there is a way from there on, then around everything to q_there: RuntimeError."""
        arm, config, held = self.arm, self.config, self._held()
        X_WG = arm.forward(self.q_now)
        reason = "no straight way up"
        for height in HEIGHTS:
            X_WG_risen = shifted(X_WG, np.array([0.0, 0.0, height]))
            for rise in cartesian_path(arm, X_WG, X_WG_risen, self.q_now, count=2):
                if not comes_clear(held, rise):
                    continue
                way = plan_path(held, rise[-1], q_there[None], seed=self.seed, budget=config.budget)
                if isinstance(way, NoPath):
                    reason = f"{way.reason} {way.pairs}"
                    continue
                return (
                    Segment("lift", timing.time_curve(rise, speed=config.straight_speed), 0.0),
                    Segment("transport", timed(held, way.qs, config.speed), 0.0),
                )
        raise RuntimeError(f"no free way on with what is in the hand: {reason}")

    def _held(self) -> PlanningScene:
        """What the arm has to keep from, and by how much, with the object in its hand."""
        config = self.config
        others = [solid_of(other, X) for other, X in self.obstacles]
        points = unexplained(np.empty((0, 3)) if self.points_W is None else self.points_W, others, config.explained)
        around = self.scene.with_solids((*others, *solids_of_points(points, size=config.point_size)))
        solids = config.solid_padding + MORE_ROOM
        held = around.padded(furniture=config.furniture_padding, solids=solids, self_distance=config.self_padding)
        X_GO = inverse(self.plan.X_WG) @ self.X_WO
        return held.holding(solid_of(self.model, self.X_WO).hulls, X_GO).with_gap(self.plan.grasp.width)


def _back(segment: Segment, name: str, gap: float) -> Segment:
    """The same way in the other direction, under another name."""
    return dataclasses.replace(segment, name=name, trajectory=timing.reverse(segment.trajectory), gap=gap)
