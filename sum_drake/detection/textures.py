"""Procedural pictures for tables, floors, walls and distractors: plain colours, noise, wood, stripes, marble, cloth ...

The families of `SHIFT` are held out: no picture of a training, validation or ordinary test scene is of their kind.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.types import Array

Texture = NDArray[np.uint8]
"""(n, n, 3), RGB."""
Painter = Callable[[np.random.Generator, int], Array]
"""A generator and a side n in pixels to colours (n, n, 3) in [0, 1]."""


def draw_texture(rng: np.random.Generator, *, shift: bool = False, size: int = 256) -> Texture:
    """A picture (size, size, 3) of a family drawn from `TRAIN`, or from `SHIFT`."""
    families = SHIFT if shift else TRAIN
    return paint(tuple(families)[rng.integers(len(families))], rng, size=size)


def paint(family: str, rng: np.random.Generator, *, size: int = 256) -> Texture:
    """A picture (size, size, 3) of one family. Raises KeyError for a family that is neither in TRAIN nor in SHIFT."""
    colors = {**TRAIN, **SHIFT}[family](rng, size)
    texture: Texture = np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)
    return texture


def draw_color(rng: np.random.Generator) -> Array:
    """An RGB colour (3,) in [0, 1]: half of them muted, as of furniture, half of any saturation."""
    muted = rng.random() < 0.5
    hue, saturation, value = rng.random(), rng.uniform(0, 0.35 if muted else 1.0), rng.uniform(0.15, 0.95)
    wheel = np.clip(np.abs((6 * hue + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1, 0, 1)
    return np.asarray(value * (1 - saturation * (1 - wheel)))


# --- what the families are made of -----------------------------------------------------------------------------------


def _noise(rng: np.random.Generator, size: int, cells: tuple[int, int], octaves: int = 4) -> Array:
    """Fractal value noise (size, size) in [0, 1] of about `cells` (down, across) bumps."""
    total = np.zeros((size, size))
    for octave in range(octaves):
        grid = rng.random((max(cells[0] << octave, 2), max(cells[1] << octave, 2)))
        total += cv2.resize(grid, (size, size), interpolation=cv2.INTER_CUBIC) / 2**octave
    low, high = total.min(), total.max()
    return np.asarray((total - low) / max(high - low, 1e-9))


def _mix(a: Array, b: Array, share: Array) -> Array:
    """Colour a where share (n, n) is 0, b where it is 1; a and b are (3,) or (n, n, 3)."""
    return np.asarray(a + (b - a) * share[..., None])


def _two_colors(rng: np.random.Generator) -> tuple[Array, Array]:
    """Two colours, half the time shades of one."""
    a = draw_color(rng)
    b = np.clip(a * rng.uniform(0.4, 1.6), 0, 1) if rng.random() < 0.5 else draw_color(rng)
    return a, b


def _coordinates(rng: np.random.Generator, size: int, *, straight: float = 0.5) -> tuple[Array, Array]:
    """x and y (size, size) over [0, 1], turned by a random angle, or with probability `straight` not at all."""
    angle = 0.0 if rng.random() < straight else rng.uniform(0, np.pi)
    v, u = np.mgrid[:size, :size] / size
    return np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u


def _grain(rng: np.random.Generator, size: int, amount: float) -> Array:
    """Unevenness (size, size, 1) around 1, to multiply colours with."""
    return np.asarray(1 + amount * (_noise(rng, size, (4, 4), 6)[..., None] - 0.5))


def _cells(rng: np.random.Generator, size: int, count: int) -> tuple[NDArray[np.int64], Array]:
    """Voronoi cells of `count` random points: index of the nearest (size, size), and how much farther the next is."""
    from scipy.spatial import cKDTree

    v, u = np.mgrid[:size, :size] / size
    distance, nearest = cKDTree(rng.random((count, 2))).query(np.stack([u, v], -1), k=2)
    return nearest[..., 0], distance[..., 1] - distance[..., 0]


def _ink(rng: np.random.Generator) -> list[int]:
    """A colour for OpenCV's drawing, which wants bytes."""
    return [int(c) for c in np.rint(255 * draw_color(rng))]


