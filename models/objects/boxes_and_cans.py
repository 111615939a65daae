"""Cartons, a sponge and a tin."""

import numpy as np

from sum_drake.models.objects.paint import BLACK, WHITE, Panel, around, box_wrap
from sum_drake.models.objects.product import BODY, STRIP, YCB, Product
from sum_drake.models.objects.shapes import box, cylinder, loft, revolve, rounded_rectangle


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
    for dx, dy in ((0, 0), (-0.017, -0.012), (0.017, -0.012), (0, -0.025)):
        cx, cy, s = y / 2 + dx, 0.082 + dy, 0.012
        front.polygon([(cx - s, cy), (cx, cy - s * 0.6), (cx + s, cy), (cx, cy + s * 0.6)], WHITE)
        front.polygon([(cx - s, cy), (cx, cy - s * 0.6), (cx, cy - s * 1.7), (cx - s, cy - s)], (216, 222, 232))
        front.polygon([(cx + s, cy), (cx, cy - s * 0.6), (cx, cy - s * 1.7), (cx + s, cy - s)], (190, 198, 214))
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
