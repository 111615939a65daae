"""What a film shows when: things move with the hand between lift and release, as the robot believes."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from run_folders import REGIONS, X_WG, X_WG_PICK, X_WO_PLACE, executed, write_run

from sum_drake.geometry import apply, inverse
from sum_drake.objects import load_catalogue
from sum_drake.runlog_reader import RunRecord, read_run_log
from sum_drake.storyboard import Shot, Storyboard, storyboard
from sum_drake.types import Attempt

CATALOGUE = load_catalogue()


def board_of(tmp_path: Path, attempt: Attempt | None = None) -> tuple[RunRecord, Storyboard]:
    record = read_run_log(write_run(tmp_path / "run", CATALOGUE, attempt) / "run.mcap")
    return record, storyboard(record, CATALOGUE, REGIONS)


def at(board: Storyboard, time: float) -> Shot:
    return min(board.shots, key=lambda shot: abs(shot.time - time))


def test_a_thing_moves_with_the_hand_from_lift_to_release_and_lies_in_its_bin_then(tmp_path: Path) -> None:
    record, board = board_of(tmp_path)
    X_WO = record.perceptions[0].posterior.tracks[0].X_WO
    np.testing.assert_array_equal(at(board, 2.5).X_WOs[0], X_WO)
    for time in (3.0, 4.0, 5.5):
        carried = X_WG(0.1 * time) @ inverse(X_WG_PICK) @ X_WO
        np.testing.assert_allclose(at(board, time).X_WOs[0], carried, atol=1e-9)
    for time in (6.0, 9.5):
        rest = at(board, time).X_WOs[0]
        np.testing.assert_allclose(rest[:2, 3], X_WO_PLACE[:2, 3])
        lowest = apply(rest, np.asarray(CATALOGUE["soup_can"].load_mesh().vertices))[:, 2].min()
        assert lowest == pytest.approx(REGIONS["left"].floor_height)
    assert "lifting soup_can" in at(board, 4.0).caption and "after look 0" in at(board, 4.0).caption
    assert board.labels == {0: "soup_can"}, "a rejected track is not shown"


def test_what_was_not_held_stays_and_what_was_lost_is_nowhere(tmp_path: Path) -> None:
    record, board = board_of(tmp_path, executed(released=False, held=False))
    X_WO = record.perceptions[0].posterior.tracks[0].X_WO
    np.testing.assert_array_equal(at(board, 9.0).X_WOs[0], X_WO)
    lost = dataclasses.replace(record, attempts=((9.8, executed(released=False)),))
    board = storyboard(lost, CATALOGUE, REGIONS)
    assert 0 in at(board, 5.0).X_WOs and 0 not in at(board, 9.0).X_WOs


def test_shots_are_few_evenly_spread_and_tell_the_speed(tmp_path: Path) -> None:
    record, whole = board_of(tmp_path)
    board = storyboard(record, CATALOGUE, REGIONS, shots=5, fps=2.0)
    assert [shot.time for shot in board.shots] == pytest.approx([0.0, 2.0, 4.5, 7.0, 9.5], abs=0.5)
    assert board.speed == pytest.approx(9.5 * 2.0 / 4)
    assert len(whole.shots) == 20


def test_a_log_with_little_in_it_makes_what_it_can(tmp_path: Path) -> None:
    record, _ = board_of(tmp_path)
    no_joints = dataclasses.replace(record, joint_times=np.zeros(0), joint_positions=np.zeros((0, 12)))
    assert storyboard(no_joints, CATALOGUE, REGIONS).shots == ()
    bare = dataclasses.replace(record, events=(), attempts=(), perceptions=())
    assert all(shot.X_WOs == {} for shot in storyboard(bare, CATALOGUE, REGIONS).shots)
    foreign = dataclasses.replace(record, joint_names=tuple(f"j{i}" for i in range(12)))
    X_WO = record.perceptions[0].posterior.tracks[0].X_WO
    np.testing.assert_array_equal(at(storyboard(foreign, CATALOGUE, {}), 4.0).X_WOs[0], X_WO)
    cut_off = dataclasses.replace(record, attempts=(), perceptions=record.perceptions[:1])
    assert "something" in at(storyboard(cut_off, CATALOGUE, REGIONS), 4.0).caption
