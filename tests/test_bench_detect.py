"""The bench on a detector made of annotations with known errors, and once as a whole with a small network."""

import json
import tempfile

import numpy as np
import pytest
from detectors import write_untrained
from pictures import LABELS, write_cards

from sum_drake.assets import InputError
from sum_drake.bench import detect
from sum_drake.bench.aims import format_figures, reached
from sum_drake.bench.detect import bench_detect
from sum_drake.bench.detect_figures import (
    AIMS,
    COUNTS,
    SHIFT,
    TEST,
    Measured,
    Proposed,
    figures,
    judge,
    rows,
)
from sum_drake.bench.detect_report import report_page
from sum_drake.detection import metrics
from sum_drake.detection.dataset import ImageSet
from sum_drake.objects import load_catalogue

K = len(LABELS)


@pytest.fixture(scope="module")
def cards(tmp_path_factory):
    return write_cards(tmp_path_factory.mktemp("cards"), {"test": 4, "shift": 3})


@pytest.fixture(scope="module")
def sets(cards):
    return {split: ImageSet(cards, split) for split in (TEST, SHIFT)}


def measure(split, index, image, *, miss=(), mistake=(), false=0):
    """A picture of which some objects are missed or mistaken for the other label, with boxes where nothing is."""
    boxes, probabilities = [], []
    for i, one in enumerate(image.objects):
        if i in miss:
            continue
        label = 1 + LABELS.index(one.label)
        row = np.full(1 + K, 0.05)
        row[(label % K) + 1 if i in mistake else label] = 0.9
        boxes.append(one.box)
        probabilities.append(row)
    for k in range(false):
        boxes.append((10.0 * k, 470.0, 8.0, 8.0))
        probabilities.append(np.array([0.3, 0.6, 0.1]))
    true = np.array([np.eye(1 + K)[1 + LABELS.index(one.label)] for one in image.objects])
    scored = metrics.scored_image(image, LABELS, boxes, probabilities, true)
    exact = metrics.proposal_overlaps(scored.true_boxes, image, COUNTS)
    names = ("edge_boxes", "edge_boxes_full") if split == TEST else ()
    proposals = {name: Proposed(exact, 2, 0.25) for name in names}
    return Measured(split, index, scored, 0.5 + 0.1 * index, proposals, 300.0 + index)


@pytest.fixture
def measured(sets):
    """8 objects in test, of which one is missed and one mistaken; 6 in shift, all found; 2 boxes on nothing."""
    errors = {(TEST, 0): {"miss": (0,)}, (TEST, 1): {"mistake": (1,)}, (TEST, 3): {"false": 2}}
    return [
        measure(split, index, pictures[index], **errors.get((split, index), {}))
        for split, pictures in sets.items()
        for index in range(len(pictures))
    ]


def test_figures_are_those_of_the_errors_that_were_made(measured):
    found = figures(measured, 0.5)
    assert set(AIMS) <= set(found)
    assert found["recall"] == 6 / 8
    assert found["false_positives_per_image"] == 3 / 4
    assert (found["recall_shift"], found["false_positives_per_image_shift"]) == (1.0, 0.0)
    assert found["map50_shift"] == found["map50_95_shift"] == 1.0
    assert 0.5 < found["map50"] < 1.0
    assert found["top1_on_true_boxes"] == 1.0
    assert found["edge_boxes_recall50_300"] == found["edge_boxes_recall70_300"] == 1.0
    assert found["calibration_error_of_detections_shift"] == pytest.approx(0.1), "said .9, and was always right"
    assert found["cpu_s_per_image"] == pytest.approx(np.mean([0.5, 0.6, 0.7, 0.8, 0.5, 0.6, 0.7]))
    assert found["peak_memory_mib"] == 303.0


def test_a_stricter_threshold_drops_what_it_should(measured):
    found = figures(measured, 0.7)
    assert found["recall"] == 6 / 8
    assert found["false_positives_per_image"] == 1 / 4, "the two at .6 are gone"
    assert figures(measured, 0.95)["recall"] == 0.0


def test_rows_name_what_was_missed_and_what_was_false(measured):
    table = rows(measured, LABELS, 0.5)
    pictures = [row for row in table if row["table"] == "image"]
    assert [row["missed"] for row in pictures[:4]] == [["red"], ["green"], [], []]
    assert [row["false"] for row in pictures[:4]] == [[], ["red"], [], ["red", "red"]]
    by_label = {(row["split"], row["label"]): row for row in table if row["table"] == "label"}
    assert by_label[TEST, "red"]["recall"] == by_label[TEST, "green"]["recall"] == 3 / 4
    assert by_label[TEST, "red"]["precision"] == 3 / 6
    assert sum(row["objects"] for row in table if row["table"] == "visible_share" and row["split"] == TEST) == 8
    costs = {row["proposer"]: row["cpu_s"] for row in table if row["table"] == "proposers"}
    assert costs == {"edge_boxes": 0.25, "edge_boxes_full": 0.25}
    by_count = {
        row["boxes"]: row["recall50"] for row in table if row.get("proposer") == "edge_boxes" and "boxes" in row
    }
    assert by_count == {1: 0.5, 2: 1.0}, "no more boxes than there are"


