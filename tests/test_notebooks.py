import os
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
SAID = {
    "one_run": ("accepted", "sorted"),
    "one_scene": ("within 2 cm and 20 degrees", "accepted", "off by"),
    "results": ("pose: ", "estimates in", "reject: "),
}
"""What each says in the end, if it got there."""


def test_every_notebook_is_run():
    assert {path.stem for path in NOTEBOOKS.glob("*.py")} == SAID.keys()


@pytest.mark.parametrize("notebook", SAID)
def test_notebook_runs_from_top_to_bottom(notebook, tmp_path):
    environment = {**os.environ, "SUM_DRAKE_NOTEBOOK_OBJECTS": "2"}
    done = subprocess.run(
        [sys.executable, str(NOTEBOOKS / f"{notebook}.py")],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for words in SAID[notebook]:
        assert words in done.stdout
