"""A trained detector on disk: one safetensors file that says what it is.

The tensors are float16, which halves the file and changes no score by more than a few thousandths. The file's metadata
holds all else that a detection depends on, as JSON under the key "sum-drake": labels, shape, calibration, threshold.
"""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake.assets import MODELS, InputError, one_line
from sum_drake.detection.calibration import Calibration
from sum_drake.files import write_whole

if TYPE_CHECKING:
    from torch import Tensor

    from sum_drake.detection.network import Network

SCHEMA = "sum-drake/detector/1"
DEFAULT = MODELS / "weights" / "detector.safetensors"
"""The weights that come with the package, of the package's fifteen objects."""
_KEY = "sum-drake"


@dataclasses.dataclass(frozen=True, eq=False)
class Weights:
    """Everything a trained detector is."""

    labels: tuple[str, ...]
    """Class i + 1 is labels[i]; class 0 is background."""
    width: int
    """Channels of the feature map."""
    hidden: int
    """Width of the box head."""
    tensors: "dict[str, Tensor]"
    """State of the network."""
    calibration: Calibration
    threshold: float
    """p_box * p_label from which a box is worth a hypothesis."""

    def network(self) -> "Network":
        """The network with these weights, on the CPU. Raises RuntimeError for tensors that do not fit."""
        from sum_drake.detection.network import Network

        network = Network(len(self.labels) + 1, width=self.width, hidden=self.hidden)
        network.load_state_dict({name: tensor.float() for name, tensor in self.tensors.items()})
        return network.eval()


def rounded(weights: Weights) -> Weights:
    """The same as they are in a file."""
    tensors = {name: tensor.detach().cpu().half() for name, tensor in weights.tensors.items()}
    return dataclasses.replace(weights, tensors=tensors)


def save_weights(path: Path, weights: Weights) -> str:
    """Writes the file and returns its SHA-256."""
    from safetensors.torch import save

    about = {
        "schema": SCHEMA,
        "labels": list(weights.labels),
        "width": weights.width,
        "hidden": weights.hidden,
        "calibration": dataclasses.asdict(weights.calibration),
        "threshold": weights.threshold,
    }
    tensors = {name: tensor.contiguous() for name, tensor in rounded(weights).tensors.items()}
    content = save(tensors, metadata={_KEY: json.dumps(about, sort_keys=True)})
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


def load_weights(path: Path | None = None, *, labels: Sequence[str] | None = None) -> Weights:
    """Reads a detector (default: the package's).

    labels: what it must know, perhaps among others. Raises InputError for a file that is missing, damaged, no detector,
    or one that lacks a label.
    """
    from safetensors import SafetensorError, safe_open

    path = DEFAULT if path is None else path
    if not path.is_file():
        problem = "a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {problem}; expected a detector's weights, as sum-drake train writes them")
    try:
        with safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {}).get(_KEY, "null"))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no mapping
    except (SafetensorError, OSError, ValueError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected a whole safetensors file") from error
    weights = _read(path, about, tensors)
    unknown = [label for label in labels or () if label not in weights.labels]
    if unknown:
        raise InputError(
            f"{path}: knows no '{unknown[0]}'; expected weights trained on the catalogue (sum-drake train), or in a "
            "scenario detector: SimulatedDetector"
        )
    return weights


def _read(path: Path, about: Any, tensors: "dict[str, Tensor]") -> Weights:
    if not isinstance(about, dict) or about.get("schema") != SCHEMA:
        raise InputError(f"{path}: its metadata names no {SCHEMA}; expected weights that sum-drake train wrote")
    missing = [name for name in ("labels", "width", "hidden", "calibration", "threshold") if name not in about]
    if missing:
        raise InputError(f"{path}: its metadata lacks '{missing[0]}'; expected weights that sum-drake train wrote")
    labels, threshold = about["labels"], about["threshold"]
    if not isinstance(labels, list) or not all(isinstance(label, str) for label in labels) or not labels:
        raise InputError(f"{path}: labels: {str(labels)[:60]}; expected a list of names")
    if len(set(labels)) < len(labels):
        raise InputError(f"{path}: labels: some are named twice; expected as many names as classes")
    # Infinite is the threshold of a detector that is always wrong.
    if not isinstance(threshold, int | float) or not threshold >= 0:
        raise InputError(f"{path}: threshold: {threshold}; expected a probability")
    classes = len(tensors["classify.bias"]) - 1 if "classify.bias" in tensors else len(labels)
    if classes != len(labels):
        raise InputError(f"{path}: {len(labels)} labels for a network of {classes}; expected one for each")
    try:
        weights = Weights(
            labels=tuple(labels),
            width=int(about["width"]),
            hidden=int(about["hidden"]),
            tensors=tensors,
            calibration=Calibration(**about["calibration"]),
            threshold=float(threshold),
        )
        weights.network()
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"{path}: {one_line(error)}; expected weights that fit their own description") from error
    return weights
