"""The fifteen products: shape, print and physics of each. Brands are the paper's; the artwork is our own."""

import dataclasses
from collections.abc import Callable

import numpy as np

from sum_drake.models.objects.paint import BLACK, WHITE, Colour, Panel, Rectangle, around, box_wrap
from sum_drake.models.objects.shapes import (
    Part,
    Piece,
    Section,
    box,
    capsules,
    curve,
    cylinder,
    hulls,
    loft,
    revolve,
    rounded_rectangle,
    smooth,
    stack,
    sweep,
    wedges,
)  # fmt: skip

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


def tide() -> Product:
    """A flat-sided jug; the upper body leaves room for a handle that is a real hole."""
    outline: list[Section] = [
        (0.000, 0.036, 0.074, 4.0, 0, 0), (0.003, 0.0400, 0.0780, 4.2, 0, 0), (0.012, 0.0425, 0.0800, 4.5, 0, 0),
        (0.095, 0.0425, 0.0800, 4.5, 0, 0), (0.112, 0.0422, 0.0780, 4.5, 0, -0.002),
        (0.124, 0.0418, 0.0630, 4.2, 0, -0.017), (0.136, 0.0412, 0.0520, 4.0, 0, -0.027),
        (0.165, 0.0380, 0.0450, 3.2, 0, -0.030), (0.180, 0.0310, 0.0340, 2.4, 0, -0.030),
        (0.188, 0.0250, 0.0250, 2.0, 0, -0.030), (0.200, 0.0250, 0.0250, 2.0, 0, -0.030),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body")
    cap_rows: list[Section] = [
        (0.186, 0.0290, 0.0290, 2.0, 0, -0.030), (0.189, 0.0310, 0.0310, 2.0, 0, -0.030),
        (0.228, 0.0285, 0.0285, 2.0, 0, -0.030), (0.232, 0.0265, 0.0265, 2.0, 0, -0.030),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 32, top="cap_top")
    grip = curve(
        [(0, -0.002, 0.158, 0.014, 0.012), (0, 0.030, 0.167, 0.0135, 0.0115), (0, 0.058, 0.157, 0.013, 0.0105),
         (0, 0.0675, 0.132, 0.013, 0.0105), (0, 0.066, 0.100, 0.014, 0.0115)], 18,
    )  # fmt: skip
    handle = sweep(grip, "handle", 16)

    orange, deep, blue, yellow = (240, 108, 24), (214, 78, 12), (24, 54, 142), (255, 205, 40)
    width = perimeter(body) / 2
    front = Panel(width, 0.24, orange)
    front.band(0, 0.018, deep)
    x = width / 2 - 0.004
    for r, colour in ((0.056, yellow), (0.047, (250, 140, 30)), (0.039, yellow), (0.031, (232, 70, 20))):
        front.ellipse(x, 0.085, r, r * 0.98, colour)
    front.text("TIDE", x, 0.087, 0.098, blue, WHITE)
    front.text("ORIGINAL", x, 0.047, 0.052, WHITE)
    front.rectangle(x - 0.03, 0.022, x + 0.03, 0.033, blue)
    front.text("32 LOADS", x, 0.0275, 0.045, WHITE)
    back = Panel(width, 0.24, orange)
    back.band(0, 0.018, deep)
    back.rectangle(x - 0.05, 0.025, x + 0.05, 0.125, WHITE)
    back.text("DIRECTIONS", x, 0.115, 0.06, blue)
    back.small_print(x - 0.045, 0.103, 0.09, 9, 0.006, (90, 90, 100))
    back.barcode(x + 0.005, 0.028, 0.04, 0.02)
    return Product(
        "tide", "cleaning", "none", 0.95, PACK + "1.36 l (46 fl oz) jug, 85 x 160 x 230 mm; half used",
        [body, cap, handle],
        [*hulls(rows, [0.0, 0.112, 0.136], 16), *hulls(rows, [0.136, 0.188], 14),
         cylinder((0, -0.03, 0.186), (0, -0.03, 0.232), 0.0305), *capsules(grip[4:15], 4)],
        {
            "body": (BODY, around(front, back)),
            "cap": (STRIP[0], ribbed(blue, (16, 36, 100))),
            "cap_top": (STRIP[1], (30, 64, 160)),
            "handle": (STRIP[2], deep),
        },
    )  # fmt: skip


def panel_box(
    label: str, size: tuple[float, float, float], radius: float, wrap: Panel, top: Panel, bottom: Panel,
    category: str, mass: float, source: str,
) -> Product:  # fmt: skip
    """A carton with slightly rounded vertical edges."""
    x, y, z = size
    levels = np.concatenate([[0], np.linspace(0, z, 9), [z]])
    inset = 2 * min(0.001, radius / 2)
    rings = [
        rounded_rectangle(
            float(level), x - (inset if k in (0, 10) else 0), y - (inset if k in (0, 10) else 0), radius, 4, 12
        )
        for k, level in enumerate(levels)
    ]
    stack_of_rings = np.stack(rings)
    stack_of_rings[1, :, 2] += inset / 2
    stack_of_rings[-2, :, 2] -= inset / 2
    part = loft(stack_of_rings, "side", bottom="bottom", top="top")
    return Product(
        label, category, "box", mass, source, [part], [box(size, (0, 0, z / 2))],
        {"side": (BODY, wrap), "top": (STRIP[0], top), "bottom": (STRIP[1], bottom)},
    )  # fmt: skip


def sugar() -> Product:
    """A pound of sugar in its carton."""
    x, y, z = 0.038, 0.089, 0.175
    yellow, blue, red = (250, 214, 60), (28, 70, 160), (206, 40, 44)
    front = Panel(y, z, yellow)
    front.band(0.128, z, blue)
    front.ellipse(y / 2, 0.128, 0.038, 0.020, WHITE)
    front.text("SUGAR", y / 2, 0.128, 0.066, blue)
    front.text("PURE CANE", y / 2, 0.158, 0.06, WHITE)
    for k, (dx, dy) in enumerate(((0, 0), (-0.017, -0.012), (0.017, -0.012), (0, -0.025))):
        cx, cy, s = y / 2 + dx, 0.082 + dy, 0.012
        front.polygon([(cx - s, cy), (cx, cy - s * 0.6), (cx + s, cy), (cx, cy + s * 0.6)], WHITE)
        front.polygon([(cx - s, cy), (cx, cy - s * 0.6), (cx, cy - s * 1.7), (cx - s, cy - s)], (216, 222, 232))
        front.polygon([(cx + s, cy), (cx, cy - s * 0.6), (cx, cy - s * 1.7), (cx + s, cy - s)], (190, 198, 214))
        del k
    front.band(0.008, 0.024, red)
    front.text("NET WT 1 LB (454 g)", y / 2, 0.016, 0.07, WHITE)
    back = Panel(y, z, yellow)
    back.band(0.128, z, blue)
    back.text("BAKER'S TIPS", y / 2, 0.15, 0.07, WHITE)
    back.small_print(0.01, 0.115, 0.068, 10, 0.007, (110, 90, 30))
    back.barcode(0.045, 0.012, 0.036, 0.022)
    side = Panel(x, z, blue)
    side.rectangle(0.004, 0.03, x - 0.004, 0.13, WHITE)
    side.text("NUTRITION", x / 2, 0.122, 0.026, BLACK)
    side.small_print(0.007, 0.112, 0.023, 12, 0.0062, (60, 60, 60))
    lid = Panel(y, x, blue)
    lid.text("SUGAR", y / 2, x / 2, 0.05, WHITE)
    base = Panel(y, x, (226, 216, 190))
    return panel_box(
        "sugar", (x, y, z), 0.002, box_wrap(front, side, back, side), lid, base, "non-cleaning", 0.514,
        YCB + "004_sugar_box, 38 x 89 x 175 mm, 514 g",
    )  # fmt: skip


def soup_can() -> Product:
    """A tin with rolled rims at both ends."""
    r, z = 0.033, 0.101
    profile = [(0.0290, 0.0025), (0.0300, 0.0004), (0.0318, 0.0), (0.0330, 0.0008), (0.0330, 0.0028), (0.0320, 0.0042),
               (0.0320, 0.018), (0.0320, 0.034)]  # fmt: skip
    profile = [*profile, (0.0320, z / 2), *[(a, z - b) for a, b in reversed(profile)]]
    part = revolve(profile, "side", 56, bottom="lid", top="lid")
    red, gold = (196, 30, 36), (214, 172, 84)
    width = np.pi * r
    front = Panel(width, z + 0.012, WHITE)
    front.band(0.052, z + 0.012, red)
    front.band(0.0495, 0.052, gold)
    front.text("TOMATO", width / 2, 0.084, 0.075, WHITE)
    front.text("S O U P", width / 2, 0.030, 0.07, red)
    front.ellipse(width / 2, 0.0515, 0.0125, 0.0125, gold)
    front.ellipse(width / 2, 0.0515, 0.009, 0.009, (222, 62, 40))
    front.polygon([(width / 2 - 0.004, 0.060), (width / 2 + 0.004, 0.060), (width / 2, 0.055)], (60, 140, 60))
    for level in (0.0, z + 0.0035):
        front.band(level, level + 0.0085, (176, 180, 186))
    back = Panel(width, z + 0.012, WHITE)
    back.image[:] = front.image[:, :1]
    back.small_print(0.008, 0.045, 0.05, 5, 0.006, (90, 90, 90))
    back.barcode(0.062, 0.018, 0.032, 0.024)
    back.text("serving idea", width / 2, 0.084, 0.06, WHITE)
    lid = Panel(0.06, 0.06, (190, 194, 200))
    for radius, colour in ((0.0265, (150, 154, 160)), (0.0245, (206, 210, 214)), (0.015, (160, 164, 170))):
        lid.ring(0.03, 0.03, radius, 0.0016, colour)
    return Product(
        "soup_can", "non-cleaning", "cylinder", 0.349, YCB + "005_tomato_soup_can, 66 x 101 mm, 349 g",
        [part], [cylinder((0, 0, 0), (0, 0, z), r)],
        {"side": (BODY, around(front, back)), "lid": (STRIP[0], lid)},
    )  # fmt: skip


def scotch_brite() -> Product:
    """A scrub sponge: yellow foam under a green scouring pad."""
    x, y, z = 0.069, 0.114, 0.0155
    levels = [(0.0, -0.003), (0.0008, -0.001), (0.0025, 0.0), (0.007, 0.0), (0.0108, 0.0), (0.0112, -0.0008),
              (0.0118, 0.0), (0.0146, 0.0), (z, -0.0012)]  # fmt: skip
    part = loft(
        np.stack([rounded_rectangle(h, x + 2 * d, y + 2 * d, 0.009, 7, 10) for h, d in levels]),
        "side", bottom="foam", top="scrub",
    )  # fmt: skip
    yellow, green = (244, 206, 70), (38, 104, 60)
    side = Panel(0.36, 0.021, yellow)
    for k in range(900):
        px, py = (k * 0.0618034 * 0.36 * 97) % 0.36, (k * 0.7548777 * 0.012) % 0.0135
        side.ellipse(px, py, 0.0007, 0.0005, (206, 164, 40))
    side.band(0.0145, 0.021, green)
    foam = Panel(y, x, yellow)
    for k in range(1100):
        px, py = (k * 0.6180340 * y) % y, (k * 0.7548777 * x) % x
        foam.ellipse(px, py, 0.0006 + 0.0009 * ((k * 13) % 7) / 7, 0.0006 + 0.0007 * ((k * 5) % 6) / 6, (208, 166, 42))
    scrub = Panel(y, x, green)
    scrub.speckle(0.10, 3, 4)
    scrub.speckle(0.05, 4, 9)
    return Product(
        "scotch_brite", "cleaning", "box", 0.04,
        "3M Scotch-Brite heavy duty scrub sponge, 4.5 x 2.7 x 0.6 in (114 x 69 x 15 mm); damp",
        [part], [box((x, y, z), (0, 0, z / 2))],
        {"side": ((0, 448, 512, 64), side), "foam": ((0, 0, 512, 224), foam), "scrub": ((0, 224, 512, 224), scrub)},
        modulus=5e5,
    )  # fmt: skip


def shampoo() -> Product:
    """An oval bottle with a flip-top cap."""
    outline: list[Section] = [
        (0.000, 0.0165, 0.0310, 2.4, 0, 0), (0.003, 0.0190, 0.0345, 2.4, 0, 0), (0.010, 0.0205, 0.0360, 2.4, 0, 0),
        (0.120, 0.0205, 0.0360, 2.4, 0, 0), (0.148, 0.0200, 0.0330, 2.3, 0, 0), (0.166, 0.0185, 0.0250, 2.1, 0, 0),
        (0.174, 0.0165, 0.0190, 2.0, 0, 0), (0.176, 0.0165, 0.0190, 2.0, 0, 0),
    ]  # fmt: skip
    rows = smooth(outline, 22)
    body = stack(rows, "body", 44)
    cap_rows: list[Section] = [
        (0.1745, 0.0175, 0.0205, 2.0, 0, 0), (0.176, 0.0182, 0.0212, 2.0, 0, 0), (0.192, 0.0178, 0.0208, 2.0, 0, 0),
        (0.1924, 0.0172, 0.0202, 2.0, 0, 0), (0.1932, 0.0172, 0.0202, 2.0, 0, 0), (0.1936, 0.0178, 0.0208, 2.0, 0, 0),
        (0.206, 0.0170, 0.0198, 2.0, 0, 0), (0.210, 0.0140, 0.0168, 2.0, 0, 0),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 36)
    purple, silver = (110, 62, 150), (222, 222, 230)
    width = perimeter(body) / 2
    front = Panel(width, 0.182, purple)
    for k in range(5):
        shade = (98 + 20 * k, 84 + 17 * k, 111 + 22 * k)
        front.wave(0.030 + 0.006 * k, 0.006, 0.06, 0.0024, shade)
    x = width / 2
    front.ellipse(x, 0.105, 0.027, 0.040, silver)
    front.ellipse(x, 0.105, 0.0255, 0.0385, (132, 84, 172))
    front.text("silka", x, 0.118, 0.042, WHITE)
    front.text("SHAMPOO", x, 0.098, 0.038, WHITE)
    for dx, angle in ((-0.008, 60), (0.0, 90), (0.008, 120)):
        front.ellipse(x + dx, 0.080, 0.008, 0.003, (176, 220, 150), angle)
    front.text("355 ml", x, 0.012, 0.022, WHITE)
    back = Panel(width, 0.182, purple)
    back.rectangle(x - 0.026, 0.025, x + 0.026, 0.14, (232, 224, 240))
    back.small_print(x - 0.022, 0.132, 0.044, 13, 0.006, (100, 80, 120))
    back.barcode(x - 0.018, 0.028, 0.036, 0.018)
    lid = Panel(0.12, 0.05, silver)
    lid.band(0.0245, 0.0265, (120, 120, 132))
    return Product(
        "shampoo", "non-cleaning", "twofold_z", 0.36, PACK + "355 ml (12 fl oz) bottle, 41 x 72 x 210 mm",
        [body, cap], [*hulls(rows, [0.0, 0.120, 0.176], 14), *hulls(cap_rows, [0.1745, 0.21], 12)],
        {"body": (BODY, around(front, back)), "cap": (STRIP[0], lid)},
    )  # fmt: skip


def mug() -> Product:
    """A mug; the cavity is open and the handle is a hole."""
    r, z = 0.040, 0.082
    profile = [(0.030, 0.0), (0.0365, 0.0), (0.0385, 0.002), (0.040, 0.008), (0.040, 0.025), (0.040, 0.045),
               (0.040, 0.065), (0.040, 0.079), (0.0392, 0.0815), (0.0380, z), (0.0368, 0.0815), (0.036, 0.079),
               (0.036, 0.055), (0.036, 0.030), (0.036, 0.012), (0.034, 0.0075), (0.028, 0.006)]  # fmt: skip
    body = revolve(profile, "body", 48)
    grip = curve(
        [(0, 0.0378, 0.066, 0.007, 0.005), (0, 0.052, 0.067, 0.0065, 0.0045), (0, 0.066, 0.056, 0.0065, 0.0045),
         (0, 0.068, 0.040, 0.0065, 0.0045), (0, 0.056, 0.023, 0.0065, 0.0045), (0, 0.0378, 0.015, 0.007, 0.005)], 24,
    )  # fmt: skip
    handle = sweep(grip, "handle", 14)
    teal, cream, rust = (36, 128, 132), (246, 238, 220), (216, 92, 48)
    # v runs from the foot over the rim to the bottom of the cavity: the outside is its lower half.
    length = float(np.linalg.norm(np.diff(np.array(profile), axis=0), axis=1).sum())
    width = np.pi * r
    front = Panel(width, length, teal)
    front.band(0.0, 0.024, cream)
    front.band(0.024, 0.027, rust)
    front.band(0.078, length, cream)
    for k in range(9):
        front.burst((k + 0.5) * width / 9, 0.015, 0.0045, 0.002, 5, rust if k % 2 else teal)
    front.ellipse(width / 2, 0.053, 0.021, 0.021, cream)
    front.text("Good", width / 2, 0.061, 0.030, teal)
    front.text("Morning", width / 2, 0.049, 0.035, rust)
    return Product(
        "mug", "non-cleaning", "none", 0.118, YCB + "025_mug, 80 x 82 mm (without handle), 118 g",
        [body, handle],
        [cylinder((0, 0, 0), (0, 0, 0.007), 0.0385), *wedges(0.0365, 0.0405, 0.006, z, 8), *capsules(grip[4:20], 3)],
        {"body": (BODY, around(front)), "handle": (STRIP[0], cream)},
    )  # fmt: skip


PRODUCTS: dict[str, Callable[[], Product]] = {
    make.__name__: make
    for make in (tide, scotch_brite, shampoo, sugar, mug, soup_can)
}  # fmt: skip
