import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sum_drake.jsonio import canonical, decode, encode, write_json
from sum_drake.types import Attempt, Camera, Detection, PickPlace, PoseBelief, SceneBelief, Track, readonly

REALS = st.floats(allow_nan=False, allow_infinity=False)
EYE = readonly(np.eye(4))
BELIEF = PoseBelief(readonly(np.random.default_rng(0).normal(size=(3, 4, 4))), readonly([0.5, 0.25, 0.25]))
TRACK = Track(5, "mug", (1.5, 2.0, 9.0, 9.0), 0.9, 0.8, BELIEF, EYE, 0.5, 0.7, True, 0, 1, (("inliers", 0.25),))
ACTION = PickPlace(2, "pick_place", 5, "mug", EYE, EYE, "bin", 0.04, 0.0, False)
REFUSED = Attempt(2, 5, "mug", "bin", "none", "ik", 7, (("ik", 7),), None)


@pytest.mark.parametrize(
    "value",
    [
        SceneBelief(3, (TRACK,), 6),
        SceneBelief(),
        ACTION,
        REFUSED,
        dataclasses.replace(REFUSED, action=ACTION, X_OG=EYE),
        Detection((0.0, 1.0, 2.0, 3.0), 0.9, (("mug", 0.8), ("toy", 0.1))),
        Camera(320, 240, 262.5, 262.5, 159.5, 119.5),
    ],
    ids=lambda value: type(value).__name__,
)
def test_values_come_back_from_json_as_they_were(value):
    again = decode(type(value), json.loads(json.dumps(encode(value))))
    assert type(again) is type(value)
    assert canonical(again) == canonical(value)


def test_arrays_come_back_read_only_and_of_their_type():
    again = decode(PoseBelief, encode(BELIEF))
    np.testing.assert_array_equal(again.X_WOs, BELIEF.X_WOs)
    assert again.X_WOs.dtype == np.float64
    assert not again.X_WOs.flags.writeable


def test_numbers_of_numpy_become_plain_ones():
    data = encode({"n": np.int64(3), "x": np.float32(0.5), "yes": np.bool_(True), "a": np.arange(2), 4: (None, "s")})
    assert data == {"n": 3, "x": 0.5, "yes": True, "a": [0, 1], "4": [None, "s"]}
    assert [type(data[key]) for key in ("n", "x", "yes")] == [int, float, bool]


def test_what_json_cannot_say_is_refused():
    with pytest.raises(TypeError, match="set"):
        encode({"labels": {"mug"}})


def test_fields_with_a_default_may_be_missing_others_not():
    data = encode(TRACK)
    del data["features"]
    assert decode(Track, data).features == ()
    del data["label"]
    with pytest.raises(TypeError, match="label"):
        decode(Track, data)


@pytest.mark.parametrize(
    ("key", "wrong"),
    [("label", 3), ("id", "five"), ("accepted", "yes"), ("box", [1.0, 2.0]), ("X_WO", "eye"), ("likelihood", None)],
)
def test_data_of_another_type_is_refused(key, wrong):
    with pytest.raises((TypeError, ValueError)):
        decode(Track, {**encode(TRACK), key: wrong})


@given(REALS, REALS)
def test_canonical_texts_are_equal_exactly_when_the_numbers_are(a, b):
    assert (canonical([a]) == canonical([b])) == (a.hex() == b.hex())
    assert canonical({"a": a, "b": b}) == canonical({"b": b, "a": a})


@given(st.lists(REALS, max_size=4))
def test_no_digit_is_lost_on_the_way_through_a_file(numbers):
    assert decode(tuple[float, ...], json.loads(json.dumps(encode(numbers)))) == tuple(numbers)


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    file = tmp_path / "summary.json"
    write_json(file, {"detections": 3})
    with pytest.raises(ValueError, match="JSON"):
        write_json(file, {"detections": float("nan")})
    assert json.loads(file.read_text()) == {"detections": 3}
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
