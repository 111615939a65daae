"""The tables and plots of the committed results are what the committed command makes of them."""

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def tables():
    spec = importlib.util.spec_from_file_location("tables_of_benchmarks", HERE / "tables.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_what_is_committed_is_fresh(tables):
    for name, text in tables.files(tables.read_results(HERE / "results")).items():
        assert (HERE / name).read_text() == text, f"{name}: run python benchmarks/tables.py"


def test_a_bench_without_results_is_left_out_and_what_is_unknown_is_said(tables):
    results = tables.read_results(HERE / "results")
    plan = {**results["plan"], "figures": {"plan_median_s": None, "ik_success": 1.0}}
    text = tables.tables({"plan": plan})
    assert "## The detector" not in text and "bench plan" in text
    assert "| plan_median_s | unknown | at most 0.1: nothing to measure it on |" in text
