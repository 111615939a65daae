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
    ellipsoid,
    hull,
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
        (0.082, 0.0425, 0.0800, 4.5, 0, 0), (0.092, 0.0424, 0.0785, 4.5, 0, -0.0015),
        (0.101, 0.0420, 0.0600, 4.2, 0, -0.020), (0.109, 0.0415, 0.0480, 4.0, 0, -0.032),
        (0.125, 0.0412, 0.0455, 3.8, 0, -0.0345), (0.155, 0.0395, 0.0440, 3.4, 0, -0.036),
        (0.173, 0.0340, 0.0370, 2.6, 0, -0.038), (0.188, 0.0250, 0.0250, 2.0, 0, -0.038),
        (0.200, 0.0250, 0.0250, 2.0, 0, -0.038),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body")
    cap_rows: list[Section] = [
        (0.186, 0.0290, 0.0290, 2.0, 0, -0.038), (0.189, 0.0310, 0.0310, 2.0, 0, -0.038),
        (0.228, 0.0285, 0.0285, 2.0, 0, -0.038), (0.232, 0.0265, 0.0265, 2.0, 0, -0.038),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 32, top="cap_top")
    grip = curve(
        [(0, -0.010, 0.168, 0.014, 0.012), (0, 0.024, 0.180, 0.0135, 0.0115), (0, 0.054, 0.169, 0.013, 0.0105),
         (0, 0.0670, 0.138, 0.013, 0.0105), (0, 0.0675, 0.105, 0.013, 0.0105), (0, 0.064, 0.080, 0.014, 0.0115)], 22,
    )  # fmt: skip
    handle = sweep(grip, "handle", 16)

    orange, deep, blue, yellow = (240, 108, 24), (214, 78, 12), (24, 54, 142), (255, 205, 40)
    width = perimeter(body) / 2
    front = Panel(width, 0.24, orange)
    front.band(0, 0.018, deep)
    x = width / 2 - 0.004
    for r, colour in ((0.050, yellow), (0.042, (250, 140, 30)), (0.035, yellow), (0.028, (232, 70, 20))):
        front.ellipse(x, 0.078, r, r * 0.96, colour)
    front.text("TIDE", x, 0.080, 0.094, blue, WHITE)
    front.text("ORIGINAL", x, 0.046, 0.052, WHITE)
    front.rectangle(x - 0.03, 0.022, x + 0.03, 0.033, blue)
    front.text("48 LOADS", x, 0.0275, 0.045, WHITE)
    back = Panel(width, 0.24, orange)
    back.band(0, 0.018, deep)
    back.rectangle(x - 0.05, 0.025, x + 0.05, 0.125, WHITE)
    back.text("DIRECTIONS", x, 0.115, 0.06, blue)
    back.small_print(x - 0.045, 0.103, 0.09, 9, 0.006, (90, 90, 100))
    back.barcode(x + 0.005, 0.028, 0.04, 0.02)
    return Product(
        "tide", "cleaning", "none", 0.95, PACK + "1.89 l (64 fl oz) jug, 85 x 160 x 230 mm; half used",
        [body, cap, handle],
        [*hulls(rows, [0.0, 0.092, 0.109], 16), *hulls(rows, [0.109, 0.155, 0.188], 14),
         cylinder((0, -0.038, 0.186), (0, -0.038, 0.232), 0.0305), *capsules(grip[3:19], 5)],
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
        "scotch_brite", "cleaning", "box", 0.06,
        "3M Scotch-Brite heavy duty scrub sponge, 4.5 x 2.7 x 0.6 in (114 x 69 x 15 mm); wet",
        [part], [box((x, y, z), (0, 0, z / 2))],
        {"side": ((0, 448, 512, 64), side), "foam": ((0, 0, 512, 224), foam), "scrub": ((0, 224, 512, 224), scrub)},
        modulus=1e6,
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


def tea() -> Product:
    """A carton of tea bags."""
    x, y, z = 0.066, 0.076, 0.132
    green, pale, gold, cream, amber = (22, 78, 66), (46, 112, 94), (222, 180, 92), (248, 240, 220), (176, 84, 30)
    front = Panel(y, z, green)
    for k in range(7):
        front.polygon([(k * y / 6 - 0.006, z), (k * y / 6, z - 0.007), (k * y / 6 + 0.006, z)], pale)
    front.rectangle(0, 0.076, y, 0.116, cream)
    for level in (0.0738, 0.1168):
        front.band(level, level + 0.0014, gold)
    front.text("LARKMOOR", y / 2, 0.102, 0.066, green)
    front.text("ENGLISH BREAKFAST", y / 2, 0.084, 0.062, amber)
    cup = (y / 2, 0.040)
    for dx in (-0.007, 0.0, 0.007):  # steam over a cup on its saucer
        rise = [(cup[0] + dx + 0.0022 * float(np.sin(t)), cup[1] + 0.014 + 0.0024 * t) for t in np.linspace(0, 7, 20)]
        front.line(rise, 0.0012, pale)
    front.ring(cup[0] + 0.019, cup[1] + 0.003, 0.0065, 0.0024, cream)
    front.ellipse(cup[0], cup[1] - 0.014, 0.026, 0.0042, gold)
    front.polygon([(cup[0] - 0.019, cup[1] + 0.010), (cup[0] + 0.019, cup[1] + 0.010), (cup[0] + 0.016, cup[1] - 0.006),
                   (cup[0] + 0.010, cup[1] - 0.013), (cup[0] - 0.010, cup[1] - 0.013),
                   (cup[0] - 0.016, cup[1] - 0.006)], cream)  # fmt: skip
    front.ellipse(cup[0], cup[1] + 0.010, 0.019, 0.0042, WHITE)
    front.ellipse(cup[0], cup[1] + 0.0097, 0.0165, 0.0032, amber)
    front.band(0.0, 0.016, amber)
    front.text("20 TEA BAGS", y / 2, 0.008, 0.050, WHITE)
    back = Panel(y, z, green)
    back.band(0.0, 0.016, amber)
    back.text("HOW TO BREW", y / 2, 0.120, 0.056, gold)
    for k, words in enumerate(("one bag a cup", "boiling water", "3 to 5 minutes")):
        level = 0.101 - 0.017 * k
        back.ellipse(0.012, level, 0.0058, 0.0058, gold)
        back.text(str(k + 1), 0.012, level, 0.0052, green)
        back.text(words, 0.046, level, 0.046, cream)
    back.rectangle(0.006, 0.020, y - 0.006, 0.055, cream)
    back.small_print(0.010, 0.051, 0.024, 5, 0.0058, (90, 90, 80))
    back.barcode(0.038, 0.023, 0.030, 0.028)
    side = Panel(x, z, green)
    side.band(0.0, 0.016, amber)
    side.text("LARKMOOR", x / 2, 0.119, 0.052, gold)
    side.ellipse(x / 2, 0.082, 0.024, 0.024, gold)
    side.ellipse(x / 2, 0.082, 0.0228, 0.0228, pale)
    for dx, dy, angle in ((-0.008, 0.001, 130), (0.008, 0.001, 50), (0.0, 0.008, 90)):  # two leaves and a bud
        side.ellipse(x / 2 + dx, 0.082 + dy, 0.0125, 0.0046, (150, 196, 96), angle)
    side.line([(x / 2, 0.086), (x / 2, 0.064)], 0.0014, (150, 196, 96))
    side.rectangle(0.007, 0.021, x - 0.007, 0.053, cream)
    side.text("INGREDIENTS", x / 2, 0.049, 0.036, green)
    side.small_print(0.011, 0.042, 0.044, 4, 0.0055, (90, 90, 80))
    side.text("50 g", x / 2, 0.008, 0.018, WHITE)
    lid = Panel(y, x, green)
    lid.rectangle(0.004, 0.018, y - 0.004, 0.048, cream)
    lid.text("LARKMOOR", y / 2, 0.037, 0.058, green)
    lid.text("TEA", y / 2, 0.025, 0.020, amber)
    base = Panel(y, x, cream)
    base.text("BEST BEFORE 10 2027", y / 2, x / 2, 0.060, (90, 90, 80))
    return panel_box(
        "tea", (x, y, z), 0.0015, box_wrap(front, side, back, side), lid, base, "non-cleaning", 0.12,
        "nominal pack size: carton of 20 tea bags in envelopes, 66 x 76 x 132 mm",
    )  # fmt: skip


def downy() -> Product:
    """A waisted fabric softener bottle with a large cup for a cap."""
    outline: list[Section] = [
        (0.000, 0.0310, 0.0520, 2.8, 0, 0), (0.003, 0.0350, 0.0570, 2.8, 0, 0), (0.012, 0.0385, 0.0600, 2.8, 0, 0),
        (0.060, 0.0390, 0.0600, 2.8, 0, 0), (0.100, 0.0370, 0.0520, 2.6, 0, 0), (0.132, 0.0345, 0.0420, 2.4, 0, 0),
        (0.160, 0.0365, 0.0460, 2.4, 0, 0), (0.180, 0.0365, 0.0455, 2.3, 0, 0), (0.196, 0.0300, 0.0330, 2.1, 0, 0),
        (0.202, 0.0250, 0.0250, 2.0, 0, 0), (0.206, 0.0250, 0.0250, 2.0, 0, 0),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body", 44)
    cap_rows: list[Section] = [
        (0.2035, 0.0290, 0.0290, 2.0, 0, 0), (0.205, 0.0305, 0.0305, 2.0, 0, 0), (0.211, 0.0305, 0.0305, 2.0, 0, 0),
        (0.2125, 0.0285, 0.0285, 2.0, 0, 0), (0.240, 0.0270, 0.0270, 2.0, 0, 0), (0.245, 0.0235, 0.0235, 2.0, 0, 0),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 36, top="cap_top")
    sky, royal, pink, soft = (92, 168, 226), (34, 82, 178), (238, 132, 176), (214, 236, 250)
    width, height = perimeter(body) / 2, 0.218
    x = width / 2
    front = Panel(width, height, sky)
    front.ellipse(x, 0.020, 0.085, 0.040, (134, 194, 238))
    front.ellipse(x, 0.076, 0.050, 0.032, soft)
    front.ellipse(x, 0.076, 0.047, 0.029, WHITE)
    front.text("Downy", x, 0.080, 0.080, royal)
    front.text("APRIL FRESH", x, 0.058, 0.052, pink)
    for cx, cy, r in ((x - 0.018, 0.158, 0.014), (x + 0.016, 0.144, 0.011), (x + 0.010, 0.176, 0.009)):
        for k in range(5):
            a = np.pi / 2 + k * 2 * np.pi / 5
            front.ellipse(cx + 0.55 * r * np.cos(a), cy + 0.55 * r * np.sin(a), 0.5 * r, 0.36 * r, pink, np.degrees(a))
        front.ellipse(cx, cy, 0.25 * r, 0.25 * r, (252, 220, 90))
    front.text("1.02 L", x, 0.028, 0.034, WHITE)
    back = Panel(width, height, sky)
    back.rectangle(x - 0.040, 0.022, x + 0.040, 0.110, WHITE)
    back.text("HOW TO USE", x, 0.101, 0.05, royal)
    back.small_print(x - 0.035, 0.090, 0.070, 7, 0.006, (90, 100, 120))
    back.barcode(x - 0.018, 0.025, 0.036, 0.018)
    return Product(
        "downy", "cleaning", "twofold_z", 0.80,
        PACK + "1.02 l (34 fl oz) bottle, 80 x 120 x 245 mm; three quarters full",
        [body, cap],
        [*hulls(rows, [0.0, 0.060, 0.132, 0.160, 0.206], 14), cylinder((0, 0, 0.2035), (0, 0, 0.245), 0.029)],
        {
            "body": (BODY, around(front, back)), "cap": (STRIP[0], ribbed(royal, (24, 60, 140))),
            "cap_top": (STRIP[1], pink),
        },
    )  # fmt: skip


def clorox() -> Product:
    """A rounded bleach jug; the handle loops from the shoulder to the body."""
    outline: list[Section] = [
        (0.000, 0.0350, 0.0530, 2.8, 0, 0), (0.003, 0.0395, 0.0580, 2.8, 0, 0), (0.010, 0.0420, 0.0610, 2.8, 0, 0),
        (0.112, 0.0420, 0.0610, 2.8, 0, 0), (0.122, 0.0417, 0.0590, 2.7, 0, -0.002),
        (0.131, 0.0410, 0.0440, 2.6, 0, -0.016), (0.139, 0.0400, 0.0340, 2.5, 0, -0.0255),
        (0.155, 0.0385, 0.0310, 2.4, 0, -0.0290), (0.190, 0.0350, 0.0290, 2.2, 0, -0.0300),
        (0.212, 0.0260, 0.0250, 2.0, 0, -0.0300), (0.226, 0.0195, 0.0195, 2.0, 0, -0.0300),
        (0.240, 0.0190, 0.0190, 2.0, 0, -0.0300),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body")
    cap_rows: list[Section] = [
        (0.2300, 0.0215, 0.0215, 2.0, 0, -0.030), (0.2320, 0.0230, 0.0230, 2.0, 0, -0.030),
        (0.2620, 0.0220, 0.0220, 2.0, 0, -0.030), (0.2650, 0.0200, 0.0200, 2.0, 0, -0.030),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 32, top="cap_top")
    grip = curve(
        [(0, -0.018, 0.203, 0.013, 0.010), (0, 0.010, 0.213, 0.0125, 0.010), (0, 0.036, 0.204, 0.012, 0.0095),
         (0, 0.0490, 0.178, 0.012, 0.0095), (0, 0.0505, 0.145, 0.012, 0.0095), (0, 0.046, 0.114, 0.013, 0.010)], 22,
    )  # fmt: skip
    handle = sweep(grip, "handle", 16)
    white, blue, red, green = (240, 241, 240), (20, 70, 160), (214, 36, 48), (60, 150, 80)
    width, height = perimeter(body) / 2, 0.25
    x = width / 2 - 0.004
    front = Panel(width, height, white)
    front.band(0.020, 0.110, blue)
    front.band(0.016, 0.020, red)
    front.band(0.110, 0.114, red)
    front.polygon([(x - 0.045, 0.066), (x, 0.104), (x + 0.045, 0.066), (x, 0.028)], WHITE)
    front.polygon([(x - 0.040, 0.066), (x, 0.1), (x + 0.040, 0.066), (x, 0.032)], red)
    front.rectangle(x - 0.052, 0.053, x + 0.052, 0.079, WHITE)
    front.text("CLOROX", x, 0.066, 0.096, blue)
    front.text("BLEACH", x, 0.043, 0.030, WHITE, tallest=0.007)
    front.text("1.27 L", x + 0.042, 0.027, 0.024, WHITE)
    back = Panel(width, height, white)
    back.band(0.020, 0.110, blue)
    back.rectangle(x - 0.045, 0.026, x + 0.045, 0.104, WHITE)
    back.text("DANGER: CORROSIVE", x, 0.096, 0.08, red)
    back.small_print(x - 0.040, 0.086, 0.080, 7, 0.006, (90, 90, 100))
    back.barcode(x, 0.028, 0.036, 0.018)
    return Product(
        "clorox", "cleaning", "none", 0.90, PACK + "1.27 l (43 fl oz) jug, 85 x 120 x 265 mm; two thirds full",
        [body, cap, handle],
        [*hulls(rows, [0.0, 0.122, 0.139, 0.190, 0.226], 14), cylinder((0, -0.030, 0.226), (0, -0.030, 0.265), 0.0225),
         *capsules(grip[3:19], 5)],
        {
            "body": (BODY, around(front, back)),
            "cap": (STRIP[0], ribbed(blue, (12, 44, 110))),
            "cap_top": (STRIP[1], green),
            "handle": (STRIP[2], white),
        },
    )  # fmt: skip


def spray_bottle() -> Product:
    """A window cleaner: oval bottle, thin neck, trigger head with its nozzle along +y."""
    outline: list[Section] = [
        (0.000, 0.0260, 0.0450, 2.6, 0, 0), (0.003, 0.0300, 0.0495, 2.6, 0, 0), (0.010, 0.0325, 0.0525, 2.6, 0, 0),
        (0.050, 0.0325, 0.0525, 2.6, 0, 0), (0.090, 0.0310, 0.0460, 2.5, 0, 0), (0.130, 0.0290, 0.0400, 2.4, 0, 0),
        (0.158, 0.0260, 0.0350, 2.3, 0, 0), (0.178, 0.0180, 0.0210, 2.1, 0, 0), (0.190, 0.0130, 0.0130, 2.0, 0, 0),
        (0.206, 0.0130, 0.0130, 2.0, 0, 0),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body", 44)
    collar = stack(
        [(0.196, 0.0155, 0.0155, 2.0, 0, 0), (0.198, 0.0165, 0.0165, 2.0, 0, 0), (0.215, 0.0160, 0.0160, 2.0, 0, 0),
         (0.217, 0.0145, 0.0145, 2.0, 0, 0)], "collar", 28,
    )  # fmt: skip
    stem = stack(
        [(0.213, 0.0120, 0.0130, 3.0, 0, 0), (0.226, 0.0115, 0.0125, 3.0, 0, 0), (0.244, 0.0115, 0.0140, 3.0, 0, 0)],
        "head", 24,
    )  # fmt: skip
    # Path rows: position, half-extent across (x), half-extent along the normal.
    shroud_path = curve(
        [(0, -0.034, 0.243, 0.0110, 0.0085), (0, -0.020, 0.249, 0.0130, 0.0135), (0, 0.005, 0.253, 0.0135, 0.0155),
         (0, 0.028, 0.256, 0.0120, 0.0130), (0, 0.042, 0.257, 0.0110, 0.0110)], 16,
    )  # fmt: skip
    shroud = sweep(shroud_path, "head", 20)
    nozzle_path = np.array(
        [[0, y, 0.257, r, r] for y, r in ((0.040, 0.0085), (0.0405, 0.0095), (0.054, 0.0090), (0.0545, 0.0080))]
    )
    nozzle = sweep(nozzle_path, "nozzle", 20)
    lever_path = curve(
        [(0, 0.020, 0.250, 0.0065, 0.0040), (0, 0.030, 0.236, 0.0065, 0.0038), (0, 0.034, 0.222, 0.0062, 0.0034),
         (0, 0.032, 0.208, 0.0060, 0.0030), (0, 0.037, 0.197, 0.0055, 0.0028)], 14,
    )  # fmt: skip
    lever = sweep(lever_path, "nozzle", 14)
    aqua, deep, red, navy = (64, 176, 214), (30, 120, 178), (220, 52, 44), (18, 44, 110)
    width, height = perimeter(body) / 2, 0.218
    x = width / 2
    front = Panel(width, height, aqua)
    front.polygon([(x - 0.040, 0.020), (x + 0.040, 0.020), (x + 0.034, 0.120), (x, 0.138), (x - 0.034, 0.120)], WHITE)
    front.band(0.0, 0.010, deep)
    front.rectangle(x - 0.038, 0.070, x + 0.038, 0.100, navy)
    front.text("GLINT", x, 0.085, 0.064, WHITE)
    front.text("glass cleaner", x, 0.058, 0.058, navy)
    front.burst(x + 0.020, 0.114, 0.012, 0.003, 4, (120, 200, 236))
    front.burst(x - 0.012, 0.120, 0.008, 0.002, 4, (120, 200, 236))
    front.rectangle(x - 0.036, 0.026, x + 0.036, 0.042, red)
    front.text("NO STREAKS", x, 0.034, 0.056, WHITE)
    back = Panel(width, height, aqua)
    back.band(0.0, 0.010, deep)
    back.rectangle(x - 0.034, 0.022, x + 0.034, 0.120, (236, 244, 248))
    back.small_print(x - 0.029, 0.112, 0.058, 10, 0.006, (70, 90, 110))
    back.barcode(x - 0.018, 0.025, 0.036, 0.018)
    return Product(
        "spray_bottle", "cleaning", "none", 0.55, YCB + "022_windex_bottle, 105 x 270 mm; half used",
        [body, collar, stem, shroud, nozzle, lever],
        [*hulls(rows, [0.0, 0.090, 0.158, 0.206], 14), cylinder((0, 0, 0.196), (0, 0, 0.217), 0.0160),
         box((0.023, 0.026, 0.030), (0, 0, 0.229)), hull(shroud.vertices),
         cylinder((0, 0.040, 0.257), (0, 0.0545, 0.257), 0.0093), *capsules(lever_path[2:], 2)],
        {
            "body": (BODY, around(front, back)), "collar": (STRIP[0], ribbed(red, (160, 30, 26))),
            "head": (STRIP[1], (236, 238, 240)), "nozzle": (STRIP[2], red),
        },
    )  # fmt: skip


def ranch() -> Product:
    """A salad dressing bottle: broad shoulders, waisted for the hand, flip cap."""
    outline: list[Section] = [
        (0.000, 0.0240, 0.0330, 2.6, 0, 0), (0.003, 0.0270, 0.0370, 2.6, 0, 0), (0.010, 0.0295, 0.0395, 2.6, 0, 0),
        (0.034, 0.0300, 0.0400, 2.6, 0, 0), (0.060, 0.0270, 0.0350, 2.5, 0, 0), (0.078, 0.0265, 0.0340, 2.4, 0, 0),
        (0.105, 0.0295, 0.0385, 2.5, 0, 0), (0.126, 0.0295, 0.0390, 2.5, 0, 0), (0.146, 0.0240, 0.0300, 2.2, 0, 0),
        (0.160, 0.0175, 0.0190, 2.0, 0, 0), (0.168, 0.0165, 0.0165, 2.0, 0, 0),
    ]  # fmt: skip
    rows = smooth(outline, 26)
    body = stack(rows, "body", 40)
    cap_rows: list[Section] = [
        (0.1660, 0.0190, 0.0190, 2.0, 0, 0), (0.1675, 0.0200, 0.0200, 2.0, 0, 0), (0.1830, 0.0195, 0.0195, 2.0, 0, 0),
        (0.1845, 0.0180, 0.0180, 2.0, 0, 0), (0.1935, 0.0165, 0.0165, 2.0, 0, 0), (0.1960, 0.0145, 0.0145, 2.0, 0, 0),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 32, top="cap_top")
    cream, green, leaf, wine = (246, 240, 222), (44, 110, 54), (112, 172, 70), (146, 36, 60)
    width, height = perimeter(body) / 2, 0.182
    x = width / 2
    front = Panel(width, height, cream)
    front.band(0.016, 0.112, green)
    front.band(0.1, 0.108, leaf)
    front.band(0.02, 0.028, leaf)
    front.ellipse(x, 0.068, 0.040, 0.024, cream)
    front.text("RANCH", x, 0.072, 0.062, wine)
    front.text("dressing", x, 0.053, 0.034, green)
    for k, (dx, angle) in enumerate(((-0.020, 130), (-0.012, 105), (0.012, 75), (0.020, 50))):
        front.ellipse(x + dx, 0.134 - 0.003 * (k in (0, 3)), 0.011, 0.0045, leaf, angle)
    front.ellipse(x, 0.131, 0.009, 0.009, (214, 54, 44))
    front.text("473 ml", x, 0.035, 0.024, WHITE)
    back = Panel(width, height, cream)
    back.band(0.016, 0.112, green)
    back.rectangle(x - 0.032, 0.026, x + 0.032, 0.102, WHITE)
    back.small_print(x - 0.028, 0.095, 0.056, 8, 0.006, (90, 90, 80))
    back.barcode(x - 0.016, 0.028, 0.032, 0.016)
    lid = ribbed(green, (30, 78, 40), 30)
    return Product(
        "ranch", "non-cleaning", "twofold_z", 0.42, PACK + "473 ml (16 fl oz) bottle, 60 x 80 x 195 mm; mostly full",
        [body, cap],
        [*hulls(rows, [0.0, 0.034, 0.078, 0.126, 0.168], 14), cylinder((0, 0, 0.166), (0, 0, 0.196), 0.0190)],
        {"body": (BODY, around(front, back)), "cap": (STRIP[0], lid), "cap_top": (STRIP[1], leaf)},
    )  # fmt: skip


def mustard() -> Product:
    """A squeeze bottle with a pointed cap."""
    outline: list[Section] = [
        (0.000, 0.0230, 0.0410, 2.6, 0, 0), (0.003, 0.0265, 0.0450, 2.6, 0, 0), (0.010, 0.0290, 0.0475, 2.6, 0, 0),
        (0.060, 0.0290, 0.0475, 2.6, 0, 0), (0.105, 0.0285, 0.0440, 2.5, 0, 0), (0.128, 0.0250, 0.0340, 2.3, 0, 0),
        (0.140, 0.0190, 0.0220, 2.1, 0, 0), (0.146, 0.0160, 0.0160, 2.0, 0, 0), (0.152, 0.0160, 0.0160, 2.0, 0, 0),
    ]  # fmt: skip
    rows = smooth(outline, 24)
    body = stack(rows, "body", 44)
    cap_rows: list[Section] = [
        (0.149, 0.0180, 0.0180, 2.0, 0, 0), (0.150, 0.0190, 0.0190, 2.0, 0, 0), (0.162, 0.0185, 0.0185, 2.0, 0, 0),
        (0.164, 0.0165, 0.0165, 2.0, 0, 0), (0.168, 0.0090, 0.0090, 2.0, 0, 0), (0.186, 0.0050, 0.0050, 2.0, 0, 0),
        (0.190, 0.0035, 0.0035, 2.0, 0, 0),
    ]  # fmt: skip
    cap = stack(cap_rows, "cap", 32)
    yellow, amber, red, dark = (250, 204, 30), (226, 164, 10), (208, 34, 36), (60, 40, 20)
    width, height = perimeter(body) / 2, 0.165
    x = width / 2
    front = Panel(width, height, yellow)
    front.ellipse(x, 0.074, 0.043, 0.042, red)
    front.ellipse(x, 0.074, 0.040, 0.039, WHITE)
    front.ellipse(x, 0.074, 0.037, 0.036, red)
    front.rectangle(x - 0.052, 0.062, x + 0.052, 0.086, WHITE)
    front.text("MUSTARD", x, 0.074, 0.094, red)
    front.text("CLASSIC", x, 0.096, 0.040, WHITE)
    front.text("YELLOW", x, 0.052, 0.036, yellow)
    front.band(0.0, 0.010, amber)
    front.text("567 g", x, 0.022, 0.022, dark)
    back = Panel(width, height, yellow)
    back.band(0.0, 0.010, amber)
    back.rectangle(x - 0.036, 0.020, x + 0.036, 0.112, WHITE)
    back.small_print(x - 0.031, 0.104, 0.062, 10, 0.006, (110, 90, 40))
    back.barcode(x - 0.016, 0.024, 0.036, 0.018)
    lid = Panel(0.12, 0.06, yellow)
    lid.band(0.014, 0.0155, amber)
    lid.band(0.052, 0.06, red)
    return Product(
        "mustard", "non-cleaning", "twofold_z", 0.603, YCB + "006_mustard_bottle, 58 x 95 x 190 mm, 603 g",
        [body, cap], [*hulls(rows, [0.0, 0.060, 0.105, 0.152], 14), *hulls(cap_rows, [0.149, 0.164], 12),
                      *hulls(cap_rows, [0.164, 0.190], 10)],
        {"body": (BODY, around(front, back)), "cap": (STRIP[0], lid)},
    )  # fmt: skip


def waterpot() -> Product:
    """An indoor watering pot: an open can, a long spout along +y, a loop of a handle."""
    profile = [(0.036, 0.0), (0.0405, 0.001), (0.042, 0.004), (0.0415, 0.030), (0.0405, 0.060), (0.0395, 0.090),
               (0.0390, 0.104), (0.0402, 0.107), (0.0402, 0.110), (0.0375, 0.111), (0.0368, 0.104), (0.0372, 0.080),
               (0.0380, 0.050), (0.0388, 0.020), (0.0370, 0.005), (0.030, 0.004)]  # fmt: skip
    body = revolve(profile, "body", 48)
    spout_path = curve(
        [(0, 0.0395, 0.022, 0.0105, 0.0105), (0, 0.068, 0.036, 0.0095, 0.0095), (0, 0.094, 0.072, 0.0080, 0.0080),
         (0, 0.112, 0.108, 0.0070, 0.0070), (0, 0.136, 0.130, 0.0065, 0.0065)], 24,
    )  # fmt: skip
    spout = sweep(spout_path, "spout", 18)
    end = spout_path[-1, :3]
    along = spout_path[-1, :3] - spout_path[-3, :3]
    along /= np.linalg.norm(along)
    flare = ((-0.004, 0.0072), (0.006, 0.0120), (0.014, 0.0180), (0.018, 0.0185), (0.020, 0.0160))
    rose_path = np.array([[*(end + d * along), r, r] for d, r in flare])
    rose = sweep(rose_path, "rose", 24, top="sieve")
    grip = curve(
        [(0, -0.0385, 0.098, 0.0085, 0.0055), (0, -0.060, 0.108, 0.0085, 0.0055), (0, -0.084, 0.094, 0.0085, 0.0055),
         (0, -0.086, 0.066, 0.0085, 0.0055), (0, -0.068, 0.038, 0.0085, 0.0055), (0, -0.0402, 0.026, 0.0085, 0.0055)],
        22,
    )  # fmt: skip
    handle = sweep(grip, "handle", 14)
    green, dark, cream, coral = (70, 148, 96), (40, 104, 66), (246, 240, 224), (232, 110, 84)
    length = float(np.linalg.norm(np.diff(np.array(profile), axis=0), axis=1).sum())
    width = float(np.pi * 0.041)
    front = Panel(width, length, green)
    front.band(0.006, 0.016, cream)
    front.band(0.103, 0.122, cream)
    front.band(0.122, length, dark)
    for k in range(5):
        cx, cy = (k + 0.5) * width / 5, 0.062 + (0.012 if k % 2 else -0.006)
        front.line([(cx, 0.016), (cx + 0.003, 0.036), (cx, cy)], 0.0022, dark)
        front.ellipse(cx + 0.006, 0.036, 0.007, 0.003, dark, 40)
        for j in range(6):
            a = j * np.pi / 3
            petal = cream if k % 2 else coral
            front.ellipse(cx + 0.0055 * np.cos(a), cy + 0.0055 * np.sin(a), 0.005, 0.0032, petal, np.degrees(a))
        front.ellipse(cx, cy, 0.0034, 0.0034, (250, 206, 80))
    sieve = Panel(0.04, 0.04, cream)
    for k in range(19):
        r = 0.0 if k == 0 else 0.007 if k < 7 else 0.0135
        a = k * np.pi / 3 if k < 7 else k * np.pi / 6
        sieve.ellipse(0.02 + r * np.cos(a), 0.02 + r * np.sin(a), 0.0013, 0.0013, BLACK)
    return Product(
        "waterpot", "non-cleaning", "none", 0.25,
        PACK + "0.5 l indoor watering can, 85 x 240 x 150 mm; a little water left",
        [body, spout, rose, handle],
        [cylinder((0, 0, 0), (0, 0, 0.006), 0.0415), *wedges(0.0380, 0.0415, 0.005, 0.111, 5),
         *capsules(spout_path[2:21], 2), hull(rose.vertices), *capsules(grip[2:20], 3)],
        {
            "body": (BODY, around(front)), "spout": (STRIP[0], green), "rose": (STRIP[1], cream),
            "sieve": (STRIP[2], sieve), "handle": (STRIP[3], coral),
        },
        modulus=2e6,
    )  # fmt: skip


def toy() -> Product:
    """A bath duck with a red scarf, looking along +x."""
    angle = np.linspace(-0.93, np.pi / 2, 15)[:-1]
    rows: list[Section] = [
        (0.036 + 0.040 * float(np.sin(a)), 0.052 * float(np.cos(a)), 0.0425 * float(np.cos(a)), 2.2, 0.0, 0.0)
        for a in angle
    ]
    body = stack(rows, "body", 36)
    tail_path = curve(
        [(-0.036, 0, 0.044, 0.022, 0.014), (-0.050, 0, 0.054, 0.016, 0.010), (-0.058, 0, 0.064, 0.008, 0.005),
         (-0.061, 0, 0.070, 0.003, 0.002)], 8,
    )  # fmt: skip
    tail = sweep(tail_path, "plain", 16, across=(0.0, 1.0, 0.0))
    head = ellipsoid((0.022, 0.0, 0.088), (0.0275, 0.0265, 0.0265), "head", 28, 16)
    scarf = ellipsoid((0.018, 0.0, 0.0665), (0.0255, 0.0245, 0.0055), "scarf", 28, 8)
    upper = ellipsoid((0.0490, 0.0, 0.0855), (0.0150, 0.0125, 0.0045), "beak", 20, 8)
    lower = ellipsoid((0.0470, 0.0, 0.0800), (0.0120, 0.0105, 0.0040), "beak", 20, 8)
    wings = [
        ellipsoid((-0.006, side * 0.0385, 0.046), (0.0290, 0.0090, 0.0185), "wing", 20, 10) for side in (-1.0, 1.0)
    ]
    yellow, shade, orange, red = (252, 212, 44), (236, 178, 24), (244, 124, 28), (206, 36, 48)
    skin = Panel(0.30, 0.09, yellow)
    skin.band(0, 0.016, shade)
    for k in range(16):
        skin.ellipse((k + 0.5) * 0.30 / 16, 0.016, 0.0095, 0.008, yellow)
    face = Panel(0.17, 0.075, yellow)
    for side in (-1, 1):
        eye = 0.085 + side * 0.0195
        face.ellipse(eye, 0.0475, 0.0066, 0.0085, WHITE)
        face.ellipse(eye - side * 0.0012, 0.0475, 0.0046, 0.0062, BLACK)
        face.ellipse(eye - side * 0.0025, 0.0500, 0.0015, 0.0019, WHITE)
        face.ellipse(0.085 + side * 0.031, 0.034, 0.0070, 0.0048, (250, 176, 60))
    cloth = Panel(0.16, 0.03, red)
    for k in range(16):
        cloth.ellipse((k + 0.5) * 0.01, 0.010 if k % 2 else 0.020, 0.0019, 0.0019, WHITE)
    feathers = Panel(0.12, 0.04, shade)
    for k in range(3):
        feathers.wave(0.010 + 0.009 * k, 0.0025, 0.015, 0.0018, (206, 140, 10))
    return Product(
        "toy", "non-cleaning", "none", 0.09, "our own design, the size of a large bath duck",
        [body, tail, head, scarf, upper, lower, *wings],
        [*hulls(rows, [rows[0][0], rows[-1][0]], 14), hull(head.vertices),
         hull(np.concatenate([upper.vertices, lower.vertices])), hull(tail.vertices),
         hull(scarf.vertices), *(hull(wing.vertices) for wing in wings)],
        {
            "body": ((0, 0, 512, 150), skin), "head": ((0, 150, 512, 226), face), "scarf": ((0, 376, 512, 64), cloth),
            "wing": ((0, 440, 256, 72), feathers), "beak": ((256, 440, 128, 72), orange),
            "plain": ((384, 440, 128, 72), yellow),
        },
        modulus=1e6,
    )  # fmt: skip


def banana() -> Product:
    """A banana lying on its side: bent in its x-y plane, stem towards +y."""
    bend = np.radians(np.array([-42, -38, -33, -24, -8, 10, 26, 36, 42, 48, 52]))
    radius = np.array([0.0050, 0.0085, 0.0130, 0.0165, 0.0180, 0.0180, 0.0165, 0.0130, 0.0085, 0.0060, 0.0062])
    R = 0.113
    knots = [
        (R * float(np.cos(a)), R * float(np.sin(a)), 0.0, float(r), float(0.94 * r))
        for a, r in zip(bend, radius, strict=True)
    ]
    path = curve(knots, 34)
    part = sweep(path, "peel", 20, across=(0.0, 0.0, 1.0))
    yellow, ridge, green, brown = (248, 210, 60), (226, 180, 40), (170, 180, 60), (84, 58, 30)
    # u runs round the banana, v from the tip to the stem.
    peel = Panel(0.10, 0.19, yellow, 2500.0)
    for k in range(5):
        peel.rectangle(0.0175 * k + 0.012, 0.0, 0.0175 * k + 0.0145, 0.19, ridge)
    rng = np.random.default_rng(5)
    for _ in range(60):
        px, py = rng.uniform((0, 0.02), (0.1, 0.16))
        peel.ellipse(px, py, rng.uniform(0.0003, 0.001), rng.uniform(0.0006, 0.003), (176, 128, 40))
    peel.band(0.158, 0.172, green)
    peel.band(0.172, 0.19, (140, 120, 50))
    peel.band(0.186, 0.19, brown)
    peel.band(0.0, 0.010, brown)
    peel.band(0.010, 0.015, (190, 150, 50))
    for at in (0.0, 0.1):
        peel.ellipse(at, 0.095, 0.0085, 0.011, (30, 90, 170))
    peel.ellipse(0.05, 0.095, 0.0085, 0.011, (30, 90, 170))
    peel.text("SOL", 0.05, 0.095, 0.012, (255, 220, 60))
    return Product(
        "banana", "non-cleaning", "none", 0.12, YCB + "011_banana, 36 x 190 mm; mass of a real one",
        [part], capsules(path[2:-1], 6),
        {"peel": ((0, 0, 512, 512), peel)},
        modulus=2e6,
    )  # fmt: skip


PRODUCTS: dict[str, Callable[[], Product]] = {
    make.__name__: make
    for make in (
        tide, downy, clorox, spray_bottle, scotch_brite, shampoo, sugar, ranch, waterpot, toy,
        mug, soup_can, tea, mustard, banana,
    )
}  # fmt: skip
