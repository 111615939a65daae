import dataclasses
import hashlib
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scenes import TABLE, observe, standing

from sum_drake.action_model import predict
from sum_drake.filter_config import FilterConfig, filter_config
from sum_drake.filtering import PoseEstimate, PoseEstimator
from sum_drake.geometry import (
    inverse,
    pose_error,
    rotation_from_vector,
    transform,
)
from sum_drake.objects import Catalogue, ObjectModel, load_catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.support import sunk
from sum_drake.types import Array, Box, Camera, Frame, PickPlace, PoseBelief, Region, readonly

CAMERA = Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
X_WC = transform(rotation_from_vector(np.array([0, 2.3, 0])) @ rotation_from_vector(np.array([0, 0, 1.2])),
                 np.array([0.1, 0.2, 1.3]))  # fmt: skip
PLACES = {
    "tide": transform(rotation_from_vector(np.array([0.3, -0.4, 2.0])), np.array([0.0, 0.05, 0.8])),
    "soup_can": transform(rotation_from_vector(np.array([1.0, 0.4, 0.0])), np.array([-0.17, -0.04, 0.75])),
}


def scene(seed: int = 0) -> tuple[Frame, dict[str, tuple[Array, Box]]]:
    """Objects before a wall, with noise of 1.5 mm and some depth missing; true poses in W and boxes."""
    rng = np.random.default_rng(seed)
    renderer = DepthRenderer(load_catalogue())
    depth = np.full((240, 320), 1.1)
    truth = {}
    for label, X_CO in PLACES.items():
        z = renderer.depth(label, X_CO, CAMERA)
        depth = np.where(z > 0, z, depth)
        v, u = np.nonzero(z)
        box = (u.min() - 3.0, v.min() + 2.0, np.ptp(u) + 5.0, np.ptp(v) + 1.0)
        truth[label] = (X_WC @ X_CO, box)
    depth = depth + rng.normal(0, 0.0015, depth.shape)
    depth[rng.random(depth.shape) < 0.05] = 0
    return Frame(0, np.zeros((240, 320, 3), np.uint8), depth.astype(np.float32), CAMERA, X_WC), truth


@pytest.fixture(scope="module")
def frame_and_truth() -> tuple[Frame, dict[str, tuple[Array, Box]]]:
    return scene()


@pytest.fixture(scope="module")
def estimator() -> PoseEstimator:
    return PoseEstimator(load_catalogue(), filter_config("default"))


def within(estimate: PoseEstimate, X_WO: Array, label: str) -> bool:
    p, angle = pose_error(estimate.X_WO, X_WO, load_catalogue()[label].symmetry)
    return bool(p < 0.02 and angle < np.deg2rad(20))


def check(estimate: PoseEstimate) -> None:
    """A belief that others can rely on, whatever was seen."""
    belief = estimate.belief
    assert belief.X_WOs.shape == (len(belief.weights), 4, 4)
    assert np.isfinite(belief.X_WOs).all() and np.isfinite(estimate.X_WO).all()
    assert (belief.weights >= 0).all() and belief.weights.sum() == pytest.approx(1)
    R = belief.X_WOs[:, :3, :3]
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-6)
    assert 0 <= estimate.likelihood <= 1
    assert all(np.isfinite(value) for _, value in estimate.features)
    assert not belief.X_WOs.flags.writeable and not estimate.X_WO.flags.writeable


@pytest.mark.parametrize("label", list(PLACES))
def test_default_finds_objects_from_their_boxes(estimator: PoseEstimator, frame_and_truth, label: str) -> None:
    frame, truth = frame_and_truth
    X_WO, box = truth[label]
    estimate = estimator.estimate(frame, box, label, rng=np.random.default_rng(1))
    check(estimate)
    assert within(estimate, X_WO, label)
    assert estimate.likelihood > 0.6
    features = dict(estimate.features)
    assert features["inliers"] > 0.8 * features["rendered"]
    assert features["translation_std_m"] < 0.03
    # The belief is about where the estimate is: most of its mass is near.
    p, _ = pose_error(estimate.belief.X_WOs, X_WO, load_catalogue()[label].symmetry)
    assert estimate.belief.weights[p < 0.02].sum() > 0.8


