"""What tells results of other versions apart: of the program, of the data that come with it, of the objects."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake.objects import Catalogue

PACKAGE = Path(__file__).parent
UNREAD_BY_RUNS = ("bench", "batch_figures.py", "batch_parts.py", "batch_report.py")
"""Parts of the package that no run uses: what measures runs and tells of them may change, and runs stay the same."""
DATA = (".json", ".mtl", ".obj", ".safetensors", ".sdf", ".urdf", ".xml", ".yaml")
"""Suffixes of models, problems, scenes, scenarios and weights; pictures on objects are left out."""


def code_and_meshes(catalogue: Catalogue, *, of_runs: bool = False) -> dict[str, str]:
    """Settings that tell versions of the program, of what comes with it and of the objects apart.

    of_runs: by which a run may differ, `code_of_runs`.
    """
    meshes = [catalogue.path]
    for model in catalogue.models:
        meshes += [model.mesh, *model.collision, *([] if model.sdf is None else [model.sdf])]
    return {
        "catalogue": catalogue.path.name,
        "meshes": digest(meshes),
        "models": models(),
        "code": code_of_runs() if of_runs else code(),
    }


def code(package: Path = PACKAGE) -> str:
    """What tells versions of the program apart."""
    return digest(_inside(package, (".py",)))


def code_of_runs(package: Path = PACKAGE) -> str:
    """What tells versions of the program apart by which a run may differ: all but UNREAD_BY_RUNS."""
    unread = [package / name for name in UNREAD_BY_RUNS]
    return digest([file for file in _inside(package, (".py",)) if not any(map(file.is_relative_to, unread))])


def models(package: Path = PACKAGE) -> str:
    """What tells versions of the data that come with the program apart."""
    return digest(_inside(package / "models", DATA))


def _inside(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    """Files in a folder and below; in a checkout, `systems` and `models` are links, which a glob does not follow."""
    found = [Path(at, name) for at, _, names in os.walk(folder, followlinks=True) for name in names]
    return sorted(file for file in found if file.suffix in suffixes)


def digest(files: Sequence[Path]) -> str:
    """Sixteen digits that tell the contents of files apart."""
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()[:16]


def different(begun: Mapping[str, Any], settings: Mapping[str, Any]) -> str:
    """In words, which settings differ; what is told apart by a digest says nothing to a reader."""
    words = {
        "code": "another version of the program", "meshes": "other meshes", "models": "other models",
        "scenario": "another scenario",
    }  # fmt: skip
    names = {"first_seed": "first seed", "time_limit_s": "time limit", "memory_limit_mib": "memory limit"}
    keys = [key for key in settings if begun.get(key) != settings[key]]
    return ", ".join(words.get(key, f"{names.get(key, key)} {begun.get(key)} and not {settings[key]}") for key in keys)
