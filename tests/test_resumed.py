"""What a bench has done is kept as it is done, and read again."""

import dataclasses

import pytest
from refusals import refused

from sum_drake.assets import InputError
from sum_drake.bench.resumed import RowLog
from sum_drake.doctor import versions
from sum_drake.files import alone


@dataclasses.dataclass(frozen=True)
class Row:
    name: str
    value: float


def log(folder, **settings):
    return RowLog(folder, {"seed": 0} | settings, list[Row])


def test_results_are_there_again_and_a_line_that_was_cut_off_is_not(tmp_path):
    first = log(tmp_path)
    first.add(("a", 1), [Row("x", 0.1), Row("y", float("nan"))])
    first.add(("b",), [])
    with (tmp_path / "rows.jsonl").open("a") as file:
        file.write('{"task": ["c"], "res')
    again = log(tmp_path)
    assert set(again.done) == {("a", 1), ("b",)}
    assert again.done["a", 1][0] == Row("x", 0.1)
    again.add(("c",), [Row("z", 1.0)])
    assert set(log(tmp_path).done) == {("a", 1), ("b",), ("c",)}


def test_rows_of_other_settings_or_of_another_shape_are_refused_and_stay(tmp_path):
    log(tmp_path).add(("a",), [Row("x", 0.1)])
    before = (tmp_path / "rows.jsonl").read_text()
    with pytest.raises(InputError, match="is of seed 0 and not 1; expected a new --out, or --force"):
        log(tmp_path, seed=1)
    assert (tmp_path / "rows.jsonl").read_text() == before
    for line, broken in (
        (2, before.replace("value", "worth")), (2, before.replace('"x"', "3")), (3, before + "nonsense\n"),
        (3, before + "7\n"), (1, before.replace(before.splitlines()[0], "null")),
    ):  # fmt: skip
        (tmp_path / "rows.jsonl").write_text(broken)
        with pytest.raises(InputError, match=rf"rows.jsonl, line {line}: .*expected a row of this bench"):
            log(tmp_path)


def test_rows_that_other_packages_made_are_refused(tmp_path, monkeypatch):
    log(tmp_path)
    monkeypatch.setattr("sum_drake.bench.resumed.versions", lambda: {**versions(), "drake": "2.0"})
    with pytest.raises(InputError, match=f"is of drake {versions()['drake']} and not 2.0"):
        log(tmp_path)


@pytest.mark.parametrize("name", ["pose", "reject", "plan"])
def test_two_are_not_at_one_folder(name, tmp_path, capsys):
    with alone(tmp_path, "a test"):
        line = refused(capsys, "bench", name, "--quick", "--out", str(tmp_path))
    assert line == f"sum-drake: --out {tmp_path}: another bench is at it; expected its end, or another folder"
    assert not list(tmp_path.iterdir())


def test_what_a_bench_refuses_leaves_no_folder_and_takes_none_away(tmp_path, capsys):
    mine = tmp_path / "mine"
    mine.mkdir()
    for out in (tmp_path / "out", mine):
        line = refused(capsys, "bench", "pose", "--quick", "--methods", "luck", "--out", str(out))
        assert "method 'luck' is unknown" in line
    assert list(tmp_path.iterdir()) == [mine]


def test_a_file_that_is_no_text_is_one_line(tmp_path):
    (tmp_path / "rows.jsonl").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"rows.jsonl: .*expected a row of this bench"):
        log(tmp_path)
