"""The problem sets for the Fetch: those committed are valid and not trivial, and come from a seed."""

import json

import numpy as np
import pytest

from sum_drake import geometry
from sum_drake import robot as fetch
from sum_drake.assets import MODELS
from sum_drake.bench.plan_scenes import MAKERS
from sum_drake.bench.plan_sets import JOINTS, KINDS, fetch_robot, make_problem, write_sets
from sum_drake.kinematics import Arm
from sum_drake.planning_problems import load_problems, problem_checker, refusal
from sum_drake.user_robot import plant_positions

FOLDER = MODELS / "problems"


@pytest.fixture(scope="module")
def robot():
    return fetch_robot()


@pytest.mark.parametrize("kind", KINDS)
def test_a_committed_set_is_valid(robot, kind):
    problems = load_problems(FOLDER / f"{kind}.json", robot)
    assert len(problems) == 40
    assert len({problem.request for problem in problems}) == 40
    assert len({problem.obstacles[0].X_WO.tobytes() for problem in problems}) == 40, "no two scenes are the same"
    for problem in problems[::5]:
        assert problem.joints == JOINTS
        checker = problem_checker(robot, problem)
        assert refusal(checker, robot, problem, "start") is None
        assert refusal(checker, robot, problem, "goal") is None
        line = plant_positions(checker, JOINTS, np.linspace(problem.start, problem.goal, 200))
        assert not all(checker.CheckConfigCollisionFree(q) for q in line), problem.request


@pytest.mark.parametrize(("kind", "part"), [("shelf", "board"), ("cage", "table"), ("under_table", "top")])
def test_the_hand_goes_among_the_furniture(robot, kind, part):
    """The goal's hand is over the footprint of shelf or cage, and under its roof, or under the table."""
    for problem in load_problems(FOLDER / f"{kind}.json", robot):
        parts = [obstacle for obstacle in problem.obstacles if obstacle.name.startswith(part)]
        p_WG = Arm().forward(problem.goal)[:3, 3]
        p_PG = geometry.apply(geometry.inverse(parts[0].X_WO), p_WG[None])[0]
        assert (np.abs(p_PG[:2]) < 0.5 * np.array(parts[0].shape.size()[:2])).all(), problem.request
        roof = parts if kind != "cage" else [each for each in problem.obstacles if each.name.startswith("roof")]
        assert p_WG[2] < max(each.X_WO[2, 3] for each in roof), problem.request


def test_starts_are_folded_or_over_the_table(robot):
    for kind in KINDS:
        starts = np.array([entry["start"] for entry in json.loads((FOLDER / f"{kind}.json").read_text())])
        folded = (np.abs(starts - fetch.VIEW)[:, 1:] < 0.13).all(1)
        assert folded.all() if kind != "under_table" else 8 <= folded.sum() <= 32


@pytest.mark.parametrize("kind", KINDS)
def test_the_committed_sets_come_from_seed_0(robot, kind):
    entries = json.loads((FOLDER / f"{kind}.json").read_text())
    assert make_problem(kind, 0, 2, robot) == entries[2]
    assert make_problem(kind, 1, 2, robot) != entries[2]


def test_a_written_set_can_be_read(robot, tmp_path):
    write_sets(tmp_path / "sets", count=1, seed=5)
    for kind in KINDS:
        (problem,) = load_problems(tmp_path / "sets" / f"{kind}.json", robot)
        assert problem.request == f"{kind}_0000"


@pytest.mark.parametrize("kind", KINDS)
def test_scenes_differ_in_all_that_is_drawn(kind):
    scenes = [MAKERS[kind](np.random.default_rng(seed))[0] for seed in range(8)]
    assert len({scene.X_WF.tobytes() for scene in scenes}) == 8
    assert len({json.dumps(scene.obstacles[0]["dimensions"]) for scene in scenes}) == 8
    for scene in scenes:
        assert len({obstacle["id"] for obstacle in scene.obstacles}) == len(scene.obstacles)
