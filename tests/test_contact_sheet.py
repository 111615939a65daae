"""Pictures of objects: print that shows, and every kind of mesh drawn alike."""

import numpy as np
import pytest
from pictures import silhouette

from sum_drake.contact_sheet import render_contact_sheet, render_model
from sum_drake.objects import Catalogue, load_catalogue

CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return CATALOGUE


@pytest.mark.parametrize("label", CATALOGUE.labels)
def test_print_shows_in_the_render(catalogue: Catalogue, label: str) -> None:
    """A texture that does not load leaves one flat hue; ours have several."""
    image = render_model(catalogue[label], size=160)
    colours = image[silhouette(image)].astype(float)
    assert len(colours) > 1500
    chroma = colours / np.maximum(colours.sum(1, keepdims=True), 1)  # free of shading
    assert chroma.std(0).max() > 0.02


def test_contact_sheet(catalogue: Catalogue) -> None:
    told = []
    sheet = render_contact_sheet(catalogue, ["tide", "mug"], progress=lambda *now: told.append(now[1:]))
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert sheet.dtype == np.uint8 and sheet.ndim == 3
    again = render_contact_sheet(catalogue, ["tide", "mug"])
    np.testing.assert_array_equal(sheet, again)
