"""Picks with true poses: what counts as what, and one that is really done."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh
from scenes import standing
from shapes import CONFIG, part_of_package, write_model

from sum_drake.bench.plan_picks import (
    AIMS,
    FULL,
    QUICK,
    Picked,
    Size,
    failed_phase,
    measure_picks,
    no_hand_could,
    pick_figures,
    pick_rows,
    pick_tasks,
    scenario_for,
    surface_points,
)
from sum_drake.geometry import transform
from sum_drake.objects import load_catalogue
from sum_drake.systems.referee import TruthSample
from sum_drake.systems.scenario import load_scenario
from sum_drake.task import region_of
from sum_drake.types import readonly

CATALOGUE = load_catalogue()
WORKED = Picked(
    "alone", 1, "mug", True, "bin", "", "", slip_m=0.002, slip_from_grasp_m=0.004,
    violations=(("position", 0), ("speed", 0), ("effort", 0)), speed_use=0.9,
)  # fmt: skip
LOST = dataclasses.replace(WORKED, succeeded=False, place="table", phase="transport", cause="lost_in_transport")
NO_PLAN = dataclasses.replace(LOST, phase="plan", cause="ik", slip_m=None, slip_from_grasp_m=None)


def test_no_two_picks_are_of_one_pour():
    tasks = pick_tasks(FULL, CATALOGUE)
    assert len({seed for _, seed, _ in tasks}) == len(tasks) == 15 * 5 + 75
    assert {label for setting, _, label in tasks if setting == "alone"} == set(CATALOGUE.labels)
    others = {seed for _, seed, _ in pick_tasks(FULL, CATALOGUE, seed=1)}
    assert not others & {seed for _, seed, _ in tasks}
    assert {task[2] for task in pick_tasks(QUICK, CATALOGUE)} <= {*CATALOGUE.labels, ""}


def test_figures_are_shares_of_what_some_hand_could_have_taken():
    clutter = dataclasses.replace(WORKED, setting="clutter", refused=(("tide", "lift"),), knocked_off=("sugar",))
    hopeless = dataclasses.replace(NO_PLAN, hopeless=True)
    slipping = dataclasses.replace(WORKED, slip_m=0.05, violations=(("position", 0), ("speed", 3), ("effort", 1)))
    found = pick_figures([WORKED, slipping, LOST, NO_PLAN, hopeless, clutter, clutter])
    assert found["pick_success_alone"] == pytest.approx(2 / 4)
    assert found["pick_success_alone_executed"] == pytest.approx(2 / 3)
    assert found["pick_success_clutter"] == 1.0
    assert (found["clutter_refused"], found["clutter_knocked_off"]) == (0.5, 1.0)
    assert found["limit_violations"] == 4
    assert 0.002 < found["slip_p95_m"] < 0.05 and found["slip_from_grasp_p95_m"] == pytest.approx(0.004)
    assert found["hopeless"] == 1
    assert AIMS.keys() <= found.keys()


def test_without_picks_there_is_nothing_to_tell():
    found = pick_figures([])
    assert np.isnan([found["pick_success_alone"], found["slip_p95_m"], found["speed_use"]]).all()
    assert found["limit_violations"] == 0
    assert pick_rows([]) == []


def test_rows_tell_success_by_object_and_failures_by_cause():
    rows = pick_rows([WORKED, LOST, LOST, NO_PLAN, dataclasses.replace(WORKED, label="tide")])
    objects = {row["label"]: (row["picks"], row["succeeded"]) for row in rows if row["table"] == "pick_object"}
    assert objects == {"mug": (4, 1), "tide": (1, 1)}
    failures = [(row["phase"], row["cause"], row["count"]) for row in rows if row["table"] == "pick_failure"]
    assert failures == [("transport", "lost_in_transport", 2), ("plan", "ik", 1)]
    assert sum(row["table"] == "pick" for row in rows) == 5
    json.dumps(rows)


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


def test_a_pick_is_done_once_and_kept(tmp_path):
    catalogue = part_of_package(tmp_path, ("sugar",))
    (picked,) = measure_picks(tmp_path / "out", catalogue, size=Size(1, 1, 0), workers=1)
    assert picked.label == "sugar" and picked.succeeded, picked
    assert picked.place == "non_cleaning_bin" and picked.phase == ""
    assert 0 <= picked.slip_m < 0.02 and picked.cpu_s > picked.planning_cpu_s > 0
    assert sum(count for _, count in picked.violations) == 0
    assert 0.5 < picked.speed_use < 1.02 and 0 < picked.effort_use < 1
    told = []
    (again,) = measure_picks(
        tmp_path / "out", catalogue, size=Size(1, 1, 0), workers=1, progress=lambda *of: told.append(of[1:])
    )
    assert told == [(1, 1)]
    np.testing.assert_equal(pick_figures([again]), pick_figures([picked]))  # to which nan is itself
