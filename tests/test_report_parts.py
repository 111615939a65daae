from sum_drake.objects import load_catalogue
from sum_drake.report_parts import (
    believed,
    count,
    degrees,
    millimetres,
    name,
    outcome_chip,
    reason,
    seconds,
    tried_chip,
)


def test_what_is_not_known_is_left_out_or_said():
    assert (millimetres(None), degrees(None), seconds(None)) == ("", "", "unknown")
    assert (millimetres(0.0123), degrees(0.5), seconds(1.26)) == ("12.3 mm", "28.6°", "1.3 s")
    assert believed(None) == "" and believed({"placed": 0.9, "lost": 0.08, "stayed": 0.02}) == "placed 0.90, lost 0.08"


def test_words_and_chips():
    assert (count(1, "look"), count(2, "look")) == ("1 look", "2 looks")
    assert (
        "good" in outcome_chip("cleared") and "poor" in outcome_chip("unfinished") and "bad" in outcome_chip("stopped")
    )
    assert "good" in tried_chip("sorted") and "bad" in tried_chip("dropped") and "unknown" in tried_chip(None)
    assert reason({"reason": "no_grasp", "kind": "none"}) == "no grasp"
    assert reason({"reason": "executed", "kind": "move"}) == "moved out of the way: executed"
    assert "&lt;mug&gt;" in name("<mug>", load_catalogue())


def test_a_cleared_table_is_not_good_where_something_fell_off_it():
    assert "good" in outcome_chip("cleared", {"objects_sorted": 5, "objects_total": 5})
    chip = outcome_chip("cleared", {"objects_sorted": 3, "objects_total": 5})
    assert "poor" in chip and "cleared, 3 of 5 sorted" in chip
