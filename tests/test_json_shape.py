"""What is wrong with JSON that was read is said, and where."""

import pytest

from sum_drake.assets import InputError
from sum_drake.json_shape import check_shape

KIND = {"name": str, "count": int, "share": float | None, "rows": [{"x": float}], "sums": {str: int}}
GOOD = {"name": "a", "count": 1, "share": None, "rows": [{"x": 1}, {"x": 0.5}], "sums": {"b": 2}, "later": [1]}


def test_what_is_right_and_more_is_let_through():
    check_shape(GOOD, KIND, "file")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": None}, "file.name: None; expected str"),
        ({"count": True}, "file.count: True; expected int"),
        ({"count": 1.0}, "file.count: 1.0; expected int"),
        ({"share": float("nan")}, "file.share: nan; expected a finite number"),
        ({"share": "1"}, "file.share: '1'; expected a finite number"),
        ({"rows": {}}, "file.rows: dict; expected a list"),
        ({"rows": [{"x": 1}, {}]}, r"file.rows\[1\].x: missing; expected float"),
        ({"sums": {"b": "2"}}, "file.sums.b: '2'; expected int"),
        ({"sums": []}, "file.sums: list; expected an object"),
    ],
)
def test_what_is_wrong_is_said(change, said):
    with pytest.raises(InputError, match=f"^{said}$"):
        check_shape({**GOOD, **change}, KIND, "file")


def test_what_is_missing_is_said():
    with pytest.raises(InputError, match=r"^file\.rows: missing; expected a list$"):
        check_shape({name: value for name, value in GOOD.items() if name != "rows"}, KIND, "file")
