"""What each object promises, if it is taken next: the policies."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from sum_drake.grasp_ranking import RankedGrasps
from sum_drake.lifting import Dragged
from sum_drake.types import Array, Immutable, Track

GRASPS = 10
"""An object with fewer grasps than this promises less: the arm may not be able to do any of them."""
RISKED = 0.2
"""From this probability on that a neighbour falls off the table, others are tried before."""


@dataclasses.dataclass(frozen=True, eq=False)
class Prospect(Immutable):
    """One believed object, and what there is to be known before a motion is planned."""

    track: Track
    obstacles_W: Array
    """(m, 3): depth points that are not of it, and where more of what they show may be hidden."""
    rank: Callable[[], RankedGrasps]
    drag: Callable[[], Sequence[Dragged]]
    """`lifting.dragged`."""

    @functools.cached_property
    def ranked(self) -> RankedGrasps:
        """Its grasps; they take some time."""
        return self.rank()

    @functools.cached_property
    def dragged(self) -> tuple[Dragged, ...]:
        """Neighbours that lifting it may move."""
        return tuple(self.drag())

    @property
    def hold(self) -> float:
        """About the probability that one of its best grasps holds, if it is where it is believed to be."""
        return float(np.sum(self.ranked.holds[:GRASPS]) / GRASPS)

    @property
    def stay(self) -> float:
        """About the probability that all of its neighbours stay where they are."""
        return float(np.prod([one.stays for one in self.dragged]))

    @property
    def endangered(self) -> tuple[str, ...]:
        """Labels of neighbours that may fall off the table, where that is likely enough for it to be taken last."""
        if np.prod([one.kept for one in self.dragged]) > 1.0 - RISKED:
            return ()
        return tuple(one.label for one in self.dragged if one.kept < 1.0)


def most_likely(prospect: Prospect) -> float:
    """p(x) of Sui et al. 2017, eq. 3, as in the paper: belief alone."""
    track = prospect.track
    return track.p_box * track.p_label * track.likelihood


def surest(prospect: Prospect) -> float:
    """About the probability that taking it works: that it is there, that grasps hold it, that nothing is dragged."""
    return prospect.track.probability * prospect.hold * prospect.stay


POLICIES: dict[str, Callable[[Prospect], float]] = {"surest": surest, "most_likely": most_likely}
"""Which accepted object is tried first: the one with the largest value."""


def in_order(prospects: Iterable[Prospect], policy: str, *, spare_neighbours: bool) -> list[Prospect]:
    """The best first; spare_neighbours: what endangers others last."""

    def key(prospect: Prospect) -> tuple[bool, float, int]:
        endangers = spare_neighbours and bool(prospect.endangered)
        return endangers, -POLICIES[policy](prospect), prospect.track.id

    return sorted(prospects, key=key)


def passed_over(chosen: Prospect, prospects: Sequence[Prospect], policy: str) -> str:
    """Which objects the policy holds more of, and come after it for their neighbours' sake; "" for none.

    prospects: those that were not tried before it, `in_order`.
    """
    value = POLICIES[policy]
    after = prospects[prospects.index(chosen) + 1 :]
    waiting = [one for one in after if value(one) > value(chosen) and one.endangered]
    said = [f"{one.track.label} waits, as {' and '.join(one.endangered)} might fall off the table" for one in waiting]
    return "".join(f"; {words}" for words in said)


def why(policy: str, prospect: Prospect) -> str:
    """What a policy holds of an object, in words."""
    track = prospect.track
    value = f"{policy} {POLICIES[policy](prospect):.2f}"
    if policy == "most_likely":
        return (
            f"{value} = {track.p_box:.2f} a box x {track.p_label:.2f} of this label x {track.likelihood:.2f} likelihood"
        )
    stay = f"{prospect.stay:.2f} that neighbours stay"
    if prospect.dragged:
        stay += f" ({', '.join(one.label for one in prospect.dragged)})"
    return f"{value} = {track.probability:.2f} that it is there x {prospect.hold:.2f} that grasps hold x {stay}"
