"""What is committed of a bench's results is what it wrote, but for columns and digits."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def keeping():
    spec = importlib.util.spec_from_file_location("keep_results", HERE / "keep_results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_figures_are_kept_to_the_last_digit_and_rows_to_five(keeping):
    row = {
        "table": "estimate",
        "adds_m": 0.123456789,
        "X_WO": [[1.0]],
        "timing": {"cpu_s": 1234.5678},
        "seed": 123456789,
    }
    data = {"bench": "pose", "figures": {"a": 0.123456789, "b": None}, "rows": [row, {"table": "other"}], "commit": "c"}
    text = keeping.kept(data)
    told = json.loads(text)
    assert told["figures"] == data["figures"] and told["commit"] == "c"
    first = {"table": "estimate", "adds_m": 0.12346, "timing": {"cpu_s": 1234.6}, "seed": 123456789}
    assert told["rows"] == [first, {"table": "other"}]
    assert keeping.kept(told) == text, "kept once more, it is the same"
    assert (
        len(text.splitlines())
        == len(json.dumps({k: v for k, v in data.items() if k != "rows"}, indent=1).splitlines()) + 4
    )


def test_what_is_not_the_result_of_its_name_wants_another(keeping, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(keeping, "RESULTS", tmp_path)
    whole = {"schema": keeping.SCHEMA, "rows": []}
    for name, data, said in (
        ("short", {"bench": "sort", "quick": True, "settings": {}}, "of the short form"),
        ("eight", {"bench": "sort", "settings": {"batches": []}}, "of the sequences alone; expected a name"),
        ("faulty", {"bench": "ablations", "settings": {"faults": True}}, "with faults; expected a name"),
        ("few", {"bench": "ablations", "settings": {"variants": {"default": ""}}}, "of default; expected a name"),
        ("some", {"bench": "pose", "settings": {"methods": ["default", "no_flips"]}}, "of default, no_flips; expected"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "results.json").write_text(json.dumps(whole | data))
        monkeypatch.setattr(sys, "argv", ["keep_results.py", str(tmp_path / name)])
        with pytest.raises(SystemExit):
            keeping.main()
        assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.json"))
    monkeypatch.setattr(sys, "argv", ["keep_results.py", f"{tmp_path / 'faulty'}=fault_ablations"])
    keeping.main()
    assert json.loads((tmp_path / "fault_ablations.json").read_text())["bench"] == "ablations"


def test_what_is_no_bench_wants_a_name(keeping, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(keeping, "RESULTS", tmp_path)
    batch = tmp_path / "batch.json"
    batch.write_text(json.dumps({"schema": "sum-drake/batch/1", "episodes": [{"seed": 1, "cpu_s": 1.23456789}]}))
    monkeypatch.setattr(sys, "argv", ["keep_results.py", str(batch)])
    with pytest.raises(SystemExit):
        keeping.main()
    assert "of no bench" in capsys.readouterr().err and list(tmp_path.iterdir()) == [batch]
    monkeypatch.setattr(sys, "argv", ["keep_results.py", f"{batch}=batch5"])
    keeping.main()
    assert json.loads((tmp_path / "batch5.json").read_text())["episodes"] == [{"seed": 1, "cpu_s": 1.2346}]


def test_a_picture_is_kept_of_the_result_that_bears_the_benchs_name(keeping, tmp_path, monkeypatch):
    monkeypatch.setattr(keeping, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(keeping, "PLOTS", tmp_path / "plots")
    for name in ("results", "plots", "pose"):
        (tmp_path / name).mkdir()
    data = {"schema": keeping.SCHEMA, "bench": "pose", "settings": {"methods": list(keeping.METHODS)}, "rows": []}
    (tmp_path / "pose" / "results.json").write_text(json.dumps(data))
    (tmp_path / "pose" / "corrected.jpg").write_bytes(b"a picture")
    monkeypatch.setattr(sys, "argv", ["keep_results.py", f"{tmp_path / 'pose'}=pose_ablations"])
    keeping.main()
    assert not list((tmp_path / "plots").iterdir())
    monkeypatch.setattr(sys, "argv", ["keep_results.py", str(tmp_path / "pose")])
    keeping.main()
    assert (tmp_path / "plots" / "corrected.jpg").read_bytes() == b"a picture"
