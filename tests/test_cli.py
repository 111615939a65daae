import json
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from refusals import refused
from run_folders import write_run

from sum_drake.assets import MODELS
from sum_drake.cli import main
from sum_drake.commands.common import Counting
from sum_drake.commands.sort import RUN_FILES
from sum_drake.objects import load_catalogue
from sum_drake.runlog_reader import read_run_log
from sum_drake.summary_schema import validate_summary

ONE_EASY_OBJECT = "{objects: {labels: [soup_can]}}"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scenario-text", "{fliter: paper}"], ["fliter", "expected one of"]),
        (["--scenario-text", "{objects: {labels: [unicorn]}}"], ["unicorn", "tide"]),
        (["--objects", "16"], ["--objects: 16 objects", "1 to 15", "catalogue.yaml has"]),
        (["--objects", "0"], ["0 objects", "1 to 15"]),
        (["--seed", "-3"], ["random_seed -3"]),
        (["--scenario-file", "nowhere.yaml"], ["nowhere.yaml"]),
        (["--scenario-name", "nothing"], ["nothing", "sorting"]),
        (["--catalogue", "nowhere.yaml"], ["nowhere.yaml"]),
        (["--catalogue", str(MODELS)], ["is a folder", "expected a YAML file"]),
        (["--scenario-text", "{objects: {count: two}}"], ["objects: count is 'two'", "whole number"]),
        (["--scenario-text", "{catalogue: nowhere.yaml}"], ["--scenario-text", "nowhere.yaml is missing"]),
        (["--graphviz", "no/such/folder/diagram.dot"], ["diagram.dot"]),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2_and_leaves_nothing(capsys, tmp_path, arguments, words):
    out = tmp_path / "run"
    line = refused(capsys, "sort", "--out", str(out), *arguments)
    for word in words:
        assert word in line
    assert list(tmp_path.iterdir()) == []


