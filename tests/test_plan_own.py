"""`sum-drake bench plan --problems`: files of one's own."""

import argparse
import json

import numpy as np
import pytest
from small_robots import ARM, write_srdf, write_urdf

from sum_drake.assets import InputError
from sum_drake.bench.plan_own import refuse_others
from sum_drake.cli import main
from sum_drake.commands.common import kept_if_interrupted

PROBLEMS = [
    {"request": "rise", "joints": ["turn", "bend"], "start": [0, 1.0], "goal": [2.0, -1.0], "obstacles": []},
    {"request": "sunk", "joints": ["turn", "bend"], "start": [0, 0], "goal": [0, 0.1], "obstacles": [
        {"id": "ball", "type": "sphere", "dimensions": [0.1], "position": [0, 0, 0.7], "quat_xyzw": [0, 0, 0, 1]}]},
]  # fmt: skip


@pytest.fixture
def files(tmp_path):
    (tmp_path / "problems.json").write_text(json.dumps(PROBLEMS))
    return tmp_path / "problems.json", write_urdf(tmp_path)


def run(files, out, *more):
    problems, urdf = files
    return main(["bench", "plan", "--problems", str(problems), "--urdf", str(urdf), "--out", str(out),
                 "--workers", "1", *more])  # fmt: skip


def test_what_came_of_them_is_in_plan_json(files, tmp_path, capsys):
    out = tmp_path / "out"
    srdf = write_srdf(tmp_path, '<disable_collisions link1="base" link2="forearm" reason="Never"/>')
    assert run(files, out, "--srdf", str(srdf), "--time-limit", "5") == 0
    data = json.loads((out / "plan.json").read_text())
    assert data["schema"] == "sum-drake/plan/1"
    rise, sunk = data["problems"]
    assert set(rise) == {"request", "start_valid", "goal_valid", "solved", "time_s", "path", "message"}
    assert rise["request"] == "rise" and rise["solved"] and rise["message"] == ""
    np.testing.assert_allclose([rise["path"][0], rise["path"][-1]], [[0, 1.0], [2.0, -1.0]])
    assert not sunk["start_valid"] and not sunk["solved"] and sunk["path"] == []
    assert "ball" in sunk["message"]
    told = capsys.readouterr().out
    assert "rise: path of" in told and "1 of 2 solved" in told
    assert run(files, out) == 2, "a finished folder is not overwritten"
    assert "--force" in capsys.readouterr().err


def test_it_goes_on_where_it_was_cut_off(files, tmp_path):
    out = tmp_path / "out"
    assert run(files, out, "--quiet") == 0
    before = json.loads((out / "plan.json").read_text())["problems"]
    lines = (out / "rows.jsonl").read_text().splitlines()
    (out / "rows.jsonl").write_text("\n".join(lines[:2]) + "\n")
    (out / "plan.json").unlink()
    assert run(files, out, "--quiet") == 0
    after = json.loads((out / "plan.json").read_text())["problems"]
    assert [one["path"] for one in after] == [one["path"] for one in before]


def test_rows_of_other_meshes_are_not_gone_on_with(files, tmp_path, capsys):
    write_urdf(tmp_path, ARM.replace('<box size="0.04 0.04 0.3"/>', '<mesh filename="forearm.obj"/>'))
    mesh = "v 0 0 0\nv 0.02 0 0\nv 0 0.02 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    (tmp_path / "forearm.obj").write_text(mesh)
    out = tmp_path / "out"
    assert run(files, out, "--quiet") == 0
    (out / "plan.json").unlink()
    (tmp_path / "forearm.obj").write_text(mesh.replace("0.02", "0.03"))
    assert run(files, out, "--quiet") == 2
    assert "rows.jsonl: is of other meshes; expected a new --out, or --force" in capsys.readouterr().err


OWN = {"seed": 0, "problems": "a1", "urdf": "b2", "srdf": None}


@pytest.mark.parametrize(
    ("begun", "settings", "said"),
    [
        ({"seed": 0, "catalogue": "catalogue.yaml"}, OWN, "is of the package's own experiments;"),
        (OWN, {"seed": 0, "catalogue": "catalogue.yaml"}, "is of problems of your own;"),
        (OWN, OWN | {"problems": "c3"}, "is of other problems;"),
        (OWN, OWN | {"urdf": "c3", "srdf": "d4"}, "is of another robot, another --srdf;"),
    ],
)
def test_a_folder_of_something_else_is_said_in_words(tmp_path, begun, settings, said):
    (tmp_path / "rows.jsonl").write_text(json.dumps(begun) + "\n")
    with pytest.raises(InputError, match=f"rows.jsonl: {said} expected a new --out, or --force"):
        refuse_others(tmp_path, settings)
    refuse_others(tmp_path, begun)
    refuse_others(tmp_path / "none", settings)


@pytest.mark.parametrize(
    ("force", "said"), [(False, "the same command goes on"), (True, "the same command without --force goes on")]
)
def test_an_interrupt_says_what_is_kept(tmp_path, force, said):
    options = argparse.Namespace(out=tmp_path, force=force, quiet=False)

    def interrupted():
        with pytest.raises(KeyboardInterrupt) as interrupt, kept_if_interrupted(options):
            raise KeyboardInterrupt
        return str(interrupt.value)

    assert interrupted() == "nothing was written"
    (tmp_path / "rows.jsonl").write_text("{}\n")
    assert interrupted() == f"{tmp_path / 'rows.jsonl'} keeps what was done: {said}"


@pytest.mark.parametrize("bench", ["plan", "pose", "reject"])
def test_help_says_until_when_a_bench_goes_on(capsys, bench):
    with pytest.raises(SystemExit):
        main(["bench", bench, "--help"])
    assert "called again, it goes on until it is done" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p, u: p.write_text("{}"), "expected [{request"),
        (lambda p, u: p.write_text(json.dumps([PROBLEMS[0] | {"start": [0]}])), "start"),
        (lambda p, u: p.unlink(), "problems.json"),
        (lambda p, u: u.write_text("<robot"), "arm.urdf"),
        (lambda p, u: write_urdf(u.parent, ARM.replace('<box size="0.04 0.04 0.3"/>', '<mesh filename="gone.stl"/>')),
         "gone.stl"),
    ],
)  # fmt: skip
def test_bad_files_are_one_line_and_leave_nothing(files, tmp_path, capsys, change, said):
    change(*files)
    assert run(files, tmp_path / "out") == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert said in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--urdf", "arm.urdf"], "expected --problems"),
        (["--time-limit", "3"], "expected --problems"),
        (["--problems", "p.json"], "expected --urdf"),
        (["--problems", "p.json", "--urdf", "arm.urdf", "--time-limit", "0"], "more than 0"),
        (["--problems", "p.json", "--urdf", "arm.urdf", "--quick"], "--quick"),
    ],
)
def test_options_that_do_not_go_together_are_said(tmp_path, capsys, arguments, said):
    assert main(["bench", "plan", "--out", str(tmp_path / "out"), *arguments]) == 2
    assert said in capsys.readouterr().err
