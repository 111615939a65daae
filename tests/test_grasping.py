from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sum_drake.geometry import apply, inverse, rotation_from_vector, symmetry_group, transform
from sum_drake.grasping import (
    CAUSES,
    GraspConfig,
    RankedGrasps,
    grasp_candidates,
    half_turn,
    hand_clearances,
    hand_collisions,
    lowest_point,
    opening,
    rank_grasps,
)
from sum_drake.objects import ObjectModel, load_catalogue
from sum_drake.robot import HAND
from sum_drake.types import Array, Grasp, PoseBelief

TABLE = 0.7
# A fraction of the default effort keeps this file quick.
CONFIG = GraspConfig(samples=120, spacing=0.004)
NOTHING = np.zeros((0, 3))


def _model(folder: Path, name: str, mesh: trimesh.Trimesh, mass: float = 0.3) -> ObjectModel:
    path = folder / f"{name}.obj"
    mesh.export(path)
    extents = mesh.extents
    return ObjectModel(
        name, path, "test", symmetry_group("none"), (float(extents[0]), float(extents[1]), float(extents[2])), mass
    )


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ObjectModel]:
    folder = tmp_path_factory.mktemp("meshes")
    profile = np.array([[0, -0.05], [0.04, -0.05], [0.04, 0.05], [0.036, 0.05], [0.036, -0.046], [0, -0.046]])
    cup = trimesh.creation.revolve(profile, sections=40)
    return {
        "carton": _model(folder, "carton", trimesh.creation.box([0.04, 0.08, 0.12])),
        "crate": _model(folder, "crate", trimesh.creation.box([0.20, 0.25, 0.12])),
        "ball": _model(folder, "ball", trimesh.creation.icosphere(3, 0.035)),
        "cup": _model(folder, "cup", cup),
        "slab": _model(folder, "slab", trimesh.creation.box([0.06, 0.10, 0.02])),
        "bar": _model(folder, "bar", trimesh.creation.box([0.04, 0.40, 0.04]), mass=1.0),
    }


def _columns(grasps: tuple[Grasp, ...]) -> tuple[Array, Array]:
    return np.array([g.X_OG for g in grasps]).reshape(-1, 4, 4), np.array([g.width for g in grasps])


def _rank(model: ObjectModel, X_WO: Array, points_W: Array = NOTHING, spread: float = 0.0) -> RankedGrasps:
    X_WOs = np.tile(X_WO, (50, 1, 1))
    X_WOs[:, :3, 3] += np.random.default_rng(0).normal(0, spread, (50, 3))
    return rank_grasps(
        grasp_candidates(model, config=CONFIG, seed=0),
        model=model,
        X_WO=X_WO,
        belief=PoseBelief(X_WOs, np.full(50, 0.02)),
        points_W=points_W,
        table_height=TABLE,
        config=CONFIG,
    )


def _standing(model: ObjectModel) -> Array:
    return transform(np.eye(3), np.array([0.6, 0.0, TABLE + model.dimensions[2] / 2]))


@pytest.mark.parametrize("name", ["carton", "ball", "cup", "slab", "bar"])
def test_the_open_hand_is_free_of_the_object(models: dict[str, ObjectModel], name: str) -> None:
    grasps = grasp_candidates(models[name], config=CONFIG, seed=0)
    assert len(grasps) > 50
    # Points of an independent draw, denser than those the candidates were tested against.
    points, _ = trimesh.sample.sample_surface(models[name].load_mesh(), 20000, seed=1)
    X_OGs, widths = _columns(grasps)
    for X_GO, width in zip(inverse(X_OGs), widths, strict=True):
        x, y, z = apply(X_GO, points).T
        y = np.abs(y)
        gap = opening(width, CONFIG)
        slack = 0.001  # the object's own points are sampled
        fingers = (np.abs(x) < HAND.pad_x[1] - slack) & (np.abs(z) < HAND.pad_half_width - slack)
        fingers &= (y > gap / 2 + slack) & (y < gap / 2 + HAND.pad_thickness - slack)
        palm = (x < HAND.palm_x[1]) & (x > HAND.palm_x[0]) & (y < HAND.palm_half[0]) & (np.abs(z) < HAND.palm_half[1])
        assert not fingers.any()
        assert not palm.any()


