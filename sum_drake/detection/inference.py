"""From a picture to detections: p(b | z) and p(o | b, z) of eq. 3 of Sui et al. 2017, by the trained R-CNN."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError
from sum_drake.detection.proposals import Proposals, Proposer, make_proposals, nms
from sum_drake.detection.proposers import LEARNED, PROPOSERS
from sum_drake.detection.sigma_c import sigma_c_rule
from sum_drake.detection.weights import Weights, load_weights
from sum_drake.geometry import iou
from sum_drake.types import Array, Detection, Immutable, readonly

if TYPE_CHECKING:
    import torch

WORKING_SIZE = 800
"""Longer side of the pictures that the network looks at, pixels; others are scaled to it.

Trained on pictures of 640, scaled by .75 to 1.4. On validation pictures of 640 x 480, mAP@.5, recall at .9 false
positives a picture and top-1 on true boxes are .935, .905, .911 at 640, .943, .918, .916 at 800 and .934, .915, .924 at
960.
"""
MAX_PROPOSALS = {LEARNED: 100}
"""Proposals classified; 300 of any proposer that is not named here."""
SAME_LABEL_IOU, ANY_LABEL_IOU = 0.45, 0.75
"""Two boxes that overlap by more show one object: if they agree on its label; whatever they say."""
LEAST_SCORE = 0.01
"""Boxes below are not worth keeping for any threshold."""
LEAST_SIDE = 4.0
"""Pixels; nor are boxes that are slimmer, within the picture."""


@dataclasses.dataclass(frozen=True, eq=False)
class Scored(Immutable):
    """The boxes that are left after suppression, best first."""

    boxes: Array
    """(n, 4), x, y, w, h."""
    probabilities: Array
    """(n, 1 + labels), calibrated: column 0 is that it holds none of the objects, i + 1 that it holds labels[i]."""
    logits: Array
    """(n, classes of the network): what they were made of."""


class Detector:
    """Detects the objects of `labels` in pictures. Made by `load_detector`.

    Args:
        weights: of the network.
        labels: what is looked for, of those that the weights know; None: all. What they know besides is background.
        proposer: "learned" or a name of `proposers.PROPOSERS`.
        sigma_c: labels less likely than this share of a box's most likely one are dropped (eq. 5).
        threshold: least p_box * p_label of a detection's most likely label; None: the weights' own.
        device: where the network runs.
    """

    def __init__(
        self,
        weights: Weights,
        *,
        labels: Sequence[str] | None = None,
        proposer: str = LEARNED,
        sigma_c: float = 0.1,
        threshold: float | None = None,
        device: str = "cpu",
    ) -> None:
        if proposer != LEARNED and proposer not in PROPOSERS:
            names = ", ".join([LEARNED, *PROPOSERS])
            raise InputError(f"proposer '{proposer}' is unknown: expected one of {names}")
        self.labels = weights.labels if labels is None else tuple(labels)
        self._columns = [1 + weights.labels.index(label) for label in self.labels]
        self.threshold = weights.threshold if threshold is None else threshold
        self._sigma_c, self._device = sigma_c, device
        self._calibration = weights.calibration
        self._network = weights.network().to(device)
        self._proposer: Proposer | None = None if proposer == LEARNED else PROPOSERS[proposer]()
        self._count = MAX_PROPOSALS.get(proposer, 300)

    def __call__(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> tuple[Detection, ...]:
        """Detections in a picture (h, w, 3) RGB with its depth (h, w) in metres, best first.

        Raises InputError for a picture that cannot be used.
        """
        scored = self.detect(color, depth)
        detections = []
        for box, p in zip(scored.boxes, scored.probabilities, strict=True):
            if p[1:].max() < self.threshold:
                break
            p_box = 1.0 - float(p[0])
            p_labels = [(label, float(q) / p_box) for label, q in zip(self.labels, p[1:], strict=True)]
            x, y, w, h = (float(side) for side in box)
            detections.append(Detection((x, y, w, h), p_box, sigma_c_rule(p_labels, self._sigma_c)))
        return tuple(detections)

    def detect(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> Scored:
        """All boxes worth a look, whatever the threshold, best first. As `__call__` otherwise."""
        return self.examine(color, depth, np.zeros((0, 4)))[0]

    def classify(self, color: NDArray[np.uint8], boxes: Array) -> Array:
        """Calibrated probabilities (n, classes) of given boxes (n, 4), with no correction and no suppression."""
        import torch

        check_picture(color, None)
        with torch.inference_mode():
            scale, features = self._features(color)
            _, logits = self._head(features, np.reshape(boxes, (-1, 4)) * scale)
        return self._probabilities(logits)

    def examine(
        self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None, boxes: Array
    ) -> tuple[Scored, Array]:
        """`detect` and `classify` of boxes (n, 4) at once, for the price of one feature map."""
        import torch

        check_picture(color, depth)
        height, width = color.shape[:2]
        with torch.inference_mode():
            scale, features = self._features(color)
            if self._proposer is None:
                proposed = self._propose(features, (height * scale, width * scale), self._count).boxes
            else:
                proposed = self._proposer(color, depth).best(self._count).boxes * scale
            corrected, logits = self._head(features, proposed)
            _, given = self._head(features, np.reshape(boxes, (-1, 4)) * scale)
        found = self._suppress(_clip(corrected / scale, width, height), logits)
        return found, self._probabilities(given)

    def proposals(self, color: NDArray[np.uint8], count: int) -> Proposals:
        """The network's own proposals."""
        import torch

        check_picture(color, None)
        height, width = color.shape[:2]
        with torch.inference_mode():
            scale, features = self._features(color)
            found = self._propose(features, (height * scale, width * scale), count)
        return make_proposals(found.boxes / scale, found.scores)

    def _features(self, color: NDArray[np.uint8]) -> "tuple[float, torch.Tensor]":
        import torch

        scale, picture = _to_working_size(color)
        pixels = torch.from_numpy(np.array(picture)).to(self._device).permute(2, 0, 1)[None].float()
        return scale, self._network.features(pixels)

    def _propose(self, features: "torch.Tensor", size: tuple[float, float], count: int) -> Proposals:
        logits, boxes = self._network.proposal_maps(features)
        return propose(logits[0], boxes[0], size, count)

    def _head(self, features: "torch.Tensor", boxes: Array) -> tuple[Array, Array]:
        """Corrected boxes (n, 4) and logits (n, classes)."""
        import torch

        from sum_drake.detection.network import decode_boxes

        on_device = torch.as_tensor(np.array(boxes), dtype=torch.float32, device=self._device)
        logits, corrections = self._network.box_head(features, [on_device])
        corrected = decode_boxes(on_device, corrections)
        return corrected.cpu().numpy().astype(np.float64), logits.cpu().numpy().astype(np.float64)

    def _probabilities(self, logits: Array) -> Array:
        """Calibrated probabilities (n, 1 + labels) of logits (n, classes)."""
        chosen = self._calibration.probabilities(logits)[:, self._columns]
        return np.concatenate([1 - chosen.sum(axis=1, keepdims=True), chosen], axis=1)

    def _suppress(self, boxes: Array, logits: Array) -> Scored:
        probabilities = self._probabilities(logits)
        best = probabilities[:, 1:].max(axis=1)
        order = np.argsort(-best, kind="stable")
        order = order[(best[order] >= LEAST_SCORE) & (boxes[order, 2:] >= LEAST_SIDE).all(axis=1)]
        labels = probabilities[:, 1:].argmax(axis=1)
        agree = labels[order][:, None] == labels[order][None]
        same = iou(boxes[order], boxes[order]) > np.where(agree, SAME_LABEL_IOU, ANY_LABEL_IOU)
        kept: list[int] = []
        for k in range(len(order)):
            if not same[k, kept].any():
                kept.append(k)
        chosen = order[kept]
        return Scored(readonly(boxes[chosen]), readonly(probabilities[chosen]), readonly(logits[chosen]))


