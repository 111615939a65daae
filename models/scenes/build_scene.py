"""Writes the fixtures of `sorting.dmd.yaml`: floor, table and bins as SDF, and the table's grain.

Heights are in metres above the floor. Everything is one rigid piece, thick enough that nothing is pushed through it.
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
Vector = tuple[float, float, float]

TABLE_SIZE = (0.60, 0.90, 0.70)
"""A solid counter, its top at .70; the model's origin lies on the floor under its centre."""
TOP_THICKNESS = 0.045
BIN_INSIDE = (0.40, 0.40, 0.36)
"""Room in a bin, some 57 litres: eight detergent jugs thrown in at random."""
BIN_FLOOR = 0.29
"""Height of a bin's inner floor; the rim is at .65, under the table's top."""
WALL = 0.02

PROPERTIES = """<drake:proximity_properties>{}
            <drake:mu_static>0.5</drake:mu_static>
            <drake:mu_dynamic>0.5</drake:mu_dynamic>
          </drake:proximity_properties>"""
RIGID = PROPERTIES.format("""
            <drake:rigid_hydroelastic/>""")
POINT = PROPERTIES.format("""
            <drake:hunt_crossley_dissipation>5</drake:hunt_crossley_dissipation>""")
"""Of the floor, on which things fall fast: in one step they would get so deep into hydroelastic contact that its
pressure, which is not implicit near an object's sides, threw them off: a tea box at 15 m/s, a sponge to infinity. Not
of bins: a thin thing that falls flat may sink into what is felt by points, and must not be lost there."""
ROOM = 6.0
"""Of its floor, which is square, the side: what rolls stays in it. Off an edge a can would roll, fall and spin ever
faster, as its steps are not implicit in that, and end the run with no number for its pose. (Drake 1.51 does not survive
a floor without an end, a half space that is felt by points.)"""
SKIRTING = (0.20, 1.0)
"""Its walls, felt and not seen: thickness and height."""


def triple(values: Vector) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def visual(name: str, center: Vector, geometry: str, color: Vector | None) -> str:
    material = f"\n        <material><diffuse>{triple(color)} 1</diffuse></material>" if color else ""
    return f"""
      <visual name="{name}">
        <pose>{triple(center)} 0 0 0</pose>
        <geometry>{geometry}</geometry>{material}
      </visual>"""


def collision(name: str, center: Vector, geometry: str, properties: str = RIGID) -> str:
    return f"""
      <collision name="{name}">
        <pose>{triple(center)} 0 0 0</pose>
        <geometry>{geometry}</geometry>
        {properties}
      </collision>"""


def box(size: Vector) -> str:
    return f"<box><size>{triple(size)}</size></box>"


def solid(name: str, center: Vector, size: Vector, color: Vector) -> str:
    """A box that is seen and felt."""
    return visual(name, center, box(size), color) + collision(name, center, box(size))


def model(name: str, parts: str) -> str:
    return f"""<?xml version="1.0"?>
<!-- Written by {Path(__file__).name}. -->
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="{name}">
    <link name="{name}">{parts}
    </link>
  </model>
</sdf>
"""


def floor_parts() -> str:
    """A floor, its top at 0, and the walls around it."""
    thickness, height = SKIRTING
    at, long = (ROOM + thickness) / 2, ROOM + 2 * thickness
    # Felt beyond the walls, too: what is pushed out of it at an edge, the nearest way, would slip through.
    felt = box((long + 1.0, long + 1.0, 0.20))
    parts = visual("floor", (0, 0, -0.10), box((ROOM, ROOM, 0.20)), (0.58, 0.60, 0.62))
    parts += collision("floor", (0, 0, -0.10), felt, POINT)
    for side, center, size in (
        ("front", (at, 0.0), (thickness, long)),
        ("back", (-at, 0.0), (thickness, long)),
        ("left", (0.0, at), (long, thickness)),
        ("right", (0.0, -at), (long, thickness)),
    ):
        parts += collision(f"wall_{side}", (*center, height / 2), box((*size, height)), POINT)
    return parts


def bin_parts(color: Vector) -> str:
    """A box open at the top on a stand; the origin lies on the floor under its centre."""
    x, y, z = BIN_INSIDE
    outer_x, outer_y = x + 2 * WALL, y + 2 * WALL
    wall_z = BIN_FLOOR + z / 2
    dark: Vector = (color[0] * 0.55, color[1] * 0.55, color[2] * 0.55)
    slab = 0.10
    stand: Vector = (x - 0.06, y - 0.06, BIN_FLOOR - slab)
    return (
        solid("stand", (0, 0, stand[2] / 2), stand, (0.34, 0.35, 0.37))
        + solid("bottom", (0, 0, BIN_FLOOR - slab / 2), (outer_x, outer_y, slab), dark)
        + solid("front", ((x + WALL) / 2, 0, wall_z), (WALL, outer_y, z), color)
        + solid("back", (-(x + WALL) / 2, 0, wall_z), (WALL, outer_y, z), color)
        + solid("left", (0, (y + WALL) / 2, wall_z), (x, WALL, z), color)
        + solid("right", (0, -(y + WALL) / 2, wall_z), (x, WALL, z), color)
    )