def test_widths_and_closing_axes_are_those_of_the_shape(models: dict[str, ObjectModel]) -> None:
    X_OGs, widths = _columns(grasp_candidates(models["carton"], config=CONFIG, seed=0))
    closing = np.abs(X_OGs[:, :3, 1])
    across = np.array([0.04, 0.08])
    assert np.allclose(closing.max(1), 1.0, atol=0.02)
    assert set(closing.argmax(1)) == {0, 1}  # .12 m does not fit
    assert np.allclose(widths, across[closing.argmax(1)], atol=1e-3)

    X_OGs, widths = _columns(grasp_candidates(models["ball"], config=CONFIG, seed=0))
    assert np.allclose(widths, 0.07, atol=2e-3)
    # The contacts of a ball lie opposite each other: its centre is between the pads, on their midline.
    p_GOs = inverse(X_OGs)[:, :3, 3]
    assert np.abs(p_GOs[:, 1:]).max() < 0.003
    assert np.abs(p_GOs[:, 0]).max() < HAND.pad_x[1]


def test_what_is_too_wide_has_no_grasps(models: dict[str, ObjectModel]) -> None:
    assert grasp_candidates(models["crate"], config=CONFIG, seed=0) == ()
    ranked = _rank(models["crate"], _standing(models["crate"]))
    assert ranked.grasps == () and ranked.X_WGs.shape == (0, 4, 4)
    assert ranked.rejected_by == tuple((cause, 0) for cause in CAUSES)


def test_a_cup_is_grasped_by_the_rim_and_around(models: dict[str, ObjectModel]) -> None:
    X_OGs, widths = _columns(grasp_candidates(models["cup"], config=CONFIG, seed=0))
    around = widths > 0.07
    rim = (widths < 0.006) & (X_OGs[:, 2, 0] < -0.9) & (X_OGs[:, 2, 3] > 0.02)
    assert around.sum() > 20 and rim.sum() > 5
    # One finger inside, one outside, all around the rim.
    angles = np.arctan2(X_OGs[rim, 1, 3], X_OGs[rim, 0, 3])
    assert len(set(np.floor(angles / (np.pi / 2)))) >= 3


def test_handles_and_necks_of_large_objects_are_found() -> None:
    catalogue = load_catalogue()
    X_OGs, widths = _columns(grasp_candidates(catalogue["tide"], config=CONFIG, seed=0))
    handle = (X_OGs[:, 1, 3] > 0.045) & (widths < 0.035)
    cap = (X_OGs[:, 2, 3] > 0.08) & (np.abs(widths - 0.061) < 0.006)
    assert handle.sum() >= 3 and cap.sum() >= 10


def test_candidates_are_a_function_of_the_seed(models: dict[str, ObjectModel]) -> None:
    first = grasp_candidates(models["carton"], config=CONFIG, seed=3)
    twin = ObjectModel(**{**vars(models["carton"])})  # another object, so that nothing comes from memory
    again, other = (grasp_candidates(twin, config=CONFIG, seed=seed) for seed in (3, 4))
    assert grasp_candidates(models["carton"], config=CONFIG, seed=3) is first
    assert all(np.array_equal(a.X_OG, b.X_OG) for a, b in zip(first, again, strict=True))
    assert len(other) != len(first) or any(
        not np.array_equal(a.X_OG, b.X_OG) for a, b in zip(first, other, strict=True)
    )
    assert not first[0].X_OG.flags.writeable


def test_ranked_hands_clear_the_table_and_come_from_above_first(models: dict[str, ObjectModel]) -> None:
    for name in ("carton", "ball", "slab"):
        ranked = _rank(models[name], _standing(models[name]), spread=0.002)
        assert len(ranked.grasps) > 5
        assert lowest_point(ranked.X_WGs, ranked.gaps).min() > TABLE + CONFIG.table_clearance - 1e-9
        assert ranked.X_WGs[0, 2, 0] < -0.8
        assert np.all(np.diff(ranked.scores) <= 0)
        X_OGs, _ = _columns(ranked.grasps)
        assert np.allclose(_standing(models[name]) @ X_OGs, ranked.X_WGs)


def test_flat_things_are_grasped_with_the_hand_drawn_back(models: dict[str, ObjectModel]) -> None:
    best = _rank(models["slab"], _standing(models["slab"]))
    # 20 mm high: no hand reaches 31 mm below its middle, so none of these was deeper than the table allows.
    assert len(best.grasps) > 5
    assert np.all(best.X_WGs[:, 2, 3] > TABLE + 0.02)
    assert best.grasps[0].width == pytest.approx(0.06, abs=0.001)


