"""Poured scenes: on the table, touching but not overlapping, at rest, and a function of the seed."""

import functools

import numpy as np
import pytest
from pydrake.multibody.parsing import LoadModelDirectives, Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from sum_drake.assets import MODELS, PACKAGE_XML, InputError
from sum_drake.objects import load_catalogue
from sum_drake.systems.pouring import PouringConfig, draw_labels, pour
from sum_drake.types import Array

CATALOGUE = load_catalogue()
DIRECTIVES = LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml")).directives
PLANT = MultibodyPlantConfig(
    time_step=0.004, contact_model="hydroelastic_with_fallback", discrete_contact_approximation="sap"
)
TOP = 0.70
SCENES = [(5, 0), (5, 1), (5, 2), pytest.param(10, 0, marks=pytest.mark.slow)]


def pour_labels(labels: tuple[str, ...], seed: int, config: PouringConfig | None = None) -> dict[str, Array]:
    objects = [CATALOGUE[label] for label in labels]
    return pour(objects=objects, directives=DIRECTIVES, plant_config=PLANT, config=config or PouringConfig(), seed=seed)


@functools.cache
def scene(count: int, seed: int) -> dict[str, Array]:
    return pour_labels(draw_labels(CATALOGUE, count, np.random.default_rng(seed)), seed)


def lowest(label: str, X_WO: Array) -> float:
    """World z of the visual mesh's lowest vertex."""
    vertices = CATALOGUE[label].load_mesh().vertices
    return float((vertices @ X_WO[2, :3] + X_WO[2, 3]).min())


@pytest.mark.parametrize(("count", "seed"), SCENES)
def test_all_lie_on_the_table_within_reach(count: int, seed: int) -> None:
    X_WOs = scene(count, seed)
    assert len(X_WOs) == count
    for label, X_WO in X_WOs.items():
        np.testing.assert_allclose(X_WO[:3, :3] @ X_WO[:3, :3].T, np.eye(3), atol=1e-9)
        assert not X_WO.flags.writeable
        assert 0.44 <= X_WO[0, 3] <= 0.80 and abs(X_WO[1, 3]) < 0.45
        # Collision pieces stand for the mesh to a few millimetres.
        assert lowest(label, X_WO) > TOP - 0.006
    assert min(lowest(label, X_WO) for label, X_WO in X_WOs.items()) < TOP + 0.006


@pytest.mark.parametrize(("count", "seed"), SCENES)
def test_nothing_overlaps_and_nothing_moves_when_the_station_takes_over(count: int, seed: int) -> None:
    """In a fresh plant with the table in place the poses overlap by at most 2 mm and hold for .5 s."""
    X_WOs = scene(count, seed)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(PLANT, builder)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(PACKAGE_XML))
    table = parser.AddModelsFromUrl("package://sum_drake/scenes/table.sdf")[0]
    weld = next(d.add_weld for d in DIRECTIVES if d.add_weld is not None and d.add_weld.child == "table::table")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("table", table), weld.X_PC.GetDeterministicValue())
    instances = {label: parser.AddModels(str(CATALOGUE[label].sdf))[0] for label in X_WOs}
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for label, instance in instances.items():
        plant.SetPositions(context, instance, _positions(X_WOs[label]))
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(simulator.get_context()))
    overlaps = [pair.depth for pair in query.ComputePointPairPenetration()]
    assert max(overlaps) <= 0.0021
    simulator.AdvanceTo(0.5)
    for label, instance in instances.items():
        moved = plant.GetPositions(context, instance)[4:] - X_WOs[label][:3, 3]
        assert np.linalg.norm(moved) < 0.005, label


def _positions(X_WO: Array) -> Array:
    from pydrake.math import RotationMatrix

    return np.concatenate([RotationMatrix(X_WO[:3, :3]).ToQuaternion().wxyz(), X_WO[:3, 3]])


def test_a_scene_is_a_function_of_its_seed() -> None:
    labels = ("soup_can", "mug", "sugar")
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


def test_gives_up_with_a_reason() -> None:
    with pytest.raises(RuntimeError, match="out of reach"):
        pour_labels(("soup_can",), 0, PouringConfig(reach_x=(0.0, 0.1), attempts=1))
