"""What is made of runs in which things go wrong on purpose."""

import dataclasses
import json

import numpy as np
import pytest
from deciding import CAN, believe
from test_batch_figures import run
from test_drawing import make_perception

from sum_drake.batch import Processes
from sum_drake.bench.faults import AIMS, SCENARIO, _invalid, bench_faults, fault_figures, invalid_beliefs
from sum_drake.commands.batch import prepare
from sum_drake.objects import load_catalogue
from sum_drake.runlog import RunLogWriter
from sum_drake.systems.scenario import load_scenario
from sum_drake.types import PoseBelief, SceneBelief, readonly


def fault(kind, after, happened=True):
    return {"kind": kind, "happened": happened, "dealt_with_after": after}


def test_only_what_happened_is_to_be_dealt_with_and_soon():
    rows = [
        run(1, {"a": "bin"}, [], faults=[fault("swept", 2), fault("swept", 3), fault("taken", None)]),
        run(2, {"a": "bin"}, [], faults=[fault("taken", 1), fault("camera", None, happened=False)]),
        {"seed": 3, "state": "crashed", "cpu_s": 1.0, "peak_memory_mib": 10.0, "objects_asked": 1},
    ]
    found = fault_figures(rows, 2)
    assert (found["faults_happened"], found["crashes"], found["invalid_beliefs"]) == (4, 1, 2)
    assert found["dealt_with_within_2"] == pytest.approx(0.5)
    assert found["dealt_with_within_2.swept"] == found["dealt_with_within_2.taken"] == pytest.approx(0.5)
    assert "dealt_with_within_2.camera" not in found
    assert set(AIMS) <= set(found)


def test_what_is_wrong_with_a_belief_is_said():
    track = believe("soup_can", CAN)
    assert list(_invalid(SceneBelief(0, (track,), 1))) == []
    nowhere = readonly(np.full((4, 4), np.nan))
    bad = [dataclasses.replace(track, id=1, probability=np.nan), dataclasses.replace(track, X_WO=nowhere)]
    said = " ".join(_invalid(SceneBelief(0, (track, *bad), 3)))
    assert all(word in said for word in ("two tracks of one id", "probability nan", "nowhere"))


def test_runs_are_made_judged_and_told(tmp_path):
    """Short ones, in which nothing goes wrong yet."""
    text = "{objects: {labels: [soup_can]}, simulation_duration: 0.3}"
    specs, settings = prepare(load_scenario(name=SCENARIO, text=text, seed=3), 3, 2)
    found = bench_faults(
        tmp_path, specs, settings, Processes(2), quick=True, progress=lambda what, done, total: None
    )  # fmt: skip
    data = json.loads((tmp_path / "results.json").read_text())
    assert [(row["seed"], row["state"]) for row in data["rows"] if row["table"] == "run"] == [
        (3, "ended"),
        (4, "ended"),
    ]
    assert (found["crashes"], found["invalid_beliefs"], found["objects_sorted_share"]) == (0, 0, 0.0)
    assert sum(row["table"] == "loss" for row in data["rows"]) == 2
    (tmp_path / "runs" / "4" / "run.mcap").write_text("no log")
    again = bench_faults(
        tmp_path, specs, settings, Processes(2), quick=True, progress=lambda what, done, total: None
    )  # fmt: skip
    assert again["invalid_beliefs"] == 1 and "Runs with faults" in (tmp_path / "report.html").read_text()


def test_a_log_with_a_pose_belief_that_is_none_is_found_out(tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(PoseBelief, "__post_init__", lambda belief: None)  # as of a program that does not ask
        perception = make_perception(0, load_catalogue())
        first, *others = perception.posterior.tracks
        unequal = PoseBelief(first.belief.X_WOs, readonly(2.0 * first.belief.weights))
        tracks = (dataclasses.replace(first, belief=unequal), *others)
        with RunLogWriter(tmp_path / "run.mcap", metadata={"seed": "7"}) as writer:
            writer.write_perception(
                dataclasses.replace(perception, posterior=dataclasses.replace(perception.posterior, tracks=tracks))
            )
    (said,) = invalid_beliefs(tmp_path / "run.mcap")
    assert "run.mcap" in said and "weights sum to 2" in said


def test_a_run_without_a_log_has_no_valid_belief(tmp_path):
    (said,) = invalid_beliefs(tmp_path / "run.mcap")
    assert "run.mcap" in said
