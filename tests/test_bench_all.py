"""All benches in turn."""

import pytest

from sum_drake.cli import main
from sum_drake.commands.bench_runs import BENCHES


def test_what_is_done_is_not_done_again_and_what_fails_is_told_and_ends_nothing(tmp_path, capsys):
    failing = ("sort", "faults")
    for name in BENCHES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "results.json").write_text("done")
    for name in failing:
        (tmp_path / name / "results.json").unlink()
        (tmp_path / name / "notes.txt").write_text("somebody's own")
    before = sorted(tmp_path.rglob("*"))
    assert main(["bench", "all", "--quick", "--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said.splitlines()[-1] == "sum-drake: failed: sort, faults: see above"
    assert said.count("notes.txt") == len(failing)
    for name in BENCHES:
        assert (f"bench {name} " in said) == (name in failing)
    assert sorted(tmp_path.rglob("*")) == before


def test_bad_arguments_are_refused_before_anything_is_run(tmp_path, capsys):
    with pytest.raises(SystemExit) as raised:
        main(["bench", "all", "--quick"])
    assert raised.value.code == 2 and "--out" in capsys.readouterr().err
    assert main(["bench", "all", "--out", str(tmp_path / "all"), "--workers", "0"]) == 2
    assert "--workers" in capsys.readouterr().err and not (tmp_path / "all").exists()
