"""COLLADA files as robots' meshes come in them."""

import numpy as np
import pytest

from sum_drake.collada import read_collada

FILE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 2 0 0 2 3</float_array>
    <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
  <source id="n"><float_array id="na" count="3">0 0 1</float_array></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  {}
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{}</visual_scene></library_visual_scenes></COLLADA>"""
INPUTS = '<input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>'
TWO = f'<triangles count="2">{INPUTS}<p>0 0 1 0 2 0 0 0 2 0 3 0</p></triangles>'
QUAD = f'<polylist count="1">{INPUTS}<vcount>4</vcount><p>0 0 1 0 2 0 3 0</p></polylist>'
POLYGON = f'<polygons count="1">{INPUTS}<p>0 0 1 0 2 0 3 0</p></polygons>'
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 3]]) * 0.01


def read(folder, mesh, scene):
    path = folder / "part.dae"
    path.write_text(FILE.format(mesh, scene))
    return read_collada(path)


@pytest.mark.parametrize("mesh", [TWO, QUAD, POLYGON])
def test_triangles_in_metres(tmp_path, mesh):
    for scene in ('<node><instance_geometry url="#g"/></node>', ""):
        np.testing.assert_allclose(read(tmp_path, mesh, scene), CORNERS[[[0, 1, 2], [0, 2, 3]]])


def test_nodes_place_what_is_in_them(tmp_path):
    scene = """<node id="n"><translate>10 0 0</translate><rotate>0 0 1 90</rotate>
      <node><scale>2 2 2</scale><matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix>
      <instance_geometry url="#g"/></node></node>"""
    x, y, z = (2 * CORNERS + [0, 0, 0.1]).T
    placed = np.column_stack([0.1 - y, x, z])
    np.testing.assert_allclose(read(tmp_path, TWO, scene), placed[[[0, 1, 2], [0, 2, 3]]], atol=1e-12)
    again = scene + '<node><translate>0 0 7</translate><instance_node url="#n"/></node>'
    both = read(tmp_path, TWO, again)
    np.testing.assert_allclose(both[2:], both[:2] + np.array([0, 0, 0.07]), atol=1e-12)


def test_broken_files_raise(tmp_path):
    for mesh, scene in (
        (TWO, '<node><instance_geometry url="#gone"/></node>'),
        (TWO, '<node id="n"><instance_node url="#n"/></node>'),
        (TWO.replace("3 0</p>", "9 0</p>"), ""),
        (TWO.replace("3 0</p>", "x 0</p>"), ""),
    ):
        with pytest.raises((ValueError, KeyError, IndexError)):
            read(tmp_path, mesh, scene)
