import json
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from detectors import write_untrained
from pictures import write_cards
from run_folders import write_run
from scenes import observe, standing

from sum_drake.assets import MODELS
from sum_drake.cli import main
from sum_drake.commands.common import Counting
from sum_drake.commands.sort import RUN_FILES
from sum_drake.detection.weights import load_weights
from sum_drake.objects import load_catalogue
from sum_drake.runlog_reader import read_run_log
from sum_drake.summary_schema import validate_summary

ONE_EASY_OBJECT = "{objects: {labels: [soup_can]}}"


def refused(capsys, *arguments):
    """The one line on stderr of a call that must be refused as bad input."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("sum-drake: ")
    return lines[0]


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
    assert "a third run" in refused(capsys, "report", "one", "two", "one")
    assert "no such folder" in refused(capsys, "report", "one", "three")
    assert "cannot be written" in refused(capsys, "report", "one", "--out", str(tmp_path / "none" / "x.html"))
    assert main(["report", "one", "--no-video", "--out", "x.html"]) == 0
    assert "<video" not in (tmp_path / "x.html").read_text() and not (one / "report.html").exists()
    assert main(["report", "two"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == str(Path("two") / "report.html") and "rendering the film: 20 of 20" in err
    assert "<video" in (two / "report.html").read_text()


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


@pytest.fixture
def weights(tmp_path):
    return write_untrained(tmp_path / "w.safetensors", load_catalogue().labels, threshold=0.0)


@pytest.fixture
def photo(tmp_path):
    """A picture of another size than the camera's."""
    file = tmp_path / "photo.png"
    cv2.imwrite(str(file), np.random.default_rng(0).integers(0, 255, (200, 300, 3)).astype(np.uint8))
    return file


def test_detections_in_a_picture_are_written_drawn_and_told(capsys, tmp_path, weights, photo):
    out = tmp_path / "found"
    cv2.imwrite(str(tmp_path / "depth.png"), np.full((200, 300), 900, np.uint16))
    depth = str(tmp_path / "depth.png")
    with_edges = ("--proposer", "edge_boxes", "--depth", depth)
    assert main(["detect", str(photo), *with_edges, "--weights", str(weights), "--out", str(out)]) == 0
    told = capsys.readouterr().out.splitlines()
    found = json.loads((out / "detections.json").read_text())
    assert len(found) == len(told) - 2 > 0, "one line each, between a head and the picture's name"
    for row in found:
        x, y, w, h = row["box"]
        assert row["label"] in load_catalogue().labels
        assert 0 <= row["score"] <= row["p_box"] <= 1
        assert x >= 0 and y >= 0 and x + w <= 300 and y + h <= 200
    assert cv2.imread(str(out / "detections.png")).shape == (200, 300, 3)
    assert "--force" in refused(capsys, "detect", str(photo), "--weights", str(weights), "--out", str(out))
    least = ("--threshold", "0.99", "--depth", depth)
    assert main(["detect", str(photo), *least, "--weights", str(weights), "--out", str(out), "--force"]) == 0
    assert "learned proposer does not use it" in capsys.readouterr().err
    assert json.loads((out / "detections.json").read_text()) == []


def test_what_cannot_be_detected_in_or_with_is_refused_and_leaves_nothing(capsys, tmp_path, weights, photo):
    out = ("--out", str(tmp_path / "found"))
    depth = tmp_path / "depth.png"
    cv2.imwrite(str(depth), np.zeros((100, 300), np.uint16))
    assert "300 x 200" in refused(capsys, "detect", str(photo), "--proposer", "edge_boxes", "--depth", str(depth), *out)
    assert "--depth as well" in refused(capsys, "detect", str(photo), "--depth-scale", "0.01", *out)
    assert "--threshold nan" in refused(capsys, "detect", str(photo), "--threshold", "nan", *out)
    assert "a folder" in refused(capsys, "detect", str(photo), "--weights", str(tmp_path), *out)
    assert "w.safetensors: is no picture" in refused(capsys, "detect", str(weights), *out)
    assert "safetensors" in refused(capsys, "detect", str(photo), "--weights", str(photo), *out)
    assert "nowhere.png" in refused(capsys, "detect", "nowhere.png", *out)
    assert "proposer 'luck'" in refused(capsys, "detect", str(photo), "--proposer", "luck", *out)
    assert not (tmp_path / "found").exists()


