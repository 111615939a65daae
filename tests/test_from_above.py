"""The table seen from above: things, regions and places lie where the world has them."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from run_folders import X_WO_PLACE, executed, write_run

from sum_drake.from_above import SCALE, above_legend, from_above
from sum_drake.jsonio import write_json
from sum_drake.objects import load_catalogue
from sum_drake.run_folder import read_run_folder

SVG = "{http://www.w3.org/2000/svg}"
CATALOGUE = load_catalogue()


def drawn(folder: Path) -> ET.Element:
    return ET.fromstring(from_above(read_run_folder(folder), CATALOGUE))


def texts(root: ET.Element) -> dict[str, np.ndarray]:
    """Where each text stands."""
    return {t.text or "": np.array([float(t.get("x", 0)), float(t.get("y", 0))]) for t in root.iter(SVG + "text")}


def titles(root: ET.Element) -> list[str]:
    return [title.text or "" for title in root.iter(SVG + "title")]


def test_places_lie_where_the_world_has_them(tmp_path: Path) -> None:
    """x upwards, y to the left, `SCALE` pixels a metre."""
    root = drawn(write_run(tmp_path / "run", CATALOGUE))
    said = texts(root)
    assert {"table", "left", "robot", "mug 0.07", "1"} <= set(said)
    off = said["1"] - said["robot"]
    np.testing.assert_allclose(off, SCALE * np.array([-X_WO_PLACE[1, 3], -X_WO_PLACE[0, 3]]), atol=1.0)
    assert (said["mug 0.07"] - said["robot"])[0] > 0, "y is negative: to the right"
    assert any(re.match(r"1: soup_can let go over left, sorted", words) for words in titles(root))
    assert any("truly here, left" in words for words in titles(root))


def test_what_was_never_let_go_leaves_no_mark(tmp_path: Path) -> None:
    assert "1" not in texts(drawn(write_run(tmp_path / "run", CATALOGUE, executed(released=False))))


def test_marks_that_would_cover_each_other_stand_beside(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    from sum_drake.runlog import RunLogWriter
    from sum_drake.runlog_reader import read_run_log

    record = read_run_log(folder / "run.mcap")
    with RunLogWriter(folder / "run.mcap") as writer:
        writer.write_perception(record.perceptions[0])
        writer.write_attempt(1.0, executed())
        writer.write_attempt(2.0, executed())
    (folder / "summary.json").unlink()
    said = texts(drawn(folder))
    assert np.linalg.norm(said["1"] - said["2"]) > 18


def test_without_a_scenario_or_a_summary_there_is_less_and_without_looks_nothing(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    (folder / "scenario.yaml").unlink()
    said = texts(drawn(folder))
    assert "table" not in said and "1" in said
    (folder / "summary.json").unlink()
    assert not any("truly" in words for words in titles(drawn(folder)))
    (folder / "scenario.yaml").write_text("resolved: {regions: {table: 3, left: {p_W: [1], half_extents: x}}}")
    assert "table" not in texts(drawn(folder))


def test_a_run_without_its_log_has_no_map(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    (folder / "run.mcap").unlink()
    assert from_above(read_run_folder(folder), CATALOGUE) == ""
    # What lies far off is not drawn, and does not stretch the map.
    folder = write_run(tmp_path / "other", CATALOGUE)
    data = json.loads((folder / "summary.json").read_text())
    data["objects"][0]["p_W"] = [90.0, 0.0, 0.0]
    write_json(folder / "summary.json", data)
    assert not any("truly" in words for words in titles(drawn(folder)))


def test_the_legend_speaks_of_marks_that_are_there(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", CATALOGUE)
    run = read_run_folder(folder)
    assert all(word in above_legend(run) for word in ("Filled", "Dotted", "Crosses"))
    assert "Crosses" not in above_legend(dataclasses.replace(run, summary=None))
    assert "Dotted" not in above_legend(dataclasses.replace(run, summary=None, record=None))