def propose(logits: "torch.Tensor", boxes: "torch.Tensor", size: tuple[float, float], count: int) -> Proposals:
    """The `count` best of a network's proposals, logits (h, w) and boxes (h, w, 4), in a picture of `size` (h, w)."""
    values, index = logits.flatten().sigmoid().topk(min(8 * count, logits.numel()))
    found = _clip(boxes.reshape(-1, 4)[index].cpu().numpy().astype(np.float64), size[1], size[0])
    usable = (found[:, 2:] >= LEAST_SIDE).all(axis=1)
    found, scores = found[usable], values.cpu().numpy().astype(np.float64)[usable]
    kept = nms(found, scores, 0.7)[:count]
    return make_proposals(found[kept], scores[kept])


def load_detector(
    path: Path | None = None,
    *,
    labels: Sequence[str] | None = None,
    proposer: str = LEARNED,
    sigma_c: float = 0.1,
    threshold: float | None = None,
    device: str = "cpu",
) -> Detector:
    """The detector of a weights file (default: the package's), for `labels` or all that it knows.

    Raises InputError for weights that cannot be used.
    """
    weights = load_weights(path, labels=labels)
    return Detector(weights, labels=labels, proposer=proposer, sigma_c=sigma_c, threshold=threshold, device=device)


def check_picture(color: NDArray[np.uint8], depth: NDArray[np.float32] | None) -> None:
    """Raises InputError for what is no colour picture of 8 bits, or depth that is not of its size."""
    if color.ndim != 3 or color.shape[2] != 3 or color.dtype != np.uint8:
        raise InputError(f"picture is {color.shape} of {color.dtype}: expected (height, width, 3) RGB of 8 bits")
    if min(color.shape[:2]) < 32:
        raise InputError(f"picture is {color.shape[1]} x {color.shape[0]} pixels: expected at least 32 x 32")
    if depth is not None and depth.shape != color.shape[:2]:
        sizes = f"depth is {depth.shape[::-1]} pixels, its picture {color.shape[1::-1]}"
        raise InputError(f"{sizes}: expected the same size")


def _to_working_size(color: NDArray[np.uint8]) -> tuple[float, NDArray[np.uint8]]:
    """The picture scaled to the working size, and by how much."""
    import cv2

    scale = WORKING_SIZE / max(color.shape[:2])
    if scale == 1.0:
        return scale, color
    size = [max(round(side * scale), 1) for side in color.shape[1::-1]]
    resized = cv2.resize(color, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    return scale, np.asarray(resized, dtype=np.uint8)


def _clip(boxes: Array, width: float, height: float) -> Array:
    low = np.clip(boxes[:, :2], 0, [width, height])
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0, [width, height])
    return np.concatenate([low, high - low], axis=1)