def test_poses_in_a_frame_are_written_drawn_and_told(capsys, tmp_path):
    catalogue = load_catalogue()
    frame, boxes = observe(catalogue, {"soup_can": standing(catalogue, "soup_can", 0.55, 0.0)})
    folder = tmp_path / "frame"
    folder.mkdir()
    cv2.imwrite(str(folder / "color.png"), frame.color[..., ::-1])
    cv2.imwrite(str(folder / "depth.png"), np.round(frame.depth * 1e4).astype(np.uint16))
    (folder / "camera.json").write_text(json.dumps(vars(frame.camera) | {"depth_scale": 1e-4}))
    rows = [{"label": label, "box": boxes["soup_can"], "score": 0.9} for label in ("soup_can", "unicorn")]
    (folder / "detections.json").write_text(json.dumps(rows))
    out = tmp_path / "out"
    estimate = ("estimate", str(folder), "--out", str(out), "--workers", "1", "--quiet")
    assert main(estimate) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[1].startswith("soup_can") and "no 'unicorn'" in told[2]
    found = json.loads((out / "estimates.json").read_text())
    assert found["schema"] == "sum-drake/estimates/1"
    can, unicorn = found["estimates"]
    keys = {
        "label",
        "box",
        "X_CO",
        "probability",
        "accepted",
        "score",
        "translation_std_m",
        "rotation_std_rad",
        "effective_sample_size",
        "mode_entropy_nats",
        "modes",
        "message",
    }
    assert can.keys() == unicorn.keys() == keys
    assert can["accepted"] and can["probability"] > 0.9 and unicorn["probability"] == 0
    assert found["timing"].keys() == {"start_s", "cpu_s", "wall_s"}
    assert cv2.imread(str(out / "overlay.png")) is not None
    assert "--force" in refused(capsys, *estimate)
    for boxes_of_nothing in ([], rows[1:], [rows[0] | {"box": [9e5, 0, 10, 10]}]):
        (folder / "detections.json").write_text(json.dumps(boxes_of_nothing))
        assert main([*estimate[:-1], "--force"]) == 0
        found = json.loads((out / "estimates.json").read_text())["estimates"]
        assert [one["probability"] for one in found] == [0.0] * len(boxes_of_nothing)
    capsys.readouterr()
    assert "--device abacus" in refused(capsys, *estimate, "--force", "--device", "abacus")
    (folder / "detections.json").unlink()
    own = tmp_path / "own.yaml"
    own.write_text(f"objects: {{teapot: {{mesh: {catalogue['mug'].mesh}, category: tools}}}}")
    line = refused(capsys, *estimate, "--force", "--catalogue", str(own))
    assert "no detections.json" in line and "knows no 'teapot'" in line


def test_a_training_is_followed_drawn_and_told(capsys, tmp_path):
    cards = write_cards(tmp_path / "cards", {"train": 8, "validation": 2})
    train = ("train", "--out", str(tmp_path / "out"), "--start", "random")
    assert main([*train, "--data", str(cards), "--epochs", "1", "--threads", "1"]) == 0
    out, err = capsys.readouterr()
    assert out.strip() == str(tmp_path / "out" / "detector.safetensors")
    told = err.splitlines()
    assert told[0].startswith("before the first step, on validation: map50 0.0")
    assert told[1].startswith("epoch 1 of 1, on validation: map50 ")
    card = (tmp_path / "out" / "detector.md").read_text()
    assert "trained on 8 pictures, 16 crops of objects" in card
    assert load_weights(tmp_path / "out" / "detector.safetensors").labels == ("red", "green")
    assert "another recipe" in refused(capsys, *train, "--data", str(cards), "--epochs", "2")
    assert "labels of its own" in refused(capsys, *train, "--data", str(cards), "--catalogue", "own.yaml")
    assert "--data is missing" in refused(capsys, "train", "--out", str(tmp_path / "out"))


def test_a_bench_of_nothing_is_refused(capsys, tmp_path, weights):
    bench = ("bench", "detect", "--out", str(tmp_path / "bench"), "--weights", str(weights))
    assert "no data set" in refused(capsys, *bench, "--data", str(tmp_path))
    assert "--workers 0" in refused(capsys, *bench, "--workers", "0", "--data", str(tmp_path))
    assert "--device abacus" in refused(capsys, *bench, "--device", "abacus")
    assert not (tmp_path / "bench").exists()


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
