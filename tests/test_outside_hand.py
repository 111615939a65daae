"""A hand that sweeps, takes and adds: in the station's own physics."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from scenes import standing

from sum_drake.faults import FaultConfig
from sum_drake.objects import load_catalogue
from sum_drake.systems.outside_hand import act, waiting_place
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.station import make_station, object_bodies, set_home


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


class Station:
    """With sugar and mug on the table, and a toy that waits."""

    def __init__(self, catalogue):
        scenario = load_scenario(catalogue=catalogue)
        self.table, self.catalogue = scenario.region("table"), catalogue
        X_WOs = {
            "sugar": standing(catalogue, "sugar", 0.6, 0.15),
            "mug": standing(catalogue, "mug", 0.65, -0.15),
            "toy": waiting_place(catalogue["toy"], 0),
        }
        self.station = make_station(
            plant_config=scenario.plant_config, directives=scenario.directives,
            camera=scenario.cameras["head_camera"], noise=scenario.depth_noise,
            objects={label: (str(catalogue[label].sdf), X_WO) for label, X_WO in X_WOs.items()}, seed=0,
        )  # fmt: skip
        self.simulator = Simulator(self.station)
        self.root = self.simulator.get_mutable_context()
        set_home(self.station, self.root)
        self.station.GetInputPort("fetch.desired_state").FixValue(self.root, np.zeros(24))
        self.bodies = object_bodies(self.station)

    def act(self, kind, *, label="", spared="", seed=0):
        done = act(
            0, FaultConfig(kind, 0, label), self.station, self.root, observation=3, table=self.table,
            model_of_added=self.catalogue["toy"], spared=spared, place=0, rng=np.random.default_rng(seed),
        )  # fmt: skip
        self.simulator.AdvanceTo(self.root.get_time() + 1.0)
        return done

    def p_W(self, label):
        poses = self.station.GetOutputPort("truth.body_poses").Eval(self.root)
        return poses[self.bodies[label]].translation()


@pytest.fixture
def station(catalogue):
    return Station(catalogue)


def test_what_is_swept_moves_and_what_the_robot_is_about_to_pick_does_not(station):
    before = {label: station.p_W(label) for label in ("sugar", "mug")}
    done = station.act("swept", spared="sugar")
    assert (done.kind, done.label, done.observation) == ("swept", "mug", 3)
    assert np.linalg.norm(station.p_W("mug") - before["mug"]) > 0.02
    assert np.linalg.norm(station.p_W("sugar") - before["sugar"]) < 0.005


def test_what_is_taken_is_gone_and_what_is_added_lies_on_the_table(station):
    assert not station.table.holds(station.p_W("toy"))
    assert station.act("added").label == "toy"
    assert station.table.holds(station.p_W("toy"))
    assert station.act("taken", label="mug").label == "mug"
    assert not station.table.holds(station.p_W("mug"))
    assert station.p_W("mug")[2] > 0.0, "it lies on the floor, and has not fallen through"


def test_a_hand_finds_nothing_where_nothing_is(station):
    assert station.act("taken", label="toy") is None
    assert station.act("swept", label="sugar", spared="sugar") is None


def test_its_seed_decides(catalogue):
    places = [Station(catalogue) for _ in range(2)]
    for one in places:
        one.act("swept", seed=4)
    assert all(np.array_equal(places[0].p_W(label), places[1].p_W(label)) for label in ("sugar", "mug"))
