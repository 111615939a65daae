"""One run from the pour to the end."""

import pytest

from sum_drake.objects import load_catalogue
from sum_drake.runlog import RunLogWriter
from sum_drake.runlog_reader import read_run_log
from sum_drake.summary_schema import validate_summary
from sum_drake.systems.episode import run
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.verdict import score


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


def test_a_run_that_is_cut_off_says_so_and_counts_what_was_under_way(catalogue):
    text = "{objects: {labels: [soup_can]}, simulation_duration: 3.0}"
    scenario = load_scenario(text=text, seed=4, catalogue=catalogue)
    told = []
    episode = run(scenario, catalogue, progress=lambda what, sim_time, share: told.append(what))
    assert episode.outcome == "stopped: 3 s of simulated time are over"
    assert episode.error is None
    assert [attempt.reason for attempt in episode.attempts] == ["cut_off"]
    assert "pouring" in told
    summary = score(episode, scenario, catalogue, versions={}, device="cpu")
    validate_summary(summary)
    assert summary["objects_sorted"] == 0
    assert summary["attempts"][0]["outcome"] == "aborted"


def test_what_goes_wrong_in_a_run_ends_it_with_its_record(catalogue, monkeypatch):
    def broken(*arguments, **options):
        raise FloatingPointError("the estimator\nbroke")

    monkeypatch.setattr("sum_drake.belief.update", broken)
    scenario = load_scenario(text="{objects: {labels: [soup_can]}}", seed=4, catalogue=catalogue)
    episode = run(scenario, catalogue)
    assert episode.outcome == "stopped: failed: FloatingPointError: the estimator broke"
    assert isinstance(episode.error, FloatingPointError)
    validate_summary(score(episode, scenario, catalogue, versions={}, device="cpu"))


def test_what_came_after_the_logs_last_look_is_in_the_log(catalogue, monkeypatch, tmp_path):
    monkeypatch.setattr("sum_drake.systems.run_log.PERIOD", 1000.0)
    scenario = load_scenario(
        text="{objects: {labels: [soup_can]}, simulation_duration: 3.0}", seed=4, catalogue=catalogue
    )
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        episode = run(scenario, catalogue, open_log=lambda: writer)
    record = read_run_log(tmp_path / "run.mcap")
    assert [perception.step for perception in record.perceptions] == [0]
    assert len(episode.perceptions) == 1 and len(record.motions) == 1
