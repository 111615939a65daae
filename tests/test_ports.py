import pytest

from sum_drake.systems.ports import abstract, pack, unpack
from sum_drake.types import Motion


@pytest.mark.parametrize("value", [None, (), "", 0, Motion(3, ())])
def test_any_value_goes_through_a_port_and_comes_back_as_itself(value):
    assert unpack(abstract(value).get_value()) == value
    assert unpack(abstract(value).Clone().get_value()) == value
    holder = abstract()
    holder.set_value(pack(value))
    assert unpack(holder.get_value()) == value
