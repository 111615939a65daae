"""The report: one file, no network, and of use for a run that did not finish."""

import dataclasses
import html.parser
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_drawing import make_perception
from test_runlog import make_attempt

from sum_drake.assets import InputError
from sum_drake.evaluation import Truth, digest, score_attempts, score_observation, summary
from sum_drake.jsonio import write_json
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.report import write_report
from sum_drake.runlog import RunLogWriter
from sum_drake.types import Attempt, Perception, PickPlace, Region, readonly

REGIONS = {
    "table": Region("table", readonly([0.7, 0.0, 0.9]), readonly([0.25, 0.35, 0.2])),
    "left": Region("left", readonly([0.12, 0.62, 0.5]), readonly([0.18, 0.18, 0.1])),
}


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


@pytest.fixture
def run_folder(tmp_path: Path, catalogue: Catalogue) -> Path:
    """A finished run of two observations, with an attempt that was given up after the first."""
    folder = tmp_path / "7"
    folder.mkdir()
    perceptions = [make_perception(step, catalogue) for step in range(2)]
    attempt = dataclasses.replace(make_attempt(0), label="soup_can")
    with RunLogWriter(folder / "run.mcap", metadata={"seed": "7"}) as writer:
        for perception in perceptions:
            writer.write_perception(perception)
        writer.write_attempt(5.0, attempt)
    truths = [Truth(step, (("soup_can", perceptions[0].posterior.tracks[0].X_WO),)) for step in range(3)]
    goal = {"soup_can": "left"}
    data = summary(
        seed=7, outcome="stopped: no object can be attempted", final=truths[-1], regions=REGIONS, goal=goal,
        observations=[score_observation(p, t, catalogue) for p, t in zip(perceptions, truths, strict=False)],
        attempts=score_attempts([attempt], truths, regions=REGIONS, goal=goal, slips=[None]),
        timing={"perception_cpu_s": 3.25, "wall_s": 8.0}, digest=digest(perceptions, [attempt], truths[-1]),
        versions={"drake": "1.51.1"}, device="a <b>machine</b>",
    )  # fmt: skip
    write_json(folder / "summary.json", data)
    (folder / "scenario.yaml").write_text("resolved:\n  random_seed: 7\n")
    return folder


