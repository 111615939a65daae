"""What is no summary is refused in words that name the field."""

import copy
from typing import Any

import pytest
from test_evaluation import START, attempt, make_summary, truth

from sum_drake.assets import InputError
from sum_drake.summary_schema import validate_summary


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("seed",), "1", r"summary\.seed: '1'; expected int"),
        (("seed",), True, r"summary\.seed: True; expected int"),
        (("schema",), "other", r"summary\.schema"),
        (("outcome",), "done", r"expected 'cleared' or 'stopped: <reason>'"),
        (("completion_ratio",), float("nan"), "expected a finite number"),
        (("attempts", 0, "outcome"), "fine", r"summary\.attempts\[0\]\.outcome: 'fine'; expected one of sorted"),
        (("attempts", 0, "rejected_by", "ik"), 0.5, r"rejected_by\.ik: 0\.5; expected int"),
        (("missorted_by", "perception"), 4, "expected objects_missorted"),
        (("objects_sorted",), 9, "expected at most"),
        (("timing",), [], r"summary\.timing: list; expected an object"),
        (("observations",), {}, r"summary\.observations: dict; expected a list"),
    ],
)
def test_validation_names_the_field(path: tuple[str | int, ...], value: object, message: str) -> None:
    data = make_summary([attempt(0, "sugar", "left")], [truth(0, **START), truth(1, **START)])
    validate_summary(data)
    validate_summary(data | {"added_later": 1})
    broken = copy.deepcopy(data)
    target: Any = broken
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    with pytest.raises(InputError, match=message):
        validate_summary(broken)
    del target[path[-1]]
    if path[-1] != "ik":
        with pytest.raises(InputError, match="missing"):
            validate_summary(broken)


def test_false_detections_may_be_missing_but_not_wrong() -> None:
    data = make_summary([attempt(0, "sugar", "left")], [truth(0, **START), truth(1, **START)])
    counts = dict.fromkeys(
        ("step", "detections", "tracks", "false_positives", "false_positives_rejected", "true_tracks",
         "true_tracks_accepted"), 0,
    )  # fmt: skip
    row: dict[str, Any] = {"box": [1.0, 2.0, 3.0, 4.0], "label": "mug", "probability": 0.5, "accepted_as": None}
    validate_summary(data | {"observations": [counts | {"poses": []}]})
    validate_summary(data | {"observations": [counts | {"poses": [], "false_detections": [row | {"fate": "unused"}]}]})
    with pytest.raises(InputError, match=r"observations\[0\]\.false_detections\[0\]\.fate: 'lost'; expected one of"):
        validate_summary(
            data | {"observations": [counts | {"poses": [], "false_detections": [row | {"fate": "lost"}]}]}
        )
    with pytest.raises(InputError, match=r"false_detections\[0\]\.fate: missing"):
        validate_summary(data | {"observations": [counts | {"poses": [], "false_detections": [row]}]})
