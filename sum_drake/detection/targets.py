"""What the network should have said of a picture, and how far it was off.

Objects that are hardly visible are no examples of anything: what lies on them is neither right nor wrong, and is left
out of every loss.
"""

import dataclasses

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from sum_drake.detection.network import BACKGROUND, STRIDE, encode_boxes

CORE = 0.25
"""A cell proposes an object if it lies within this share of the object's sides from the middle of its box."""
POSITIVE_IOU = 0.5
"""A box with at least this overlap shows the object."""
IGNORED_SHARE = 0.5
"""A box of which at least this share lies in a hardly visible object's box is left out, if it shows nothing else."""


@dataclasses.dataclass(frozen=True, eq=False)
class Truth:
    """The boxes of one picture: objects (n, 4) with classes (n,), and (m, 4) of those hardly visible."""

    boxes: Tensor
    classes: Tensor
    ignored: Tensor


def overlap(a: Tensor, b: Tensor) -> Tensor:
    """Intersection areas (n, m) of boxes (n, 4) and (m, 4), x, y, w, h."""
    low = torch.maximum(a[:, None, :2], b[None, :, :2])
    high = torch.minimum((a[:, :2] + a[:, 2:])[:, None], (b[:, :2] + b[:, 2:])[None])
    return (high - low).clamp(min=0).prod(-1)


def iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union (n, m) of boxes (n, 4) and (m, 4)."""
    shared = overlap(a, b)
    return shared / (a[:, 2:].prod(-1)[:, None] + b[:, 2:].prod(-1)[None] - shared)


def _share_ignored(boxes: Tensor, truth: Truth) -> Tensor:
    """(n,): the largest share of each box (n, 4) that lies in one hardly visible object's box."""
    if len(truth.ignored) == 0:
        return boxes.new_zeros(len(boxes))
    return (overlap(boxes, truth.ignored) / boxes[:, 2:].prod(-1)[:, None]).amax(1)


def proposal_loss(logits: Tensor, boxes: Tensor, truth: Truth) -> tuple[Tensor, Tensor]:
    """Losses of one picture's proposal maps, logits (h, w) and boxes (h, w, 4): of objectness and of boxes.

    Cells in the core of an object, the smallest where several overlap, should propose its box, and say as objectness
    how well theirs overlaps it (Li et al., "Generalized Focal Loss", 2020); all others should say 0. Boxes are drawn to
    theirs by 1 - GIoU (Rezatofighi et al., "Generalized Intersection over Union", 2019). Each is a sum over cells
    divided by the number of positive ones.
    """
    height, width = logits.shape
    v, u = torch.meshgrid(
        torch.arange(height, device=logits.device), torch.arange(width, device=logits.device), indexing="ij"
    )
    cells = (torch.stack([u, v], -1).reshape(-1, 2) + 0.5) * STRIDE
    logits, boxes = logits.reshape(-1), boxes.reshape(-1, 4)
    target = torch.zeros_like(logits)
    weight = torch.ones_like(logits)
    for box in truth.ignored:
        weight[((cells >= box[:2]) & (cells < box[:2] + box[2:])).all(1)] = 0.0
    zero = logits.sum() * 0.0
    if len(truth.boxes) == 0:
        return _quality_focal(logits, target, weight).sum(), zero
    middle = truth.boxes[:, :2] + truth.boxes[:, 2:] / 2
    # At least one cell to each object, however small.
    reach = (CORE * truth.boxes[:, 2:]).clamp(min=0.5 * STRIDE)
    inside = ((cells[:, None] - middle).abs() <= reach).all(-1)
    area = truth.boxes[:, 2:].prod(-1).expand_as(inside).masked_fill(~inside, float("inf"))
    positive = inside.any(1)
    matched = truth.boxes[area.argmin(1)[positive]]
    agreement, loss = _giou_loss(boxes[positive], matched)
    target[positive] = agreement.detach()
    weight[positive] = 1.0
    count = max(int(positive.sum()), 1)
    return _quality_focal(logits, target, weight).sum() / count, loss.sum() / count


