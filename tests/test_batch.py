"""Many runs: each is kept once and whole, whatever is killed, and a run that goes wrong is a result."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from refusals import refused

from sum_drake import episodes
from sum_drake.batch_folder import read_episodes
from sum_drake.cli import main
from sum_drake.doctor import versions
from sum_drake.episodes import EpisodeSpec, Running, run_episode
from sum_drake.summary_schema import validate_summary
from sum_drake.systems.scenario import dump_scenario, load_scenario

SHORT = "{objects: {labels: [soup_can]}, simulation_duration: 1.0}"
"""Long enough to look and to set out."""
RUN_FILES = {"episode.json", "report.html", "run.mcap", "scenario.yaml", "summary.json"}


def batch(out, *more, runs=2, text=SHORT):
    arguments = ["--runs", str(runs), "--first-seed", "5", "--scenario-text", text, "--out", str(out), "--quiet"]
    return ["batch", *arguments, *more]


def told(out):
    return json.loads((out / "batch.json").read_text())


def digests(out):
    return {row["seed"]: row["digest"] for row in told(out)["episodes"]}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    out = tmp_path_factory.mktemp("batch") / "out"
    assert main(batch(out, "--workers", "1")) == 0
    return out


def test_each_run_is_a_folder_and_the_whole_is_told(undisturbed):
    for seed in ("5", "6"):
        assert {path.name for path in (undisturbed / seed).iterdir()} == RUN_FILES
        summary = json.loads((undisturbed / seed / "summary.json").read_text())
        validate_summary(summary)
        assert summary["seed"] == int(seed)
        assert summary["observations"][0]["tracks"] >= 1 and summary["attempts"][0]["kind"] == "pick_place"
    whole = told(undisturbed)
    assert (whole["schema"], whole["runs"], whole["done"]) == ("sum-drake/batch/1", 2, 2)
    assert [row["seed"] for row in whole["episodes"]] == [5, 6]
    assert len(set(digests(undisturbed).values())) == 2
    figures = whole["figures"]
    assert (figures["runs"], figures["objects"], figures["objects_sorted_share"]) == (2, 2, 0)
    assert 100 < figures["peak_memory_mib_max"] < 4096
    assert whole["causes"] == whole["errors"] == {"aborted: cut_off": 2}


def test_killed_half_way_and_called_again_it_is_the_same_batch(undisturbed, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "sum_drake", *batch(out, "--workers", "2", runs=3)]
    process = subprocess.Popen(command)
    while not list(out.glob("*/episode.json")):
        assert process.poll() is None, "it ended before it was killed"
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = {path.parent.name: path.stat().st_mtime_ns for path in out.glob("*/episode.json")}
    assert main(batch(out, "--workers", "4", runs=3)) == 0
    for seed, written in kept.items():
        assert (out / seed / "episode.json").stat().st_mtime_ns == written, "what was kept is not run again"
    assert sorted(path.name for path in out.iterdir()) == ["5", "6", "7", "batch.json"]
    assert {5: None, 6: None, 7: None}.keys() == digests(out).keys()
    assert digests(undisturbed).items() <= digests(out).items()


def test_a_worker_ends_with_whoever_started_it():
    """With a batch that is killed, that is: nothing runs on that nobody waits for."""
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "sum_drake.worker", "4096", "sort", "--objects", "5"]
    process = subprocess.Popen(command, stdin=reading, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(reading)
    time.sleep(1.0)
    assert process.poll() is None
    os.close(writing)
    assert process.wait(timeout=20.0) == 1


@pytest.mark.parametrize(
    ("limits", "state", "words"),
    [((1.0, 4096), "timed_out", "not done after 1 s"), ((600.0, 200), "crashed", "exit status")],
    ids=["time", "memory to start"],
)
def test_what_takes_too_much_is_a_result(limits, state, words, tmp_path):
    scenario = dump_scenario(load_scenario(text=SHORT, seed=5))
    episode = run_episode(EpisodeSpec(5, scenario, *limits), tmp_path)
    assert (episode.state, episode.summary) == (state, None)
    assert words in episode.reason
    row = episode.row()
    assert row["seed"] == 5 and row["reason"] == episode.reason and "digest" not in row
    assert not list(tmp_path.iterdir()), "nothing is left"


def test_a_run_that_gets_no_more_memory_is_a_result_with_its_reason(tmp_path):
    scenario = dump_scenario(load_scenario(text=SHORT, seed=5))
    episode = run_episode(EpisodeSpec(5, scenario, 600.0, 750), tmp_path)
    assert episode.state in ("failed", "crashed"), "what asked for it says so, or dies"
    assert "memory" in episode.reason or "ended by SIG" in episode.reason


FAILED_RUN = EpisodeSpec(5, "", 1.0, 512), episodes._Done(1, False, 2.0, 3.0, 4.0), "said\nno memory"


def test_a_run_that_fails_and_says_why_is_told_as_that(undisturbed, tmp_path):
    summary = json.loads((undisturbed / "5" / "summary.json").read_text())
    outcome = "stopped: failed: ValueError: no such thing"
    (tmp_path / "summary.json").write_text(json.dumps(summary | {"outcome": outcome}))
    episode = episodes._judge(*FAILED_RUN, tmp_path)
    assert (episode.state, episode.reason, episode.log) == ("failed", outcome, "said\nno memory")
    assert episode.row()["digest"] == summary["digest"]


def test_a_run_that_ended_well_and_could_not_be_reported_says_that(undisturbed):
    episode = episodes._judge(*FAILED_RUN, undisturbed / "5")
    assert (episode.state, episode.reason) == ("failed", "exit status 1; last: no memory")


def test_a_full_disk_ends_a_batch_and_is_no_result(tmp_path, monkeypatch, capsys):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr("sum_drake.episodes.shutil.disk_usage", lambda _: usage._replace(free=4096))
    out = tmp_path / "out"
    assert main(batch(out, "--workers", "1", "--time-limit", "1")) == 2
    assert f"{out / '.work'}: No space left on device" in capsys.readouterr().err
    assert not list(out.glob("*/episode.json"))
    monkeypatch.undo()
    told = batch(out, "--workers", "1", "--time-limit", "1", runs=1)
    assert main(told) == 0 and list(out.glob("*/episode.json")), "with room, what ends badly is one"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_batch_says_how_it_goes_on_and_leaves_nothing_running(number, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "sum_drake", *batch(out, "--workers", "2", runs=3)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not (runs := episodes_of(process.pid)):
        assert process.poll() is None, "it ended before it was interrupted"
        time.sleep(0.05)
    process.send_signal(number)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    word = "interrupted" if number == signal.SIGINT else "ended"
    assert said.splitlines()[-1] == f"sum-drake: {word}; {out} keeps what was done: the same command goes on"
    assert not any(Path(f"/proc/{run}").exists() for run in runs)


def episodes_of(pid):
    """Processes of episodes that a process has under way."""
    children = Path(f"/proc/{pid}/task").glob("*/children")
    return [child for file in children for child in file.read_text().split() if "sum_drake.worker" in command_of(child)]


def command_of(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:  # it has ended
        return ""


def test_none_is_begun_once_all_were_ended(tmp_path):
    running = Running()
    running.end()
    with pytest.raises(RuntimeError, match="ended"):
        run_episode(EpisodeSpec(5, "", 1.0, 512), tmp_path, running)
    assert not list(tmp_path.iterdir())


def test_a_batch_in_which_every_run_dies_is_told_like_others(tmp_path, capsys):
    out = tmp_path / "out"
    command = [part for part in batch(out, "--workers", "2", "--time-limit", "1") if part != "--quiet"]
    assert main(command) == 0
    figures = told(out)["figures"]
    assert (figures["runs"], figures["runs_ended"], figures["hangs"]) == (2, 0, 2)
    assert (figures["objects"], figures["objects_sorted_share"], figures["runs_complete_share"]) == (2, 0.0, 0.0)
    assert (out / "5" / "log.txt").is_file()
    said = capsys.readouterr().out
    assert (
        "2 runs: 0 of 2 objects sorted, 0.000" in said
        and "lost: 2, the run timed out" in said
        and f"sum-drake report {out}" in said
    )


def test_a_run_that_is_refused_and_one_that_is_killed_are_results(tmp_path):
    scenario = dump_scenario(load_scenario(text=SHORT, seed=5))
    missing = run_episode(EpisodeSpec(5, scenario.replace("soup_can", "no_such_thing"), 600, 4096), tmp_path)
    assert missing.state == "crashed" and "exit status 2, no summary.json" in missing.reason
    running = Running()

    def end() -> None:
        while not running.processes:
            time.sleep(0.01)
        (process,) = running.processes
        os.killpg(process.pid, signal.SIGRTMIN + 3)

    killer = threading.Thread(target=end)
    killer.start()
    killed = run_episode(EpisodeSpec(5, scenario, 600, 4096), tmp_path, running)
    killer.join()
    assert killed.state == "crashed" and killed.reason.startswith(f"ended by signal {signal.SIGRTMIN + 3}")


def test_a_batch_that_was_killed_at_its_first_write_goes_on(tmp_path):
    out = tmp_path / "out"
    (out / ".work").mkdir(parents=True)
    (out / ".batch.json.part").write_text("{")
    assert main(batch(out, "--time-limit", "1", runs=1)) == 0
    assert told(out)["done"] == 1


def test_what_a_killed_batch_left_and_cannot_be_removed_is_no_obstacle(tmp_path, monkeypatch):
    out, remove = tmp_path / "out", shutil.rmtree
    (out / ".work" / "5.kept.old").mkdir(parents=True)

    def keep_work(path, *arguments, **options):
        """As where a file is still open on a network's disk."""
        if Path(path).name != ".work":
            remove(path, *arguments, **options)
        elif not options.get("ignore_errors"):
            raise OSError("not empty")

    monkeypatch.setattr(shutil, "rmtree", keep_work)
    assert main(batch(out, "--time-limit", "1", runs=1)) == 0
    assert told(out)["done"] == 1 and (out / "5" / "episode.json").is_file()


