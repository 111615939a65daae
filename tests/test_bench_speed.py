"""What the bench of speed measures, on a catalogue of two objects."""

import json
from pathlib import Path

import pytest
from shapes import part_of_package

from sum_drake.bench.aims import reached
from sum_drake.bench.speed import AIMS, FILES, bench_speed
from sum_drake.cli import main

LABELS = ("soup_can", "mustard")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("speed")
    bench_speed(folder / "out", part_of_package(folder, LABELS), quick=True)
    return folder / "out"


def test_every_table_has_its_rows_and_every_aim_its_figure(out):
    results = json.loads((out / "results.json").read_text())
    assert {row["table"] for row in results["rows"]} == {"particles", "shares", "renders", "objects", "memory"}
    assert AIMS.keys() <= results["figures"].keys()
    # What a model holds is the difference of two readings of what the allocator does: it may come out as nothing.
    held = results["figures"].pop("memory_mib_per_model")
    assert abs(held) < 150
    assert all(value > 0 for value in results["figures"].values()), results["figures"]
    shares = [row["share"] for row in results["rows"] if row["table"] == "shares"]
    assert sum(shares) == pytest.approx(1, abs=0.01)
    assert all(share > 0 for share in shares)


def test_many_in_a_picture_score_as_one_by_one_and_nearly_as_exact_renders(out):
    figures = json.loads((out / "results.json").read_text())["figures"]
    assert figures["atlas_error"] < 0.05
    renders = [row for row in json.loads((out / "results.json").read_text())["rows"] if row["table"] == "renders"]
    alone = next(row for row in renders if row["kind"] == "alone")
    assert alone["error"] == pytest.approx(figures["atlas_error"], abs=0.002)


def test_memory_stays_below_its_bound(out):
    figures = json.loads((out / "results.json").read_text())["figures"]
    assert reached(AIMS, "run_peak_memory_mib", figures["run_peak_memory_mib"])


def test_the_page_says_what_was_measured(out: Path):
    page = (out / "report.html").read_text()
    assert "Where the time of an estimate goes" in page
    assert "nan" not in page


def test_results_are_not_overwritten(out, capsys):
    before = {name: (out / name).read_bytes() for name in FILES}
    assert main(["bench", "speed", "--out", str(out), "--quick"]) == 2
    assert "--force" in capsys.readouterr().err
    assert before == {name: (out / name).read_bytes() for name in FILES}
