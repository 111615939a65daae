"""The search for poses in a box."""

import dataclasses

import numpy as np
import pytest
import torch
from scenes import observe as look
from scenes import standing

from sum_drake.appearance import Appearances
from sum_drake.filter_config import filter_config
from sum_drake.geometry import symmetry_group
from sum_drake.likelihood import TERMS, WEIGHTS, observe
from sum_drake.objects import load_catalogue
from sum_drake.particles import to_camera
from sum_drake.search import Sought, rivals, score, search, start
from sum_drake.types import PoseBelief, readonly

CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def sought() -> tuple[Sought, torch.Tensor]:
    """A search for a sugar box, and where its middle is."""
    X_WO = standing(CATALOGUE, "sugar", 0.6, 0.0, 0.4)
    frame, boxes = look(CATALOGUE, {"sugar": X_WO})
    model = Appearances(CATALOGUE, "views")["sugar"]
    truth = to_camera(PoseBelief(readonly(X_WO[None]), readonly(np.ones(1))), frame, model.p_OM)
    return Sought(observe(frame, boxes["sugar"]), model, symmetry_group("none"), filter_config()), truth.p_CMs[0]


def test_particles_begin_with_their_surface_on_what_was_observed(sought) -> None:
    here, middle = sought
    begun = start(here, 500, np.random.default_rng(0))
    assert len(begun) == 500
    off = (begun.p_CMs - middle).norm(dim=-1)
    assert float(off.median()) < 2 * here.model.radius
    R = begun.R_COs
    torch.testing.assert_close(R @ R.transpose(1, 2), torch.eye(3).expand_as(R), atol=1e-5, rtol=0)


def test_each_iteration_finds_what_explains_more(sought) -> None:
    here, middle = sought
    rng = np.random.default_rng(0)
    begun = start(here, 800, rng)
    first = score(here, begun, here.epsilon())
    found, scores = search(here, begun, 6, 0.0, rng)
    assert len(found) == len(scores) == here.config.particles_last
    assert float(scores.max()) > float(first.max()) + 1
    assert float((found.p_CMs[scores.argmax()] - middle).norm()) < 0.02


def test_rivals_differ_and_the_best_of_them_is_no_worse_than_the_search(sought) -> None:
    here, _ = sought
    rng = np.random.default_rng(1)
    found, scores = search(here, start(here, 800, rng), 5, 0.0, rng)
    modes = rivals(here, found, scores)
    assert 1 < len(modes) <= here.config.candidates
    of_modes = score(here, modes, here.epsilon())
    assert float(of_modes.max()) >= float(score(here, found, here.epsilon()).max()) - 1e-4
    for i in range(len(modes)):
        near = (modes.p_CMs[:i] - modes.p_CMs[i]).norm(dim=-1) < 0.0099
        cosine = (torch.einsum("nij,ij->n", modes.R_COs[:i], modes.R_COs[i]) - 1) / 2
        assert not bool((near & (cosine > np.cos(np.radians(9.9)))).any())


def test_inlier_distances_fall(sought) -> None:
    here, _ = sought
    distances = [here.epsilon(share) for share in (0.0, 0.5, 1.0)]
    assert distances[0] > distances[1] > distances[2] == here.epsilon()
    paper = dataclasses.replace(here, config=filter_config("paper"))
    assert paper.epsilon(0.0) == paper.epsilon() == pytest.approx(0.008)


def test_what_a_filter_is_without_counts_nothing(sought) -> None:
    here, _ = sought
    for i, name in enumerate(TERMS[1:], 1):
        less = dataclasses.replace(here, config=dataclasses.replace(here.config, without=(name,)))
        assert less.weights == (*WEIGHTS[:i], 0.0, *WEIGHTS[i + 1 :])
