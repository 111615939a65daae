"""Attempts in a report: a picture of each grasp with what is known of it; the others in a table."""

import dataclasses
from pathlib import Path

from run_folders import executed, write_run
from test_report import Page
from test_runlog import make_attempt

from sum_drake.objects import load_catalogue
from sum_drake.report_attempts import attempts_part
from sum_drake.run_folder import Tried, read_run_folder

CATALOGUE = load_catalogue()


def page_of(tried: list[Tried]) -> Page:
    return Page("".join(attempts_part(tried, CATALOGUE)))


def test_an_attempt_has_its_picture_and_its_reasons(tmp_path: Path) -> None:
    page = page_of(read_run_folder(write_run(tmp_path / "run", CATALOGUE)).tried())
    assert len(page.pictures) == 1
    words = ("1.", "soup_can", "sorted", "after look 0", "executed", "1.2 mm", "most_likely 0.93", "66 mm apart")
    for word in (*words, "40 grasps considered"):
        assert word in page.words, word
    assert "<td" not in "".join(attempts_part(read_run_folder(tmp_path / "run").tried(), CATALOGUE))


def test_attempts_that_never_set_out_are_a_table_below(tmp_path: Path) -> None:
    (one,) = read_run_folder(write_run(tmp_path / "run", CATALOGUE)).tried()
    row = {**one.row, "step": 1, "reason": "no_grasp", "outcome": "infeasible", "label": "tide"}
    given_up = Tried(row, dataclasses.replace(make_attempt(1), label="tide"), None, None)
    page = page_of([one, given_up])
    assert "Given up before the arm set out" in page.words and "no grasp" in page.words and len(page.pictures) == 1
    assert "Given up" not in page_of([given_up]).words
    assert attempts_part([], CATALOGUE) == []


def test_an_attempt_whose_look_is_lost_has_no_picture(tmp_path: Path) -> None:
    (one,) = read_run_folder(write_run(tmp_path / "run", CATALOGUE)).tried()
    page = page_of([dataclasses.replace(one, look=None)])
    assert page.pictures == [] and "sorted" in page.words
    other = dataclasses.replace(executed(), track=9)
    action = dataclasses.replace(other.action, track=9) if other.action is not None else None
    unknown = dataclasses.replace(one, attempt=dataclasses.replace(other, action=action))
    assert len(page_of([unknown]).pictures) == 1, "the hand alone"