def test_aims_that_are_missed_are_said_to_be(measured):
    found = figures(measured, 0.5)
    lines = {line.split()[0]: line for line in format_figures(found, AIMS).splitlines()}
    assert lines["recall"].endswith("at least 0.9: missed")
    assert lines["cpu_s_per_image"].endswith("at most 1.2: reached")
    assert not reached(AIMS, "recall", float("nan"))


def test_the_page_shows_the_worst_pictures_first(measured, sets):
    html = report_page(measured, figures(measured, 0.5), rows(measured, LABELS, 0.5), LABELS, 0.5, sets)
    assert html.count("data:image/jpeg") == 7
    at = [html.index(f"<figcaption>{name}:") for name in ("test/00001/0", "test/00003/0", "test/00000/0")]
    assert at == sorted(at)
    assert "test/00003/0: 0 missed, 2 false" in html
    assert "http://" not in html.replace("http://www.w3.org/2000/svg", ""), "it opens without a network"
    assert judge(measured[1].scored, 0.5).errors == 2


def test_the_whole_bench_measures_what_the_network_says(cards, tmp_path, monkeypatch):
    monkeypatch.setattr(detect, "QUICK_IMAGES", 1)
    weights = write_untrained(tmp_path / "w.safetensors", LABELS, threshold=0.3)
    catalogue = _Cards()
    out, told = tmp_path / "out", []
    found = bench_detect(
        out, catalogue, quick=True, data=cards, weights=weights, workers=1, progress=lambda *now: told.append(now)
    )
    results = json.loads((out / "results.json").read_text())
    assert results["schema"] == "sum-drake/bench/1"
    assert (results["bench"], results["quick"], results["seeds"]) == ("detect", True, {"dataset": 0})
    assert results["settings"]["images"] == {"test": 1, "shift": 1}, "as many as asked for, of those there are"
    assert results["figures"] == pytest.approx(found, nan_ok=True)
    assert set(AIMS) <= set(found)
    assert 0 < found["cpu_s_per_image"] < 10
    assert 50 < found["peak_memory_mib"] < 2000
    assert found["edge_boxes_recall50_300"] == 1.0, "cards on grey are easily found"
    assert (out / "report.html").read_text().startswith("<!DOCTYPE html>")
    assert told[-1] == ("measuring", 2, 2)


class _Cards:
    """A catalogue, as far as the bench asks."""

    labels = LABELS


def test_other_labels_and_missing_files_are_refused_before_anything_is_rendered(cards, tmp_path):
    weights = write_untrained(tmp_path / "w.safetensors", LABELS)
    out = tmp_path / "out"
    with pytest.raises(InputError, match="no 'tide'"):
        bench_detect(out, load_catalogue(), data=cards, weights=weights)
    with pytest.raises(InputError, match="no such file"):
        bench_detect(out, _Cards(), data=cards, weights=tmp_path / "none")
    with pytest.raises(InputError, match="no data set"):
        bench_detect(out, _Cards(), data=tmp_path, weights=weights)
    other = write_untrained(tmp_path / "other.safetensors", ("mug", "toy"))
    catalogue = _Cards()
    catalogue.labels = ("mug", "toy")
    with pytest.raises(InputError, match="other labels"):
        bench_detect(out, catalogue, data=cards, weights=other)
    assert not out.exists()


def test_pictures_are_rendered_where_none_are_given(tmp_path, monkeypatch):
    """One of each split, of scenes that training never draws, and nothing of them is left behind."""
    monkeypatch.setattr(detect, "QUICK_IMAGES", 1)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    catalogue, told = load_catalogue(), []
    weights = write_untrained(tmp_path / "w.safetensors", catalogue.labels, threshold=0.5)
    bench_detect(
        tmp_path / "out", catalogue, quick=True, seed=3, weights=weights, workers=1,
        progress=lambda *now: told.append(now),
    )  # fmt: skip
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["seeds"] == {"dataset": 3}
    assert [row["name"] for row in results["rows"] if row["table"] == "image"] == ["test/00000/0", "shift/00000/0"]
    assert told[:3] == [("rendering", 0, 2), ("test/00000", 1, 2), ("shift/00000", 2, 2)]
    assert {path.name for path in tmp_path.iterdir()} == {"out", "w.safetensors"}
