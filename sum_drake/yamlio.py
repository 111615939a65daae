"""YAML without silent surprises."""

from typing import Any

import yaml

from sum_drake.assets import InputError, one_line


def parse_yaml(text: str, where: str) -> Any:
    """Like `yaml.safe_load`, but a repeated key is an error rather than the last one winning.

    where: names the source in errors. Raises InputError.
    """
    try:
        _check_keys(yaml.compose(text, Loader=yaml.SafeLoader), where)
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InputError(f"{where}: {one_line(error)}; expected YAML") from error


def _check_keys(node: Any, where: str) -> None:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    keys = [key.value for key, _ in pairs]
    for key in keys:
        if isinstance(key, str) and keys.count(key) > 1:
            raise InputError(f"{where}: {key!r} is given twice; expected every key once")
    for _, child in pairs:
        _check_keys(child, where)
