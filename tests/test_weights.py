"""Weights on disk: what is written is what is read, and what is wrong is said in one line."""

import dataclasses
import json

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from sum_drake.assets import InputError
from sum_drake.detection.calibration import Calibration
from sum_drake.detection.network import Network
from sum_drake.detection.weights import Weights, load_weights, save_weights

LABELS = ("tide", "mug", "toy")


@pytest.fixture(scope="module")
def weights():
    torch.manual_seed(0)
    network = Network(4, width=24, hidden=32)
    return Weights(LABELS, 24, 32, network.state_dict(), Calibration(1.5, -0.2, 0.8), threshold=0.4)


@pytest.fixture
def file(weights, tmp_path):
    save_weights(tmp_path / "detector.safetensors", weights)
    return tmp_path / "detector.safetensors"


def test_what_is_written_is_read(weights, file):
    read = load_weights(file, labels=LABELS)
    assert (read.labels, read.calibration, read.threshold) == (LABELS, weights.calibration, 0.4)
    picture = torch.rand(1, 3, 64, 64) * 255
    with torch.inference_mode():
        a, b = (one.network().features(picture) for one in (weights, read))
    assert torch.allclose(a, b, atol=0.05)


def test_file_is_half_precision_and_its_hash_that_of_its_bytes(weights, tmp_path):
    import hashlib

    path = tmp_path / "w.safetensors"
    sha256 = save_weights(path, weights)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == sha256
    count = sum(int(np.prod(tensor.shape)) for tensor in weights.tensors.values())
    assert path.stat().st_size < 2 * count + 30_000


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"nothing.safetensors: no such file"):
        load_weights(tmp_path / "nothing.safetensors")


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
def test_truncated_file(file, share):
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"detector.safetensors: .*expected") as caught:
        load_weights(file)
    assert "\n" not in str(caught.value)


def test_foreign_files(file, tmp_path):
    (tmp_path / "text.safetensors").write_text("not weights at all")
    save_file({"a": torch.zeros(3)}, tmp_path / "other.safetensors")
    for name in ("text", "other"):
        with pytest.raises(InputError, match=rf"{name}.safetensors"):
            load_weights(tmp_path / f"{name}.safetensors")


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (("tide", "mug", "banana"), "knows no 'banana'"),
        (("unicorn",), "expected weights trained on the catalogue"),
    ],
)
def test_other_class_list(file, labels, words):
    with pytest.raises(InputError, match=words):
        load_weights(file, labels=labels)


def test_some_of_its_labels_in_any_order_will_do(file):
    assert load_weights(file, labels=("mug", "tide")).labels == ("tide", "mug", "toy")


def test_tensors_that_do_not_fit(weights, tmp_path):
    path = tmp_path / "w.safetensors"
    save_weights(path, dataclasses.replace(weights, hidden=33))
    with pytest.raises(InputError, match="fit their own description") as caught:
        load_weights(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"threshold": float("nan")}, "threshold: nan; expected a probability"),
        ({"threshold": -1}, "threshold: -1; expected a probability"),
        ({"threshold": None}, "threshold: None; expected a probability"),
        ({"labels": [0, 1, 2]}, "labels: .*expected a list of names"),
        ({"labels": "mug"}, "labels: mug; expected a list of names"),
        ({"labels": ["mug"] * 3}, "named twice"),
        ({"labels": ["one"]}, "1 labels for a network of 3"),
        ({"calibration": {"box_temperature": 0.0}}, "box_temperature is 0"),
        ({"calibration": {"label_temperature": float("inf")}}, "label_temperature is inf"),
        ({"calibration": {"warmth": 1.0}}, "warmth"),
    ],
)
def test_metadata_that_cannot_be(file, tmp_path, change, words):
    with safe_open(file, framework="pt") as opened:
        about = json.loads(opened.metadata()["sum-drake"])
        tensors = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118  # no mapping
    spoiled = tmp_path / "spoiled.safetensors"
    save_file(tensors, spoiled, metadata={"sum-drake": json.dumps(about | change)})
    with pytest.raises(InputError, match=rf"spoiled.safetensors: .*{words}"):
        load_weights(spoiled)
    del about["threshold"]
    save_file(tensors, spoiled, metadata={"sum-drake": json.dumps(about)})
    with pytest.raises(InputError, match="its metadata lacks 'threshold'"):
        load_weights(spoiled)
