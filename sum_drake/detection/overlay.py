"""Pictures with boxes on them."""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Box

Color = tuple[int, int, int]


@dataclasses.dataclass(frozen=True)
class MarkedBox:
    """A box, its colour (RGB), and the words that stand at it, if any."""

    box: Box
    color: Color
    words: str = ""
    dashed: bool = False


def draw_boxes(picture: NDArray[np.uint8], marked: Sequence[MarkedBox]) -> NDArray[np.uint8]:
    """A copy of a picture (h, w, 3), RGB, with boxes; words are moved until none covers another."""
    image = np.array(picture)
    thick = max(2, round(max(image.shape[:2]) / 400))
    for one in marked:
        x, y, w, h = one.box
        left, top, right, bottom = (round(value) for value in (x, y, x + w - 1, y + h - 1))
        if one.dashed:
            _dashed(image, (left, top, right, bottom), one.color, thick)
        else:
            # Dark around bright, so that it shows on anything.
            cv2.rectangle(image, (left, top), (right, bottom), (0, 0, 0), thick + 2)
            cv2.rectangle(image, (left, top), (right, bottom), one.color, thick)
    placed: list[tuple[int, int, int, int]] = []
    for one in marked:
        if one.words:
            placed.append(_words(image, one, placed, 0.42 * max(1.0, max(image.shape[:2]) / 640)))
    return image


def _dashed(image: NDArray[np.uint8], sides: tuple[int, int, int, int], color: Color, thick: int) -> None:
    left, top, right, bottom = sides
    dash = 5 * thick
    for x in range(left, right, 2 * dash):
        for y in (top, bottom):
            cv2.line(image, (x, y), (min(x + dash, right), y), color, thick)
    for y in range(top, bottom, 2 * dash):
        for x in (left, right):
            cv2.line(image, (x, y), (x, min(y + dash, bottom)), color, thick)


def _words(
    image: NDArray[np.uint8], one: MarkedBox, placed: Sequence[tuple[int, int, int, int]], size: float
) -> tuple[int, int, int, int]:
    """Writes the words over the box's upper edge, or as near as there is room; returns where: x, y, w, h."""
    (width, height), baseline = cv2.getTextSize(one.words, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    width, height = width + 4, height + baseline
    rows, columns = image.shape[:2]
    x = int(np.clip(one.box[0], 0, max(columns - width, 0)))
    first = int(np.clip(one.box[1] - height, 0, max(rows - height, 0)))
    y = next((y for y in _outwards(first, rows - height) if not _covered(x, y, width, height, placed)), first)
    cv2.rectangle(image, (x, y), (x + width, y + height), one.color, cv2.FILLED)
    ink = (16, 16, 16) if np.dot(one.color, (0.299, 0.587, 0.114)) > 110 else (255, 255, 255)
    cv2.putText(image, one.words, (x + 2, y + height - baseline), cv2.FONT_HERSHEY_SIMPLEX, size, ink, 1, cv2.LINE_AA)
    return x, y, width, height


def _outwards(first: int, last: int) -> list[int]:
    """Rows 0..last, nearest to `first` first."""
    return sorted(range(max(last, 0) + 1), key=lambda y: abs(y - first))


def _covered(x: int, y: int, w: int, h: int, placed: Sequence[tuple[int, int, int, int]]) -> bool:
    return any(x < x1 + w1 and x1 < x + w and y < y1 + h1 and y1 < y + h for x1, y1, w1, h1 in placed)
