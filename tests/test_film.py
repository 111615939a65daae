"""The film: the robot where its joints were, things where they were believed, in a file that browsers play."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from run_folders import REGIONS, write_run

from sum_drake.assets import InputError
from sum_drake.film import film, look_at, webm
from sum_drake.objects import load_catalogue
from sum_drake.runlog_reader import read_run_log
from sum_drake.storyboard import storyboard

CATALOGUE = load_catalogue()


def test_the_film_shows_the_arm_moving_and_the_can_that_was_put_away(tmp_path: Path) -> None:
    record = read_run_log(write_run(tmp_path / "run", CATALOGUE) / "run.mcap")
    board = storyboard(record, CATALOGUE, REGIONS, shots=3)
    told: list[tuple[int, int]] = []
    pictures = list(
        film(board, CATALOGUE, record.joint_names, size=(160, 120), progress=lambda *done: told.append(done))
    )
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert all(picture.shape == (120, 160, 3) for picture in pictures)
    moved = np.abs(pictures[0].astype(int) - pictures[1].astype(int)).max(-1)[:90] > 40
    assert moved.sum() > 30
    without = dataclasses.replace(board.shots[0], X_WOs={})
    (empty,) = film(dataclasses.replace(board, shots=(without,)), CATALOGUE, record.joint_names, size=(160, 120))
    gone = np.abs(pictures[0].astype(int) - empty.astype(int)).max(-1)[:90] > 40
    assert 3 < gone.sum() < 300, "the can alone"


def test_a_scene_that_is_not_the_runs_is_refused(tmp_path: Path) -> None:
    record = read_run_log(write_run(tmp_path / "run", CATALOGUE) / "run.mcap")
    board = storyboard(record, CATALOGUE, REGIONS, shots=1)
    with pytest.raises(InputError, match="the scene cannot be made"):
        next(film(board, CATALOGUE, record.joint_names, directives="directives: [{add_model: {name: a, file: b}}]"))
    with pytest.raises(InputError, match="the scene cannot be made"):
        next(film(board, CATALOGUE, ("elbow",)))


def test_a_webm_is_read_back_in_its_colours_and_is_the_same_each_time(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    images = [np.full((48, 64, 3), (200, 40 * i, 30), np.uint8) for i in range(5)]
    data = webm(iter(images))
    assert data == webm(iter(images)) and data[:4] == b"\x1a\x45\xdf\xa3" and b"V_VP8" in data
    (tmp_path / "film.webm").write_bytes(data)
    reader = cv2.VideoCapture(str(tmp_path / "film.webm"))
    read = [reader.read()[1] for _ in range(5)]
    assert not reader.read()[0]
    for image, back in zip(images, read, strict=True):
        assert np.abs(back[..., ::-1].astype(int) - image).max() < 12
    assert webm(iter([])) == b""
    assert capfd.readouterr().err == ""


def test_a_camera_looks_where_it_is_told() -> None:
    X_WC = look_at(np.array([2.0, 1.0, 1.5]), np.array([0.3, 0.0, 0.7]))
    z = X_WC[:3, 2]
    np.testing.assert_allclose(np.cross(z, np.array([0.3, 0.0, 0.7]) - X_WC[:3, 3]), 0.0, atol=1e-12)
    assert X_WC[2, 1] < 0 and abs(X_WC[2, 0]) < 1e-12
