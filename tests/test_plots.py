import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.plots import Series, interval_plot, line_plot, matrix_plot

SVG = "{http://www.w3.org/2000/svg}"
WORDS = {"title": "a plot", "x_label": "boxes", "y_label": "recall"}


def elements(svg, tag):
    return list(ET.fromstring(svg).iter(SVG + tag))


def words(svg):
    return [text.text for text in elements(svg, "text")]


def points(svg):
    """Of the one line in a plot, in pixels."""
    (path,) = (path.get("d") for path in elements(svg, "path"))
    return np.array([[float(value) for value in point.split()] for point in path[1:].split("L")])


def test_axes_legend_and_title_are_named_and_markup_is_escaped():
    svg = line_plot([Series("R-CNN & <Edge Boxes>", [0, 1], [0.5, 0.7])], **WORDS)
    assert {"a plot", "boxes", "recall", "R-CNN & <Edge Boxes>"} <= set(words(svg))


@given(st.lists(st.floats(0.01, 0.99), min_size=2, max_size=20, unique=True))
def test_points_lie_where_their_values_are(values):
    """Affine in both axes, the corners of the ranges at the corners of the axes, y upwards."""
    x, y = np.linspace(0, 1, len(values)), np.array(values)
    whole = points(line_plot([Series("", [0, 1], [0, 1])], **WORDS, x_range=(0, 1), y_range=(0, 1)))
    drawn = points(line_plot([Series("", x, y)], **WORDS, x_range=(0, 1), y_range=(0, 1)))
    (left, bottom), (right, top) = whole
    assert left < right
    assert top < bottom
    np.testing.assert_allclose(drawn[:, 0], left + x * (right - left), atol=0.06)
    np.testing.assert_allclose(drawn[:, 1], bottom + y * (top - bottom), atol=0.06)


def test_a_logarithmic_axis_spaces_by_ratio_and_does_not_reach_0():
    drawn = points(line_plot([Series("", [1, 10, 100], [0, 0.5, 1])], **WORDS, log_x=True))
    assert drawn[1, 0] - drawn[0, 0] == pytest.approx(drawn[2, 0] - drawn[1, 0], abs=0.2)
    with pytest.raises(ValueError, match="logarithmic"):
        line_plot([Series("", [0, 10], [0, 1])], **WORDS, log_x=True)


def test_what_is_not_finite_is_a_gap():
    svg = line_plot([Series("a", [0, 1, 2, 3, 4], [0, 1, math.nan, 1, math.inf], dots=True)], **WORDS)
    (path,) = elements(svg, "path")
    assert path.get("d").count("M") == 2
    assert len(elements(svg, "circle")) == 3
    assert "nan" not in svg
    assert "inf" not in svg


@pytest.mark.parametrize("series", [[], [Series("a", [], [])], [Series("a", [3], [3])], [Series("a", [0], [math.nan])]])
@pytest.mark.parametrize("log_x", [False, True])
def test_hardly_any_data_make_a_plot_all_the_same(series, log_x):
    if log_x:
        series = [Series(one.name, 1 + np.asarray(one.x), one.y) for one in series]
    assert "a plot" in words(line_plot(series, **WORDS, log_x=log_x))


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_a_few_round_ticks_lie_in_any_range(low, span):
    svg = line_plot([], **WORDS, x_range=(low, low + span), y_range=(0, 1))
    ticks = [text for text in elements(svg, "text") if text.get("y") == "310.0" and text.get("text-anchor") == "middle"]
    assert 2 <= len(ticks) <= 12


def test_series_of_two_lengths_are_refused():
    with pytest.raises(ValueError, match="series 'a'"):
        line_plot([Series("a", [0, 1], [0])], **WORDS)


def test_a_matrix_shows_each_count_shaded_by_its_share_of_the_row():
    svg = matrix_plot([[3, 1], [0, 0]], ["mug", "toy"], ["mug", "toy"], **WORDS)
    assert {"3", "1", "mug", "toy"} <= set(words(svg))
    assert words(svg).count("0") == 0
    cells = [rect for rect in elements(svg, "rect") if rect.find(SVG + "title") is not None]
    assert [cell.find(SVG + "title").text for cell in cells] == [
        "mug, mug: 3 (0.75)", "mug, toy: 1 (0.25)", "toy, mug: 0 (0.00)", "toy, toy: 0 (0.00)"
    ]  # fmt: skip
    shades = [cell.get("fill") for cell in cells]
    assert shades[2] == shades[3] == "rgb(255,255,255)"
    assert len(set(shades)) == 3
    with pytest.raises(ValueError, match="2 rows"):
        matrix_plot([[1]], ["a", "b"], ["a"], **WORDS)


def test_intervals_are_drawn_about_their_values_beside_zero():
    rows = [("no <memory>", -0.1, -0.2, 0.05), ("alone", 0.02, math.nan, math.nan), ("unknown", math.nan, 0.0, 1.0)]
    svg = interval_plot(rows, title="a plot", x_label="gain")
    assert {"no <memory>", "alone", "unknown", "gain", "0"} <= set(words(svg))
    first, second = elements(svg, "circle")
    blue = [line for line in elements(svg, "line") if line.get("stroke-width") == "2"]
    (interval,) = blue
    low, high, at = (float(of.get(name)) for of, name in ((interval, "x1"), (interval, "x2"), (first, "cx")))
    assert low < at < high < 640 and (at - low) / (high - at) == pytest.approx(0.1 / 0.15, abs=1e-3)
    assert float(second.get("cx")) > at
    assert interval_plot([], title="a plot", x_label="gain").count("<circle") == 0
