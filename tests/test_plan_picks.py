"""Picks with true poses: what counts as what."""

import dataclasses
import json

import numpy as np
import pytest

from sum_drake.bench.plan_picks import AIMS, FULL, QUICK, Picked, pick_figures, pick_rows, pick_tasks
from sum_drake.objects import load_catalogue

CATALOGUE = load_catalogue()
WORKED = Picked(
    "alone", 1, "mug", True, "bin", "", "", slip_m=0.002, slip_from_grasp_m=0.004,
    violations=(("position", 0), ("speed", 0), ("effort", 0)), speed_use=0.9,
)  # fmt: skip
LOST = dataclasses.replace(WORKED, succeeded=False, place="table", phase="transport", cause="lost_in_transport")
NO_PLAN = dataclasses.replace(LOST, phase="plan", cause="ik", slip_m=None, slip_from_grasp_m=None)


def test_no_two_picks_are_of_one_pour():
    tasks = pick_tasks(FULL, CATALOGUE)
    assert len({seed for _, seed, _ in tasks}) == len(tasks) == 15 * 4 + 60
    assert {label for setting, _, label in tasks if setting == "alone"} == set(CATALOGUE.labels)
    others = {seed for _, seed, _ in pick_tasks(FULL, CATALOGUE, seed=1)}
    assert not others & {seed for _, seed, _ in tasks}
    assert {task[2] for task in pick_tasks(QUICK, CATALOGUE)} <= {*CATALOGUE.labels, ""}


def test_what_no_hand_could_take_counts_as_failed():
    clutter = dataclasses.replace(
        WORKED, setting="clutter", refused=(("tide", "lift"),), knocked_off=("sugar",), pushed_m=0.3
    )
    hopeless = dataclasses.replace(NO_PLAN, hopeless=True)
    slipping = dataclasses.replace(WORKED, slip_m=0.05, violations=(("position", 0), ("speed", 3), ("effort", 1)))
    found = pick_figures([WORKED, slipping, LOST, NO_PLAN, hopeless, clutter, clutter])
    assert found["pick_success_alone"] == pytest.approx(2 / 5)
    assert found["pick_success_alone_but_hopeless"] == pytest.approx(2 / 4)
    assert found["pick_success_alone_executed"] == pytest.approx(2 / 3)
    assert found["pick_success_clutter"] == 1.0
    assert (found["clutter_refused"], found["clutter_knocked_off"]) == (0.5, 1.0)
    assert found["clutter_pushed_median_m"] == pytest.approx(0.3)
    assert found["limit_violations"] == 4
    assert 0.002 < found["slip_p95_m"] < 0.05 and found["slip_from_grasp_p95_m"] == pytest.approx(0.004)
    assert found["hopeless"] == 1
    assert AIMS.keys() <= found.keys()


def test_a_table_without_any_plan_is_refused_as_a_whole():
    none = dataclasses.replace(NO_PLAN, setting="clutter", refused=(("tide", "lift"), ("tea", "ik")))
    assert pick_figures([none])["clutter_refused"] == 1.0
    assert pick_figures([none, dataclasses.replace(WORKED, setting="clutter")])["clutter_refused"] == 3 / 4


def test_without_picks_there_is_nothing_to_tell():
    found = pick_figures([])
    assert np.isnan([found["pick_success_alone"], found["slip_p95_m"], found["speed_use"]]).all()
    assert found["limit_violations"] == 0
    assert pick_rows([]) == []


def test_rows_tell_success_by_object_and_failures_by_cause():
    rows = pick_rows([WORKED, LOST, LOST, NO_PLAN, dataclasses.replace(WORKED, label="tide")])
    objects = {row["label"]: (row["picks"], row["succeeded"]) for row in rows if row["table"] == "pick_object"}
    assert objects == {"mug": (4, 1), "tide": (1, 1)}
    failures = [(row["phase"], row["cause"], row["which"]) for row in rows if row["table"] == "pick_failure"]
    assert failures == [("transport", "lost_in_transport", ["mug 1", "mug 1"]), ("plan", "ik", ["mug 1"])]
    assert sum(row["table"] == "pick" for row in rows) == 5
    json.dumps(rows)
