"""Picks with true poses: how one is judged, and one that is really done."""

import numpy as np
import pytest
import trimesh
from scenes import standing
from shapes import CONFIG, part_of_package, write_model

from sum_drake.attempting import region_of
from sum_drake.bench.plan_pick_trials import (
    failed_phase,
    measure_pick,
    no_hand_could,
    scenario_for,
    start_worker,
    surface_points,
)
from sum_drake.bench.plan_picks import Size, pick_tasks
from sum_drake.geometry import transform
from sum_drake.objects import load_catalogue
from sum_drake.systems.referee import TruthSample
from sum_drake.systems.scenario import load_scenario
from sum_drake.types import readonly

CATALOGUE = load_catalogue()


def sample(segment, hand, mug):
    def at(p):
        return readonly(transform(np.eye(3), np.array(p, dtype=float)))

    return TruthSample(0.0, 1, 0, segment, (("mug", at([*mug])),), at([*hand]))


CLOSED = sample("close", (0, 0, 0.8), (0, 0, 0.75))
LIFTED = [sample("lift", (0, 0, z), (0, 0, z - 0.05)) for z in (0.8, 0.9, 1.0)]
CARRIED = [sample("transport", (x, 0, 1.0), (x, 0, 0.95)) for x in (0.0, 0.2, 0.4)]


@pytest.mark.parametrize(
    ("truth", "phase"),
    [
        ([sample("approach", (0, 0, 1.2), (0, 0, 0.75))], "motion"),
        ([CLOSED, *(sample("lift", (0, 0, z), (0, 0, 0.75)) for z in (0.8, 1.0))], "grasp"),
        ([CLOSED, *LIFTED[:2], sample("lift", (0, 0, 1.0), (0, 0.02, 0.75))], "lift"),
        ([CLOSED, *LIFTED, *CARRIED[:2], sample("transport", (0.4, 0, 1.0), (0.25, 0, 0.75))], "transport"),
        ([CLOSED, *LIFTED, *CARRIED, sample("open", (0.4, 0, 1.0), (0.4, 0, 0.3))], "release"),
    ],
)
def test_a_failure_is_of_the_phase_in_which_the_object_left_the_hand(truth, phase):
    assert failed_phase(truth, "mug") == phase


def test_some_things_no_hand_could_take(tmp_path):
    plate = write_model(tmp_path, "plate", trimesh.creation.box([0.3, 0.3, 0.004]))
    brick = write_model(tmp_path, "brick", trimesh.creation.box([0.06, 0.12, 0.05]))
    for model, hopeless in ((plate, True), (brick, False)):
        X_WO = transform(np.eye(3), np.array([0.6, 0.0, 0.7 + model.dimensions[2] / 2]))
        assert no_hand_could(model, X_WO, table_height=0.7, config=CONFIG) == hopeless


def test_every_label_of_any_catalogue_has_a_bin_to_go_to(tmp_path):
    usual = scenario_for(CATALOGUE)
    assert usual.goal == {label: region_of(label, load_scenario().goal, CATALOGUE) for label in CATALOGUE.labels}
    (tmp_path / "few").mkdir()
    few = part_of_package(tmp_path / "few", ("sugar", "tide"))
    entries = few.path.read_text().replace("category: cleaning", "category: strange")
    few.path.write_text(entries)
    scenario = scenario_for(load_catalogue(few.path))
    assert set(scenario.goal) == {"sugar", "tide"} and set(scenario.goal.values()) <= set(scenario.regions)


def test_points_on_neighbours_are_on_their_surfaces():
    mug, can = CATALOGUE["mug"], CATALOGUE["soup_can"]
    points = surface_points(
        [(mug, standing(CATALOGUE, "mug", 0.6, 0.3)), (can, standing(CATALOGUE, "soup_can", 0.6, 0))]
    )
    assert len(points) == 3000 and (points[:1500, 1] > 0.2).all() and (points[1500:, 1] < 0.1).all()
    assert points[:, 2].min() >= 0.7 - 1e-6
    assert surface_points([]).shape == (0, 3)


def test_a_pick_is_done_and_judged(tmp_path):
    catalogue = part_of_package(tmp_path, ("sugar",))
    start_worker(catalogue)
    ((setting, seed, label),) = pick_tasks(Size(1, 1, 0), catalogue)
    picked = measure_pick(setting, seed, label)
    assert picked.label == "sugar" and picked.succeeded, picked
    assert picked.place == "non_cleaning_bin" and picked.phase == ""
    assert 0 <= picked.slip_m < 0.02 and picked.cpu_s > picked.planning_cpu_s > 0
    assert sum(count for _, count in picked.violations) == 0
    assert 0.5 < picked.speed_use < 1.02 and 0 < picked.effort_use < 1
