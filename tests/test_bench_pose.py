"""What the bench of poses measures, on two scenes of three objects."""

import json

import pytest
from shapes import part_of_package

from sum_drake.assets import InputError
from sum_drake.bench.pose import FILES, bench_pose
from sum_drake.bench.pose_methods import ABLATIONS, METHODS, filter_configs
from sum_drake.cli import main
from sum_drake.filter_config import filter_config

LABELS = ("soup_can", "mustard", "sugar")
RUN = {"scenes": 2, "methods": ("default", "fast"), "quick": True, "workers": 1}


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory):
    return part_of_package(tmp_path_factory.mktemp("pose"), LABELS)


@pytest.fixture(scope="module")
def out(catalogue, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "out"
    bench_pose(folder, catalogue, **RUN)
    return folder


def timeless(rows):
    return [{key: value for key, value in row.items() if key != "cpu_s"} for row in rows]


def test_it_writes_estimates_figures_and_a_page_with_the_worst(out):
    results = json.loads((out / "results.json").read_text())
    without = set() if results["figures"]["trials.false_positives"] else {"corrected.jpg"}
    assert {path.name for path in out.iterdir()} == set(FILES) - without
    rows = [row for row in results["rows"] if not row["detected"]]
    assert {row["method"] for row in rows} == {"default", "fast"}
    assert {row["label"] for row in rows} <= set(LABELS)
    assert {row["scene"] for row in rows} == {1000, 1001}
    figures = results["figures"]
    own = [row for row in rows if row["method"] == "default" and not row["wrong_box"]]
    right = [row["translation_m"] < 0.02 and row["rotation_deg"] < 20 for row in own]
    assert figures["default.within_2cm_20deg"] == pytest.approx(sum(right) / len(right))
    assert figures["default.within_2cm_20deg"] > 0.5
    assert 0 < figures["fast.cpu_s_per_object"] < figures["default.cpu_s_per_object"]
    page = (out / "report.html").read_text()
    assert page.count("<figure>") >= len(own) and "In boxes that are off" in page


def test_the_papers_experiment_is_in_the_trained_detectors_boxes(out):
    results = json.loads((out / "results.json").read_text())
    rows = [row for row in results["rows"] if row["detected"]]
    assert {row["method"] for row in rows} == {"default"}, "of the paper's methods, the one that was asked for"
    assert {row["scene"] for row in rows} == {61_000, 61_001} and {row["label"] for row in rows} <= set(LABELS)
    figures = results["figures"]
    assert figures["trials.true_positives"] == len(rows) > 2
    assert figures["trials.default.within_2cm_20deg"] > 0.5
    assert figures["trials.default.area_1cm"] <= figures["trials.default.area_20cm"] <= 1
    assert "trials.lead_1cm" not in figures, "there is nothing to lead"
    assert "the paper&#x27;s experiment" in (out / "report.html").read_text().lower().replace("'", "&#x27;")


def test_cut_off_it_goes_on_where_it_was(out, catalogue, tmp_path):
    """With the same estimates, since each has a seed of its own."""
    lines = (out / "rows.jsonl").read_text().splitlines()
    (tmp_path / "rows.jsonl").write_text("\n".join(lines[:3]) + "\n" + lines[3][:100])
    told = []
    bench_pose(tmp_path, catalogue, **RUN, progress=lambda what, done, total: told.append((done, total)))
    assert told == [(2, 6), (3, 6), (4, 6), (5, 6), (6, 6), (1, 2), (2, 2)], "and looks at the paper's scenes again"
    before, after = (json.loads((folder / "results.json").read_text())["rows"] for folder in (out, tmp_path))
    assert timeless(before) == timeless(after)


def test_rows_of_other_settings_and_unknown_methods_are_refused(out, catalogue, tmp_path):
    (tmp_path / "rows.jsonl").write_text((out / "rows.jsonl").read_text())
    with pytest.raises(InputError, match="is of seed 0 and not 1; expected"):
        bench_pose(tmp_path, catalogue, **RUN | {"seed": 1})
    changed = (out / "rows.jsonl").read_text().replace('"code": "', '"code": "0', 1)
    (tmp_path / "rows.jsonl").write_text(changed)
    with pytest.raises(InputError, match="is of another version of the program; expected"):
        bench_pose(tmp_path, catalogue, **RUN)
    (tmp_path / "rows.jsonl").write_text((out / "rows.jsonl").read_text().replace("adds_m", "adds_km", 1))
    with pytest.raises(InputError, match=r"line 2: .*expected a row of this bench"):
        bench_pose(tmp_path, catalogue, **RUN)
    with pytest.raises(InputError, match="'luck' is unknown; expected some of paper, default"):
        bench_pose(tmp_path / "new", catalogue, **RUN | {"methods": ("luck",)})
    assert not (tmp_path / "new").exists()


def test_rows_outlast_a_call_that_is_refused(out, catalogue, tmp_path):
    (tmp_path / "rows.jsonl").write_text((out / "rows.jsonl").read_text())
    with pytest.raises(InputError, match="luck"):
        bench_pose(tmp_path, catalogue, **RUN | {"methods": ("luck",)}, anew=True)
    assert (tmp_path / "rows.jsonl").read_text() == (out / "rows.jsonl").read_text()


def test_ablations_leave_something_out_each():
    default = filter_config()
    configs = [filter_configs()[name] for name in ABLATIONS]
    assert all(config != default for config in configs)
    assert all(a != b for i, a in enumerate(configs) for b in configs[:i])
    assert not set(ABLATIONS) & set(METHODS)


def test_the_command_refuses_a_folder_in_use_and_counts(capsys, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    for arguments, said in (
        (("--out", str(tmp_path)), "not empty"),
        (("--out", str(tmp_path / "new"), "--scenes", "0"), "--scenes 0"),
    ):
        assert main(["bench", "pose", *arguments]) == 2
        assert said in capsys.readouterr().err
