"""Tables of all kinds, watched as the sorting robot would."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapes import part_of_package

from sum_drake.association import greedy_matches
from sum_drake.bench.hypotheses import is_right
from sum_drake.bench.watching import Setting, Tables, compare_matches, setting
from sum_drake.detection.inference import load_detector
from sum_drake.filter_config import filter_config
from sum_drake.objects import Catalogue

LABELS = ("soup_can", "mustard", "sugar")
SIMULATED = Setting(
    1, objects=3, others=1, head=True, sensor="structured_light", trained=False, own_meshes=True
)  # fmt: skip


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory) -> Catalogue:
    return part_of_package(tmp_path_factory.mktemp("watching"), LABELS)


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


@given(
    arrays(float, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.sampled_from([0.0, 0.02, 0.1, 0.4, 1.0]))
)
def test_greedy_matches_are_held_against_the_best_there_are(scores: np.ndarray) -> None:
    found = compare_matches(scores, 0.05, 3)
    assert found.observation == 3
    assert found.greedy == len(greedy_matches(scores, 0.05)) <= min(scores.shape)
    assert found.greedy_score <= found.best_score + 1e-9 <= 2 * found.greedy_score + 1e-6, (
        "greedy is half as good or better"
    )
    assert not found.same or found.greedy_score == pytest.approx(found.best_score)


def test_what_an_update_costs_is_told_apart(tables: Tables) -> None:
    table, onlooker, watcher, rng = tables.begin(SIMULATED)
    for step in range(2):
        watcher.observe(table, onlooker.look(table, step, rng))
    first, second = watcher.updates
    assert (first.tracked, second.tracked > 0) == (0, True)
    assert first.spawning_cpu_s > first.tracking_cpu_s
    assert second.tracking_cpu_s > 0
