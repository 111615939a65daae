"""The tables and plots of the committed results are what the committed command makes of them."""

import importlib.util
import re
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
    text = tables.README.read_text()
    assert tables.readme(text, tables.read_results(HERE / "results")) == text, "README: run python benchmarks/tables.py"


def test_every_picture_that_is_shown_is_there(tables):
    shown = re.findall(r"\]\((plots/[^)]+)\)", tables.tables(tables.read_results(HERE / "results")))
    assert len(shown) > 5 and all((HERE / name).is_file() for name in shown)


def test_the_readmes_table_is_of_what_there_is_and_the_rest_of_the_readme_stays(tables):
    results = {"plan": {"figures": {"ik_success": 0.9999, "ik_median_s": None}}}
    words = f"# A\n\nb\n\n{tables.BEGIN}\nold\n{tables.END}\n\nc\n"
    lines = tables.readme(words, results).splitlines()
    assert lines[:3] == ["# A", "", "b"] and lines[-3:] == [tables.END, "", "c"] and "old" not in lines
    row, seconds = [line for line in lines if "`plan`" in line]
    assert "| unknown |" in seconds and seconds.endswith("| `plan` | not told |")
    assert "| 0.9999 | at least 0.999: reached | `plan` |" in row


def test_every_figure_that_the_readme_tells_is_one_of_its_bench(tables):
    results = tables.read_results(HERE / "results")
    for bench in results.keys() & tables.HEADLINES.keys():
        told = {name for _, template in tables.HEADLINES[bench] for name in tables.names_in(template)}
        assert told <= results[bench]["figures"].keys()


def test_ingredients_are_told_where_things_go_wrong_too(tables):
    changes = {"default": "{}", "no_memory": "{task: {remember: false}}"}
    shares = {"runs": 10.0, "objects_sorted_share": 0.9, "objects_sorted_low95": 0.8, "objects_sorted_high95": 0.95,
              "missorted": 0.0, "trials_per_object": 1.1, "cpu_s_per_run_median": 200.0,
              "dealt_with_within_2": 0.96}  # fmt: skip
    figures = {f"{name}.{figure}": value for name in changes for figure, value in shares.items()}
    gain = {f"no_memory.{what}": 0.0 for what in ("gain", "gain_low95", "gain_high95", "pairs_that_differ", "gain_p")}
    packages = dict.fromkeys(("python", "drake", "torch", "numpy"), "1")
    data = {
        "bench": "ablations", "settings": {"variants": changes, "faults": True},
        "seeds": {"first": 710}, "figures": {**figures, **gain}, "rows": [], "versions": packages, "device": "d",
    }  # fmt: skip
    text = tables.tables({"fault_ablations": data})
    command = "bench ablations --out out/fault_ablations --seed 710 --runs 10 --faults --variants default no_memory"
    assert f"`sum-drake {command}`" in text
    heads, rule, *rows = [line for line in text.splitlines() if line.startswith("|")]
    assert heads.endswith("faults dealt with within two looks |") and rows[0].endswith("| 0.96 |")
    assert all("| 10 | 0.900 (0.800 to 0.950) |" in row for row in rows)
    assert "| default | +0.000 (+0.000 to +0.000) | 0 | 0 |" in rows[1]
    assert {line.count("|") for line in (heads, rule, *rows)} == {heads.count("|")}


def test_a_sequence_that_died_sorted_nothing(tables):
    row = {"table": "sequence", "seed": 500, "state": "crashed", "objects_asked": 5}
    assert "| ours, seed 500 | 5 | 0 | 0 | 0 |" in tables._sequences({"rows": [row]})


def test_a_bench_without_results_is_left_out_and_what_is_unknown_is_said(tables):
    results = tables.read_results(HERE / "results")
    plan = {**results["plan"], "figures": {"plan_median_s": None, "ik_success": 1.0}}
    text = tables.tables({"plan": plan})
    assert "## The detector" not in text and "bench plan" in text
    assert "| plan_median_s | unknown | at most 0.1: nothing to measure it on |" in text