def test_a_clusters_workers_are_not_this_machines(tmp_path, capsys):
    line = refused(capsys, *batch(tmp_path / "out", "--cluster", "tcp://127.0.0.1:8786", "--workers", "2"))
    assert "--workers 2: of this machine; expected none with --cluster" in line and not (tmp_path / "out").exists()


def test_a_batch_says_what_made_its_runs_whoever_counts_them(undisturbed, tmp_path, capsys):
    out = tmp_path / "out"
    shutil.copytree(undisturbed, out)
    row = json.loads((out / "5" / "episode.json").read_text())
    (out / "5" / "episode.json").write_text(json.dumps({**row, "device": "another machine"}))
    (out / "batch.json").write_text(json.dumps({**told(out), "commit": "begun"}))
    assert main(batch(out)) == 0
    assert told(out)["device"] == f"another machine; {row['device']}" and told(out)["commit"] == "begun"
    fewer = [part for part in batch(out, runs=1) if part != "--quiet"]
    assert main(fewer) == 0 and "kept and not told of, as not asked for: 1 run\n" in capsys.readouterr().out
    assert [one["seed"] for one in read_episodes(out)] == [5], "the other is no part of it any longer"
    (out / "batch.json").write_text(json.dumps({**told(out), "versions": {**versions(), "drake": "1.0"}}))
    assert f"is of drake 1.0 and not {versions()['drake']}; expected a new --out" in refused(capsys, *batch(out))


