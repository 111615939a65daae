from pathlib import Path

import numpy as np
import trimesh
from pictures import silhouette

from sum_drake.contact_sheet import render_model
from sum_drake.objects import load_catalogue

CATALOGUE = load_catalogue()


def test_any_mesh_that_trimesh_reads_is_drawn(tmp_path: Path) -> None:
    """Drake draws nothing of an STL or PLY and refuses an OBJ without normals; ours shows the same mug in each."""
    mesh = CATALOGUE["mug"].load_mesh()
    for name in ("mug.stl", "mug.ply", "mug.off"):
        mesh.export(tmp_path / name)
    mesh.export(tmp_path / "bare.obj", include_normals=False)
    # A face without area has no normal.
    (tmp_path / "flaw.obj").write_text((tmp_path / "bare.obj").read_text() + "f 1 1 2\n")
    # A part of a larger file: normals are there, but no face names them.
    (tmp_path / "unused.obj").write_text("vn 0 0 1\n" + (tmp_path / "bare.obj").read_text())
    files = sorted(path.name for path in tmp_path.iterdir())
    (tmp_path / "objects.yaml").write_text(
        "objects:\n" + "".join(f"  {name}: {{mesh: {name}, category: tools}}\n" for name in files)
    )
    own = load_catalogue(tmp_path / "objects.yaml")
    expected = silhouette(render_model(CATALOGUE["mug"], size=160))
    for name in files:
        image = render_model(own[name], size=160)
        assert np.count_nonzero(silhouette(image) != expected) < 0.01 * np.count_nonzero(expected), name
        assert image[expected].astype(float).mean(1).std() > 10, f"{name} is not shaded"


def test_materials_show_where_normals_are_given(tmp_path: Path) -> None:
    """An OBJ of a user with normals goes to the renderer as it is."""
    box = trimesh.creation.box((0.1, 0.05, 0.08))
    corners = [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in box.vertices]
    normals = [f"vn {x:.0f} {y:.0f} {z:.0f}" for x, y, z in box.face_normals]
    faces = [f"f {a}/1/{i} {b}/2/{i} {c}/3/{i}" for i, (a, b, c) in enumerate(box.faces + 1, 1)]
    lines = ["mtllib box.mtl", *corners, "vt 0 0", "vt 1 0", "vt 0 1", *normals, "usemtl green", *faces]
    (tmp_path / "box.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "box.mtl").write_text("newmtl green\nKd 0 1 0\n")
    (tmp_path / "objects.yaml").write_text("objects: {box: {mesh: box.obj, category: tools}}")
    image = render_model(load_catalogue(tmp_path / "objects.yaml")["box"], size=160)
    green = image[silhouette(image)].astype(float)
    assert green[:, 1].mean() > 5 * green[:, [0, 2]].mean()