def _quality_focal(logits: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    error = (target - logits.sigmoid()).abs().pow(2)
    return weight * error * F.binary_cross_entropy_with_logits(logits, target, reduction="none")


def _giou_loss(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """IoU (n,) and 1 - GIoU (n,) of boxes (n, 4) pair by pair."""
    low, high = torch.maximum(a[:, :2], b[:, :2]), torch.minimum(a[:, :2] + a[:, 2:], b[:, :2] + b[:, 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    union = a[:, 2:].prod(-1) + b[:, 2:].prod(-1) - shared
    around = (torch.maximum(a[:, :2] + a[:, 2:], b[:, :2] + b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])).prod(-1)
    agreement = shared / union
    return agreement, 1 - agreement + (around - union) / around


def box_loss(
    logits: Tensor, corrections: Tensor, boxes: Tensor, classes: Tensor, targets: Tensor
) -> tuple[Tensor, Tensor]:
    """Losses of the box head on boxes (n, 4) with classes (n,): of classes, and of the corrections of true ones.

    logits: (n, classes); corrections: (n, 4); targets: (n, 4), the object's box where there is one.
    """
    true = classes != BACKGROUND
    wanted = encode_boxes(boxes[true], targets[true])
    shift = F.smooth_l1_loss(corrections[true], wanted, reduction="sum") / max(len(boxes), 1)
    return F.cross_entropy(logits, classes), shift


def label_boxes(boxes: Tensor, truth: Truth) -> tuple[Tensor, Tensor, Tensor]:
    """Classes (n,), the object's boxes (n, 4) where there is one, and whether each box (n, 4) says anything (n,)."""
    if len(truth.boxes) == 0:
        classes = torch.full((len(boxes),), BACKGROUND, dtype=torch.long, device=boxes.device)
        return classes, boxes, _share_ignored(boxes, truth) < IGNORED_SHARE
    best, index = iou(boxes, truth.boxes).max(1)
    shown = best >= POSITIVE_IOU
    classes = torch.where(shown, truth.classes[index], BACKGROUND)
    return classes, truth.boxes[index], shown | (_share_ignored(boxes, truth) < IGNORED_SHARE)


def draw_boxes(
    proposals: Tensor, truth: Truth, size: tuple[int, int], *, count: int, share: float, rng: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """`count` training boxes of a picture with their classes and targets, at most `share` of them of objects.

    They come from the network's own proposals (n, 4), from around the objects and from anywhere, so that the head is
    ready for whoever proposes. size: height and width of the picture, pixels.
    """
    height, width = size
    anywhere = rng.uniform(0, 1, (count, 4)) * [width, height, 0, 0]
    anywhere[:, 2:] = np.exp(rng.uniform(np.log(16), np.log(240), (count, 2)))
    candidates = [proposals, torch.as_tensor(anywhere, dtype=proposals.dtype)]
    if len(truth.boxes):
        near = truth.boxes.repeat(8, 1).numpy().astype(np.float64)
        spread = rng.choice([0.08, 0.35], (len(near), 1))
        near[:, :2] += spread * rng.normal(size=(len(near), 2)) * near[:, 2:]
        near[:, 2:] *= np.exp(spread * rng.normal(size=(len(near), 2)))
        candidates += [truth.boxes, torch.as_tensor(near, dtype=proposals.dtype)]
    boxes = _clip(torch.cat(candidates), width, height)
    usable = (boxes[:, 2:] >= 4).all(1)
    boxes, own = boxes[usable], usable[: len(proposals)].sum().item()
    classes, targets, telling = label_boxes(boxes, truth)
    true = (telling & (classes != BACKGROUND)).nonzero()[:, 0].numpy()
    false = (telling & (classes == BACKGROUND)).nonzero()[:, 0].numpy()
    true = rng.permutation(true)[: round(share * count)]
    # Half of what is no object are the network's own proposals: the mistakes it is about to make.
    mistakes = rng.permutation(false[false < own])[: (count - len(true)) // 2]
    other = rng.permutation(false[false >= own])[: count - len(true) - len(mistakes)]
    chosen = torch.as_tensor(np.concatenate([true, mistakes, other]))
    return boxes[chosen], classes[chosen], targets[chosen]


def _clip(boxes: Tensor, width: int, height: int) -> Tensor:
    limit = boxes.new_tensor([width, height])
    low, high = boxes[:, :2].clamp(min=0).minimum(limit), (boxes[:, :2] + boxes[:, 2:]).clamp(min=0).minimum(limit)
    return torch.cat([low, high - low], 1)