def test_who_watches_sees_the_belief_sharpen_and_changes_nothing(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    label = next(iter(PLACES))
    X_WO, box = truth[label]
    seen: list[PoseBelief] = []
    found = [
        estimator.estimate(frame, box, label, rng=np.random.default_rng(3), watch=watch)
        for watch in (seen.append, None)
    ]
    assert len(seen) == FilterConfig().iterations
    near = []
    for belief in seen:
        assert belief.weights.sum() == pytest.approx(1.0) and belief.X_WOs.shape == (len(belief.weights), 4, 4)
        away = np.linalg.norm(belief.X_WOs[:, :3, 3] - X_WO[:3, 3], axis=1)
        near.append(belief.weights[away < 0.02].sum())
    assert near[0] < 0.5 < 0.9 < near[-1]
    np.testing.assert_array_equal(found[0].belief.X_WOs, found[1].belief.X_WOs)


def test_the_right_label_is_likelier_than_a_wrong_one(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    box = truth["tide"][1]
    right = estimator.estimate(frame, box, "tide", rng=np.random.default_rng(1))
    wrong = estimator.estimate(frame, box, "soup_can", rng=np.random.default_rng(1))
    check(wrong)
    assert right.likelihood > wrong.likelihood + 0.1


def test_tracking_refines_a_prior_and_gives_up_a_wrong_one(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    X_WO, box = truth["tide"]
    rng = np.random.default_rng(3)
    for offset, turn in (([0.015, -0.01, 0.01], 0.1), ([0.4, 0.3, 0.2], 2.5)):
        X_prior = transform(rotation_from_vector(np.array([0, 0, turn])) @ X_WO[:3, :3], X_WO[:3, 3] + offset)
        held = PoseBelief(np.tile(X_prior, (50, 1, 1)), np.full(50, 1 / 50))
        other = PickPlace(0, "pick_place", 9, "mug", np.eye(4), np.eye(4), "cleaning_bin", 0.05, 0.05, True)
        prior = predict(held, other, is_target=False, rng=rng, config=FilterConfig())
        estimate = estimator.estimate(frame, box, "tide", rng=rng, prior=prior)
        check(estimate)
        if turn < 1:
            assert within(estimate, X_WO, "tide")
        else:
            # Fresh particles: the belief goes where the box is, if not at once to the right orientation.
            assert np.linalg.norm(estimate.X_WO[:3, 3] - X_WO[:3, 3]) < 0.15


def test_what_is_out_of_sight_does_not_reach_into_a_table_that_is_known(estimator: PoseEstimator) -> None:
    """The handle of a mug that lies there props it up, unseen: turned down into the table it would look the same."""
    catalogue = load_catalogue()
    R_WO = rotation_from_vector(np.array([0.0, 0.0, 2.7])) @ rotation_from_vector(np.array([0.0, np.pi / 2, 0.0]))
    R_WO = R_WO @ rotation_from_vector(np.array([0.0, 0.0, 3.6]))
    vertices = np.asarray(catalogue["mug"].load_mesh().vertices)
    X_WO = transform(R_WO, np.array([0.7, 0.05, TABLE - (vertices @ R_WO[2]).min()]))
    frame, boxes = observe(catalogue, {"mug": X_WO})
    table = Region("table", readonly([0.7, 0.0, TABLE + 0.2]), readonly([0.3, 0.45, 0.2]))
    alone, told = (
        estimator.estimate(frame, boxes["mug"], "mug", rng=np.random.default_rng(0), table=known)
        for known in (None, table)
    )
    sunk_of = [np.array([sunk(vertices, X, table) for X in one.belief.X_WOs]) for one in (alone, told)]
    assert np.mean(sunk_of[0] > 0.02) > 0.3
    assert np.mean(sunk_of[1] > 0.02) < 0.02
    assert within(told, X_WO, "mug")
    assert dict(told.features)["near_share"] > dict(alone.features)["near_share"] + 0.2


def near(X_WO: Array) -> PoseBelief:
    """A prior about a pose."""
    rng = np.random.default_rng(0)
    turns, shifts = rotation_from_vector(rng.normal(0, 0.1, (100, 3))), rng.normal(0, 0.01, (100, 3))
    X_WOs = np.tile(X_WO, (100, 1, 1))
    X_WOs[:, :3, :3], X_WOs[:, :3, 3] = turns @ X_WO[:3, :3], X_WO[:3, 3] + shifts
    return PoseBelief(X_WOs, np.full(100, 0.01))


def test_what_an_earlier_look_told_apart_is_remembered(estimator: PoseEstimator) -> None:
    """A mug whose handle is behind it: this look alone cannot tell how it is turned."""
    catalogue = load_catalogue()
    X_WO = standing(catalogue, "mug", 0.6, 0.0, yaw=1.5 * np.pi)
    frame, boxes = observe(catalogue, {"mug": X_WO})
    gained = []
    for seed in range(6):  # one belief's share is that of some hundred particles
        alone = estimator.estimate(frame, boxes["mug"], "mug", rng=np.random.default_rng(seed))
        told = estimator.estimate(
            frame, boxes["mug"], "mug", rng=np.random.default_rng(seed), prior=near(X_WO), before=alone.likelihood
        )
        assert within(told, X_WO, "mug")
        gained.append(dict(told.features)["near_share"] - dict(alone.features)["near_share"])
    assert min(gained) > 0
    assert np.mean(gained) > 0.15


def test_an_object_that_moved_is_found_where_it_is_now(estimator: PoseEstimator, frame_and_truth) -> None:
    """It is explained less well than before where it was believed to be, so it is searched from scratch as well."""
    frame, truth = frame_and_truth
    X_WO, box = truth["tide"]
    elsewhere = transform(rotation_from_vector(np.array([2.0, 1.0, 0.0])) @ X_WO[:3, :3], X_WO[:3, 3] + [0.1, 0.1, 0.1])
    moved = estimator.estimate(
        frame, box, "tide", rng=np.random.default_rng(2), prior=near(elsewhere), before=0.95
    )  # fmt: skip
    assert within(moved, X_WO, "tide")


@pytest.mark.parametrize("box", [(0, 0, 0, 0), (-90, -90, 20, 20), (1000, 50, 20, 20)], ids=str)
def test_nothing_in_the_box_is_a_wide_belief_at_likelihood_0(
    estimator: PoseEstimator, frame_and_truth, box: Box
) -> None:
    estimate = estimator.estimate(frame_and_truth[0], box, "tide", rng=np.random.default_rng(0))
    check(estimate)
    assert estimate.likelihood == 0
    assert dict(estimate.features)["translation_std_m"] > 0.1


def test_no_depth_in_the_box_keeps_the_prior(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    dark = Frame(1, frame.color, np.zeros_like(frame.depth), CAMERA, X_WC)
    X_WO, box = truth["tide"]
    prior = PoseBelief(np.stack([X_WO, np.eye(4)]), np.array([0.75, 0.25]))
    estimate = estimator.estimate(dark, box, "tide", rng=np.random.default_rng(0), prior=prior)
    check_values = np.array_equal(estimate.belief.X_WOs, prior.X_WOs), np.array_equal(estimate.X_WO, X_WO)
    assert check_values == (True, True)
    assert estimate.likelihood == 0


def test_a_single_observed_pixel_does_not_break_it(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    box = truth["tide"][1]
    depth = np.zeros_like(frame.depth)
    depth[int(box[1]) + 5, int(box[0]) + 5] = 0.8
    check(estimator.estimate(Frame(1, frame.color, depth, CAMERA, X_WC), box, "tide", rng=np.random.default_rng(0)))


def test_a_noisy_sensor_asks_for_more_points(frame_and_truth) -> None:
    """Where a few points say nothing of where a thing is, nothing is said."""
    frame, truth = frame_and_truth
    x, y, w, h = truth["tide"][1]
    depth = np.zeros_like(frame.depth)
    depth[int(y + h / 2) : int(y + h / 2) + 5, int(x + w / 2) : int(x + w / 2) + 6] = 1.0
    few = dataclasses.replace(frame, depth=depth)
    noisy = DepthNoiseConfig(axial_constant=0.02)
    likelihoods = [
        PoseEstimator(load_catalogue(), FilterConfig(particles=200, iterations=2), noise=noise)
        .estimate(few, (x, y, w, h), "tide", rng=np.random.default_rng(0))
        .likelihood
        for noise in (DepthNoiseConfig(), noisy)
    ]
    assert likelihoods[0] > 0 and likelihoods[1] == 0


def test_the_published_filter_takes_every_sensor_alike(frame_and_truth) -> None:
    frame, truth = frame_and_truth
    box = truth["tide"][1]
    config = dataclasses.replace(filter_config("paper"), particles=50, particles_last=50, iterations=2)
    estimates = [
        PoseEstimator(load_catalogue(), config, noise=noise).estimate(frame, box, "tide", rng=np.random.default_rng(0))
        for noise in (DepthNoiseConfig(), DepthNoiseConfig(axial_constant=0.02))
    ]
    np.testing.assert_array_equal(estimates[0].belief.X_WOs, estimates[1].belief.X_WOs)


def test_another_thread_raises(estimator: PoseEstimator, frame_and_truth) -> None:
    frame, truth = frame_and_truth
    errors: list[Exception] = []

    def call() -> None:
        try:
            estimator.estimate(frame, truth["tide"][1], "tide", rng=np.random.default_rng(0))
        except RuntimeError as error:
            errors.append(error)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    assert "thread" in str(errors[0])


def test_paper_preset_runs_and_improves_on_its_start(frame_and_truth) -> None:
    frame, truth = frame_and_truth
    X_WO, box = truth["soup_can"]
    config = filter_config("paper")
    assert (config.particles, config.iterations, config.epsilon) == (625, 25, 0.008)
    config.iterations = 1
    start = PoseEstimator(load_catalogue(), config)
    first = start.estimate(frame, box, "soup_can", rng=np.random.default_rng(0))
    config.iterations = 8
    last = start.estimate(frame, box, "soup_can", rng=np.random.default_rng(0))
    check(first)
    check(last)
    assert len(last.belief.weights) == 625
    assert last.likelihood > first.likelihood
    assert np.linalg.norm(last.X_WO[:3, 3] - X_WO[:3, 3]) < 0.05


def test_a_users_mesh_needs_nothing_but_a_mesh(tmp_path: Path) -> None:
    """Not watertight, off-centre, with an open side and one face wound the wrong way."""
    mesh = trimesh.creation.box([0.08, 0.12, 0.05])
    mesh.apply_translation([0.3, 0, 0.1])
    mesh.faces = np.concatenate([mesh.faces[:9], mesh.faces[9:10, ::-1]])
    mesh.export(tmp_path / "thing.obj")
    identity = load_catalogue()["tide"].symmetry
    model = ObjectModel("thing", tmp_path / "thing.obj", "any", identity, (0.08, 0.12, 0.05))
    catalogue = Catalogue(tmp_path / "objects.yaml", (model,))
    X_CO = transform(np.eye(3), np.array([-0.3, 0, 0.7]))
    depth = DepthRenderer(catalogue).depth("thing", X_CO, CAMERA)
    v, u = np.nonzero(depth)
    box = (float(u.min()), float(v.min()), np.ptp(u) + 1.0, np.ptp(v) + 1.0)
    frame = Frame(0, np.zeros((240, 320, 3), np.uint8), depth, CAMERA, X_WC)
    estimate = PoseEstimator(catalogue, FilterConfig()).estimate(frame, box, "thing", rng=np.random.default_rng(0))
    check(estimate)
    assert estimate.likelihood > 0.8


DIGEST = """
import hashlib, sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from test_filtering import digest
print(digest())
"""


def digest() -> str:
    frame, truth = scene()
    estimator = PoseEstimator(load_catalogue(), FilterConfig(particles=400, iterations=3))
    estimate = estimator.estimate(frame, truth["soup_can"][1], "soup_can", rng=np.random.default_rng(5))
    return hashlib.sha256(estimate.belief.X_WOs.tobytes() + estimate.belief.weights.tobytes()).hexdigest()


def test_same_seed_same_bits_in_two_processes_and_any_number_of_threads() -> None:
    here = digest()
    threads = 1 if torch.get_num_threads() > 1 else 2
    code = f"import torch; torch.set_num_threads({threads})\n" + DIGEST
    there = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parent)], capture_output=True, text=True, check=True
    )
    assert there.stdout.split()[-1] == here


def test_poses_are_of_the_mesh_frame(frame_and_truth) -> None:
    """X_WO of the estimate renders onto the object that it was made of."""
    frame, truth = frame_and_truth
    X_WO, _ = truth["tide"]
    depth = DepthRenderer(load_catalogue()).depth("tide", inverse(X_WC) @ X_WO, CAMERA)
    seen = (depth > 0) & (frame.depth > 0)
    assert np.median(np.abs(depth - frame.depth)[seen]) < 0.003