def test_a_missing_and_a_broken_mesh_are_named(capsys, tmp_path):
    catalogue = tmp_path / "objects.yaml"
    catalogue.write_text("objects: {box: {mesh: box.obj, category: cleaning}}")
    assert "box.obj" in refused(capsys, "sort", "--catalogue", str(catalogue), "--out", str(tmp_path / "run"))
    (tmp_path / "box.obj").write_text("this is no mesh")
    assert "box.obj" in refused(capsys, "sort", "--catalogue", str(catalogue), "--out", str(tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_run_is_not_overwritten_unless_that_is_said_and_nothing_else_ever(capsys, tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    assert "--force" in refused(capsys, "sort", "--out", str(tmp_path))
    (tmp_path / "thesis.tex").write_text("years of work")
    assert "thesis.tex" in refused(capsys, "sort", "--out", str(tmp_path), "--force")
    assert (tmp_path / "summary.json").read_text() == "{}"
    file = tmp_path / "thesis.tex"
    assert "a file" in refused(capsys, "sort", "--out", str(file), "--force")


def test_report_of_nothing_is_refused(capsys, tmp_path):
    assert "no such folder" in refused(capsys, "report", str(tmp_path / "none"))
    (tmp_path / "report.html").write_text("")
    assert "--force" in refused(capsys, "report", str(tmp_path))
    assert "a file; expected the folder of a run" in refused(capsys, "report", str(tmp_path / "report.html"))


def test_a_report_goes_where_it_is_told_and_two_runs_side_by_side(capsys, tmp_path, monkeypatch):
    catalogue = load_catalogue()
    one, two = write_run(tmp_path / "one", catalogue), write_run(tmp_path / "two", catalogue)
    monkeypatch.chdir(tmp_path)
    assert main(["report", "one", "two"]) == 0
    assert capsys.readouterr().out == "report_one_two.html\n"
    assert "--force" in refused(capsys, "report", "one", "two")
    assert "one: one too many" in refused(capsys, "report", "one", "two", "one")
    assert "no such folder" in refused(capsys, "report", "one", "three")
    assert "cannot be written" in refused(capsys, "report", "one", "--out", str(tmp_path / "none" / "x.html"))
    assert main(["report", "one", "--no-video", "--out", "x.html"]) == 0
    assert "<video" not in (tmp_path / "x.html").read_text() and not (one / "report.html").exists()
    assert main(["report", "two"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == str(Path("two") / "report.html") and "rendering the film: 20 of 20" in err
    assert "<video" in (two / "report.html").read_text()


@pytest.mark.parametrize("more", [[], ["--force"], ["--force", "--out", "page.html"]])
def test_what_an_interrupted_report_suggests_does_what_was_asked_for(capsys, tmp_path, monkeypatch, more):
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "run", load_catalogue())
    (tmp_path / "run" / "report.html").unlink(missing_ok=True)
    if more:
        (tmp_path / more[-1] if "--out" in more else tmp_path / "run" / "report.html").write_text("what was there")

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("sum_drake.report.write_report", interrupted)
        assert main(["report", "run", *more]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    command = shlex.split(line.split("it is quick: ")[1])
    assert command[0] == "sum-drake" and "--no-video" in command
    assert main(command[1:]) == 0
    assert "<html" in Path(capsys.readouterr().out.strip()).read_text()


def test_unknown_commands_exit_with_2(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["juggle"])
    assert stop.value.code == 2


def test_every_command_has_help_with_an_example(capsys):
    for command in (
        ["sort"],
        ["objects", "list"],
        ["objects", "check"],
        ["objects", "render"],
        ["detect"],
        ["bench", "detect"],
        ["report"],
        ["replay"],
        ["doctor"],
    ):
        with pytest.raises(SystemExit) as stop:
            main([*command, "--help"])
        assert stop.value.code == 0
        assert f"example: sum-drake {' '.join(command)}" in capsys.readouterr().out


def test_help_of_sort_says_what_its_exit_codes_cover(capsys):
    with pytest.raises(SystemExit):
        main(["sort", "--help"])
    words = " ".join(capsys.readouterr().out.split())
    assert "The exit code is 0 when the run came to its own end, with objects left on the table, too" in words
    assert "summary.json" in words


def test_an_interrupt_waits_for_the_end_of_an_import(tmp_path):
    """Drake takes an import that is interrupted for a broken installation, and says so at length."""
    (tmp_path / "slow.py").write_text(
        "import os, signal, time\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "for _ in range(20):\n    time.sleep(0.01)\n"
        "print('imported', flush=True)\n"
    )
    code = (
        "import sys, time, sum_drake.cli as cli, sum_drake.commands.doctor as doctor\n"
        "def check(options):\n    import slow\n    time.sleep(30)\n"
        "doctor._doctor = check\n"
        "sys.exit(cli.main(['doctor']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=20
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "imported\n", "sum-drake: interrupted\n")


def test_an_interrupted_run_says_where_to_look(tmp_path):
    """Before anything was written, and after."""
    out = tmp_path / "my run"
    sort = [sys.executable, "-m", "sum_drake.cli", "sort", "--scenario-text", ONE_EASY_OBJECT, "--out", str(out)]
    with subprocess.Popen(sort, stderr=subprocess.PIPE, text=True) as process:
        assert "pouring" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == "sum-drake: interrupted; nothing was written\n"
    assert process.returncode == 130 and not out.exists()
    with subprocess.Popen(sort, stderr=subprocess.PIPE, text=True) as process:
        assert "pouring" in process.stderr.readline()
        assert "observation 0" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        told = process.stderr.read()
    assert process.returncode == 130
    assert told == f"sum-drake: interrupted; {out} holds what was done until then: sum-drake report '{out}'\n"
    assert main(["report", str(out)]) == 0
    assert len(read_run_log(out / "run.mcap").perceptions) == 1


def test_help_does_not_load_drake_or_torch():
    code = (
        "import sys, sum_drake.cli\n"
        "try: sum_drake.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('pydrake', 'torch', 'trimesh', 'ompl') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_objects_list_and_check_name_all_fifteen(capsys):
    for what in ("list", "check"):
        assert main(["objects", what]) == 0
        out = capsys.readouterr().out
        assert all(path.name in out for path in (MODELS / "objects").iterdir() if (path / f"{path.name}.obj").exists())


def test_objects_check_says_all_and_then_refuses(capsys, tmp_path):
    """What can be used is still told; the last line, on stderr, says how many cannot."""
    catalogue = tmp_path / "objects.yaml"
    (tmp_path / "noise.obj").write_bytes(bytes(range(256)) * 8)
    mug = MODELS / "objects" / "mug" / "mug.obj"
    catalogue.write_text(f"objects: {{a: {{mesh: noise.obj, category: x}}, b: {{mesh: {mug}, category: x}}}}")
    assert main(["objects", "check", "--catalogue", str(catalogue)]) == 2
    out, err = capsys.readouterr()
    assert out.splitlines()[0].startswith("a: cannot be used: mesh ") and out.splitlines()[1].startswith("b: 23")
    assert err == f"sum-drake: {catalogue}: 1 of 2 objects cannot be used; expected none\n"


def test_objects_render_replaces_nothing_unless_that_is_said(capsys, tmp_path):
    catalogue, sheet = tmp_path / "objects.yaml", tmp_path / "sheet.png"
    mug = MODELS / "objects" / "mug" / "mug.obj"
    catalogue.write_text(f"objects: {{b: {{mesh: {mug}, category: x}}}}")
    sheet.write_text("a photograph")
    arguments = ["objects", "render", "--catalogue", str(catalogue), "--out", str(sheet)]
    assert "--force" in refused(capsys, *arguments)
    assert sheet.read_text() == "a photograph"
    assert main([*arguments, "--force"]) == 0
    assert sheet.read_bytes().startswith(b"\x89PNG")


def sort(*arguments):
    """A run in a process of its own; what it says on stderr."""
    done = subprocess.run(
        [sys.executable, "-m", "sum_drake.cli", "sort", *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_a_run_and_its_resolved_scenario_in_another_process_are_the_same(tmp_path):
    """The main job from end to end: pours, perceives, picks, places, sees that the table is clear, and says so.

    With a catalogue of one's own, which the resolved scenario names.
    """
    out_1, out_2, dot = tmp_path / "one", tmp_path / "two", tmp_path / "diagram.dot"
    own = tmp_path / "own.yaml"
    objects = {"soup_can": "non-cleaning, symmetry: cylinder", "tide": "cleaning"}
    own.write_text(
        "objects:\n"
        + "".join(
            f"  {label}: {{mesh: {MODELS}/objects/{label}/{label}.obj, sdf: {MODELS}/objects/{label}/{label}.sdf,"
            f" category: {category}}}\n"
            for label, category in objects.items()
        )
    )
    first = ("--catalogue", str(own), "--scenario-text", ONE_EASY_OBJECT, "--graphviz", str(dot))
    told = sort("--seed", "4", *first, "--out", str(out_1))
    assert "observation 0" in told
    assert sort("--scenario-file", str(out_1 / "scenario.yaml"), "--out", str(out_2), "--quiet") == "", "--quiet"
    assert (out_1 / "scenario.yaml").read_text() == (out_2 / "scenario.yaml").read_text()
    one, two = (json.loads((out / "summary.json").read_text()) for out in (out_1, out_2))
    validate_summary(one)
    assert one["digest"] == two["digest"]
    assert one["seed"] == two["seed"] == 4
    assert one["outcome"] == "cleared"
    assert one["objects_sorted"] == 1
    assert {path.name for path in out_1.iterdir()} == set(RUN_FILES)
    log = read_run_log(out_1 / "run.mcap")
    assert len(log.perceptions) == len(one["observations"])
    assert "<html" in (out_1 / "report.html").read_text()
    assert "sorting_planner" in dot.read_text()


def test_counting_tells_the_time_left_now_and_then(capsys, monkeypatch):
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    counting = Counting(quiet=False)
    for done in range(101):
        counting("measuring", done, 100)
        now += 4.0
    counting("rendering", 1, 7)
    assert capsys.readouterr().err.splitlines() == [
        "measuring: 0 of 100",
        *(f"measuring: {done} of 100, {left} left" for done, left in (
            (8, "6 min"), (16, "6 min"), (24, "5 min"), (32, "5 min"), (40, "4 min"), (48, "3 min"), (56, "3 min"),
            (64, "2 min"), (72, "112 s"), (80, "80 s"), (88, "48 s"), (96, "16 s"), (100, "0 s"),
        )),
        "rendering: 1 of 7",
    ]  # fmt: skip
    Counting(quiet=True)("measuring", 1, 1)
    assert capsys.readouterr().err == ""


def test_the_package_runs_as_a_module_too():
    done = subprocess.run([sys.executable, "-m", "sum_drake", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("sum-drake ")
