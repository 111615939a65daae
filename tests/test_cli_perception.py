"""The commands that look at pictures: detect, estimate, train, and their benches."""

import json

import cv2
import numpy as np
import pytest
from detectors import write_untrained
from pictures import write_cards
from refusals import refused
from scenes import observe, standing

from sum_drake.cli import main
from sum_drake.detection.weights import load_weights
from sum_drake.objects import load_catalogue


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
    told, err = (text.splitlines() for text in capsys.readouterr())
    assert err == ["detecting: 0 of 1", "detecting: 1 of 1, 0 s left"]
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
    assert main(estimate[:-1]) == 0
    out_text, err = capsys.readouterr()
    told = out_text.splitlines()
    assert [line.split(",")[0] for line in err.splitlines()] == [
        "looking at meshes: 0 of 1", "looking at meshes: 1 of 1",
        "estimating poses: 0 of 2", "estimating poses: 2 of 2",
    ]  # fmt: skip
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
    assert told[:2] == ["validating: 0 of 2", "validating: 2 of 2, 0 s left"]
    assert told[2].startswith("before the first step, on validation: map50 0.0")
    assert told[5].startswith("epoch 1 of 1, on validation: map50 ")
    assert told[6].startswith("calibrating: 0 of 2")
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