class Page(html.parser.HTMLParser):
    """Checks that tags nest, and gathers text, pictures and addresses."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words = ""
        self.pictures: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                self.addresses.append(value or "")
        if tag == "img":
            self.pictures.append(dict(attrs)["src"] or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data + " "


def test_a_finished_run(run_folder: Path) -> None:
    path = write_report(run_folder)
    assert path == run_folder / "report.html"
    text = path.read_text()
    page = Page(text)
    assert len(page.pictures) == 4
    # Nothing is fetched: every address is data, and the style names none.
    assert all(address.startswith("data:image/jpeg;base64,") for address in page.addresses)
    assert "http" not in text and "url(" not in text and "<script" not in text
    for words in (
        "seed 7", "stopped: no object can be attempted", "0 of 1", "infeasible",
        "40 grasps considered: 30 within reach, but no way to hold the arm, 10 too near the table",
        "1 of 1 false positives rejected; 1 of 1 true tracks accepted", "3.2 s", "a <b>machine</b>", "random_seed: 7",
    ):  # fmt: skip
        assert words in page.words, words
    # Written through a temporary file that does not stay.
    assert sorted(p.name for p in run_folder.iterdir()) == ["report.html", "run.mcap", "scenario.yaml", "summary.json"]


def test_the_same_run_gives_the_same_page(run_folder: Path) -> None:
    assert write_report(run_folder).read_bytes() == write_report(run_folder).read_bytes()


def test_a_run_that_was_killed(run_folder: Path) -> None:
    (run_folder / "summary.json").unlink()
    log = (run_folder / "run.mcap").read_bytes()
    (run_folder / "run.mcap").write_bytes(log[: int(0.7 * len(log))])
    text = write_report(run_folder).read_text()
    page = Page(text)
    assert "unfinished" in page.words and "There is no summary.json" in page.words
    assert "the log run.mcap is cut off" in page.words
    assert str(run_folder) not in text
    assert len(page.pictures) >= 2


MOVING = [("segment_begun", {"motion": 0, "segment": "reach"}), ("segment_begun", {"motion": 0, "segment": "lift"})]
HOLDING = [*MOVING, ("motion_done", {"motion": 0})]


@pytest.mark.parametrize(
    ("events", "tried", "words"),
    [
        (MOVING, None, "Then a pick and place was under way (lift) when the log ends, at 9.5 s."),
        (HOLDING, None, "Then a pick and place was under way (lift) when the log ends, at 9.5 s."),
        (MOVING, "no_grasp", "(no grasp). Then a pick and place was under way (lift) when the log ends, at 9.5 s."),
        (HOLDING, "executed", "(executed). Then the log ends, at 9.6 s."),
        ([], None, "Then the log ends, at 9.5 s."),
        ([("run_ended", {"outcome": "cleared"})], None, "Then the run ended: cleared."),
    ],
)
def test_a_cut_off_run_tells_what_was_under_way(
    tmp_path: Path, catalogue: Catalogue, events: list[tuple[str, dict[str, Any]]], tried: str | None, words: str
) -> None:
    """After its last look; an earlier one after which nothing was tried says so."""
    perceptions = [
        dataclasses.replace(p, frame=dataclasses.replace(p.frame, time=4.0 * p.step))
        for p in (make_perception(step, catalogue) for step in range(2))
    ]
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        for perception in perceptions:
            writer.write_perception(perception)
        for i, (name, detail) in enumerate(events):
            writer.write_event(5.0 + i, name, detail)
        writer.write_joint_state(9.5, ["pan"], np.zeros(1))
        if tried is not None:
            writer.write_attempt(9.6 if tried == "executed" else 4.1, attempt_of(perceptions[1], tried))
    page = Page(write_report(tmp_path).read_text())
    assert page.words.count("Then nothing was attempted.") == 1
    assert words in page.words


def attempt_of(perception: Perception, reason: str) -> Attempt:
    action = None
    if reason == "executed":
        eye = readonly(np.eye(4))
        action = PickPlace(perception.step, "pick_place", 0, "soup_can", eye, eye, "left", 0.03, 0.03, True)
    return dataclasses.replace(make_attempt(perception.step), reason=reason, action=action)


def test_the_runs_own_catalogue_is_used(run_folder: Path, tmp_path: Path, catalogue: Catalogue) -> None:
    """The scenario names it; where it is gone the page says so and draws what the package knows."""
    by_package = write_report(run_folder).read_text()
    own = tmp_path / "own.yaml"
    # The same labels in another order have other colours.
    entries = [f"  {label}: {{mesh: {catalogue[label].mesh}, category: x}}\n" for label in reversed(catalogue.labels)]
    own.write_text("objects:\n" + "".join(entries))
    (run_folder / "scenario.yaml").write_text(f"resolved:\n  catalogue: {own}\n")
    by_own = write_report(run_folder).read_text()
    pictures = Page(by_own).pictures
    assert pictures != Page(by_package).pictures and "Only objects of the package" not in by_own
    assert Page(write_report(run_folder, load_catalogue(own)).read_text()).pictures == pictures
    own.unlink()
    gone = Page(write_report(run_folder).read_text())
    assert "Only objects of the package can be drawn: catalogue" in gone.words and "own.yaml is missing" in gone.words
    assert gone.pictures == Page(by_package).pictures


@pytest.mark.parametrize("scenario", ["{", "3", "resolved: 3", "resolved: {catalogue: 3}", "resolved: {catalogue: ''}"])
def test_a_scenario_that_names_no_catalogue_stands_for_the_packages(run_folder: Path, scenario: str) -> None:
    (run_folder / "scenario.yaml").write_text(scenario)
    page = Page(write_report(run_folder).read_text())
    assert len(page.pictures) == 4 and "Only objects" not in page.words


def test_a_run_without_its_log(run_folder: Path) -> None:
    (run_folder / "run.mcap").unlink()
    page = Page(write_report(run_folder).read_text())
    assert page.pictures == [] and "cannot read the log" in page.words and "infeasible" in page.words


@pytest.mark.parametrize("content", ["{", "[]", '{"schema": "other"}', '"text"'])
def test_a_broken_summary_is_told(run_folder: Path, content: str) -> None:
    (run_folder / "summary.json").write_text(content)
    page = Page(write_report(run_folder).read_text())
    assert "summary.json cannot be used" in page.words and len(page.pictures) == 4


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to report; expected a run folder"):
        write_report(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_page_prints_and_fits_a_phone(run_folder: Path) -> None:
    text = write_report(run_folder).read_text()
    assert 'name="viewport" content="width=device-width' in text
    assert "@media (max-width" in text and "@media print" in text
    # Each cell names its column, for rows that are stacked.
    assert len(re.findall(r"<td ", text)) == len(re.findall(r"<td data-name=", text))


def test_false_detections_and_their_fates_are_told(run_folder: Path) -> None:
    summary_file = run_folder / "summary.json"
    data = json.loads(summary_file.read_text())
    box = [1.0, 2.0, 30.0, 40.0]
    data["observations"][0]["false_detections"] = [
        {"box": box, "label": "mug", "probability": 0.42, "fate": "corrected", "accepted_as": "toy"},
        {"box": box, "label": "tide", "probability": 0.2, "fate": "rejected", "accepted_as": None},
    ]
    data["observations"][1]["false_detections"] = []
    write_json(summary_file, data)
    words = Page(write_report(run_folder).read_text()).words
    assert "false detections: mug 0.42 corrected to toy, tide 0.20 rejected." in words
    assert words.count("false detections") == 1


def test_why_something_was_moved_and_what_was_in_the_way_is_told(run_folder: Path) -> None:
    summary_file = run_folder / "summary.json"
    data = json.loads(summary_file.read_text())
    data["attempts"][0] |= {
        "kind": "move", "reason": "executed", "outcome": "moved", "why": "in the way of 96 grasps at sugar",
        "grasp_candidates": 120, "rejected_by": {"neighbour_finger_tide": 96, "table": 4, "ik": 0},
    }  # fmt: skip
    write_json(summary_file, data)
    words = Page(write_report(run_folder).read_text()).words
    assert "moved out of the way: executed" in words and "in the way of 96 grasps at sugar" in words
    assert "120 grasps considered: 96 with tide at a finger, 4 too near the table, 20 hold" in words
    del data["attempts"][0]["why"]
    write_json(summary_file, data)
    assert "moved" in write_report(run_folder).read_text(), "summaries written before there was a why"


def test_faults_ends_and_what_was_believed_of_attempts_are_told(run_folder: Path) -> None:
    data = json.loads((run_folder / "summary.json").read_text())
    data["faults"] = [
        {"kind": "swept", "observation": 0, "object": "mug", "happened": True, "dealt_with_after": 2,
         "belief": "found again, 0.93"},
        {"kind": "taken", "observation": 1, "object": None, "happened": False, "dealt_with_after": None,
         "belief": "the run was over before"},
    ]  # fmt: skip
    data["attempts"][0]["believed"] = {"placed": 0.02, "stayed": 0.7, "slipped": 0.28}
    write_json(run_folder / "summary.json", data)
    page = (write_report(run_folder)).read_text()
    for words in ("Faults", "found again, 0.93", "2 looks", "the run was over before", "stayed 0.70, slipped 0.28"):
        assert words in page
    del data["faults"], data["attempts"][0]["believed"]
    write_json(run_folder / "summary.json", data)
    assert "Faults" not in write_report(run_folder).read_text(), "summaries written before there were any"