def table_parts() -> str:
    x, y, z = TABLE_SIZE
    below = z - TOP_THICKNESS
    mesh = "<mesh><uri>table_top.obj</uri></mesh>"
    return (
        visual("top", (0, 0, z - TOP_THICKNESS / 2), mesh, None)
        + visual("cabinet", (0, 0, (below + 0.06) / 2), box((x - 0.05, y - 0.05, below - 0.06)), (0.80, 0.81, 0.80))
        + visual("plinth", (0, 0, 0.03), box((x - 0.10, y - 0.10, 0.06)), (0.25, 0.25, 0.26))
        + collision("counter", (0, 0, z / 2), box(TABLE_SIZE))
    )


def textured_box(size: Vector, metres: float) -> str:
    """An OBJ whose texture repeats every `metres`."""
    lines = [f"# Written by {Path(__file__).name}.", "mtllib table_top.mtl", "usemtl wood"]
    faces: list[str] = []
    half = np.array(size) / 2
    for axis in range(3):
        for side in (-1, 1):
            # Corners run counterclockwise seen from outside.
            u, v = ((axis + 1) % 3, (axis + 2) % 3) if side > 0 else ((axis + 2) % 3, (axis + 1) % 3)
            first = 4 * len(faces) + 1
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                p = np.zeros(3)
                p[axis], p[u], p[v] = side * half[axis], a * half[u], b * half[v]
                # Planks run along y.
                grain, across = ((p[1], p[2]), (p[0], p[2]), (p[1], p[0]))[axis]
                lines.append(f"v {p[0]:.4f} {p[1]:.4f} {p[2]:.4f}")
                lines.append(f"vt {grain / metres + 0.5:.4f} {across / metres + 0.5:.4f}")
            normal = np.eye(3)[axis] * side
            lines.append(f"vn {normal[0]:.0f} {normal[1]:.0f} {normal[2]:.0f}")
            index = len(faces) + 1
            faces.append("f " + " ".join(f"{first + i}/{first + i}/{index}" for i in range(4)))
    return "\n".join(lines + faces) + "\n"


def wood(pixels: int = 512) -> NDArray[np.uint8]:
    """Planks of a light wood, RGB: rings of stretched noise, a darker seam between planks."""
    rng = np.random.default_rng(7)
    noise = np.zeros((pixels, pixels))
    for cells, share in ((6, 1.0), (14, 0.5), (60, 0.22), (160, 0.12)):
        coarse = rng.normal(size=(cells, max(cells // 6, 2)))
        noise += share * cv2.resize(coarse, (pixels, pixels), interpolation=cv2.INTER_CUBIC)
    planks = 5
    rows = np.arange(pixels) * planks / pixels
    plank = rows.astype(int)
    tone = rng.uniform(-0.05, 0.05, planks)[plank][:, None]
    rings = 0.5 + 0.5 * np.sin(9 * noise + 4.0 * rng.uniform(size=planks)[plank][:, None])
    seam = np.exp(-(((rows - np.round(rows)) * pixels / planks / 1.2) ** 2))[:, None]
    light, dark = np.array([0.80, 0.64, 0.46]), np.array([0.66, 0.49, 0.32])
    mix = np.clip(0.65 * rings + 0.10 * noise, 0, 1)[..., None]
    color = (light * (1 - mix) + dark * mix) * (1 + tone[..., None] - 0.35 * seam[..., None])
    return np.asarray(np.clip(255 * color, 0, 255), dtype=np.uint8)


def build(folder: Path) -> None:
    """Writes every file of the scene but the directives into `folder`."""
    files = {
        "floor.sdf": model("floor", floor_parts()),
        "table.sdf": model("table", table_parts()),
        "cleaning_bin.sdf": model("cleaning_bin", bin_parts((0.10, 0.42, 0.66))),
        "non_cleaning_bin.sdf": model("non_cleaning_bin", bin_parts((0.93, 0.66, 0.14))),
        "table_top.obj": textured_box((TABLE_SIZE[0], TABLE_SIZE[1], TOP_THICKNESS), 0.60),
        "table_top.mtl": "newmtl wood\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nmap_Kd wood.png\n",
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    cv2.imwrite(str(folder / "wood.png"), wood()[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    build(HERE)
