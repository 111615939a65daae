"""Bottles and jugs: lofts of superellipses, with handles that are real holes."""

import numpy as np

from sum_drake.models.objects.paint import WHITE, Panel, around
from sum_drake.models.objects.product import BODY, PACK, STRIP, YCB, Product, perimeter, ribbed
from sum_drake.models.objects.shapes import Section, box, capsules, curve, cylinder, hull, hulls, smooth, stack, sweep


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
