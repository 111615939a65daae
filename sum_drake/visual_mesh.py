"""An object's mesh as RenderEngineVtk draws it in colour."""

import functools

import trimesh
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from sum_drake.objects import ObjectModel, is_shaded


@functools.lru_cache(maxsize=64)
def visual_mesh(model: ObjectModel) -> Mesh:
    """The object's own file where the engine can draw it; otherwise its surface alone, faceted and without colour.

    Raises InputError for a mesh that cannot be read.
    """
    if model.mesh.suffix.lower() == ".gltf" or is_shaded(model.mesh):
        return Mesh(str(model.mesh))
    return _faceted(model.load_mesh())


def _faceted(mesh: trimesh.Trimesh) -> Mesh:
    """The mesh as an OBJ with a normal for each face. Drake wants normals, and draws nothing of an STL."""
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*vertex) for vertex in mesh.vertices]
    lines += ["vn {:.6g} {:.6g} {:.6g}".format(*normal) for normal in mesh.face_normals]
    lines += ["f {1}//{0} {2}//{0} {3}//{0}".format(i, *face) for i, face in enumerate((mesh.faces + 1).tolist(), 1)]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "faceted")))
