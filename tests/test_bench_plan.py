"""`sum-drake bench plan`: what is measured, and the figures made of it."""

import json

import numpy as np
import pytest

from sum_drake.bench import plan_picks
from sum_drake.bench.plan import AIMS, FULL, QUICK, Measured, Size, bench_plan, figures, plan_tasks, set_figures
from sum_drake.bench.plan_queries import QueryMeasured
from sum_drake.bench.plan_report import report_page
from sum_drake.bench.plan_solve import Solved
from sum_drake.objects import load_catalogue

TINY = Size(poses=50, queries=3, problems=1, picks=plan_picks.Size(objects=0, poses=0, tables=0))


def query(kind, solved, seconds, *, free=True, use=0.9):
    return QueryMeasured(f"{kind}_0", kind, 5, solved, "" if solved else "budget", seconds, 10, 3.0, 5.0, free, use)


def problem(solved, seconds):
    return Solved("one", True, True, solved, seconds, [[0.0]] if solved else [], "" if solved else "no path")


def test_a_full_bench_is_of_everything_and_a_quick_one_of_a_few():
    catalogue = load_catalogue()
    full, quick = plan_tasks(FULL, catalogue, 0), plan_tasks(QUICK, catalogue, 0)
    for kind, least in (("query", 300), ("problem", 120), ("pick", 120), ("ik", 1)):
        assert sum(task[0] == kind for task in full) >= least
        assert 0 < sum(task[0] == kind for task in quick) <= 40
    assert len(set(full)) == len(full)
    kinds = [task[0] for task in full]
    assert list(dict.fromkeys(kinds)) == ["ik", "query", "problem", "pick"], "short ones first, so that progress shows"
    assert {task[1] for task in quick if task[0] == "problem"} == {"shelf", "cage", "under_table"}


def test_figures_count_what_is_in_time_and_what_is_not_free():
    done = {
        ("query", 0): Measured(query=query("approach", True, 0.1)),
        ("query", 1): Measured(query=query("approach", True, 1.5)),
        ("query", 2): Measured(query=query("return", False, 0.3)),
        ("query", 3): Measured(query=query("return", True, 0.2, free=False, use=1.2)),
        ("problem", "shelf", 0): Measured(solved=problem(True, 0.5)),
        ("problem", "shelf", 1): Measured(solved=problem(True, 5.0), valid=False),
        ("problem", "cage", 0): Measured(solved=problem(False, 10.0)),
    }
    found = figures(done)
    assert found["plan_success_1s"] == 0.5
    assert found["plan_success"] == 0.75
    assert found["plan_median_s"] == pytest.approx(0.25)
    assert found["plan_return_success_1s"] == 0.5
    assert (found["shelf_solved_10s"], found["shelf_solved_1s"], found["cage_solved_10s"]) == (1.0, 0.5, 0.0)
    assert np.isnan(found["under_table_solved_10s"])
    late = set_figures("cage", [Measured(solved=problem(True, 9.9)), Measured(solved=problem(True, 10.1))])
    assert late["cage_solved_10s"] == 0.5
    assert found["paths_free"] == pytest.approx(3 / 5)
    assert found["limit_violations"] == 1
    assert np.isnan(found["pick_success_alone"])


def test_it_writes_results_and_a_page(tmp_path):
    found = bench_plan(tmp_path / "out", load_catalogue(), size=TINY, workers=1)
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["bench"] == "plan" and results["schema"] == "sum-drake/bench/1"
    assert found["ik_success"] > 0.95 and found["paths_free"] == 1.0 and found["plan_success"] == 1.0
    assert results["figures"]["ik_success"] == found["ik_success"]
    assert {row["table"] for row in results["rows"]} >= {"query", "problem"}
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Planning and picks" in page and "What is measured" in page and page.count("role='img'") == 2
    told = []
    again = bench_plan(
        tmp_path / "out", load_catalogue(), size=TINY, workers=1, progress=lambda *of: told.append(of[1:])
    )
    assert told == [(7, 7)], "what was done is not done again"
    np.testing.assert_equal(again, found)  # to which nan is itself


def test_a_page_without_anything_is_a_page():
    assert "Every path was found" in report_page([], figures({}), AIMS)


def test_a_page_tells_which_picks_failed():
    failed = {"setting": "alone", "phase": "plan", "cause": "ik", "count": 2, "which": ["mug 1", "tide 2"]}
    assert "mug 1, tide 2" in report_page([{"table": "pick_failure"} | failed], figures({}), AIMS)
