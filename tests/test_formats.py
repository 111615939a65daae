"""docs/formats.md names everything that the files hold."""

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sum_drake import action_model, belief, faults, grasp_ranking, pick_phases, reflex, runlog, summary_schema
from sum_drake.geometry import SYMMETRIES
from sum_drake.systems import run_log

FORMATS = (Path(__file__).parents[1] / "docs" / "formats.md").read_text()
WORDS = set(re.findall(r"[\w/-]+", FORMATS))


def names(kind: Any) -> list[str]:
    """Every field of the summary's schema."""
    if isinstance(kind, list):
        return names(kind[0])
    if not isinstance(kind, dict):
        return []
    fields = [name for name in kind if isinstance(name, str)]
    return fields + [inner for value in kind.values() for inner in names(value)]


@pytest.mark.parametrize(
    "listed",
    [
        summary_schema.OUTCOMES, summary_schema.FATES, pick_phases.REASONS, grasp_ranking.CAUSES, SYMMETRIES,
        names(summary_schema._SUMMARY), names(summary_schema._FALSE_DETECTION), names(summary_schema.FAULT),
        names(summary_schema._GONE), names(summary_schema.LIMITS), faults.KINDS, belief.ENDS, action_model.OUTCOMES,
        reflex.CAUSES,
    ],
    ids=["outcomes", "fates", "reasons", "causes", "symmetries", "summary", "false detections", "faults", "gone",
         "limits", "kinds of fault", "ends of tracks", "outcomes of actions", "causes of stops"],
)  # fmt: skip
def test_everything_is_listed(listed: Any) -> None:
    assert sorted(set(listed) - WORDS) == []


def test_topics_and_schemas_are_listed() -> None:
    assert runlog.__doc__ is not None
    topics = re.findall(r"^ +(/\S+)", runlog.__doc__, re.MULTILINE)
    assert len(topics) == 16 and set(topics) <= WORDS
    assert {summary_schema.SCHEMA, runlog.SCHEMA} <= WORDS


def test_events_are_listed() -> None:
    assert set(re.findall(r'(?:yield|get_time\(\),) "(\w+)"', inspect.getsource(run_log))) <= WORDS


def test_links_within_the_page_lead_somewhere() -> None:
    heads = [re.sub(r"[^\w -]", "", head).lower().replace(" ", "-") for head in re.findall(r"^#+ (.*)", FORMATS, re.M)]
    assert set(re.findall(r"\(#([^)]*)\)", FORMATS)) <= set(heads)


def test_planning_from_python_works_as_it_stands(capsys: pytest.CaptureFixture[str]) -> None:
    section = FORMATS[FORMATS.index("### Planning from Python") :]
    found = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {}
    exec(found[1], names)
    path, X_WG = names["path"], names["X_WG"]
    assert path.qs.shape[1] == 8 and capsys.readouterr().out
    np.testing.assert_allclose(names["arm"].forward(path.qs[-1]), X_WG, atol=1e-6)
    assert X_WG[2, 0] < -0.9 and names["scene"].path_free(path.qs)
