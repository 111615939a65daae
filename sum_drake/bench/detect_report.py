"""report.html of `sum-drake bench detect`: tables, plots, and the pictures with the most errors."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake import page
from sum_drake.bench.aims import figure_table
from sum_drake.bench.detect_figures import (
    AIMS,
    COUNTS,
    SHIFT,
    TEST,
    Measured,
    Proposed,
    Verdict,
    by_proposer,
    judge,
)
from sum_drake.detection import metrics
from sum_drake.detection.dataset import ImageSet
from sum_drake.detection.metrics import ScoredImage
from sum_drake.detection.overlay import Color, MarkedBox, draw_boxes
from sum_drake.detection.reliability import box_reliability, label_reliability
from sum_drake.plots import Series, line_plot, matrix_plot
from sum_drake.types import Array

WORST = 36
"""Pictures of each split shown."""
_RIGHT, _FALSE, _MISSED, _LEFT_OUT = (90, 220, 120), (240, 70, 60), (255, 180, 40), (190, 190, 190)


def report_page(
    measured: Sequence[Measured],
    found: Mapping[str, float],
    table: Sequence[Mapping[str, Any]],
    labels: Sequence[str],
    threshold: float,
    sets: Mapping[str, ImageSet],
) -> str:
    """The page: figures, tables, plots, and the worst pictures of each split.

    Args:
        measured: of both splits.
        found, table: its figures and rows.
        labels, threshold: the detector's.
        sets: the pictures by split.
    """
    images = {split: [one.scored for one in measured if one.split == split] for split in (TEST, SHIFT)}
    parts = [
        "<h1>Detector</h1>",
        f"<p>{len(images[TEST])} pictures like those it was trained on ({TEST}) and {len(images[SHIFT])} under lights, "
        f"textures, shapes and a shading it never saw ({SHIFT}), each of a scene of its own; working threshold "
        f"{threshold:.3f}, from the weights.</p>",
        page.tiles([(name.replace("_", " "), f"{found[name]:.3f}") for name in AIMS if name in found]),
        "<h2>Figures</h2>",
        figure_table(found, AIMS),
        "<h2>Plots</h2>",
        f'<div class="plots">{"".join(_plots(images, measured, labels, threshold))}</div>',
        "<h2>By label</h2>",
        _label_table(table, labels),
        "<h2>By visible share</h2>",
        _share_table(table),
        "<h2>Proposals</h2>",
        _proposal_table(table),
    ]
    for split in (TEST, SHIFT):
        parts += [f"<h2>The worst of {len(images[split])} pictures, {split}</h2>", _LEGEND]
        parts.append(_gallery([one for one in measured if one.split == split], sets[split], labels, threshold))
    return page.page("Detector", parts)


_LEGEND = (
    '<p class="legend">Green: right, with its probability. Red: false. Orange, dashed: missed. Grey, dashed: too small '
    "or too hidden to be asked for.</p>"
)


def _plots(
    images: Mapping[str, Sequence[ScoredImage]], measured: Sequence[Measured], labels: Sequence[str], threshold: float
) -> Iterator[str]:
    share, size = (0.0, 1.0), (525, 330)
    for split in (TEST, SHIFT):
        curves = [metrics.precision_recall(images[split], 1 + i) for i in range(len(labels))]
        yield line_plot(
            [_steps(label, curve) for label, curve in zip(labels, curves, strict=True)],
            title=f"Precision over recall at IoU .5, {split}",
            x_label="recall",
            y_label="precision, at best",
            x_range=share,
            y_range=share,
            size=size,
        )
    recalls = {split: metrics.recall_curve(images[split]) for split in (TEST, SHIFT)}
    yield line_plot(
        [Series(split, [0.0, *false], [0.0, *recall]) for split, (_, recall, false) in recalls.items()],
        title="Recall over false positives",
        x_label="false positives an image",
        y_label="recall",
        x_range=(0.0, 5.0),
        y_range=share,
        size=size,
    )
    as_stated = Series("", share, share, dashed=True)
    boxes = {split: box_reliability(images[split]) for split in (TEST, SHIFT)}
    truths = {split: label_reliability(images[split]) for split in (TEST, SHIFT)}
    for title, found in (("Boxes: does it hold an object of its label?", boxes), ("Labels on true boxes", truths)):
        yield line_plot(
            [as_stated, *(Series(split, one.stated, one.observed, dots=True) for split, one in found.items())],
            title=title,
            x_label="stated probability",
            y_label="observed share",
            x_range=share,
            y_range=share,
            size=size,
        )
    for percent in (50, 70):
        yield line_plot(
            [
                Series(name, COUNTS, metrics.proposal_recall(_overlaps(proposed), percent / 100), dots=True)
                for name, proposed in by_proposer(measured).items()
            ],
            title=f"Recall of proposals at IoU .{percent // 10}, {TEST}",
            x_label="boxes",
            y_label="recall",
            log_x=True,
            y_range=share,
            size=size,
        )
    for split in (TEST, SHIFT):
        yield matrix_plot(
            metrics.confusion_matrix(images[split], threshold),
            ("nothing", *labels),
            ("nothing", *labels),
            title=f"What was taken for what, {split}",
            x_label="said",
            y_label="is",
            cell=25,
        )


def _steps(label: str, curve: metrics.PrecisionRecall) -> Series:
    """The precision envelope from recall 0 on: what average precision is the area under."""
    recall = np.concatenate([[0.0], np.repeat(curve.recall, 2)])[: 2 * len(curve.recall)]
    return Series(label, recall, np.repeat(curve.envelope, 2))


def _overlaps(proposed: Sequence[Proposed]) -> Array:
    return np.concatenate([one.overlaps for one in proposed])


def _label_table(table: Sequence[Mapping[str, Any]], labels: Sequence[str]) -> str:
    of = {(row["split"], row["label"]): row for row in table if row["table"] == "label"}
    shares = ("ap50", "ap50_95", "recall", "precision", "false_positives_per_image")
    lines = []
    for label in labels:
        cells = [page.text(label)]
        for split in (TEST, SHIFT):
            row = of[split, label]
            cells += [str(row["objects"]), *(_share(row[key]) for key in shares)]
        lines.append(cells)
    heads = ("objects", "AP .5", "AP .5:.95", "recall", "precision", "false an image")
    return page.table(("label", *(f"{split} {head}" for split in (TEST, SHIFT) for head in heads)), lines)


def _share_table(table: Sequence[Mapping[str, Any]]) -> str:
    shown = [row for row in table if row["table"] == "visible_share"]
    lines = [
        [row["split"], f"{row['from']:g} to {row['to']:g}", str(row["objects"]), _share(row["recall"])] for row in shown
    ]
    return page.table(("split", "visible", "objects", "recall"), lines)


def _proposal_table(table: Sequence[Mapping[str, Any]]) -> str:
    lines = []
    for one in (row for row in table if row["table"] == "proposers"):
        recalls = [row for row in table if row["table"] == "proposals" and row["proposer"] == one["proposer"]]
        for row in recalls:
            if row["boxes"] in (10, 50, 100, 300, 1000) or row is recalls[-1]:
                lines.append(
                    [
                        page.text(one["proposer"]),
                        str(row["boxes"]),
                        _share(row["recall50"]),
                        _share(row["recall70"]),
                        f"{one['mean_boxes']:.0f}",
                        f"{1000 * one['cpu_s']:.0f} ms",
                    ]
                )
    heads = ("proposer", "first boxes", "recall, IoU .5", "recall, IoU .7", "boxes it makes", "CPU time for all")
    return page.table(heads, lines)


def _gallery(measured: Sequence[Measured], pictures: ImageSet, labels: Sequence[str], threshold: float) -> str:
    """The pictures with the most errors, worst first."""
    judged = [(one, judge(one.scored, threshold)) for one in measured]
    judged.sort(key=lambda pair: (-pair[1].errors, pair[0].scored.name))
    figures = []
    for one, verdict in judged[:WORST]:
        marked = draw_boxes(pictures[one.index].color, _marked(one.scored, verdict, labels))
        words = f"{one.scored.name}: {len(verdict.missed)} missed, {len(verdict.false)} false"
        shown = page.picture(marked, words)
        figures.append(f"<figure>{shown}<figcaption>{page.text(words)}</figcaption></figure>")
    return f'<div class="gallery">{"".join(figures)}</div>'


def _marked(image: ScoredImage, verdict: Verdict, labels: Sequence[str]) -> list[MarkedBox]:
    def box(values: Array) -> tuple[float, float, float, float]:
        x, y, w, h = values.tolist()
        return x, y, w, h

    def said(index: int, color: Color) -> MarkedBox:
        words = f"{labels[verdict.classes[index] - 1]} {verdict.scores[index]:.2f}"
        return MarkedBox(box(image.boxes[index]), color, words)

    left_out = [MarkedBox(box(image.true_boxes[i]), _LEFT_OUT, dashed=True) for i in np.flatnonzero(~image.scored)]
    missed = [
        MarkedBox(box(image.true_boxes[i]), _MISSED, f"missed {labels[image.true_classes[i] - 1]}", dashed=True)
        for i in verdict.missed
    ]
    right, false = [said(i, _RIGHT) for i in verdict.right], [said(i, _FALSE) for i in verdict.false]
    return [*left_out, *right, *missed, *false]


def _share(value: float) -> str:
    return "unknown" if np.isnan(value) else f"{value:.3f}"
