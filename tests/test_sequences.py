"""Tables to which something happens between looks, with three objects and real components."""

import numpy as np
import pytest
from shapes import part_of_package

from sum_drake.bench.sequences import LOOKS, mistake, run_sequence
from sum_drake.bench.watching import Setting, Tables
from sum_drake.detection.inference import load_detector
from sum_drake.filter_config import filter_config

LABELS = ("soup_can", "mustard", "sugar", "tide")


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    catalogue = part_of_package(tmp_path_factory.mktemp("sequences"), LABELS)
    return Tables(catalogue, catalogue, load_detector(None, labels=LABELS), filter_config())


def setting(seed):
    return Setting(seed, objects=3, others=0, head=True, sensor="structured_light", trained=True, own_meshes=True)


@pytest.mark.parametrize("fault", ["drops", "taken", "frame_missing", "wrong_repeated"])
def test_what_something_happened_to_is_found_again_or_given_up(tables, fault):
    followed = run_sequence(tables, setting(5), fault)
    assert followed is not None and followed.outcomes
    for outcome in followed.outcomes:
        assert outcome.fault == fault
        assert 0 < outcome.handled_after <= LOOKS
    assert {one.observation for one in followed.judged} == {0, 2} if fault == "frame_missing" else {0, 1, 2}
    assert len(followed.updates) == 1 + LOOKS
    assert followed.updates[-1].tracked > 0 and followed.updates[-1].tracking_cpu_s > 0
    assert all(0 <= one.greedy_score <= one.best_score + 1e-9 for one in followed.matched)


def test_an_action_is_told_as_the_robot_knows_it_and_judged_by_what_is_seen(tables):
    followed = run_sequence(tables, setting(5), "misses")
    (outcome,) = followed.outcomes
    assert (outcome.happened, outcome.believed, outcome.handled_after) == ("stayed", "stayed", 1)


def test_a_mistake_is_of_a_label_that_is_not_there(tables):
    table, onlooker, _, rng = tables.begin(setting(6))
    sight = onlooker.look(table, 0, rng)
    for seed in range(8):
        wrong = mistake(table, sight, tables.catalogue, np.random.default_rng(seed))
        ((label, _),) = wrong.p_labels
        assert label not in table.X_WOs
        assert min(wrong.box[2:]) > 0
