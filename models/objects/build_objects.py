"""Writes the fifteen household objects: mesh, texture, collision pieces, SDF, and the catalogue of them all.

    python models/objects/build_objects.py [LABEL ...]

The same input gives the same files, byte for byte. Shapes and prints are in bottles.py,
boxes_and_cans.py and others.py.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import trimesh
import yaml
from pydrake.math import RollPitchYaw, RotationMatrix

from sum_drake.models.objects import bottles, boxes_and_cans, others, paint, shapes
from sum_drake.models.objects.product import Product

HERE = Path(__file__).resolve().parent
PRODUCTS: dict[str, Callable[[], Product]] = {
    make.__name__: make
    for make in (
        bottles.tide, bottles.downy, bottles.clorox, bottles.spray_bottle, boxes_and_cans.scotch_brite,
        bottles.shampoo, boxes_and_cans.sugar, bottles.ranch, others.waterpot, others.toy,
        others.mug, boxes_and_cans.soup_can, boxes_and_cans.tea, bottles.mustard, others.banana,
    )
}  # fmt: skip
"""In the order of the catalogue."""
FRICTION = 0.6
SAGITTA = 5e-4
"""How far the facets of a round primitive's contact mesh may lie inside it, metres."""


def write_visual(product: Product, origin: shapes.Array, folder: Path) -> trimesh.Trimesh:
    """OBJ with normals and texture coordinates, MTL and PNG. Returns the geometry."""
    vertices, faces, uv, offset = [], [], [], 0
    margin = 1.0  # pixels a region keeps clear of its edge, so that neighbours do not bleed into it
    for part in product.parts:
        vertices.append(part.vertices - origin)
        faces.append(part.faces + offset)
        offset += len(part.vertices)
        rectangles = np.array([product.regions[name][0] for name in part.region], dtype=float)[:, None]
        x, y, w, h = np.moveaxis(rectangles, -1, 0)
        u = (x + margin + part.uv[..., 0] * (w - 2 * margin)) / paint.SIZE
        v = 1 - (y + margin + (1 - part.uv[..., 1]) * (h - 2 * margin)) / paint.SIZE
        uv.append(np.stack([u, v], -1))
    points, triangles = np.concatenate(vertices), np.concatenate(faces)
    corners = np.concatenate(uv).reshape(-1, 2).round(5)
    normals = np.concatenate(
        [shapes.shading_normals(v, f - f.min()) for v, f in zip(vertices, faces, strict=True)]
    )  # each part by itself: overlapping parts share no vertex
    normals = normals.reshape(-1, 3).round(4) + 0.0
    vt, vt_index = np.unique(corners, axis=0, return_inverse=True)
    vn, vn_index = np.unique(normals, axis=0, return_inverse=True)
    label = product.label
    lines = [f"# {label}: written by build_objects.py", f"mtllib {label}.mtl", f"o {label}"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points + 0.0]
    lines += [f"vt {u:g} {v:g}" for u, v in vt]
    lines += [f"vn {x:g} {y:g} {z:g}" for x, y, z in vn]
    lines.append(f"usemtl {label}")
    indices = np.stack([triangles, vt_index.reshape(-1, 3), vn_index.reshape(-1, 3)], -1) + 1
    lines += ["f " + " ".join("/".join(map(str, corner)) for corner in face) for face in indices.tolist()]
    (folder / f"{label}.obj").write_text("\n".join(lines) + "\n")
    (folder / f"{label}.mtl").write_text(
        f"newmtl {label}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd {label}.png\n"
    )
    cv2.imwrite(str(folder / f"{label}.png"), paint.texture(product.regions)[:, :, ::-1])
    return trimesh.Trimesh(points, triangles, process=False)


def write_piece(piece: shapes.Piece, origin: shapes.Array, path: Path) -> None:
    """A convex piece as an OBJ."""
    vertices, faces = shapes.triangulate_hull(piece.points - origin)
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def numbers(values: object) -> str:
    """Numbers as an SDF lists them."""
    return " ".join(f"{v:.6g}" for v in np.ravel(np.asarray(values, dtype=float)).round(9) + 0.0)


def roll_pitch_yaw(R: shapes.Array) -> shapes.Array:
    """Angles of an SDF pose; Drake's own, which are right where pitch is a right angle, too."""
    return np.asarray(RollPitchYaw(RotationMatrix(R)).vector())


