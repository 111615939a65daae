"""Paths that picks ask for: those committed, their files, and what is measured of one."""

import dataclasses

import numpy as np
import pytest

from sum_drake.assets import MODELS, InputError
from sum_drake.bench.plan_queries import KINDS, load_queries, make_queries, measure_query, query_scene, write_queries
from sum_drake.objects import load_catalogue
from sum_drake.pick_config import PickConfig
from sum_drake.planning_scene import PlanningScene

COMMITTED = MODELS / "problems" / "table.json"


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def base():
    return PlanningScene()


def test_those_committed_are_many_of_every_kind_and_begin_and_end_free(catalogue, base):
    queries = load_queries(COMMITTED)
    assert len(queries) >= 300
    for kind in KINDS:
        assert sum(query.kind == kind for query in queries) >= 90
    assert len({query.request for query in queries}) == len(queries)
    assert {label for query in queries for label, _ in query.objects} == set(catalogue.labels)
    for query in queries[:: len(queries) // 5]:
        scene = query_scene(query, catalogue, base, PickConfig())
        assert scene.is_free(query.start)
        assert scene.free_many(query.goals).all()
        assert scene.confirmed(query.start[None])


@pytest.mark.parametrize("kind", KINDS)
def test_a_query_is_planned_as_in_a_pick(catalogue, base, kind):
    query = next(query for query in load_queries(COMMITTED) if query.kind == kind)
    found = measure_query(query, catalogue, base, seed=0)
    assert found.solved and found.reason == ""
    assert found.kind == kind and found.objects == len(query.objects)
    assert found.free and 0.5 < found.limit_use <= 1.0
    assert found.duration_s > 0.3 and found.length_rad > 0.1
    again = measure_query(query, catalogue, base, seed=0)
    assert (again.checks, again.length_rad) == (found.checks, found.length_rad)


def test_why_there_is_no_path_is_told(catalogue, base):
    query = next(query for query in load_queries(COMMITTED) if query.kind == "approach")
    blocked = np.array([0.0, 0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0])  # the arm in the table
    found = measure_query(dataclasses.replace(query, goals=blocked[None]), catalogue, base, seed=0)
    assert not found.solved and found.reason == "goal_in_collision" and found.duration_s == 0


def test_queries_made_are_read_back_as_they_were(catalogue, tmp_path):
    made = make_queries(catalogue, pours=1, seed=5)
    assert 0 < len(made) <= 3
    write_queries(tmp_path / "q.json", made)
    read = load_queries(tmp_path / "q.json")
    for a, b in zip(made, read, strict=True):
        assert (a.request, a.taken, a.gap) == (b.request, b.taken, b.gap)
        np.testing.assert_array_equal(a.start, b.start)
        np.testing.assert_array_equal(a.goals, b.goals)
        for (label, X), (other, Y) in zip(a.objects, b.objects, strict=True):
            assert label == other
            np.testing.assert_allclose(X, Y, atol=1e-9)


@pytest.mark.parametrize("text", ["", "[{}]", '{"request": 1}', "[1]"])
def test_a_file_of_something_else_is_one_line(tmp_path, text):
    (tmp_path / "q.json").write_text(text)
    with pytest.raises(InputError, match="expected queries"):
        load_queries(tmp_path / "q.json")
