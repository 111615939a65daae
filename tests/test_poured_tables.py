"""Tables that things are poured onto, taken from and pushed on, and what a camera sees of them."""

import dataclasses

import numpy as np
import pytest

from sum_drake.bench.poured_tables import TABLE_TOP, Onlooker, Table, changed, pour_table
from sum_drake.objects import Catalogue, load_catalogue
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.support import sunk

PERFECT = DepthNoiseConfig(enabled=False)


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


@pytest.fixture(scope="module")
def table(catalogue: Catalogue) -> Table:
    return pour_table(catalogue, np.random.default_rng(3), objects=6, others=2)


def onlooker(*, head: bool = True) -> Onlooker:
    return Onlooker(np.random.default_rng(0), head=head, noise=PERFECT)


def test_what_was_poured_lies_on_the_table(catalogue: Catalogue, table: Table) -> None:
    assert len(table.X_WOs) >= 3
    assert len(table.things) - len(table.X_WOs) == 2
    for label, X_WO in table.X_WOs.items():
        assert sunk(np.asarray(catalogue[label].load_mesh().vertices), X_WO, TABLE_TOP) < 0.004


def test_a_seed_is_a_table(catalogue: Catalogue, table: Table) -> None:
    again = pour_table(catalogue, np.random.default_rng(3), objects=6, others=2)
    assert again.X_WOs.keys() == table.X_WOs.keys()
    assert all(np.array_equal(again.X_WOs[label], table.X_WOs[label]) for label in table.X_WOs)


def test_what_is_taken_away_is_not_seen_and_the_rest_stays(table: Table) -> None:
    taken = table.things[0]
    left = changed(table, {taken.name: None})
    assert [thing.name for thing in left.things] == [thing.name for thing in table.things[1:]]
    lone = dataclasses.replace(table, things=(taken,))
    before = onlooker().look(lone, 0, np.random.default_rng(0))
    after = onlooker().look(changed(lone, {taken.name: None}), 1, np.random.default_rng(0))
    was_there = before.owners == 1
    assert was_there.sum() > 1000
    assert (after.frame.depth[was_there] > before.frame.depth[was_there] + 0.005).mean() > 0.9
    assert np.array_equal(after.frame.depth[~was_there], before.frame.depth[~was_there])
    assert after.frame.observation == 1


def test_what_is_pushed_moves_what_is_pushed_far_is_gone_and_what_is_added_lies_there(
    catalogue: Catalogue, table: Table
) -> None:
    lone = dataclasses.replace(table, things=(table.things[0],))
    name = lone.things[0].name
    pushed = changed(lone, {}, velocities={name: np.array([0, 0, 0, 0.0, 0.7, 0.0])})
    assert pushed.things[0].X_WO[1, 3] > lone.things[0].X_WO[1, 3] + 0.02
    assert changed(lone, {}, velocities={name: np.array([0, 0, 0, 0.0, 4.0, 1.0])}).things == ()
    both = changed(lone, {}, added=(table.things[1],))
    assert [thing.name for thing in both.things] == [name, table.things[1].name]


@pytest.mark.parametrize("head", [True, False])
def test_owners_and_depth_are_of_one_picture(table: Table, head: bool) -> None:
    sight = onlooker(head=head).look(table, 0, np.random.default_rng(0))
    seen = (sight.owners >= 1) & (sight.owners <= len(table.things))
    assert seen.mean() > 0.01
    frame = sight.frame
    v, u = np.nonzero(seen & (frame.depth > 0))
    z = frame.depth[v, u]
    camera = frame.camera
    p_C = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z], -1)
    p_W = p_C @ frame.X_WC[:3, :3].T + frame.X_WC[:3, 3]
    above = p_W[:, 2] - TABLE_TOP.floor_height
    assert (above > -0.004).mean() > 0.99
    assert frame.color.shape == (camera.height, camera.width, 3)
