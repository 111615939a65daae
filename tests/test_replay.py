"""Replay: the same log gives the same belief to the last bit, and whatever differs is found and told."""

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import observe, standing
from test_runlog import make_perception, write

from sum_drake.association import associate_frame
from sum_drake.cli import main
from sum_drake.costs import Costs
from sum_drake.faults import FaultConfig
from sum_drake.geometry import rotation_from_vector, transform
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.replay import compare, difference_table, false_detections, verdict
from sum_drake.runlog import RunLogWriter
from sum_drake.runlog_reader import read_run_log
from sum_drake.systems.scenario import dump_scenario, load_scenario
from sum_drake.systems.sorting import bind_perception
from sum_drake.types import (
    Detection,
    Detections,
    Gone,
    Perception,
    PickPlace,
    SceneBelief,
    Track,
    readonly,
)

# A detector that is never sure enough of anything; what is detected was put there by a fault.
TEXT = "{object_detector: {threshold: 1.0}, objects: {labels: [mug]}, faults: [{kind: false_detection, object: sugar}]}"


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, catalogue: Catalogue) -> Path:
    """A short run: a sugar box is seen, missed by the hand, and seen again."""
    folder = tmp_path_factory.mktemp("runs") / "5"
    folder.mkdir()
    scenario = load_scenario(text=TEXT, seed=5)
    (folder / "scenario.yaml").write_text(dump_scenario(scenario))
    update = bind_perception(scenario, catalogue, Costs())
    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    missed = PickPlace(0, "pick_place", 0, "sugar", readonly(X_WO), readonly(X_WO), "bin", 0.0, 0.0, False)
    held = SceneBelief()
    with RunLogWriter(folder / "run.mcap", metadata={"seed": "5"}) as writer:
        for step, action in enumerate((None, missed)):
            frame, boxes = observe(catalogue, {"sugar": X_WO}, observation=step)
            seen = Detections(step, (Detection(boxes["sugar"], 0.9, (("sugar", 0.9),)),))
            pairs = associate_frame(
                held, frame, seen, action, lambda label: catalogue[label].load_mesh().vertices, scenario.association
            )
            posterior = update(held, frame, seen, pairs, action)
            writer.write_perception(Perception(step, frame, seen.boxes, pairs.pairs, held, posterior, action))
            held = posterior
    assert [track.accepted for track in held.tracks] == [True]
    return folder


def rewritten(source: Path, folder: Path, change: Callable[[Perception], Perception] = lambda one: one) -> Path:
    """The run in a folder of its own, every record of its log changed."""
    folder.mkdir()
    (folder / "scenario.yaml").write_bytes((source / "scenario.yaml").read_bytes())
    record = read_run_log(source / "run.mcap")
    with RunLogWriter(folder / "run.mcap", metadata={"seed": record.metadata["seed"]}) as writer:
        for perception in record.perceptions:
            writer.write_perception(change(perception))
    return folder


