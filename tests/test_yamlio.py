import pytest

from sum_drake.assets import InputError
from sum_drake.yamlio import parse_yaml


def test_plain_yaml_and_merges_read_as_ever():
    assert parse_yaml("a: &a {x: 1}\nb: {<<: *a, y: 2}", "text") == {"a": {"x": 1}, "b": {"x": 1, "y": 2}}
    assert parse_yaml("", "text") is None


@pytest.mark.parametrize(("text", "words"), [("a: {x: 1, x: 2}", "'x' is given twice"), ("a: [", "expected YAML")])
def test_repeated_keys_and_broken_text_are_named(text, words):
    with pytest.raises(InputError, match=words) as error:
        parse_yaml(text, "here")
    assert str(error.value).startswith("here: ")
    assert "\n" not in str(error.value)