def test_bad_input_is_one_line(undisturbed, tmp_path, capsys):
    assert "--runs 0: expected at least 1" in refused(capsys, *batch(tmp_path / "a", runs=0))
    for limit in ("0", "nan", "inf", "1e300"):
        assert f"--time-limit {float(limit):g}" in refused(capsys, *batch(tmp_path / "a", "--time-limit", limit))
    for limit in ("511", "99999999999999"):
        line = refused(capsys, *batch(tmp_path / "a", "--memory-limit", limit))
        assert f"--memory-limit {limit}: expected 512" in line
    line = refused(capsys, *batch(undisturbed, "--scenario-text", "{objects: {labels: [mug]}}"))
    assert "batch.json: is of" in line and "expected a new --out" in line
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("precious")
    assert "holds no batch" in refused(capsys, *batch(foreign))
    broken = tmp_path / "broken"
    shutil.copytree(undisturbed, broken)
    (broken / "5" / "episode.json").rename(broken / "5" / "mine.json")
    assert f"{broken / '5'}: holds no episode.json" in refused(capsys, *batch(broken))
    (broken / "5" / "mine.json").rename(broken / "5" / "episode.json")
    (broken / "5" / "episode.json").write_text("{}")
    assert f": remove {broken / '5'} to run it again" in refused(capsys, *batch(broken))
    (broken / "batch.json").write_text("{}")
    for command in (batch(broken), ["report", str(broken)]):
        assert "restore it, or take another folder" in refused(capsys, *command)
    (broken / "batch.json").unlink()
    assert "lost the batch.json that tells what its runs are of; expected a new" in refused(capsys, *batch(broken))
