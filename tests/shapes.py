"""Simple objects, and small catalogues, for tests."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
import yaml

from sum_drake.geometry import symmetry_group
from sum_drake.grasping import GraspConfig
from sum_drake.objects import Catalogue, ObjectModel, load_catalogue
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


def part_of_package(folder: Path, labels: Sequence[str]) -> Catalogue:
    """A catalogue, written into a folder, of some of the package's objects."""
    package = load_catalogue().path
    entries = yaml.safe_load(package.read_text())["objects"]
    (folder / "objects.yaml").write_text(yaml.safe_dump({"objects": {label: entries[label] for label in labels}}))
    for label in labels:
        shutil.copytree(package.parent / label, folder / label)
    return load_catalogue(folder / "objects.yaml")


def columns(grasps: tuple[Grasp, ...]) -> tuple[Array, Array]:
    return np.array([g.X_OG for g in grasps]).reshape(-1, 4, 4), np.array([g.width for g in grasps])
