"""Hypotheses of poured tables: estimated as the sorting robot's are, and judged against the truth."""

import dataclasses

import numpy as np
import pytest
from shapes import part_of_package

from sum_drake.bench.hypotheses import Setting, Tables, is_right, setting
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


def test_settings_are_balanced_and_functions_of_the_seed() -> None:
    drawn = [setting(seed) for seed in range(200)]
    assert drawn == [setting(seed) for seed in range(200)]
    for name in ("head", "trained", "own_meshes"):
        assert 0.35 < np.mean([getattr(at, name) for at in drawn]) < 0.65
    assert {at.sensor for at in drawn} == {"structured_light", "stereo"}
    assert {setting(seed).sensor for seed in range(1000, 1100)} == {"structured_light", "wide_stereo"}
    assert 0.35 < np.mean([at.others > 0 for at in drawn]) < 0.65


def test_looks_at_a_table_are_believed_one_after_the_other(tables: Tables, catalogue: Catalogue) -> None:
    table, onlooker, watcher, rng = tables.begin(SIMULATED)
    first = watcher.observe(table, onlooker.look(table, 0, rng))
    second = watcher.observe(table, onlooker.look(table, 1, rng))
    assert second.prior is first.posterior
    right = {track.label for track in first.posterior.tracks if is_right(track, table, catalogue)}
    assert right
    assert right <= set(table.X_WOs)
    again, other, watcher, rng = tables.begin(SIMULATED)
    repeated = watcher.observe(again, other.look(again, 0, rng))
    assert [(t.label, t.probability) for t in repeated.posterior.tracks] == [
        (t.label, t.probability) for t in first.posterior.tracks
    ]


def test_the_simulated_detector_takes_things_that_no_label_fits_for_objects(tables: Tables) -> None:
    table, onlooker, watcher, rng = tables.begin(SIMULATED)
    other = next(thing for thing in table.things if not thing.is_object)
    alone = dataclasses.replace(table, things=(other,))
    found = [watcher.detect(alone, onlooker.look(alone, step, rng)) for step in range(4)]
    assert max(map(len, found)) >= 1
    assert {label for boxes in found for box in boxes for label, _ in box.p_labels} <= set(LABELS)


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
    judged = tables.first_look(3)
    assert judged
    assert not judged[0].trained
    assert {one.table for one in judged} == {3}
    assert all(0 <= one.probability <= 1 and one.label in LABELS for one in judged)
    assert all("sunk_m" in dict(one.features) for one in judged)
