"""What a scene leaves of an object's grasps, and in which order."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import CONFIG, columns, write_model

from sum_drake.geometry import apply, rotation_from_vector, transform
from sum_drake.grasp_ranking import CAUSES, DROPPED, RankedGrasps, hand_clearances, lowest_point, rank_grasps
from sum_drake.grasping import GraspConfig, grasp_candidates, half_turn
from sum_drake.objects import ObjectModel
from sum_drake.robot import HAND
from sum_drake.types import Array, Grasp, PoseBelief

TABLE = 0.7
NOTHING = np.zeros((0, 3))


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ObjectModel]:
    folder = tmp_path_factory.mktemp("meshes")
    return {
        "carton": write_model(folder, "carton", trimesh.creation.box([0.04, 0.08, 0.12])),
        "crate": write_model(folder, "crate", trimesh.creation.box([0.20, 0.25, 0.12])),
        "ball": write_model(folder, "ball", trimesh.creation.icosphere(3, 0.035)),
        "slab": write_model(folder, "slab", trimesh.creation.box([0.06, 0.10, 0.02])),
        "bar": write_model(folder, "bar", trimesh.creation.box([0.04, 0.40, 0.04]), mass=1.0),
    }


def _rank(
    model: ObjectModel,
    X_WO: Array,
    points_W: Array = NOTHING,
    spread: float = 0.0,
    owners: list[str] | None = None,
    config: GraspConfig = CONFIG,
    reaches: Callable[[Array], bool] | None = None,
) -> RankedGrasps:
    X_WOs = np.tile(X_WO, (50, 1, 1))
    X_WOs[:, :3, 3] += np.random.default_rng(0).normal(0, spread, (50, 3))
    return rank_grasps(
        grasp_candidates(model, config=CONFIG, seed=0),
        model=model,
        X_WO=X_WO,
        belief=PoseBelief(X_WOs, np.full(50, 0.02)),
        points_W=points_W,
        table_height=TABLE,
        config=config,
        owners=owners,
        reaches=reaches,
    )


def _standing(model: ObjectModel) -> Array:
    return transform(np.eye(3), np.array([0.6, 0.0, TABLE + model.dimensions[2] / 2]))


def test_without_candidates_nothing_is_ranked(models: dict[str, ObjectModel]) -> None:
    ranked = _rank(models["crate"], _standing(models["crate"]))
    assert ranked.grasps == () and ranked.X_WGs.shape == (0, 4, 4)
    assert ranked.rejected_by == tuple((cause, 0) for cause in CAUSES)


def test_ranked_hands_clear_the_table_and_come_from_above_first(models: dict[str, ObjectModel]) -> None:
    for name in ("carton", "ball", "slab"):
        ranked = _rank(models[name], _standing(models[name]), spread=0.002)
        assert len(ranked.grasps) > 5
        assert lowest_point(ranked.X_WGs, ranked.gaps).min() > TABLE + CONFIG.table_clearance - 1e-9
        assert ranked.X_WGs[0, 2, 0] < -0.8
        assert np.all(np.diff(ranked.scores) <= 0)
        X_OGs, _ = columns(ranked.grasps)
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


def test_off_the_middle_a_small_contact_counts_for_less(models: dict[str, ObjectModel]) -> None:
    """A pad on an edge lets the object swing where a pad on a face does not."""
    X_WO, bar = _standing(models["bar"]), models["bar"]
    best = _rank(bar, X_WO)
    off = [grasp for grasp in best.grasps if abs(grasp.X_OG[1, 3]) > 0.05]

    def share(quality: float, grasp: Grasp) -> float:
        """Of its contact's quality, what is left in the grasp's score for where it is."""
        config = dataclasses.replace(CONFIG, weight_above=0.0, weight_room=0.0)
        given = dataclasses.replace(grasp, quality=quality)
        ranked = rank_grasps(
            [given], model=bar, X_WO=X_WO, belief=PoseBelief(X_WO[None], np.ones(1)), points_W=np.zeros((0, 3)),
            table_height=0.0, config=config,
        )  # fmt: skip
        return float(ranked.scores[0]) / quality

    assert off and all(share(0.4, grasp) < 0.8 * share(1.0, grasp) for grasp in off[:3])


def test_what_the_arm_is_too_short_for_takes_no_room_among_what_is_tried_out(models: dict[str, ObjectModel]) -> None:
    """The best of a long bar are at its middle, which is out of reach: its near end is tried all the same."""

    def reaches(X_WG: Array) -> bool:
        return bool(X_WG[1, 3] < -0.12)

    few = dataclasses.replace(CONFIG, tried=5)
    X_WO = _standing(models["bar"])
    blind, seen = _rank(models["bar"], X_WO, config=few), _rank(models["bar"], X_WO, config=few, reaches=reaches)
    assert not any(map(reaches, blind.X_WGs)) and all(map(reaches, seen.X_WGs))
    whole = dataclasses.replace(CONFIG, tried=10_000)
    ranked, told = (_rank(models["bar"], X_WO, config=whole, reaches=way) for way in (None, reaches))
    near = [i for i, X_WG in enumerate(ranked.X_WGs) if reaches(X_WG)]
    assert 0 < len(near) < len(ranked.grasps) == len(told.grasps)
    np.testing.assert_array_equal(told.X_WGs[: len(near)], ranked.X_WGs[near], "among the others nothing changes")
    assert told.scores[: len(near)].min() > 0 and not told.scores[len(near) :].any()
    assert told.holds[: len(near)].min() > 0 and not told.holds[len(near) :].any()


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
    assert (
        hand_clearances(beside.X_WGs, beside.gaps, wall, approach=CONFIG.approach).min() >= CONFIG.neighbour_clearance
    )
    assert len(beside.grasps) < len(free.grasps)

    doubtful = _rank(carton, X_WO, spread=0.05)
    assert dict(doubtful.rejected_by)["belief_too_wide"] > 0
    assert doubtful.scores[:1].sum() < free.scores[0]
    candidates = grasp_candidates(carton, config=CONFIG, seed=0)
    for ranked in (free, beside, doubtful):
        assert sum(count for _, count in ranked.rejected_by) + len(ranked.grasps) == len(candidates), "each is told of"
    few = _rank(carton, X_WO, spread=0.05, config=dataclasses.replace(CONFIG, tried=5))
    assert dict(few.rejected_by)["belief_too_wide"] > 5, "where the best do not hold, the next best are tried"


def test_what_is_in_the_way_is_named_where_it_is_known(models: dict[str, ObjectModel]) -> None:
    carton = models["carton"]
    X_WO = _standing(carton)
    y, z = np.meshgrid(np.linspace(-0.1, 0.1, 60), np.linspace(TABLE, TABLE + 0.12, 40))
    wall = np.stack([np.full(y.size, 0.6 + 0.02 + 0.005), y.ravel(), z.ravel()], 1)
    both = np.concatenate([wall, wall * [-1, 1, 1] + [1.2, 0, 0]])
    owners = ["tide"] * len(wall) + ["mug"] * len(wall)
    named, unnamed = _rank(carton, X_WO, both, owners=owners), _rank(carton, X_WO, both)
    counts = dict(named.rejected_by)
    assert counts["neighbour_finger_tide"] > 0 and counts["neighbour_finger_mug"] > 0
    assert (
        sum(n for cause, n in named.rejected_by if cause.startswith("neighbour_finger_"))
        == dict(unnamed.rejected_by)["neighbour_finger"]
    )
    assert sum(counts.values()) == sum(dict(unnamed.rejected_by).values())
    # A sample of what was dropped is told one by one, with no cause that was not counted and none left out.
    assert DROPPED <= len(named.causes) == len(named.X_WDs) <= DROPPED + len(CAUSES)
    assert set(named.causes) <= {cause for cause, count in named.rejected_by if count}
    parts = {cause for cause in CAUSES if any(told.startswith(cause) and counts[told] for told in counts)}
    assert parts == {cause for cause in CAUSES if any(told.startswith(cause) for told in named.causes)}
    shares = {cause: named.causes.count(cause) / len(named.causes) for cause in set(named.causes)}
    total = sum(counts.values())
    assert all(abs(share - counts[cause] / total) < 0.05 for cause, share in shares.items())
    for X_WD, cause in zip(named.X_WDs, named.causes, strict=True):
        assert (cause == "approach_from_below") == (X_WD[2, 0] > -np.cos(CONFIG.max_tilt))
    assert np.array_equal(named.X_WGs, unnamed.X_WGs), "a name changes nothing"


def test_room_on_the_way_up_counts(models: dict[str, ObjectModel]) -> None:
    """A beam above one end of a slab, higher than the hand on its way in from the side."""
    slab = models["bar"]
    X_WO = transform(np.eye(3), np.array([0.6, 0.0, TABLE + 0.02]))
    free = _rank(slab, X_WO)
    x, z = np.meshgrid(np.linspace(0.5, 0.7, 60), [TABLE + 0.30])
    beam = np.stack([x.ravel(), np.full(x.size, 0.10), z.ravel()], 1)
    under = _rank(slab, X_WO, beam)
    assert np.all(free.holds > 0) and np.all(free.holds <= 1)
    assert len(under.holds) == len(under.grasps)
    met = np.abs(under.X_WGs[:, 1, 3] - 0.10) < 0.02
    assert under.X_WGs[0, 1, 3] < 0.09, "the best grasp keeps away from it"
    assert not met.any() or under.holds[met].max() < free.holds.max()


vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


@settings(max_examples=50)
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


@settings(max_examples=50)
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
        clearance = hand_clearances(X, gap, np.array([point]), approach=0.1)
        assert tuple(clearance[0] < 0.002) == expected, place
    assert np.all(np.isinf(hand_clearances(X, gap, NOTHING, approach=0.1)))
