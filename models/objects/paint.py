"""Packaging drawn with OpenCV: pictures of panels, laid out in one texture. Colours are RGB."""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

WHITE, BLACK = (250, 250, 248), (20, 20, 24)
SIZE = 512
"""Width and height of a texture in pixels."""


@dataclasses.dataclass
class Panel:
    """A picture `width` by `height` metres; positions and lengths are in metres from its lower left corner."""

    width: float
    height: float
    colour: Colour
    scale: float = 3000.0  # pixels a metre: drawn large, shrunk into the texture

    def __post_init__(self) -> None:
        shape = (max(round(self.height * self.scale), 4), max(round(self.width * self.scale), 4), 3)
        self.image: Image = np.full(shape, self.colour, np.uint8)

    def _at(self, x: float, y: float) -> tuple[int, int]:
        return round(x * self.scale), round((self.height - y) * self.scale)

    def band(self, low: float, high: float, colour: Colour) -> None:
        """A horizontal band between two heights."""
        self.rectangle(0.0, low, self.width, high, colour)

    def rectangle(self, left: float, low: float, right: float, high: float, colour: Colour) -> None:
        """A filled rectangle."""
        cv2.rectangle(self.image, self._at(left, high), self._at(right, low), colour, -1)

    def polygon(self, points: Sequence[tuple[float, float]], colour: Colour) -> None:
        """A filled polygon."""
        cv2.fillPoly(self.image, [np.array([self._at(*p) for p in points], np.int32)], colour, cv2.LINE_AA)

    def ellipse(self, x: float, y: float, rx: float, ry: float, colour: Colour, angle: float = 0.0) -> None:
        """A filled ellipse; `angle` in degrees, anticlockwise."""
        axes = (max(round(rx * self.scale), 1), max(round(ry * self.scale), 1))
        cv2.ellipse(self.image, self._at(x, y), axes, -angle, 0, 360, colour, -1, cv2.LINE_AA)

    def ring(self, x: float, y: float, r: float, thickness: float, colour: Colour) -> None:
        """A circle's outline."""
        pixels = max(round(thickness * self.scale), 1)
        cv2.circle(self.image, self._at(x, y), round(r * self.scale), colour, pixels, cv2.LINE_AA)

    def line(self, points: Sequence[tuple[float, float]], thickness: float, colour: Colour) -> None:
        """An open stroke through `points`."""
        path = np.array([self._at(*p) for p in points], np.int32)
        cv2.polylines(self.image, [path], False, colour, max(round(thickness * self.scale), 1), cv2.LINE_AA)

    def wave(self, y: float, amplitude: float, period: float, thickness: float, colour: Colour) -> None:
        """A sine across the whole width."""
        x = np.linspace(0, self.width, 120)
        self.line(list(zip(x, y + amplitude * np.sin(2 * np.pi * x / period), strict=True)), thickness, colour)

    def burst(self, x: float, y: float, outer: float, inner: float, points: int, colour: Colour) -> None:
        """A star with `points` rays."""
        angle = np.pi / 2 + np.arange(2 * points) * np.pi / points
        r = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
        self.polygon(list(zip(x + r * np.cos(angle), y + r * np.sin(angle), strict=True)), colour)

    def text(
        self, words: str, x: float, y: float, width: float, colour: Colour, outline: Colour | None = None,
        tallest: float = 1.0,
    ) -> None:  # fmt: skip
        """Centred on (x, y), as wide as `width` unless it would be higher than `tallest`."""
        font, weight = cv2.FONT_HERSHEY_DUPLEX, 3
        (w, h), _ = cv2.getTextSize(words, font, 2.0, weight)
        size = 2.0 * min(width * self.scale / w, tallest * self.scale / h)
        weight = max(round(size * 2.2), 1)
        (w, h), _ = cv2.getTextSize(words, font, size, weight)
        px, py = self._at(x, y)
        origin = (px - w // 2, py + h // 2)
        if outline is not None:
            cv2.putText(self.image, words, origin, font, size, outline, weight + max(round(size * 5), 2), cv2.LINE_AA)
        cv2.putText(self.image, words, origin, font, size, colour, weight, cv2.LINE_AA)

    def barcode(self, x: float, y: float, width: float, height: float) -> None:
        """Bars in a white field, lower left corner at (x, y)."""
        self.rectangle(x, y, x + width, y + height, WHITE)
        bars = "1101001011001110100101100110101101001011"
        step = width * 0.86 / len(bars)
        for k, bar in enumerate(bars):
            if bar == "1":
                left = x + 0.07 * width + k * step
                self.rectangle(left, y + 0.12 * height, left + step, y + 0.9 * height, BLACK)

    def small_print(self, x: float, y: float, width: float, lines: int, pitch: float, colour: Colour) -> None:
        """Lines of unreadable text downward from (x, y): broken strokes of varying length."""
        for k in range(lines):
            end = width * (0.72 + 0.28 * ((k * 7) % 5) / 4)
            gap = width * (0.25 + 0.1 * ((k * 3) % 4))
            level = y - k * pitch
            self.line([(x, level), (x + min(gap, end) - 0.002, level)], pitch * 0.35, colour)
            self.line([(x + min(gap, end), level), (x + end, level)], pitch * 0.35, colour)

    def speckle(self, amount: float, seed: int, grain: int = 3) -> None:
        """Noise of brightness, `amount` of 255 in standard deviation, `grain` pixels wide."""
        h, w, _ = self.image.shape
        noise = np.random.default_rng(seed).normal(0, amount * 255, (h // grain + 1, w // grain + 1, 1))
        noise = np.repeat(np.repeat(noise, grain, 0), grain, 1)[:h, :w]
        self.image = np.clip(self.image + noise, 0, 255).astype(np.uint8)


def around(front: Panel, back: Panel | None = None) -> Panel:
    """The wrap of a loft (its seam is behind) from the pictures of its two halves."""
    other = back or front
    half = other.image.shape[1] // 2
    wrap = Panel(2 * front.width, front.height, front.colour, front.scale)
    wrap.image = np.concatenate([other.image[:, half:], front.image, other.image[:, :half]], axis=1)
    return wrap


def box_wrap(front: Panel, right: Panel, back: Panel, left: Panel) -> Panel:
    """The wrap of a rounded rectangle: half the back, left side (-y), front (+x), right side (+y), half the back."""
    half = back.image.shape[1] // 2
    wrap = Panel(2 * front.width + 2 * right.width, front.height, front.colour, front.scale)
    parts = [back.image[:, half:], left.image, front.image, right.image, back.image[:, :half]]
    wrap.image = np.concatenate(parts, axis=1)
    return wrap


Rectangle = tuple[int, int, int, int]
"""x, y, width, height of a region in the texture, pixels, y down."""


def texture(regions: dict[str, tuple[Rectangle, Panel | Colour]]) -> Image:
    """The texture with every region's picture shrunk into its rectangle."""
    sheet = np.full((SIZE, SIZE, 3), 128, np.uint8)
    for (x, y, w, h), picture in regions.values():
        if isinstance(picture, Panel):
            sheet[y : y + h, x : x + w] = cv2.resize(picture.image, (w, h), interpolation=cv2.INTER_AREA)
        else:
            sheet[y : y + h, x : x + w] = picture
    return sheet