def test_heavy_things_are_held_near_their_middle(models: dict[str, ObjectModel]) -> None:
    best = _rank(models["bar"], _standing(models["bar"]))
    assert abs(best.grasps[0].X_OG[1, 3]) < 0.05
    assert max(abs(grasp.X_OG[1, 3]) for grasp in best.grasps) > abs(best.grasps[0].X_OG[1, 3]) + 0.05


def test_neighbours_and_doubt_cost_grasps_and_say_so(models: dict[str, ObjectModel]) -> None:
    carton = models["carton"]
    X_WO = _standing(carton)
    free = _rank(carton, X_WO)
    # A wall of neighbours 5 mm beside one of the faces: no finger fits between.
    y, z = np.meshgrid(np.linspace(-0.1, 0.1, 60), np.linspace(TABLE, TABLE + 0.12, 40))
    wall = np.stack([np.full(y.size, 0.6 + 0.02 + 0.005), y.ravel(), z.ravel()], 1)
    beside = _rank(carton, X_WO, wall)
    assert dict(beside.rejected_by)["neighbour_finger"] > 0
    assert all(g.width == pytest.approx(0.08, abs=0.002) for g in beside.grasps)
    assert not hand_collisions(beside.X_WGs, beside.gaps, wall, margin=CONFIG.neighbour_clearance).any()
    assert len(beside.grasps) < len(free.grasps)

    doubtful = _rank(carton, X_WO, spread=0.05)
    assert dict(doubtful.rejected_by)["belief_too_wide"] > 0
    assert doubtful.scores[:1].sum() < free.scores[0]
    candidates = grasp_candidates(carton, config=CONFIG, seed=0)
    assert sum(count for _, count in beside.rejected_by) + len(beside.grasps) <= len(candidates)


vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


@settings(max_examples=50, deadline=None)
@given(vectors, vectors, st.floats(0.01, 0.1), st.integers(0, 1000))
def test_clearances_move_with_the_hand(w: Array, p: Array, gap: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    X_WG = transform(rotation_from_vector(3 * w), p)
    p_GQs = rng.uniform(-0.2, 0.2, (30, 3))
    at_origin = hand_clearances(np.eye(4)[None], np.array([gap]), p_GQs, approach=0.1)
    moved = hand_clearances(X_WG[None], np.array([gap]), apply(X_WG, p_GQs), approach=0.1)
    assert np.allclose(at_origin, moved, atol=1e-9)
    # The half-turn exchanges the fingers; the hand fills the same space.
    turned = hand_clearances(half_turn(X_WG)[None], np.array([gap]), apply(X_WG, p_GQs), approach=0.1)
    assert np.allclose(moved, turned, atol=1e-9)
    assert np.allclose(half_turn(half_turn(X_WG)), X_WG)


@settings(max_examples=50, deadline=None)
@given(vectors, vectors, st.floats(0.01, 0.1))
def test_the_lowest_point_is_a_corner_of_the_hand(w: Array, p: Array, gap: float) -> None:
    X_WG = transform(rotation_from_vector(3 * w), p)
    side = gap / 2 + HAND.pad_thickness
    corners = [
        [x, sy * y, sz * z]
        for xs, y, z in ((HAND.pad_x, side, HAND.pad_half_width), (HAND.palm_x, *HAND.palm_half))
        for x in xs
        for sy in (-1, 1)
        for sz in (-1, 1)
    ]
    lowest = apply(X_WG, np.array(corners))[:, 2].min()
    assert lowest_point(X_WG[None], np.array([gap]))[0] == pytest.approx(lowest, abs=1e-12)


def test_clearances_of_points_at_known_places() -> None:
    X = np.eye(4)[None]
    gap = np.array([0.06])
    places = {
        "between the fingers": ([0.0, 0.0, 0.0], (True, False, False)),
        "in a finger": ([0.0, 0.035, 0.0], (True, False, False)),
        "ahead of the tips": ([0.04, 0.0, 0.0], (False, False, False)),
        "in the palm": ([-0.08, 0.0, 0.0], (False, True, False)),
        "behind the palm": ([-0.2, 0.0, 0.0], (False, False, True)),
        "behind the approach": ([-0.3, 0.0, 0.0], (False, False, False)),
    }
    for place, (point, expected) in places.items():
        hit = hand_collisions(X, gap, np.array([point]), margin=0.002)
        assert tuple(hit[0]) == expected, place
    assert np.all(np.isinf(hand_clearances(X, gap, NOTHING, approach=0.1)))
