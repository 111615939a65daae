"""Ctrl-C in the commands: one line that says what is kept and how to go on, and no file in part."""

import os
import signal
import subprocess
import sys

import cv2
import numpy as np
import pytest
from detectors import write_untrained
from pictures import write_cards
from run_folders import write_run

from sum_drake.cli import main
from sum_drake.objects import load_catalogue


def interrupt(*arguments, **options):
    raise KeyboardInterrupt


@pytest.fixture
def interrupted(capsys, monkeypatch):
    """Calls a command that is interrupted where it would call what is named; returns what it says of that."""

    def call(seam, *arguments):
        with monkeypatch.context() as patched:
            patched.setattr(seam, interrupt)
            assert main(arguments) == 130
        told = capsys.readouterr().err.splitlines()[-1]
        assert told.startswith("sum-drake: interrupted; ")
        return told.removeprefix("sum-drake: interrupted; ")

    return call


ANEW = "; the same command begins anew"


def test_commands_that_write_at_the_end_begin_anew_and_leave_what_was_there(interrupted, tmp_path):
    out = tmp_path / "out"
    color = np.random.default_rng(0).integers(0, 255, (200, 300, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), color)
    weights = write_untrained(tmp_path / "w.safetensors", load_catalogue().labels, threshold=0.0)
    frame = tmp_path / "frame"
    frame.mkdir()
    cv2.imwrite(str(frame / "color.png"), color)
    cv2.imwrite(str(frame / "depth.png"), np.full((200, 300), 900, np.uint16))
    camera = {"fx": 300, "fy": 300, "cx": 149.5, "cy": 99.5, "width": 300, "height": 200, "depth_scale": 0.001}
    (frame / "camera.json").write_text(str(camera).replace("'", '"'))
    (frame / "detections.json").write_text("[]")
    for seam, *command in (
        ("sum_drake.detection.inference.Detector.__call__", "detect", str(tmp_path / "photo.png"),
         "--weights", str(weights)),
        ("sum_drake.estimates.estimate_frame", "estimate", str(frame)),
        ("sum_drake.bench.detect.bench_detect", "bench", "detect"),
        ("sum_drake.bench.speed.bench_speed", "bench", "speed"),
    ):  # fmt: skip
        assert interrupted(seam, *command, "--out", str(out)) == f"nothing was written{ANEW}"
        assert not out.exists()
    out.mkdir()
    (out / "estimates.json").write_text("of before")
    again = interrupted("sum_drake.estimates.estimate_frame", "estimate", str(frame), "--out", str(out), "--force")
    assert again == f"{out} is as it was{ANEW}"
    assert (out / "estimates.json").read_text() == "of before"


def test_a_sheet_and_a_replay_begin_anew(interrupted, tmp_path):
    sheet, run = tmp_path / "sheet.png", write_run(tmp_path / "run", load_catalogue())
    seam = "sum_drake.contact_sheet.render_model"
    assert interrupted(seam, "objects", "render", "--out", str(sheet)) == f"nothing was written{ANEW}"
    sheet.write_text("a photograph")
    assert interrupted(seam, "objects", "render", "--out", str(sheet), "--force") == f"{sheet} is as it was{ANEW}"
    assert sheet.read_text() == "a photograph"
    replay = ("replay", str(run), "--workers", "1")
    assert interrupted("sum_drake.replay.compare", *replay) == f"nothing was written{ANEW}"
    assert interrupted("sum_drake.replay.compare", *replay, "--out", str(tmp_path / "r.json")).endswith(ANEW)


def test_a_training_goes_on_from_its_last_checkpoint_if_there_is_one(interrupted, tmp_path):
    cards, out = write_cards(tmp_path / "cards", {"train": 4, "validation": 1}), tmp_path / "out"
    train = ("train", "--out", str(out), "--start", "random", "--data", str(cards), "--epochs", "1", "--threads", "1")
    evaluate, report = "sum_drake.detection.training.evaluate", "sum_drake.detection.training_report.write_results"
    assert interrupted(evaluate, *train) == "there is no checkpoint yet; the same command begins anew"
    kept = f"{out} keeps what was learned until its last checkpoint: the same command goes on"
    assert interrupted(report, *train) == kept
    assert main(train) == 0
    assert (out / "detector.safetensors").is_file()


def test_a_data_set_goes_on_and_only_the_command_itself_speaks(tmp_path):
    """Its workers, which are interrupted while they start, say nothing of it."""
    out = tmp_path / "data"
    command = [sys.executable, "-m", "sum_drake", "dataset", "--quick", "--workers", "2", "--out", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr.readline() == "rendering: 0 of 72\n"
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
    told = process.communicate(timeout=50)[1]
    assert told == f"sum-drake: interrupted; {out} keeps what was rendered: the same command goes on\n"
    assert process.returncode == 130
    assert [path.name for path in out.iterdir()] == ["dataset.json"]


def started(tmp_path, **streams):
    """A sort that has said its first step."""
    command = [sys.executable, "-m", "sum_drake", "sort", "--seed", "5", "--objects", "1", "--workers", "1"]
    return subprocess.Popen([*command, "--out", str(tmp_path / "run")], text=True, **streams)


def test_a_scheduler_that_ends_a_run_is_answered_as_ctrl_c_is(tmp_path):
    with started(tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
        first = run.stderr.readline()
        run.send_signal(signal.SIGTERM)
        said = run.stderr.read().splitlines()
    assert "pouring" in first and run.returncode == 128 + signal.SIGTERM
    assert said[-1].startswith("sum-drake: ended; ") and not any("Traceback" in line for line in said)


@pytest.mark.parametrize("closed", ["a pipe that nobody reads", "no standard error"])
def test_a_run_goes_on_when_nobody_listens(tmp_path, closed):
    command = [sys.executable, "-m", "sum_drake", "objects", "check"]
    if closed == "no standard error":
        done = subprocess.run(["sh", "-c", '"$@" 2>&-', "sh", *command], capture_output=True, text=True, check=False)
        assert done.returncode == 0 and done.stdout.count("\n") >= 15
        return
    reading, writing = os.pipe()
    os.close(reading)
    try:
        short = ["--scenario-text", "{objects: {labels: [soup_can]}, simulation_duration: 0.1}"]
        sort = [sys.executable, "-m", "sum_drake", "sort", "--seed", "5", "--workers", "1", *short]
        done = subprocess.run(
            [*sort, "--out", str(tmp_path / "run")], stderr=writing, stdout=subprocess.PIPE, text=True, check=False
        )
    finally:
        os.close(writing)
    assert done.returncode == 0 and "of 1 objects sorted" in done.stdout
    assert (tmp_path / "run" / "report.html").is_file()


def test_a_running_sorts_folder_is_not_taken(tmp_path, capsys):
    with started(tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
        try:
            for line in run.stderr:
                if (tmp_path / "run" / "run.mcap").is_file() or "look" in line:
                    break
            assert main(["sort", "--seed", "6", "--objects", "1", "--out", str(tmp_path / "run"), "--force"]) == 2
        finally:
            run.kill()
    assert "another run is at it" in capsys.readouterr().err