def sdf(product: Product, mesh: trimesh.Trimesh, origin: shapes.Array) -> str:
    """The simulation model: one free link."""
    label = product.label
    mesh.density = product.mass / mesh.volume
    inertia = mesh.moment_inertia  # about the centre of mass, in the object's axes
    tensor = "".join(
        f"<i{axes}>{value:.6g}</i{axes}>"
        for axes, value in zip(
            ("xx", "yy", "zz", "xy", "xz", "yz"),
            (*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]),
            strict=True,
        )
    )
    collisions = []
    for k, piece in enumerate(product.pieces):
        pose = f"<pose>{numbers([*(piece.p - origin), *roll_pitch_yaw(piece.R)])}</pose>"
        if piece.kind == "box":
            shape = f"<box><size>{numbers(piece.size)}</size></box>"
            hint = max(piece.size)
        elif piece.kind in ("cylinder", "capsule"):
            radius, length = piece.size
            shape = f"<{piece.kind}><radius>{radius:.6g}</radius><length>{length:.6g}</length></{piece.kind}>"
            hint = 2 * np.sqrt(2 * SAGITTA * radius)
        else:
            pose = ""
            shape = f"<mesh><uri>{label}_collision_{k}.obj</uri><drake:declare_convex/></mesh>"
            hint = float(np.ptp(piece.points, axis=0).max())
        collisions.append(f"""
      <collision name="collision_{k}">
        {pose}<geometry>{shape}</geometry>
        <drake:proximity_properties>
          <drake:compliant_hydroelastic/>
          <drake:hydroelastic_modulus>{product.modulus:g}</drake:hydroelastic_modulus>
          <drake:mesh_resolution_hint>{hint:.3g}</drake:mesh_resolution_hint>
          <drake:hunt_crossley_dissipation>5</drake:hunt_crossley_dissipation>
          <drake:mu_dynamic>{FRICTION}</drake:mu_dynamic>
          <drake:mu_static>{FRICTION}</drake:mu_static>
        </drake:proximity_properties>
      </collision>""")
    return f"""<?xml version="1.0"?>
<!-- Written by build_objects.py. -->
<sdf version="1.9" xmlns:drake="drake.mit.edu">
  <model name="{label}">
    <link name="{label}">
      <inertial>
        <pose>{numbers(mesh.center_mass)} 0 0 0</pose>
        <mass>{product.mass:g}</mass>
        <inertia>{tensor}</inertia>
      </inertial>
      <visual name="visual">
        <geometry><mesh><uri>{label}.obj</uri></mesh></geometry>
      </visual>{"".join(collisions)}
    </link>
  </model>
</sdf>
"""


def build(product: Product) -> dict[str, object]:
    """Writes one object's folder. Returns its entry in the catalogue."""
    label = product.label
    folder = HERE / label
    folder.mkdir(exist_ok=True)
    for stale in folder.glob(f"{label}_collision_*.obj"):
        stale.unlink()
    points = np.concatenate([part.vertices for part in product.parts])
    origin = (points.min(0) + points.max(0)) / 2
    mesh = write_visual(product, origin, folder)
    for k, piece in enumerate(product.pieces):
        write_piece(piece, origin, folder / f"{label}_collision_{k}.obj")
    (folder / f"{label}.sdf").write_text(sdf(product, mesh, origin))
    print(f"{label:14s} {len(mesh.faces):5d} faces  {'closed' if mesh.is_watertight else 'OPEN':6s}  "
          f"{mesh.extents.round(3)} m  {mesh.volume * 1e3:.2f} l  {len(product.pieces)} pieces")  # fmt: skip
    return {
        "mesh": f"{label}/{label}.obj",
        "category": product.category,
        "symmetry": product.symmetry,
        "mass": product.mass,
        "sdf": f"{label}/{label}.sdf",
        "collision": [f"{label}/{label}_collision_{k}.obj" for k in range(len(product.pieces))],
        "source": product.source,
    }


HEADER = """\
# Fifteen household objects. Written by build_objects.py; lengths in metres, masses in kilograms.
# Masses are those of products in use, partly filled, so that an arm of Fetch's strength lifts them.
# Frames: origin at the centre of the bounding box, z up when standing, x out of the label's front.
# Symmetries are of the shape, not of the print: depth cannot see a label.
"""


def main() -> None:
    """Builds all objects, or those named; the catalogue lists all whose folders exist."""
    catalogue = HERE / "catalogue.yaml"
    known = yaml.safe_load(catalogue.read_text())["objects"] if catalogue.exists() else {}
    wanted = sys.argv[1:] or list(PRODUCTS)
    for label in wanted:
        known[label] = build(PRODUCTS[label]())
    entries = {label: known[label] for label in PRODUCTS if label in known}
    catalogue.write_text(HEADER + yaml.safe_dump({"objects": entries}, sort_keys=False, width=110))


if __name__ == "__main__":
    main()
