from pathlib import Path

from sum_drake.assets import MODELS, PACKAGE_XML, asset


def test_package_uris_and_plain_paths_resolve():
    assert PACKAGE_XML.is_file()
    assert asset("package://sum_drake/robots/fetch.urdf") == MODELS / "robots" / "fetch.urdf"
    assert asset("package://sum_drake/robots/fetch.urdf").is_file()
    assert asset("/elsewhere/thing.obj") == Path("/elsewhere/thing.obj")