def replayed(capsys: pytest.CaptureFixture[str], *arguments: Any) -> tuple[int, list[str], list[str]]:
    """Exit code of the command, and the lines of what it said on stdout and stderr."""
    code = main(["replay", "--workers", "1", "--quiet", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out.splitlines(), err.splitlines()


def test_a_run_repeats_to_the_last_bit(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], catalogue: Catalogue
) -> None:
    code, out, err = replayed(capsys, recorded, "--out", tmp_path / "replay.json")
    assert (code, err) == (0, [])
    assert out == [
        "false detections, of a fault, are taken as recorded: observations 0, 1",
        "identical: 2 observations, 1 track",
    ]
    data = json.loads((tmp_path / "replay.json").read_text())
    assert (data["schema"], data["seed"], data["filter"]) == ("sum-drake/replay/1", 5, "default")
    assert (data["identical"], data["log_is_whole"]) == (True, True)
    assert [one["observation"] for one in data["observations"]] == [0, 1]
    (track,) = data["observations"][1]["tracks"]
    assert track["log"] == track["replay"]
    assert (track["label"], track["differs"], track["translation_m"]) == ("sugar", [], 0.0)
    # The page on formats names every field.
    words = set(re.findall(r"\w+", (Path(__file__).parents[1] / "docs" / "formats.md").read_text()))
    assert {*data, *data["observations"][0], *track, *track["log"]} <= words
    assert sorted(path.name for path in recorded.iterdir()) == ["run.mcap", "scenario.yaml"]


def test_other_depth_in_one_picture_is_another_belief_from_there_on(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def dent(one: Perception) -> Perception:
        if one.step == 0:
            return one
        x, y, w, h = (int(side) for side in one.detections[0].box)
        depth = np.array(one.frame.depth)
        depth[y + h // 4 : y + h // 2, x + w // 4 : x + w // 2] += 0.03
        return dataclasses.replace(one, frame=dataclasses.replace(one.frame, depth=readonly(depth, np.float32)))

    code, out, err = replayed(capsys, rewritten(recorded, tmp_path / "dented", dent))
    assert code == 1
    assert out[1].split() == ["observation", "what", "log", "replay", "differs", "in"]
    assert all(line.split()[0] == "1" for line in out[2:])
    assert re.search(r" 1  sugar \(track 0\)  accepted, 0\.\d+ +accepted, 0\.\d+ +probability, pose by \d", out[-1])
    assert len(err) == 1
    assert "failed: the run did not repeat: differences in 1 of 2 observations, from observation 1 on" in err[0]


def test_another_detector_is_told_apart_from_its_consequences(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the fault the detector sees nothing, and the log's detections are none of its."""
    run = rewritten(recorded, tmp_path / "bare")
    text = (run / "scenario.yaml").read_text()
    assert "false_detection" in text
    (run / "scenario.yaml").write_text(
        dump_scenario(load_scenario(text=TEXT.replace("false_detection", "camera"), seed=5))
    )
    code, out, _ = replayed(capsys, run)
    assert code == 1
    table = "\n".join(out)
    assert re.search(r" 0  detections +1, 1 not in the replay +0\n", table)
    assert re.search(r" 0  sugar \(track 0\) +accepted, 0\.\d+ +not there +there\n", table)
    code, out, _ = replayed(capsys, run, "--scenario-text", "{detector: SimulatedDetector}")
    assert code == 0
    assert out == [
        "detections are taken as recorded: SimulatedDetector needs the simulator",
        "identical: 2 observations, 1 track",
    ]


def test_what_another_filter_would_have_believed_is_an_answer(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = replayed(capsys, recorded, "--filter", "paper")
    assert (code, err) == (0, [])
    assert any("sugar" in line and "pose by" in line for line in out)
    assert out[-1].startswith("differences in 2 of 2 observations, from observation 0 on; objects accepted")


def test_a_log_that_was_cut_off_is_replayed_as_far_as_it_goes(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = rewritten(recorded, tmp_path / "cut")
    whole = (run / "run.mcap").read_bytes()
    (run / "run.mcap").write_bytes(whole[: int(0.7 * len(whole))])
    code, out, _ = replayed(capsys, run)
    assert code == 0
    assert out[0].startswith("replayed as far as it goes: the log ") and "is cut off" in out[0]
    assert out[-1] == "identical as far as the log goes: 1 observation, 1 track"


def put(perception: Perception, **changes: Any) -> Perception:
    """The record with its first track changed."""
    first, *rest = perception.posterior.tracks
    tracks = (dataclasses.replace(first, **changes), *rest)
    return dataclasses.replace(perception, posterior=dataclasses.replace(perception.posterior, tracks=tracks))


def believe(perception: Perception, **changes: Any) -> Perception:
    return dataclasses.replace(perception, posterior=dataclasses.replace(perception.posterior, **changes))


def told(a: Perception, b: Perception, catalogue: Catalogue) -> list[str]:
    """The lines of the table of differences."""
    return difference_table([compare(a, b, catalogue)]).splitlines()[1:]


def test_each_thing_that_differs_has_its_words(catalogue: Catalogue) -> None:
    one = make_perception(1)
    first = one.posterior.tracks[0]
    assert told(one, one, catalogue) == []
    turned = np.array(first.X_WO) @ transform(rotation_from_vector(np.array([0.0, 0.0, 0.1])), np.zeros(3))
    turned[0, 3] += 0.003
    cases: list[tuple[Perception, str]] = [
        (put(one, probability=0.71), "sugar (track 0)  accepted, 0.7  accepted, 0.71  probability"),
        (put(one, accepted=False), "sugar (track 0)  accepted, 0.7  not accepted, 0.7  accepted"),
        (put(one, X_WO=readonly(turned)), "sugar (track 0)  accepted, 0.7  accepted, 0.7  pose by 3 mm, 5.7 deg"),
        (put(one, box=(3.0, 4.0, 20.0, 10.0)), "sugar (track 0)  accepted, 0.7  accepted, 0.7  box"),
        (put(one, id=7), "sugar (track 0 and 7)  accepted, 0.7  accepted, 0.7  id"),
        (believe(one, next_id=5), "tracks so far  2  5"),
        (believe(one, gone=(Gone(4, "mug", 1, "empty"),)), "ended  none  mug (empty)"),
        (dataclasses.replace(one, detections=()), "detections  1, 1 not in the replay  0"),
        (dataclasses.replace(one, associations=one.associations[:1]), "associations  2, 1 not in the replay  1"),
    ]
    for other, words in cases:
        (line,) = told(one, other, catalogue)
        assert re.sub(r" +", " ", line) == re.sub(r" +", " ", f" 1 {words}")
    weights = np.array(first.belief.weights)[::-1]
    (line,) = told(one, put(one, belief=dataclasses.replace(first.belief, weights=readonly(weights))), catalogue)
    assert line.endswith("particles")
    other = told(one, put(one, label="mug"), catalogue)
    assert [line.split()[1] for line in other] == ["sugar", "mug"]
    assert all(line.endswith("there") for line in other)


def test_a_log_keeps_fewer_particles_and_says_the_same(catalogue: Catalogue, tmp_path: Path) -> None:
    whole = make_perception(0)
    with RunLogWriter(tmp_path / "run.mcap") as writer:
        writer.write_perception(whole)
    (read,) = read_run_log(tmp_path / "run.mcap").perceptions
    assert len(read.posterior.tracks[0].belief.weights) < len(whole.posterior.tracks[0].belief.weights)
    assert compare(read, whole, catalogue).identical
    assert verdict([compare(read, whole, catalogue)]) == "identical: 1 observation, 2 tracks"


@settings(max_examples=10)
@given(order=st.permutations(range(5)), shift=st.floats(0.0, 0.004), gone=st.integers(0, 4))
def test_tracks_are_paired_by_place_whatever_their_order_and_ids(
    catalogue: Catalogue, order: list[int], shift: float, gone: int
) -> None:
    """Five of one label, ten centimetres apart; one is missing on the other side."""
    one = make_perception(0)
    like = one.posterior.tracks[0]

    def at(i: int, id: int, off: float) -> Track:
        return dataclasses.replace(like, id=id, X_WO=readonly(transform(np.eye(3), np.array([0.1 * i + off, 0, 0.7]))))

    log = believe(one, tracks=tuple(at(i, i, 0.0) for i in range(5)))
    now = believe(one, tracks=tuple(at(i, k, shift) for k, i in enumerate(order) if i != gone))
    found = compare(log, now, catalogue).tracks
    assert [track.log.track for track in found if track.log is not None] == [0, 1, 2, 3, 4]
    for track in found:
        assert track.log is not None
        if track.log.track == gone:
            assert track.replay is None and track.differs == ("there",)
        else:
            assert track.replay is not None and track.replay.track == order.index(track.log.track)
            assert track.translation_m == pytest.approx(shift, abs=1e-9)


def test_which_detections_are_a_faults() -> None:
    faults = [FaultConfig("false_detection", 2), FaultConfig("camera", 2), FaultConfig("false_detection", 4)]
    assert [false_detections(faults, step) for step in range(8)] == [0, 0, 1, 1, 2, 1, 1, 0]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder that can be replayed as far as its files go."""
    folder = tmp_path / "run"
    folder.mkdir()
    write(folder / "run.mcap")
    (folder / "scenario.yaml").write_text(dump_scenario(load_scenario(seed=3)))
    return folder


def refused(capsys: pytest.CaptureFixture[str], *arguments: Any) -> str:
    """The one line of a call that must be refused as bad input."""
    code, out, err = replayed(capsys, *arguments)
    assert (code, out, len(err)) == (2, [], 1), (out, err)
    return err[0]


def empty_log(path: Path, **metadata: str) -> None:
    with RunLogWriter(path, metadata=metadata):
        pass


def foreign_log(path: Path) -> None:
    """Another program's MCAP."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()


def cut(path: Path, share: float) -> None:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda run: (run / "run.mcap").unlink(), ["cannot read the log", "run.mcap", "expected an MCAP file"]),
        (lambda run: (run / "run.mcap").write_text("hello, " * 9), ["run.mcap is no log of a run: it is no MCAP file"]),
        (lambda run: foreign_log(run / "run.mcap"), ["run.mcap is no log of a run", "has no mark of one"]),
        (lambda run: empty_log(run / "run.mcap", schema="sum-drake/log/9"), ["sum-drake/log/9", "expected"]),
        (lambda run: empty_log(run / "run.mcap"), ["holds no observation"]),
        (lambda run: cut(run / "run.mcap", 0.01), ["run.mcap"]),
        (lambda run: empty_log(run / "run.mcap", seed="8"), ["holds no observation"]),
        (lambda run: (run / "scenario.yaml").unlink(), ["no scenario.yaml in it", "expected the folder of a run"]),
        (
            lambda run: (run / "scenario.yaml").rename(run / "batch.json"),
            ["the folder of a batch", "expected the folder of a run"],
        ),
        (lambda run: (run / "scenario.yaml").write_bytes(b"\xff\xfe\x00"), ["scenario.yaml", "expected a YAML file"]),
        (lambda run: (run / "scenario.yaml").write_text("resolved: [1"), ["scenario.yaml", "expected YAML"]),
        (lambda run: (run / "scenario.yaml").write_text("resolved: {speed: 3}"), ["unknown key 'speed'"]),
        (lambda run: (run / "scenario.yaml").write_text("a: {catalogue: gone.yaml}"), ["gone.yaml is missing"]),
        (lambda run: (run / "scenario.yaml").write_text("a: {random_seed: 4}"), ["seed 3", "scenario.yaml of 4"]),
    ],
)  # fmt: skip
def test_a_folder_that_cannot_be_replayed_is_told_in_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], spoil: Callable[[Path], Any], words: list[str]
) -> None:
    spoil(run)
    line = refused(capsys, run)
    for word in words:
        assert word in line


def test_what_is_no_run_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no such folder; expected the folder of a run" in refused(capsys, tmp_path / "none")
    (tmp_path / "file").write_text("")
    assert "a file; expected the folder of a run" in refused(capsys, tmp_path / "file")


def test_options_that_cannot_be_meant_are_refused(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "'best' is unknown; expected one of default, paper" in refused(capsys, run, "--filter", "best")
    assert "faults: what went wrong" in refused(capsys, run, "--scenario-text", "{faults: []}")
    assert "unknown key 'fliter'" in refused(capsys, run, "--scenario-text", "{fliter: paper}")
    assert "filter 'best'" in refused(capsys, run, "--scenario-text", "{filter: best}")
    assert "gone.yaml is missing" in refused(capsys, run, "--scenario-text", "{catalogue: gone.yaml}")
    assert "--workers 0" in refused(capsys, run, "--workers", "0")
    assert "cannot be written" in refused(capsys, run, "--out", tmp_path / "no" / "replay.json")
    (tmp_path / "kept.json").write_text("{}")
    assert "--force" in refused(capsys, run, "--out", tmp_path / "kept.json")
    assert (tmp_path / "kept.json").read_text() == "{}"


def test_a_catalogue_that_lacks_what_the_log_speaks_of_is_refused(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], catalogue: Catalogue
) -> None:
    other = tmp_path / "objects.yaml"
    other.write_text(f"objects: {{mug: {{mesh: {catalogue['mug'].mesh}, category: cup}}}}")
    text = f"{{catalogue: {other}, objects: {{count: 1}}, goal: {{cup: leave}}}}"
    assert "speaks of 'sugar', which is not in" in refused(capsys, run, "--scenario-text", text)
