"""Things with handles, wings and bends."""

import numpy as np

from sum_drake.models.objects.paint import BLACK, WHITE, Panel, around
from sum_drake.models.objects.product import BODY, PACK, STRIP, YCB, Product
from sum_drake.models.objects.shapes import (
    Section,
    capsules,
    curve,
    cylinder,
    ellipsoid,
    hull,
    hulls,
    revolve,
    stack,
    sweep,
    wedges,
)


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
