import pytest

from sum_drake.assets import InputError
from sum_drake.filter_config import FilterConfig, filter_config


def test_unknown_preset_and_settings_are_refused() -> None:
    with pytest.raises(InputError, match="fastest"):
        filter_config("fastest")
    for field in ("render", "start", "score"):
        with pytest.raises(InputError, match=rf"filter\.{field}: 'never' is unknown; expected '\w+' or '\w+'"):
            FilterConfig(**{field: "never"})
    with pytest.raises(InputError, match="normals"):
        FilterConfig(render="each")
    with pytest.raises(InputError, match=r"filter\.without: 'luck' is unknown; expected some of close"):
        FilterConfig(without=("luck",))
