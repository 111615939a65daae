"""Plots of results are of all that they tell, and of nothing else."""

import pytest

from sum_drake.bench.reject_figures import SAYERS
from sum_drake.bench.result_plots import (
    belief_series,
    centimetres,
    gain_plot,
    lost_plot,
    plan_plot,
    pose_plot,
    rows_of,
    telling_plot,
    telling_series,
    trials_plot,
)


def estimate(method, metres, degrees, **more):
    row = {"table": "estimate", "method": method, "translation_m": metres, "rotation_deg": degrees}
    return row | {"wrong_box": False, "detected": False} | more


POSES = {
    "rows": [
        estimate("default", 0.01, 5.0), estimate("paper", 0.1, 90.0), estimate("wrong", 0.01, 5.0, wrong_box=True),
        estimate("in_a_detectors_box", 0.01, 5.0, detected=True), {"table": "other"},
    ]
}  # fmt: skip


def test_boxes_that_are_off_and_the_detectors_are_told_apart():
    assert [row["method"] for row in rows_of(POSES, "estimate")][-1] == "in_a_detectors_box"
    ours, papers = pose_plot(POSES), trials_plot(POSES, 0.05)
    assert "default" in ours and "paper" in ours and "wrong" not in ours and "in_a_detectors_box" not in ours
    assert "in_a_detectors_box" in papers and "within 5 cm" in papers and ">default<" not in papers


@pytest.mark.parametrize(("metres", "words"), [(0.01, "1"), (0.2, "20")])
def test_distances_are_told_in_whole_centimetres(metres, words):
    assert centimetres(metres) == words


def test_a_gain_that_cannot_be_told_is_named_all_the_same():
    figures = {
        "default.objects": 5,
        "no_memory.gain": None,
        "no_memory.gain_low95": None,
        "no_memory.gain_high95": None,
    }
    drawn = gain_plot({"figures": figures})
    assert "no memory" in drawn and "default" not in drawn


def test_a_belief_that_knows_rejects_what_is_wrong_and_keeps_the_rest():
    rows = [
        {"table": "hypothesis", "right": right, "said": {**dict.fromkeys(SAYERS, 0.5), "belief": p}, "probability": p}
        for p, right in ((0.9, True), (0.8, True), (0.1, False))
    ]
    series = telling_series({"rows": rows})
    assert [one.name for one in series] == list(SAYERS.values())
    belief, *others = ([*zip(map(float, one.x), map(float, one.y), strict=True)] for one in series)
    assert belief == [(0, 1), (0.5, 1), (1, 1), (1, 0)]
    assert others == [[(0, 1), (1, 0)]] * (len(SAYERS) - 1), "they say the same of all"
    diagonal, told = belief_series({"rows": rows})
    assert not diagonal.name
    assert (list(told.x), list(told.y)) == (pytest.approx([0.1, 0.8, 0.9]), [0.0, 1.0, 1.0])


def test_where_all_hypotheses_are_right_nothing_can_be_told():
    row = {"table": "hypothesis", "right": True, "said": dict.fromkeys(SAYERS, 0.5)}
    assert telling_series({"rows": [row, row]}) == [] and "<svg" in telling_plot({"rows": [row, row]})


def test_losses_are_of_all_runs_a_crashed_one_too():
    batch = {"settings": {"objects": 5}, "episodes": [{"objects_total": 5, "objects_sorted": 4}, {"state": "crashed"}]}
    drawn = lost_plot(batch)
    assert "5 at a time" in drawn and ">6<" in drawn, "one, and five that nobody saw again"


def test_problems_are_drawn_by_kind_and_picks_beside_them():
    rows = [
        {"table": "query", "cpu_s": 0.05, "solved": True},
        {"table": "problem", "kind": "cage", "time_s": 3.0, "solved": True},
        {"table": "problem", "kind": "shelf", "time_s": 10.0, "solved": False},
    ]
    drawn = plan_plot({"rows": rows})
    assert all(f">{name}<" in drawn for name in ("pick", "cage", "shelf"))
