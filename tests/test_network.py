"""The network: what its parts compute, checked against what can be computed otherwise."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.detection.network import STRIDE, Network, decode_boxes, encode_boxes, imagenet_state, pool

BOX = st.tuples(*(st.floats(0, 500),) * 2, *(st.floats(4, 300),) * 2)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return Network(16).eval()


def test_maps_cover_the_picture_at_one_cell_a_stride(network):
    with torch.inference_mode():
        features = network.features(torch.zeros(2, 3, 96, 128))
        logits, boxes = network.proposal_maps(features)
    assert features.shape[2:] == logits.shape[1:] == (96 // STRIDE, 128 // STRIDE)
    assert boxes.shape == (2, 12, 16, 4)


@pytest.mark.parametrize(("height", "width"), [(101, 67), (120, 88), (3, 40)])
def test_of_any_size_a_cell_stands_for_the_same_pixels(network, height, width):
    """What lies about a point does not depend on where the picture ends, as long as that is far away."""
    torch.manual_seed(1)
    large = torch.rand(1, 3, 480, 480) * 255
    with torch.inference_mode():
        assert network.features(large[:, :, :height, :width]).shape[2:] == (-(-height // 16) * 2, -(-width // 16) * 2)
        whole, cut = network.features(large), network.features(large[:, :, :467, :469])
    torch.testing.assert_close(cut[:, :, :16, :16], whole[:, :, :16, :16])


def test_each_cell_proposes_a_box_about_itself(network):
    with torch.inference_mode():
        _, boxes = network.proposal_maps(network.features(torch.rand(1, 3, 64, 64) * 255))
    for v in range(8):
        for u in range(8):
            x, y, w, h = boxes[0, v, u].tolist()
            assert x < (u + 0.5) * STRIDE < x + w
            assert y < (v + 0.5) * STRIDE < y + h


@given(box=BOX, target=BOX)
def test_decoding_undoes_encoding(box, target):
    a, b = (torch.tensor([list(one)], dtype=torch.float64) for one in (box, target))
    if (b[:, 2:] / a[:, 2:]).log().abs().max() < 2.0:
        assert torch.allclose(decode_boxes(a, encode_boxes(a, b)), b, atol=1e-6)


@settings(max_examples=40)
@given(
    x=st.floats(8, 60), y=st.floats(8, 40), w=st.floats(8, 60), h=st.floats(8, 40),
    slope=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
)  # fmt: skip
def test_pooling_a_linear_map_gives_the_values_at_the_centres_of_the_cells(x, y, w, h, slope):
    rows, columns = 12, 18
    v, u = np.mgrid[:rows, :columns]
    # A map whose cell (v, u), centred at ((u + .5), (v + .5)) strides, holds a linear function of the picture.
    values = slope[0] * (u + 0.5) * STRIDE + slope[1] * (v + 0.5) * STRIDE
    box = torch.tensor([[x, y, w, h]], dtype=torch.float64)
    pooled = pool(torch.tensor(values, dtype=torch.float64)[None, None], box)[0, 0]
    at = (np.arange(7) + 0.5) / 7
    expected = slope[0] * (x + w * at)[None, :] + slope[1] * (y + h * at)[:, None]
    np.testing.assert_allclose(pooled, expected, atol=1e-9)


def test_pooling_is_roi_align():
    """Torch samples point by point; border and channels are as there."""
    generator = torch.Generator().manual_seed(0)
    features = torch.randn(1, 5, 12, 18, generator=generator, dtype=torch.float64)
    boxes = torch.rand(40, 4, generator=generator, dtype=torch.float64) * torch.tensor([150.0, 100.0, 80.0, 80.0])
    boxes = boxes - torch.tensor([20.0, 20.0, 0.0, 0.0])
    steps = (torch.arange(14, dtype=torch.float64) + 0.5) / 14
    x, y = boxes[:, :1] + boxes[:, 2:3] * steps, boxes[:, 1:2] + boxes[:, 3:] * steps
    grid = torch.stack(torch.broadcast_tensors(x[:, None, :], y[:, :, None]), -1) / STRIDE
    grid = grid / torch.tensor([18.0, 12.0]) * 2 - 1
    sampled = torch.nn.functional.grid_sample(
        features.expand(40, -1, -1, -1), grid, padding_mode="border", align_corners=False
    )
    expected = torch.nn.functional.avg_pool2d(sampled, 2)
    assert torch.allclose(pool(features, boxes), expected, atol=1e-12)


def test_pooling_no_box_gives_nothing():
    assert pool(torch.zeros(1, 5, 4, 4), torch.zeros(0, 4)).shape == (0, 5, 7, 7)


def test_boxes_of_a_batch_are_pooled_from_their_own_picture(network):
    noise = torch.rand(1, 3, 96, 96, generator=torch.Generator().manual_seed(1)) * 255
    pictures = torch.cat([noise, torch.zeros_like(noise)])
    box = torch.tensor([[10.0, 20.0, 50.0, 40.0]])
    with torch.inference_mode():
        features = network.features(pictures)
        together, _ = network.box_head(features, [box, box])
        second, _ = network.box_head(features[1:], [box])
    assert torch.allclose(together[1:], second, atol=1e-5)
    assert not torch.equal(together[0], together[1])


def test_folding_keeps_what_batch_normalisation_computes():
    """A stem of random weights, with its normalisation in place and folded."""
    torch.manual_seed(2)
    conv = torch.nn.Conv2d(3, 32, 3, 2, bias=False)
    norm = torch.nn.BatchNorm2d(32, eps=1e-3).eval()
    torch.nn.init.uniform_(norm.running_mean, -1, 1)
    torch.nn.init.uniform_(norm.running_var, 0.5, 2)
    torch.nn.init.uniform_(norm.weight, 0.5, 2)
    weights = {
        "_conv_stem.weight": conv.weight.detach(),
        **{f"_bn0.{k}": v.detach() for k, v in norm.state_dict().items()},
    }
    network = Network(2)
    network.backbone.stem.load_state_dict(
        {k.removeprefix("stem."): v for k, v in imagenet_state(weights, blocks=0).items()}
    )
    picture = torch.rand(1, 3, 32, 32)
    with torch.inference_mode():
        # TensorFlow pads an even picture under a kernel of 3 and a stride of 2 at the right and the bottom alone.
        expected = norm(conv(torch.nn.functional.pad(picture, (0, 1, 0, 1))))
        assert torch.allclose(network.backbone.stem(picture), expected, atol=1e-5)
