"""Simple objects for the tests of grasps."""

from pathlib import Path

import numpy as np
import trimesh

from sum_drake.geometry import symmetry_group
from sum_drake.grasping import GraspConfig
from sum_drake.objects import ObjectModel
from sum_drake.types import Array, Grasp

# A fraction of the default effort keeps the tests quick.
CONFIG = GraspConfig(samples=120, spacing=0.004)


def write_model(folder: Path, name: str, mesh: trimesh.Trimesh, mass: float = 0.3) -> ObjectModel:
    path = folder / f"{name}.obj"
    mesh.export(path)
    extents = mesh.extents
    return ObjectModel(
        name, path, "test", symmetry_group("none"), (float(extents[0]), float(extents[1]), float(extents[2])), mass
    )


def columns(grasps: tuple[Grasp, ...]) -> tuple[Array, Array]:
    return np.array([g.X_OG for g in grasps]).reshape(-1, 4, 4), np.array([g.width for g in grasps])
