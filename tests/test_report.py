"""The report: one file, no network, and of use for a run that did not finish."""

import dataclasses
import html.parser
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_runlog import make_attempt

from sum_drake.assets import InputError
from sum_drake.evaluation import Truth, digest, score_attempts, score_observation, summary
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.jsonio import write_json
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.rendering import predicted_box
from sum_drake.report import draw_depth, draw_perception, label_color, write_report
from sum_drake.runlog import RunLogWriter
from sum_drake.types import (
    Array,
    Camera,
    Detection,
    Frame,
    Perception,
    PoseBelief,
    Region,
    SceneBelief,
    Track,
    readonly,
)

CAMERA = Camera(320, 240, 262.0, 262.0, 159.5, 119.5)
X_WC = readonly(transform(np.diag([1.0, -1.0, -1.0]), np.array([0.7, 0.0, 1.7])))
REGIONS = {
    "table": Region("table", readonly([0.7, 0.0, 0.9]), readonly([0.25, 0.35, 0.2])),
    "left": Region("left", readonly([0.12, 0.62, 0.5]), readonly([0.18, 0.18, 0.1])),
}


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def make_track(id: int, label: str, X_WO: Array, frame: Frame, catalogue: Catalogue, *, accepted: bool) -> Track:
    box = predicted_box(np.asarray(catalogue[label].load_mesh().vertices), X_WO, frame)
    belief = PoseBelief(readonly(X_WO[None]), readonly([1.0]))
    return Track(
        id,
        label,
        box,
        0.9,
        0.8,
        belief,
        readonly(X_WO),
        0.7,
        0.93 if accepted else 0.07,
        accepted,
        0,
        frame.observation,
    )


def make_perception(step: int, catalogue: Catalogue) -> Perception:
    """A can that is believed in, a mug that is not, on a plain grey table."""
    frame = Frame(
        step, np.full((240, 320, 3), 128, np.uint8), np.full((240, 320), 1.0, np.float32), CAMERA, X_WC, 10.0 * step
    )
    tracks = (
        make_track(0, "soup_can", transform(np.eye(3), np.array([0.7, 0.1, 0.75])), frame, catalogue, accepted=True),
        make_track(1, "mug", transform(np.eye(3), np.array([0.7, -0.15, 0.75])), frame, catalogue, accepted=False),
    )
    detections = tuple(Detection(track.box, track.p_box, ((track.label, track.p_label),)) for track in tracks)
    return Perception(step, frame, detections, (), SceneBelief(step - 1), SceneBelief(step, tracks, 2), None)


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
        "seed 7", "stopped: no object can be attempted", "0 of 1", "infeasible", "ik 30",
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


def test_the_overlay_lies_on_the_object(catalogue: Catalogue) -> None:
    """The accepted can's picture is tinted within its box and untouched elsewhere; the mug is only outlined."""
    perception = make_perception(0, catalogue)
    can, mug = perception.posterior.tracks
    picture = draw_perception(perception, catalogue, scale=2)
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    changed = (picture != 128).any(-1)
    x, y, w, h = (round(2 * value) for value in can.box)
    assert changed[y + 2 : y + h - 2, x + 2 : x + w - 2].mean() > 0.75
    x, y, w, h = (round(2 * value) for value in mug.box)
    assert 0.02 < changed[y : y + h, x : x + w].mean() < 0.6
    assert not changed[:, : min(round(2 * t.box[0]) for t in (can, mug)) - 60].any()
    assert (picture[changed] == label_color("soup_can", catalogue)).all(-1).any()


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(-2, 2), min_size=3, max_size=3),
    st.booleans(),
)
def test_any_estimate_can_be_drawn(w: list[float], p: list[float], accepted: bool) -> None:
    """Beside the picture, behind the camera, through it: never an exception, never another size."""
    catalogue = load_catalogue()
    perception = make_perception(0, catalogue)
    track = dataclasses.replace(
        perception.posterior.tracks[0],
        X_WO=transform(rotation_from_vector(np.array(w)), np.array(p)),
        accepted=accepted,
    )
    belief = dataclasses.replace(perception.posterior, tracks=(track,) * 3)
    picture = draw_perception(dataclasses.replace(perception, posterior=belief), catalogue, scale=1)
    assert picture.shape == (240, 320, 3)


def test_a_label_that_the_catalogue_lacks(catalogue: Catalogue) -> None:
    perception = make_perception(0, catalogue)
    track = dataclasses.replace(perception.posterior.tracks[0], label="stapler")
    belief = dataclasses.replace(perception.posterior, tracks=(track,))
    assert draw_perception(dataclasses.replace(perception, posterior=belief), catalogue).shape == (480, 640, 3)


def test_colors_differ(catalogue: Catalogue) -> None:
    colors = [label_color(label, catalogue) for label in catalogue]
    assert len(set(colors)) == len(colors)


def test_depth_picture() -> None:
    depth = np.full((4, 6), 1.0, np.float32)
    depth[0] = 0.0
    depth[1] = 0.8
    picture = draw_depth(depth)
    assert (picture[0] == 0).all() and picture[1].sum() > picture[2].sum() > 0
    assert (draw_depth(np.zeros((4, 6), np.float32)) == 0).all()


def test_the_page_prints_and_fits_a_phone(run_folder: Path) -> None:
    text = write_report(run_folder).read_text()
    assert 'name="viewport" content="width=device-width' in text
    assert "@media (max-width" in text and "@media print" in text
    # Each cell names its column, for rows that are stacked.
    assert len(re.findall(r"<td ", text)) == len(re.findall(r"<td data-name=", text))
