import json

import numpy as np

from sum_drake.bench.results import SCHEMA, write_results
from sum_drake.fingerprint import code


def test_results_say_what_they_depend_on_and_what_is_unknown_is_null(tmp_path):
    write_results(
        tmp_path, "detect", quick=True, settings={"images": 3}, seeds={"dataset": 4},
        figures={"map50": np.float64(0.5), "recall": float("nan")}, rows=[{"table": "label", "ap50": float("nan")}],
    )  # fmt: skip
    data = json.loads((tmp_path / "results.json").read_text(), parse_constant=lambda name: 1 / 0)
    assert data["schema"] == SCHEMA == "sum-drake/bench/1"
    assert (data["bench"], data["quick"], data["settings"], data["seeds"]) == (
        "detect", True, {"code": code(), "images": 3}, {"dataset": 4}
    )  # fmt: skip
    assert data["figures"] == {"map50": 0.5, "recall": None}
    assert data["rows"] == [{"table": "label", "ap50": None}]
    assert data["versions"]["sum-drake"] != "missing"
    assert data["device"]


def test_results_of_batches_are_of_what_made_those_not_of_whoever_counts(tmp_path):
    made = [{"commit": "a", "device": "one"}, {"commit": "b", "device": "two; one"}, {"commit": None, "device": "one"}]
    write_results(tmp_path, "sort", quick=True, settings={}, seeds={}, figures={}, rows=[], batches=made)
    data = json.loads((tmp_path / "results.json").read_text())
    assert (data["commit"], data["device"]) == ("a; b; unknown", "one; two")
