"""What a product is made of, and how its print is laid out.

Brands are the paper's or invented; the artwork is our own.
"""

import dataclasses

import numpy as np

from sum_drake.models.objects.paint import Colour, Panel, Rectangle
from sum_drake.models.objects.shapes import Part, Piece

YCB = "Calli et al. 2015, YCB object set, "
PACK = "nominal pack size, rounded to 5 mm: "


@dataclasses.dataclass
class Product:
    """All that build_objects.py writes out of one object."""

    label: str
    category: str
    symmetry: str
    mass: float
    source: str
    parts: list[Part]
    pieces: list[Piece]
    regions: dict[str, tuple[Rectangle, Panel | Colour]]
    modulus: float = 1e7
    """Hydroelastic modulus, Pa. Light things need a lower one: a stiff contact throws them at steps of 4 ms."""


# Layout of a texture: the wrap of the body above, smaller things in a strip below.
BODY: Rectangle = (0, 0, 512, 384)
STRIP = ((0, 384, 128, 128), (128, 384, 128, 128), (256, 384, 128, 128), (384, 384, 128, 128))


def perimeter(part: Part) -> float:
    """Length of the horizontal outline of an upright part, metres, nearly enough to lay out its print."""
    x, y, _ = np.ptp(part.vertices, axis=0)
    a, b = x / 2, y / 2
    return float(np.pi * (3 * (a + b) - np.sqrt((3 * a + b) * (a + 3 * b))) * 1.04)


def ribbed(colour: Colour, dark: Colour, ribs: int = 24) -> Panel:
    """A screw cap's side: fine vertical ribs."""
    panel = Panel(0.12, 0.04, colour)
    for k in range(ribs):
        x = (k + 0.5) * 0.12 / ribs
        panel.rectangle(x - 0.0008, 0.006, x + 0.0008, 0.034, dark)
    return panel
