"""What many runs come to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.batch_figures import batch_figures, causes, errors, exact_interval, losses, share_interval


def attempt(label, outcome, reason="executed", taken=None, knocked_off=()):
    told = {"label": label, "object": taken or label, "outcome": outcome, "reason": reason}
    return told | {"knocked_off": list(knocked_off)}


def run(seed, places, attempts, **more):
    objects = [{"label": label, "goal": "bin", "place": place} for label, place in places.items()]
    done = sum(place == "bin" for place in places.values())
    return {
        "seed": seed, "state": "ended", "outcome": "cleared", "objects_total": len(places), "objects_sorted": done,
        "objects_missorted": 0, "manipulation_trials": len(attempts), "manipulation_errors": 0, "objects": objects,
        "attempts": attempts, "limits": {"violations": {"speed": 1}}, "cpu_s": 100.0, "peak_memory_mib": 700.0,
        "timing": {
            "perception_cpu_s": 1.0, "planning_cpu_s": None, "simulation_cpu_s": 3.0, "sim_time_s": 60.0, "wall_s": 9.0,
        },
    } | more  # fmt: skip


def test_every_lost_object_has_its_cause():
    rows = [
        run(1, {"a": "bin", "b": "floor"}, [attempt("a", "sorted"), attempt("b", "dropped", "empty_hand")]),
        run(2, {"a": "floor", "b": "bin"}, [attempt("b", "sorted", knocked_off=["a"])]),
        run(3, {"a": "table", "b": "table"}, [attempt("a", "infeasible", "no_path")]),
        run(4, {"a": "table"}, [], state="failed"),
        run(5, {"a": "table"}, [attempt("b", "missed", "empty_hand", taken="a")]),
    ]
    found = {(loss["seed"], loss["label"]): loss["cause"] for loss in losses(rows)}
    assert found == {
        (1, "b"): "dropped: empty_hand",
        (2, "a"): "knocked off by another's pick",
        (3, "a"): "not tried: no_path",
        (3, "b"): "not believed there",
        (4, "a"): "the run failed",
        (5, "a"): "missed: empty_hand",
    }
    assert sum(causes(rows).values()) == 6


def test_errors_are_trials_that_went_wrong_whatever_became_of_the_object():
    rows = [
        run(1, {"a": "bin", "b": "bin"}, [attempt("a", "slipped", "empty_hand"), attempt("a", "sorted")]),
        run(2, {"a": "bin", "b": "floor"}, [attempt("a", "sorted", knocked_off=["b"]), attempt("b", "infeasible")]),
        run(3, {"a": "other"}, [attempt("b", "missorted", taken="a"), attempt("a", "moved")]),
        run(4, {"a": "bin"}, [attempt("a", "slipped", "empty_hand")]),
        {"seed": 5, "state": "crashed", "objects_asked": 2},
    ]
    assert errors(rows) == {"slipped: empty_hand": 2, "knocked another off": 1}, "a wrong label is not the hand's error"


def test_shares_costs_and_picks():
    rows = [run(i, {"a": "bin", "b": "bin"}, [attempt("a", "sorted"), attempt("b", "sorted")]) for i in range(3)]
    figures = batch_figures(rows)
    assert figures["objects_sorted_share"] == figures["runs_complete_share"] == 1.0
    assert figures["trials_per_object"] == 1.0
    assert figures["picks_per_simulated_hour"] == pytest.approx(120.0)
    assert figures["limit_violations"] == 3
    assert figures["planning_cpu_s_median"] is None, "never planned"
    dear = run(3, {"a": "table"}, [], state="failed", cpu_s=1e4, timing={**rows[0]["timing"], "perception_cpu_s": 1e4})
    told = batch_figures([*rows, dear])
    costs = ("cpu_s_per_run_median", "cpu_s_per_run_max", "perception_cpu_s_median", "picks_per_simulated_hour")
    assert [told[cost] for cost in costs] == [figures[cost] for cost in costs], "of those that came to their own end"
    assert told["objects_sorted_share"] == pytest.approx(6 / 7)


def test_a_run_whose_process_died_sorted_nothing():
    died = {"seed": 9, "state": "crashed", "cpu_s": 1.0, "peak_memory_mib": 10.0, "objects_asked": 2}
    rows = [run(1, {"a": "bin", "b": "bin"}, []), died]
    figures = batch_figures(rows)
    assert (figures["objects"], figures["objects_sorted_share"], figures["crashes"]) == (4, 0.5, 1)
    assert causes(rows) == {"the run crashed": 2}, "what was lost has its cause"
    figures = batch_figures([died, died])
    assert (figures["objects"], figures["objects_sorted_share"], figures["runs_complete_share"]) == (4, 0.0, 0.0)


def test_of_nothing_nothing_can_be_told():
    figures = batch_figures([])
    assert figures["runs"] == 0 and figures["objects_sorted_share"] is None


@given(st.lists(st.integers(0, 5), min_size=2, max_size=40))
def test_the_interval_holds_the_share_and_depends_on_the_seed_alone(done):
    total = np.full(len(done), 5.0)
    low, high = share_interval(np.array(done, float), total)
    assert 0.0 <= low <= sum(done) / total.sum() + 1e-9 and sum(done) / total.sum() - 1e-9 <= high <= 1.0
    assert (low, high) == share_interval(np.array(done, float), total)


def test_losses_that_come_together_make_the_interval_wider(n=60):
    together, apart = ([5.0] * (n - len(lost)) + [5.0 - k for k in lost] for lost in ([5, 5], [1] * 10))
    wide, narrow = (share_interval(np.array(done), np.full(n, 5.0)) for done in (together, apart))
    assert wide[0] < narrow[0] - 0.01 and wide[1] > narrow[1]


@given(st.lists(st.integers(0, 5), min_size=2, max_size=60))
def test_the_interval_is_no_narrower_than_that_of_independent_objects(done):
    low, high = share_interval(np.array(done, float), np.full(len(done), 5.0))
    exact = exact_interval(float(sum(done)), 5.0 * len(done))
    assert low <= exact[0] and exact[1] <= high


def test_the_first_losses_cost(n=60):
    """Draws of runs alone would tell less of one loss than of none."""
    lows = [share_interval(np.array([5.0] * (n - k) + [4.0] * k), np.full(n, 5.0))[0] for k in range(8)]
    assert lows == sorted(lows, reverse=True) and len(set(lows)) == len(lows)


def test_runs_without_a_loss_are_no_proof_and_the_more_there_are_the_surer():
    intervals = [share_interval(np.full(n, 5.0), np.full(n, 5.0)) for n in (2, 20, 60)]
    assert [high for _, high in intervals] == [1.0] * 3
    assert [low for low, _ in intervals] == pytest.approx([0.025 ** (1 / (5 * n)) for n in (2, 20, 60)])
    assert share_interval(np.zeros(4), np.full(4, 5.0))[0] == 0.0
    even = share_interval(np.full(4, 1.0), np.full(4, 2.0))
    assert even[0] < 0.5 < even[1] and even[0] == pytest.approx(1 - even[1])
