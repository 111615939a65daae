"""Hypotheses of poured tables: estimated as the sorting robot's are, and judged against the truth."""

import dataclasses

import numpy as np
import pytest
from shapes import part_of_package

from sum_drake.bench.hypotheses import first_look, is_right
from sum_drake.bench.watching import Setting, Tables, setting
from sum_drake.detection.inference import load_detector
from sum_drake.filter_config import filter_config
from sum_drake.geometry import transform
from sum_drake.objects import Catalogue

LABELS = ("soup_can", "mustard", "sugar")
SIMULATED = Setting(
    1, objects=3, others=1, head=True, sensor="structured_light", trained=False, own_meshes=True
)  # fmt: skip


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory) -> Catalogue:
    return part_of_package(tmp_path_factory.mktemp("hypotheses"), LABELS)


@pytest.fixture(scope="module")
def tables(catalogue: Catalogue) -> Tables:
    return Tables(catalogue, catalogue, load_detector(None, labels=LABELS), filter_config())


def test_an_estimate_is_right_where_its_object_is_and_nowhere_else(tables: Tables, catalogue: Catalogue) -> None:
    table, onlooker, watcher, rng = tables.begin(SIMULATED)
    track = watcher.observe(table, onlooker.look(table, 0, rng)).posterior.tracks[0]
    label, X_WO = next(iter(table.X_WOs.items()))

    def right(X_WA: np.ndarray, said: str = label) -> bool:
        return is_right(dataclasses.replace(track, label=said, X_WO=X_WA), table, catalogue)

    assert right(X_WO)
    assert not right(transform(np.eye(3), np.array([0.03, 0.0, 0.0])) @ X_WO)
    missing = dataclasses.replace(table, things=tuple(t for t in table.things if t.name != label))
    assert not is_right(dataclasses.replace(track, label=label, X_WO=X_WO), missing, catalogue)


def test_every_hypothesis_of_a_look_is_judged(tables: Tables) -> None:
    look = first_look(tables, setting(3))
    judged = look.judged
    assert judged
    assert not judged[0].trained
    assert {one.table for one in judged} == {3}
    assert all(0 <= one.probability <= 1 and one.label in LABELS for one in judged)
    assert all("sunk_m" in dict(one.features) for one in judged)
