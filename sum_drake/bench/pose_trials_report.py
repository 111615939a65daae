"""The part of `sum-drake bench pose`'s page that is of the paper's experiment: plots, and false positives corrected."""

import dataclasses
from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake import page
from sum_drake.bench.pose_figures import DEGREES, PAPER_BOUNDS, PoseRow, curve
from sum_drake.bench.pose_trials import OBJECTS, Corrected
from sum_drake.detection.overlay import MarkedBox, draw_boxes
from sum_drake.drawing import draw_perception, label_color
from sum_drake.objects import Catalogue
from sum_drake.plots import Series, line_plot
from sum_drake.report_parts import count
from sum_drake.types import Perception

SHOWN = 3
"""Scenes shown in which false positives were corrected."""


def papers_part(
    rows: Sequence[PoseRow],
    found: Mapping[str, float],
    looks: Sequence[Corrected],
    why_not: str,
    catalogue: Catalogue,
) -> list[str]:
    """Accuracy over the detector's true positives, and false positives that the belief corrected; HTML.

    rows: of the experiment alone; looks: at its scenes; why_not: why there are none.
    """
    title = "<h2>The paper's experiment: single scenes, in the trained detector's boxes</h2>"
    if not rows:
        return [title, f"<p>Left out: {page.text(why_not or 'none of its methods was asked for')}.</p>"]
    methods = list(dict.fromkeys(row.method for row in rows))
    scenes, trials = len({row.scene for row in rows}), len({row.seed for row in rows})
    heads = ("method", "2 cm, 20 deg", *(f"area at {100 * metres:.0f} cm" for metres in PAPER_BOUNDS))
    columns = ("within_2cm_20deg", *(f"area_{100 * metres:.0f}cm" for metres in PAPER_BOUNDS))
    told = [[f"trials.{name}.{column}" for column in columns] for name in methods]
    parts = [
        title,
        f"<p>{count(scenes, 'scene')} of {OBJECTS} objects, {count(trials, 'trial')} each: the share, of the boxes "
        "that the detector labels rightly with an intersection over union above .5, whose estimate is within a "
        "translation and a rotation bound. Area: the mean height of a curve. Meshes are off as below.</p>",
        f'<div class="plots">{"".join(paper_plots(rows, methods))}</div>',
        page.table(
            heads,
            [
                (page.text(name), *(f"{found[figure]:.3f}" for figure in row))
                for name, row in zip(methods, told, strict=True)
            ],
        ),
    ]  # fmt: skip
    if looks:
        false, rejected = sum(look.false for look in looks), sum(look.rejected for look in looks)
        parts += [
            "<h3>False positives corrected</h3>",
            f"<p>One look at each scene: {rejected} of {false} hypotheses that have no object of their label in their "
            f"box are rejected; {sum(look.accepted_wrong for look in looks)} accepted ones are wrong. The scenes "
            "with the most false ones: what was detected, all hypotheses, what is accepted.</p>",
        ]
        parts += [_corrected(look, catalogue) for look in _most(looks)]
    return parts


def corrected_sheet(looks: Sequence[Corrected], catalogue: Catalogue) -> NDArray[np.uint8] | None:
    """The page's pictures of corrected false positives as one, (h, w, 3) RGB: a row a look; None where there are none.

    Frames are of one size.
    """
    rows = [_in_three(look, catalogue) for look in _most(looks)]
    if not rows:
        return None
    heads = {words: _head(words, image.shape[1]) for words, image in rows[0].items()}
    return np.asarray(np.vstack([np.hstack([_edged(image) for image in row.values()]) for row in (heads, *rows)]))


def _head(words: str, width: int) -> NDArray[np.uint8]:
    """Words over a column of pictures, (32, width, 3)."""
    head = np.full((32, width, 3), 255, np.uint8)
    cv2.putText(head, words, (8, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (16, 16, 16), 1, cv2.LINE_AA)
    return head


def _edged(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """With a white edge, which keeps pictures side by side apart."""
    return np.asarray(cv2.copyMakeBorder(image, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(255, 255, 255)), np.uint8)


def _most(looks: Sequence[Corrected]) -> list[Corrected]:
    """Those with the most false positives, of those with any."""
    return sorted((look for look in looks if look.false), key=lambda look: (-look.false, -look.rejected))[:SHOWN]


def _in_three(look: Corrected, catalogue: Catalogue) -> dict[str, NDArray[np.uint8]]:
    """A look in three pictures (h, w, 3), as in the paper's figure, by what they show."""
    record, tracks = look.record, look.record.posterior.tracks
    accepted = dataclasses.replace(record.posterior, tracks=tuple(one for one in tracks if one.accepted))
    bare = dataclasses.replace(record, detections=())
    return {
        "detections": draw_boxes(record.frame.color, _marked(record, catalogue)),
        "all hypotheses": draw_perception(bare, catalogue, scale=1),
        "accepted": draw_perception(dataclasses.replace(bare, posterior=accepted), catalogue, scale=1),
    }


def _corrected(look: Corrected, catalogue: Catalogue) -> str:
    """A look's three pictures; HTML."""
    pictures = [
        f"<figure>{page.picture(image, words)}<figcaption>{page.text(words)}</figcaption></figure>"
        for words, image in _in_three(look, catalogue).items()
    ]
    words = f"{look.rejected} of {look.false} false hypotheses rejected"
    return f'<p>{page.text(words)}</p><div class="gallery three">{"".join(pictures)}</div>'


def _marked(record: Perception, catalogue: Catalogue) -> list[MarkedBox]:
    """The detections with their likeliest label and its probability."""
    marked = []
    for one in record.detections:
        label, p_label = one.p_labels[0]
        marked.append(MarkedBox(one.box, label_color(label, catalogue), f"{label} {one.p_box * p_label:.2f}"))
    return marked


def paper_plots(rows: Sequence[PoseRow], methods: Sequence[str]) -> list[str]:
    """Share within a translation bound over a rotation bound: the paper's four plots, SVG."""
    of = {name: [row for row in rows if row.method == name] for name in methods}
    return [
        line_plot(
            [Series(name, DEGREES, curve(of[name], bound, DEGREES)) for name in methods],
            title=f"Within {100 * bound:.0f} cm",
            x_label="rotation bound, degrees",
            y_label="share",
            x_range=(0.0, 180.0),
            y_range=(0.0, 1.0),
            size=(525, 330),
        )
        for bound in PAPER_BOUNDS
    ]  # fmt: skip