# --- families of training --------------------------------------------------------------------------------------------


def _plain(rng: np.random.Generator, size: int) -> Array:
    return draw_color(rng) * _grain(rng, size, rng.uniform(0, 0.15))


def _clouds(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    cells = int(rng.integers(2, 12))
    return _mix(a, b, _noise(rng, size, (cells, cells)))


def _wood(rng: np.random.Generator, size: int) -> Array:
    light = np.array([rng.uniform(0.45, 0.85), rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.4)])
    rings = _noise(rng, size, (1, int(rng.integers(3, 10))), 2) * rng.uniform(3, 12)
    fibres = _noise(rng, size, (2, size // 6), 2)
    share = 0.6 * (0.5 + 0.5 * np.sin(2 * np.pi * rings)) + 0.4 * fibres
    planks = int(rng.integers(1, 6))
    plank = np.arange(size) * planks // size
    shade = rng.uniform(0.85, 1.1, planks)[plank] * np.where(np.diff(plank, prepend=0) > 0, 0.5, 1.0)
    colors = _mix(light, light * rng.uniform(0.5, 0.8), share) * shade[None, :, None]
    return np.swapaxes(colors, 0, 1) if rng.random() < 0.5 else colors


def _stripes(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    x, _ = _coordinates(rng, size)
    wave = x * rng.uniform(3, 25) % 1.0
    return _mix(a, b, (wave < rng.uniform(0.2, 0.8)).astype(float)) * _grain(rng, size, 0.1)


def _checks(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    x, y = _coordinates(rng, size)
    n = rng.uniform(2, 14)
    return _mix(a, b, (np.floor(x * n) + np.floor(y * n)) % 2) * _grain(rng, size, 0.1)


def _gradient(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    x, _ = _coordinates(rng, size, straight=0.2)
    return _mix(a, b, (x - x.min()) / np.ptp(x)) * _grain(rng, size, 0.1)


def _speckle(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    dots = cv2.GaussianBlur(rng.random((size, size)), (0, 0), rng.uniform(0.6, 2.0))
    return _mix(a, b, (dots > np.quantile(dots, rng.uniform(0.7, 0.97))).astype(float))


def _blotches(rng: np.random.Generator, size: int) -> Array:
    colors = draw_color(rng) * np.ones((size, size, 1))
    for _ in range(int(rng.integers(1, 4))):
        cells = int(rng.integers(2, 10))
        field = _noise(rng, size, (cells, cells), 3)
        colors = _mix(colors, draw_color(rng), (field > np.quantile(field, rng.uniform(0.5, 0.8))).astype(float))
    return colors


def _print(rng: np.random.Generator, size: int) -> Array:
    """Boxes, discs and letters on a ground: what packaging looks like that is none of ours."""
    canvas = np.full((size, size, 3), _ink(rng), np.uint8)
    for _ in range(int(rng.integers(2, 8))):
        x, y = (int(i) for i in rng.integers(0, size, 2))
        w, h = (int(i) for i in rng.integers(size // 12, size // 2, 2))
        color, kind = _ink(rng), rng.integers(3)
        if kind == 0:
            cv2.rectangle(canvas, (x - w // 2, y - h // 2), (x + w // 2, y + h // 2), color, -1)
        elif kind == 1:
            cv2.ellipse(canvas, (x, y), (w // 2, h // 2), float(rng.uniform(0, 180)), 0, 360, color, -1, cv2.LINE_AA)
        else:
            word = "".join(chr(65 + int(i)) for i in rng.integers(0, 26, int(rng.integers(2, 7))))
            scale = size / 256 * float(rng.uniform(0.5, 2.2))
            cv2.putText(canvas, word, (x - w // 2, y), cv2.FONT_HERSHEY_DUPLEX, scale, color, 2, cv2.LINE_AA)
    return canvas / 255


# --- families held out -----------------------------------------------------------------------------------------------


def _marble(rng: np.random.Generator, size: int) -> Array:
    a, b = _two_colors(rng)
    x, y = _coordinates(rng, size, straight=0)
    warp = rng.uniform(1, 3) * _noise(rng, size, (3, 3), 6)
    veins = np.abs(np.sin(np.pi * (rng.uniform(1, 4) * x + 0.3 * y + warp))) ** rng.uniform(0.15, 0.6)
    return _mix(b, a, veins)


def _fabric(rng: np.random.Generator, size: int) -> Array:
    """A weave: warp and weft take turns on top."""
    warp, weft = _two_colors(rng)
    v, u = np.mgrid[:size, :size] / size * rng.integers(16, 48)
    over = (np.floor(u) + np.floor(v)) % 2
    thread = np.where(over > 0, np.sin(np.pi * (u % 1)), np.sin(np.pi * (v % 1)))
    shade: Array = (0.55 + 0.45 * thread[..., None]) * _grain(rng, size, 0.2)
    return _mix(warp, weft, over) * shade


def _terrazzo(rng: np.random.Generator, size: int) -> Array:
    count = int(rng.integers(60, 400))
    cell, gap = _cells(rng, size, count)
    chips = np.array([draw_color(rng) for _ in range(6)])[rng.integers(0, 6, count)]
    chip = (rng.random(count) < rng.uniform(0.3, 0.7))[cell] & (gap > 0.25 / np.sqrt(count))
    return _mix(draw_color(rng) * _grain(rng, size, 0.1), chips[cell], chip.astype(float))


def _tiles(rng: np.random.Generator, size: int) -> Array:
    """Tiles or bricks with grout between them, each of its own shade."""
    rows = int(rng.integers(3, 12))
    columns = max(1, rows // int(rng.integers(1, 4)))
    v, u = np.mgrid[:size, :size] / size
    row = np.floor(v * rows)
    x = u * columns + (0.5 * (row % 2) if rng.random() < 0.5 else 0.0)
    tile, grout = _two_colors(rng)
    shade = rng.uniform(0.75, 1.15, (rows, columns + 1))[row.astype(int), np.floor(x).astype(int)]
    width = rng.uniform(0.03, 0.12)
    joint = (v * rows % 1 < width) | (x % 1 < width * columns / rows)
    return _mix(tile * shade[..., None], grout, joint.astype(float)) * _grain(rng, size, 0.15)


def _scales(rng: np.random.Generator, size: int) -> Array:
    """Round scales in rows, the lower over the upper."""
    n = int(rng.integers(5, 16))
    v, u = np.mgrid[:size, :size] / size * n
    distance = np.full((size, size), np.inf)
    for row in (np.floor(v), np.floor(v) + 1):
        x = (u + 0.5 * (row % 2)) % 1 - 0.5
        reach = np.hypot(x, v - row + 0.1)
        distance = np.where(reach < 0.75, np.minimum(distance, reach), distance)
    a, b = _two_colors(rng)
    return _mix(a, b, np.clip(distance / 0.75, 0, 1) ** 2)


def _polygons(rng: np.random.Generator, size: int) -> Array:
    """Overlapping triangles in a few colours: print that looks like no label."""
    canvas = np.full((size, size, 3), _ink(rng), np.uint8)
    palette = [_ink(rng) for _ in range(5)]
    for _ in range(int(rng.integers(6, 30))):
        corners = rng.uniform(0, size, 2) + rng.normal(0, size / 6, (3, 2))
        cv2.fillConvexPoly(canvas, corners.astype(np.int32), palette[rng.integers(5)], cv2.LINE_AA)
    return canvas / 255


TRAIN: dict[str, Painter] = {
    "plain": _plain, "clouds": _clouds, "wood": _wood, "stripes": _stripes, "checks": _checks,
    "gradient": _gradient, "speckle": _speckle, "blotches": _blotches, "print": _print,
}  # fmt: skip
"""Families that training, validation and ordinary test scenes draw from."""
SHIFT: dict[str, Painter] = {
    "marble": _marble, "fabric": _fabric, "terrazzo": _terrazzo, "tiles": _tiles, "scales": _scales,
    "polygons": _polygons,
}  # fmt: skip
"""Families that only scenes of the split `shift` draw from."""
