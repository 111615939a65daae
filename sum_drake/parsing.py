"""Reading models with Drake's parser: this project's package, and no download where downloads are forbidden."""

import contextlib
import os
from collections.abc import Iterator

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from sum_drake.assets import MODELS

_SWITCH = "DRAKE_ALLOW_NETWORK"


@contextlib.contextmanager
def parser_allowed() -> Iterator[None]:
    """A block in which a Parser or a RobotDiagramBuilder can be made although DRAKE_ALLOW_NETWORK forbids downloads.

    Both register Drake's own remote models, and where these are not installed with Drake (a wheel) and may not be
    downloaded, that alone raises. Registering fetches nothing; `add_packages` then takes the registration back.
    """
    setting = os.environ.get(_SWITCH)
    if setting is not None:
        os.environ[_SWITCH] = "package_map"
    try:
        yield
    finally:
        if setting is not None:
            os.environ[_SWITCH] = setting


def add_packages(parser: Parser) -> Parser:
    """Makes package://sum_drake known to `parser` and, where downloads are forbidden, Drake's remote models unknown."""
    packages = parser.package_map()
    packages.Add("sum_drake", str(MODELS))
    setting = os.environ.get(_SWITCH)
    if setting is not None and "package_map" not in setting.split(":"):
        packages.Remove("drake_models")
    return parser


def make_parser(plant: MultibodyPlant) -> Parser:
    """A parser for `plant` (and the SceneGraph it is registered with, if any) that knows package://sum_drake."""
    with parser_allowed():
        parser = Parser(plant)
    return add_packages(parser)
