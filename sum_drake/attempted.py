"""What the robot knows of a pick and place that is over: its own commands, and what its hand felt."""

import dataclasses

from sum_drake.action_model import holds
from sum_drake.task import Pick
from sum_drake.types import Attempt, Immutable, PickPlace


@dataclasses.dataclass(frozen=True)
class Feel(Immutable):
    """What the hand feels."""

    gap: float = 0.0
    """Between the fingers, metres."""
    squeeze: float = 0.0
    """Force that closes them, newtons."""

    def holds(self, width: float) -> bool:
        """Whether that is an object of this width."""
        return holds(self.gap, self.squeeze, width)


NOTHING = Feel()


def attempt_of(
    pick: Pick, step: int, *, at_lift: Feel, at_place: Feel, released: bool, hangs: bool | None, stopped: str
) -> Attempt:
    """The record of an attempt, with its action.

    step: of the observation that it was decided on. at_lift, at_place: after the lift, and just before the hand opened.
    released: whether it did at the place. hangs: whether something weighs on it still; None: not weighed. stopped: why
    the controller broke a motion off, one of `reflex.CAUSES`, or "".
    """
    plan, track = pick.plan, pick.track
    width = plan.grasp.width
    action = PickPlace(
        step=step,
        kind=pick.kind,
        track=track.id,
        label=track.label,
        X_WG_pick=plan.X_WG,
        X_WO_place=plan.X_WO_place,
        region=pick.region,
        gap_lift=at_lift.gap,
        gap_place=at_place.gap,
        released=released,
        squeeze_lift=at_lift.squeeze,
        squeeze_place=at_place.squeeze,
        held_lift=at_lift.holds(width),
        held_place=at_place.holds(width),
        hangs=hangs,
    )
    if hangs:
        reason = "hangs_on_hand"
    elif stopped not in ("", "empty_hand"):
        reason = stopped
    elif action.held_place:
        reason = "executed"
    else:
        reason = "lost_in_transport" if action.held_lift else "empty_hand"
    return Attempt(
        step, track.id, track.label, pick.region, pick.kind, reason, plan.grasp_candidates, plan.rejected_by, action,
        plan.grasp.X_OG, pick.why, plan.candidates,
    )  # fmt: skip
