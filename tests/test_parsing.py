"""Models are read without a network, and what that takes leaves no trace."""

import os

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from sum_drake.parsing import add_packages, make_parser, parser_allowed
from sum_drake.robot import FETCH_URDF, JOINTS

SWITCH = "DRAKE_ALLOW_NETWORK"


def test_a_model_of_the_package_is_read_where_downloads_are_forbidden(monkeypatch):
    monkeypatch.setenv(SWITCH, "none")
    plant = MultibodyPlant(0.001)
    make_parser(plant).AddModelsFromUrl(FETCH_URDF)
    plant.Finalize()
    assert {joint.name for joint in JOINTS} <= {plant.get_joint(index).name() for index in plant.GetJointIndices()}
    assert os.environ[SWITCH] == "none"


@pytest.mark.parametrize(
    ("setting", "known"), [("none", False), ("vtk", False), ("package_map", True), ("vtk:package_map", True)]
)
def test_drakes_remote_models_are_known_only_where_they_may_be_downloaded(monkeypatch, setting, known):
    monkeypatch.setenv(SWITCH, setting)
    packages = make_parser(MultibodyPlant(0.0)).package_map()
    assert packages.Contains("sum_drake")
    assert packages.Contains("drake_models") == known


def test_without_the_switch_nothing_is_forbidden_and_nothing_is_set(monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    with parser_allowed():
        parser = Parser(MultibodyPlant(0.0))
    assert add_packages(parser).package_map().Contains("drake_models")
    assert SWITCH not in os.environ


def test_the_switch_is_put_back_when_the_block_fails(monkeypatch):
    monkeypatch.setenv(SWITCH, "none")
    with pytest.raises(RuntimeError, match="no parser"), parser_allowed():
        raise RuntimeError("no parser")
    assert os.environ[SWITCH] == "none"
