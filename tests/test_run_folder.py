"""A run folder: what there is of it, and attempts of summary and log brought together."""

import dataclasses
import json
from pathlib import Path

import pytest
from run_folders import REGIONS, write_run

from sum_drake.assets import InputError
from sum_drake.jsonio import write_json
from sum_drake.objects import load_catalogue
from sum_drake.run_folder import read_run_folder

CATALOGUE = load_catalogue()


def test_a_whole_folder(tmp_path: Path) -> None:
    run = read_run_folder(write_run(tmp_path / "run", CATALOGUE))
    assert (run.name, run.seed, run.outcome, run.problems) == ("run", "7", "cleared", ())
    (one,) = run.tried()
    assert one.number == 1 and one.row["outcome"] == "sorted"
    assert one.attempt is not None and one.look is not None and one.look.step == one.attempt.step == 0
    assert {name: region.floor_height for name, region in run.regions().items()} == pytest.approx(
        {name: region.floor_height for name, region in REGIONS.items()}
    )


def test_attempts_that_are_not_the_logs_stand_for_themselves(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    data = json.loads((folder / "summary.json").read_text())
    data["attempts"][0]["label"] = "mug"
    write_json(folder / "summary.json", data)
    (one,) = read_run_folder(folder).tried()
    assert one.attempt is None and one.number is None
    (folder / "summary.json").unlink()
    (one,) = read_run_folder(folder).tried()
    assert one.number == 1 and one.row["outcome"] is None and one.row["slip_m"] is None


@pytest.mark.parametrize("scenario", ["{", "3", "resolved: {regions: 3}", "resolved: {regions: {a: {p_W: 3}}}"])
def test_a_scenario_without_regions_has_none(tmp_path: Path, scenario: str) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    (folder / "scenario.yaml").write_text(scenario)
    assert read_run_folder(folder).regions() == {}


def test_files_of_two_runs_and_a_missing_scenario_are_told(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps({**summary, "seed": 12345}))
    (folder / "scenario.yaml").write_text(" \n")
    problems = "\n".join(read_run_folder(folder).problems)
    assert "summary.json is of seed 12345, run.mcap of seed" in problems and "expected files of one run" in problems
    assert "scenario.yaml holds no scenario that can be read: table and bins are not known." in problems
    (folder / "scenario.yaml").unlink()
    assert "There is no scenario.yaml: table and bins are not known." in read_run_folder(folder).problems


def test_without_a_summary_the_logs_last_event_tells_how_it_ended(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    run = read_run_folder(folder)
    assert run.record is not None
    ended = {"time": 12.0, "name": "run_ended", "detail": {"outcome": "cleared"}}
    told = dataclasses.replace(run, summary=None, record=dataclasses.replace(run.record, events=(ended,)))
    assert told.outcome == "cleared"
    assert dataclasses.replace(told, record=dataclasses.replace(run.record, events=())).outcome == "unfinished"


def test_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to report; expected a run folder"):
        read_run_folder(tmp_path)
