"""What a bench's figures are to reach."""

import pytest

from sum_drake.bench.aims import aim, figure_table, number, reached

AIMS = {"share": ("at least", 0.98), "errors": ("at most", 0.0)}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("share", 0.98, "at least 0.98: reached"),
        ("share", 0.979, "at least 0.98: missed"),
        ("errors", 0.0, "at most 0: reached"),
        ("errors", 1.0, "at most 0: missed"),
        ("share", float("nan"), "at least 0.98: nothing to measure it on"),
        ("other", 1.0, ""),
    ],
)
def test_what_is_asked_for_is_said_and_whether_it_is_there(name, value, words):
    assert aim(AIMS, name, value) == words
    if name in AIMS:
        assert reached(AIMS, name, value) == ("reached" in words)


def test_nearly_all_is_not_told_as_all():
    assert (number(0.9999), number(1.0), number(0.98765)) == ("0.9999", "1", "0.988")


def test_a_page_marks_what_was_missed_and_leaves_unmarked_what_cannot_be_told():
    table = figure_table({"share": 0.5, "errors": float("nan"), "<other>": 2.0}, AIMS)
    assert 'class="chip bad">at least 0.98: missed' in table and 'class="chip plain">at most 0: nothing' in table
    assert "chip good" not in table and "&lt;other&gt;" in table and "nan" not in table
    assert 'class="chip good">at least 0.98: reached' in figure_table({"share": 0.99}, AIMS)
