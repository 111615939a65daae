"""A detector as it comes from a file, for tests of what is around it: a small network that has learned nothing."""

from collections.abc import Sequence
from pathlib import Path

import torch

from sum_drake.detection.calibration import Calibration
from sum_drake.detection.network import Network
from sum_drake.detection.weights import Weights, save_weights


def write_untrained(file: Path, labels: Sequence[str], *, threshold: float = 0.0) -> Path:
    """Weights of a network of random tensors; the same for the same labels."""
    torch.manual_seed(0)
    network = Network(1 + len(labels), width=16, hidden=16)
    save_weights(file, Weights(tuple(labels), 16, 16, network.state_dict(), Calibration(), threshold))
    return file
