"""Two runs side by side: what is the same is said to be, what differs is marked."""

import json
from pathlib import Path

import pytest
from run_folders import executed, write_run
from test_report import Page

from sum_drake.assets import InputError
from sum_drake.jsonio import write_json
from sum_drake.objects import load_catalogue
from sum_drake.report_compare import write_comparison

CATALOGUE = load_catalogue()


def compared(tmp_path: Path) -> Page:
    text = write_comparison(tmp_path / "a", tmp_path / "b", tmp_path / "c.html").read_text()
    assert "http" not in text and "<script" not in text
    return Page(text)


def test_equal_runs_are_said_to_be_equal(tmp_path: Path) -> None:
    for name in "ab":
        write_run(tmp_path / name, CATALOGUE)
    page = compared(tmp_path)
    assert "the same to the last bit" in page.words and "differs" not in page.words
    assert "Probabilities agree within 0.1" in page.words
    assert "The same versions on the same device." in page.words
    assert len(page.pictures) == 4


def test_what_differs_is_marked(tmp_path: Path) -> None:
    write_run(tmp_path / "a", CATALOGUE)
    write_run(tmp_path / "b", CATALOGUE, executed(released=False), seed=8)
    data = json.loads((tmp_path / "b" / "summary.json").read_text())
    data |= {"objects_sorted": 0, "outcome": "stopped: no object can be attempted"}
    data["objects"][0]["place"] = "floor"
    data["versions"] = {"drake": "1.58.0"}
    write_json(tmp_path / "b" / "summary.json", data)
    (tmp_path / "b" / "scenario.yaml").write_text("resolved:\n  random_seed: 8\n")
    page = compared(tmp_path)
    for words in ("seed 8", "stopped: no object", "lost in transport", "differs", "1.58.0", "+  random_seed: 8", "-1"):
        assert words in page.words, words
    assert "All their looks look alike; what they did after them differs." in page.words


def test_a_run_that_was_cut_off_goes_beside_one_that_was_not(tmp_path: Path) -> None:
    for name in "ab":
        write_run(tmp_path / name, CATALOGUE)
    log = (tmp_path / "b" / "run.mcap").read_bytes()
    (tmp_path / "b" / "run.mcap").write_bytes(log[: int(0.6 * len(log))])
    for file in ("summary.json", "scenario.yaml"):
        (tmp_path / "b" / file).unlink()
    page = compared(tmp_path)
    assert "B: There is no summary.json" in page.words and "B: There is no scenario.yaml" in page.words
    assert "unknown" in page.words and "not there" not in page.words, "of B nobody knows where things ended"
    (tmp_path / "b" / "run.mcap").unlink()
    with pytest.raises(InputError, match="nothing to report"):
        compared(tmp_path)


def test_runs_without_logs_compare_their_figures(tmp_path: Path) -> None:
    for name in "ab":
        write_run(tmp_path / name, CATALOGUE)
        (tmp_path / name / "run.mcap").unlink()
    data = json.loads((tmp_path / "b" / "summary.json").read_text())
    write_json(tmp_path / "b" / "summary.json", data | {"digest": "0" * 64})
    page = compared(tmp_path)
    assert page.pictures == [] and "Without looks in the log of A and B nothing can be said" in page.words


def test_a_run_without_its_log_differs_in_nothing_that_is_not_known(tmp_path: Path) -> None:
    for name in "ab":
        write_run(tmp_path / name, CATALOGUE)
    (tmp_path / "b" / "run.mcap").unlink()
    data = json.loads((tmp_path / "b" / "summary.json").read_text())
    write_json(tmp_path / "b" / "summary.json", data | {"digest": "0" * 64})
    page = compared(tmp_path)
    assert "Without looks in the log of B nothing can be said about where they part." in page.words
    assert "Only one of them has looks: probabilities cannot be compared." in page.words
    assert "Up to look -1" not in page.words and "agree" not in page.words


def test_an_attempt_of_which_one_run_does_not_know_the_end_does_not_differ(tmp_path: Path) -> None:
    for name in "ab":
        write_run(tmp_path / name, CATALOGUE)
    (tmp_path / "b" / "summary.json").unlink()
    page = compared(tmp_path)
    assert "soup_can" in page.words and "differs" not in page.words
