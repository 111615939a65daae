"""All benches in turn."""

import json
import os
import shutil
import signal

import pytest
from refusals import refused

from sum_drake.bench.results import write_results
from sum_drake.cli import _parser, main
from sum_drake.commands.bench_runs import BENCHES, FIRST_SEEDS, ON_DEVICE, _bench_all


def made_of(name):
    """Of a bench's results, the settings that `bench all` looks at."""
    seed = {"first_seed": FIRST_SEEDS[name]} if name in FIRST_SEEDS else {"seed": 0}
    return seed | ({"device": "cpu"} if name in ON_DEVICE else {})


@pytest.mark.parametrize("every", [False, True])
def test_what_is_done_is_not_done_again_and_what_fails_is_told_and_ends_nothing(every, tmp_path, capsys):
    failing = BENCHES if every else ("sort", "faults")
    for name in BENCHES:
        (tmp_path / name).mkdir()
        write_results(tmp_path / name, name, quick=True, settings=made_of(name), seeds={}, figures={}, rows=[])
    for name in failing:
        (tmp_path / name / "results.json").unlink()
        (tmp_path / name / "notes.txt").write_text("somebody's own")
    before = sorted(tmp_path.rglob("*"))
    assert main(["bench", "all", "--quick", "--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said.splitlines()[-1] == f"sum-drake: failed: {', '.join(failing)}: see above"
    assert said.count("holds 'notes.txt'") + said.count("exists and is not empty") == len(failing)
    for name in BENCHES:
        assert (f"bench {name} " in said) == (name in failing)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_ends_one_ends_all(number, tmp_path, capsys, monkeypatch):
    begun = []

    def bench(*arguments, **options):
        begun.append(arguments)
        os.kill(os.getpid(), number)
        raise AssertionError("the signal comes first")

    monkeypatch.setattr("sum_drake.bench.detect.bench_detect", bench)
    monkeypatch.setattr("sum_drake.bench.pose.bench_pose", bench)
    assert main(["bench", "all", "--quick", "--out", str(tmp_path)]) == 128 + number
    assert len(begun) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"sum-drake: {'ended' if number == signal.SIGTERM else 'interrupted'}; the same command goes on"


def test_results_of_another_seed_or_device_are_not_taken_for_done(tmp_path, capsys):
    for name in ("sort", "detect"):
        (tmp_path / name).mkdir()
        write_results(tmp_path / name, name, quick=True, settings=made_of(name), seeds={}, figures={}, rows=[])
    out = ("bench", "all", "--quick", "--out", str(tmp_path))
    assert "is of seed 0 and not 3; expected a new --out" in refused(capsys, *out, "--seed", "3")
    shutil.rmtree(tmp_path / "detect")
    assert "is of first seed 500 and not 3; expected a new --out" in refused(capsys, *out, "--seed", "3")
    assert "--device warp: unknown" in refused(capsys, *out, "--device", "warp")
    assert "--seed -1" in refused(capsys, *out, "--seed", "-1")


def test_seed_and_device_go_to_those_that_take_them(tmp_path):
    asked = {}
    options = _parser().parse_args(["bench", "all", "--quick", "--seed", "3", "--out", str(tmp_path)])
    options.main = lambda arguments: asked.update({arguments[1]: arguments}) or 0
    _bench_all(options)
    assert list(asked) == list(BENCHES)
    for name, arguments in asked.items():
        assert _parser().parse_args(arguments).seed == 3
        assert ("--device" in arguments) == hasattr(_parser().parse_args(arguments), "device"), name


def test_a_folder_of_something_else_is_refused(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("precious")
    line = refused(capsys, "bench", "all", "--quick", "--out", str(tmp_path))
    assert "holds 'thesis.tex', which is no part of a bench all" in line
    assert "cannot be made" in refused(capsys, "bench", "all", "--quick", "--out", str(tmp_path / "thesis.tex" / "out"))


def test_results_of_something_else_are_not_taken_for_done(tmp_path, capsys):
    out = ("bench", "all", "--out", str(tmp_path))
    (tmp_path / "pose").mkdir()
    write_results(tmp_path / "pose", "pose", quick=True, settings=made_of("pose"), seeds={}, figures={}, rows=[])
    file = tmp_path / "pose" / "results.json"
    assert "of the short form; expected a new --out" in refused(capsys, *out)
    file.write_text(json.dumps({**json.loads(file.read_text()), "settings": made_of("pose") | {"code": "0" * 16}}))
    assert "of another version of the program; expected a new --out" in refused(capsys, *out, "--quick")
    file.write_text(json.dumps({**json.loads(file.read_text()), "settings": made_of("pose")}))
    assert "of another version of the program; expected a new --out" in refused(capsys, *out, "--quick"), "an older one"
    file.write_text(json.dumps({**json.loads(file.read_text()), "bench": "plan"}))
    assert "of bench plan" in refused(capsys, *out, "--quick")
    file.write_text("done")
    assert "expected results of bench pose" in refused(capsys, *out, "--quick")
    assert sorted(tmp_path.iterdir()) == [tmp_path / "pose"], "nothing was begun"
    assert "a file; expected a folder" in refused(capsys, "bench", "all", "--out", str(file))


@pytest.mark.parametrize("name", ["sort", "faults", "ablations"])
def test_what_is_done_is_not_replaced_unasked_and_what_a_killed_process_left_is_no_obstacle(name, tmp_path, capsys):
    write_results(tmp_path, name, quick=True, settings={}, seeds={}, figures={}, rows=[])
    (tmp_path / ".report.html.part").write_text("half")
    before = (tmp_path / "results.json").read_bytes()
    assert "is done; expected a new folder, or --force" in refused(capsys, "bench", name, "--out", str(tmp_path))
    assert (tmp_path / "results.json").read_bytes() == before
    (tmp_path / "notes.txt").write_text("somebody's own")
    assert "holds 'notes.txt'" in refused(capsys, "bench", name, "--out", str(tmp_path), "--force")


def test_bad_arguments_are_refused_before_anything_is_run(tmp_path, capsys):
    with pytest.raises(SystemExit) as raised:
        main(["bench", "all", "--quick"])
    assert raised.value.code == 2 and "--out" in capsys.readouterr().err
    assert main(["bench", "all", "--out", str(tmp_path / "all"), "--workers", "0"]) == 2
    assert "--workers" in capsys.readouterr().err and not (tmp_path / "all").exists()
