"""`sum-drake bench reject`, on a few tables of three objects."""

import json

import pytest
from shapes import part_of_package

from sum_drake.bench.reject import FILES, Size, bench_reject
from sum_drake.cli import main

LABELS = ("soup_can", "mustard", "sugar", "tide")
SMALL = Size(tables=2, scenes=1, trials=2, sequences=1)


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory):
    return part_of_package(tmp_path_factory.mktemp("reject"), LABELS)


@pytest.fixture(scope="module")
def out(catalogue, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "out"
    bench_reject(folder, catalogue, size=SMALL, workers=1)
    return folder


def test_it_writes_figures_rows_and_a_page(out):
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    results = json.loads((out / "results.json").read_text())
    wanted = {
        "false_rejected", "true_kept", "calibration_error", "brier_skill", "recovered_within_2",
        "tracked_cpu_s_per_object",
    }  # fmt: skip
    assert wanted <= results["figures"].keys()
    assert {row["table"] for row in results["rows"]} == {"hypothesis", "trial", "outcome", "update", "association"}
    assert results["figures"]["recovered_within_2"] > 0.5
    assert 0 < results["figures"]["tracked_cpu_s_per_object"] < results["figures"]["scratch_cpu_s_per_object"]
    page = (out / "report.html").read_text()
    assert page.count("role='img'") == 4 and "found again" in page


def test_called_again_it_goes_on_with_the_same_rows(out, catalogue, tmp_path):
    lines = (out / "rows.jsonl").read_text().splitlines()
    (tmp_path / "rows.jsonl").write_text("\n".join([*lines[:2], *lines[3:]]) + "\n")
    told = []
    bench_reject(
        tmp_path, catalogue, size=SMALL, workers=1, progress=lambda what, done, total: told.append((done, total))
    )  # fmt: skip
    total = len(lines) - 1
    assert told == [(total - 1, total), (total, total)]
    hypotheses = [
        [row for row in json.loads((folder / "results.json").read_text())["rows"] if row["table"] == "hypothesis"]
        for folder in (out, tmp_path)
    ]
    assert hypotheses[0] == hypotheses[1]


def test_the_command_refuses_a_folder_in_use_and_counts(capsys, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    for arguments, said in (
        (("--out", str(tmp_path)), "not empty"),
        (("--out", str(tmp_path / "new"), "--workers", "0"), "--workers 0"),
    ):
        assert main(["bench", "reject", *arguments]) == 2
        assert said in capsys.readouterr().err
