"""Which object promises most."""

import dataclasses

import numpy as np
import pytest

from sum_drake.grasp_ranking import RankedGrasps
from sum_drake.lifting import Dragged
from sum_drake.prospects import GRASPS, POLICIES, Prospect, in_order, most_likely, passed_over, surest, why
from sum_drake.types import PoseBelief, Track, readonly

EYE = readonly(np.eye(4))
TRACK = Track(
    3, "mug", (0, 0, 9, 9), 0.9, 0.8, PoseBelief(readonly(EYE[None]), readonly([1.0])), EYE, 0.5, 0.7, True, 0, 0
)


def prospect(holds=(1.0,) * GRASPS, dragged=(), **of_track):
    """An object with grasps that hold so well, and neighbours that lifting it may move."""

    def rank():
        n = len(holds)
        return RankedGrasps((), np.empty((n, 4, 4)), np.empty(n), np.empty(n), (), readonly(holds))

    return Prospect(dataclasses.replace(TRACK, **of_track), np.empty((0, 3)), rank, lambda: dragged)


def test_the_papers_policy_goes_by_belief_alone():
    values = [most_likely(prospect(holds)) for holds in ((), (0.5,), (1.0,) * 20)]
    assert values == pytest.approx([0.9 * 0.8 * 0.5] * 3)

    def never():
        raise AssertionError("nothing is ranked before it is that object's turn")

    assert most_likely(Prospect(TRACK, np.empty((0, 3)), never, never)) > 0


def test_the_surest_is_there_can_be_held_and_drags_nothing():
    assert surest(prospect()) == pytest.approx(0.7)
    assert surest(prospect(probability=0.9)) > surest(prospect())
    assert surest(prospect((0.5,) * GRASPS)) == pytest.approx(0.35)
    assert surest(prospect((1.0,) * (GRASPS // 2))) == pytest.approx(0.35), "half as many to choose from"
    assert surest(prospect(dragged=(Dragged("tide", 0.3), Dragged("tea", 0.8)))) == pytest.approx(0.7 * 0.24)
    assert surest(prospect(())) == 0.0
    assert 0.0 <= surest(prospect((0.9,) * 80)) <= 1.0


def test_what_may_fall_off_the_table_is_told_where_that_is_likely():
    near, middle = Dragged("tide", 0.3, falls=0.5), Dragged("tea", 0.3)
    assert prospect(dragged=(near, middle)).endangered == ("tide",)
    assert prospect(dragged=(middle,)).endangered == prospect().endangered == ()
    barely = [Dragged(label, 0.8, falls=0.5) for label in ("tide", "tea", "toy")]
    assert prospect(dragged=barely[:1]).endangered == ()
    assert prospect(dragged=barely).endangered == ("tide", "tea", "toy"), "one of them"


def test_what_endangers_others_waits_and_it_is_said():
    edge = prospect(dragged=(Dragged("tide", 0.3, falls=0.5),), id=0, label="mug", likelihood=0.9)
    first, second = (prospect(id=i, label=f"can {i}", likelihood=0.5) for i in (1, 2))
    ids = [one.track.id for one in in_order([second, edge, first], "most_likely", spare_neighbours=True)]
    assert ids == [1, 2, 0], "ties are broken by the track"
    ordered = in_order([first, edge], "most_likely", spare_neighbours=True)
    assert passed_over(first, ordered, "most_likely") == "; mug waits, as tide might fall off the table"
    assert passed_over(edge, ordered, "most_likely") == ""

    def never():
        raise AssertionError("the paper's choice asks for nothing but the belief")

    papers = [Prospect(one.track, one.obstacles_W, never, never) for one in (first, edge)]
    ids = [one.track.id for one in in_order(papers, "most_likely", spare_neighbours=False)]
    assert ids == [0, 1]


def test_a_choice_is_explained_by_its_factors():
    said = why("surest", prospect(dragged=(Dragged("tide", 0.3),)))
    assert said == "surest 0.21 = 0.70 that it is there x 1.00 that grasps hold x 0.30 that neighbours stay (tide)"
    assert why("most_likely", prospect()) == "most_likely 0.36 = 0.90 a box x 0.80 of this label x 0.50 likelihood"
    assert set(POLICIES) == {"surest", "most_likely"}
