"""Poured scenes: on the table, touching but not overlapping, at rest, and a function of the seed."""

from typing import Any

import numpy as np
import pytest
from pydrake.multibody.parsing import LoadModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from sum_drake.assets import MODELS, InputError
from sum_drake.objects import load_catalogue
from sum_drake.parsing import make_parser
from sum_drake.seeds import derive
from sum_drake.systems import pouring
from sum_drake.systems.pouring import PouringConfig, draw_labels, pour
from sum_drake.types import Array

CATALOGUE = load_catalogue()
DIRECTIVES = LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml")).directives
PLANT = MultibodyPlantConfig(
    time_step=0.004, contact_model="hydroelastic_with_fallback", discrete_contact_approximation="sap"
)
TOP = 0.70
TOPPLING = derive(1238, "pouring")
"""Of a pour in which something stood on an edge, slower than what counts as moving, and fell two seconds later."""
SCENES = [(5, 6), (10, 0), (5, TOPPLING)]


def pour_labels(labels: tuple[str, ...], seed: int, config: PouringConfig | None = None) -> dict[str, Array]:
    objects = [CATALOGUE[label] for label in labels]
    return pour(objects=objects, directives=DIRECTIVES, plant_config=PLANT, config=config or PouringConfig(), seed=seed)


@pytest.fixture(scope="module", params=SCENES, ids=lambda scene: "{} objects, seed {}".format(*scene))
def poured(request: pytest.FixtureRequest) -> dict[str, Array]:
    count, seed = request.param
    X_WOs = pour_labels(draw_labels(CATALOGUE, count, np.random.default_rng(seed)), seed)
    assert len(X_WOs) == count
    return X_WOs


def lowest(label: str, X_WO: Array) -> float:
    """World z of the visual mesh's lowest vertex."""
    vertices = CATALOGUE[label].load_mesh().vertices
    return float((vertices @ X_WO[2, :3] + X_WO[2, 3]).min())


def test_all_lie_on_the_table_within_reach(poured: dict[str, Array]) -> None:
    for label, X_WO in poured.items():
        np.testing.assert_allclose(X_WO[:3, :3] @ X_WO[:3, :3].T, np.eye(3), atol=1e-9)
        assert not X_WO.flags.writeable
        assert 0.44 <= X_WO[0, 3] <= 0.80 and abs(X_WO[1, 3]) < 0.45
        # Collision pieces stand for the mesh to a few millimetres.
        assert lowest(label, X_WO) > TOP - 0.006
    assert min(lowest(label, X_WO) for label, X_WO in poured.items()) < TOP + 0.006


def test_nothing_overlaps_and_nothing_moves_when_the_station_takes_over(poured: dict[str, Array]) -> None:
    """In a fresh plant with the table in place the poses overlap by at most 2 mm and hold for 4 s."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(PLANT, builder)
    parser = make_parser(plant)
    table = parser.AddModelsFromUrl("package://sum_drake/scenes/table.sdf")[0]
    weld = next(d.add_weld for d in DIRECTIVES if d.add_weld is not None and d.add_weld.child == "table::table")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("table", table), weld.X_PC.GetDeterministicValue())
    instances = {label: parser.AddModels(str(CATALOGUE[label].sdf))[0] for label in poured}
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for label, instance in instances.items():
        plant.SetPositions(context, instance, _positions(poured[label]))
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(simulator.get_context()))
    overlaps = [pair.depth for pair in query.ComputePointPairPenetration()]
    assert max(overlaps) <= 0.0021
    simulator.AdvanceTo(4.0)
    for label, instance in instances.items():
        moved = plant.GetPositions(context, instance)[4:] - poured[label][:3, 3]
        assert np.linalg.norm(moved) < 0.001, label


def _positions(X_WO: Array) -> Array:
    from pydrake.math import RotationMatrix

    return np.concatenate([RotationMatrix(X_WO[:3, :3]).ToQuaternion().wxyz(), X_WO[:3, 3]])


def test_a_scene_is_a_function_of_its_seed() -> None:
    labels = ("soup_can", "sugar")
    first, again, other = (pour_labels(labels, seed) for seed in (1, 1, 2))
    for label in labels:
        np.testing.assert_array_equal(first[label], again[label])
        assert np.linalg.norm(other[label] - first[label]) > 0.01


def test_labels_are_drawn_from_the_seed() -> None:
    drawn = draw_labels(CATALOGUE, 5, np.random.default_rng(4))
    assert drawn == draw_labels(CATALOGUE, 5, np.random.default_rng(4))
    assert len(set(drawn)) == 5 and set(drawn) <= set(CATALOGUE.labels)
    assert set(draw_labels(CATALOGUE, 15, np.random.default_rng(0))) == set(CATALOGUE.labels)
    for count in (0, 16):
        with pytest.raises(InputError, match="1 to 15"):
            draw_labels(CATALOGUE, count, np.random.default_rng(0))


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="every label once"):
        pour_labels(("mug", "mug"), 0)
    with pytest.raises(InputError, match="'desk'"):
        pour_labels(("mug",), 0, PouringConfig(support="desk"))


def test_a_state_that_blows_up_is_never_handed_out(monkeypatch: pytest.MonkeyPatch) -> None:
    place = pouring._Pour._place

    def hurl(self: Any, context: Context, instance: Any, quaternion: Array, p_WO: Array) -> None:
        place(self, context, instance, quaternion, p_WO)
        self._plant.SetVelocities(context, instance, np.full(6, 1e200))

    monkeypatch.setattr(pouring._Pour, "_place", hurl)
    with pytest.raises(RuntimeError, match=r"failed 2 times: .*(blew up|broke down).*"):
        pour_labels(("soup_can",), 0, PouringConfig(attempts=2))


def test_gives_up_with_a_reason() -> None:
    with pytest.raises(RuntimeError, match="out of reach"):
        pour_labels(("soup_can",), 0, PouringConfig(reach_x=[0.0, 0.1], attempts=1, returns=1))
