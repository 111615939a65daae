"""The baselines of pose estimation, which need the extra `bench`."""

import numpy as np
import pytest
from scenes import observe, standing

from sum_drake.geometry import pose_error
from sum_drake.objects import load_catalogue
from sum_drake.registration import FpfhConfig, FpfhEstimator

pytest.importorskip("open3d", reason="needs the extra bench")
CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def seen():
    X_WO = standing(CATALOGUE, "mustard", 0.6, 0.02, 0.7)
    frame, boxes = observe(CATALOGUE, {"mustard": X_WO})
    return X_WO, frame, boxes["mustard"]


def test_features_and_icp_find_what_stands_alone_and_a_seed_is_a_result(seen):
    X_WO, frame, box = seen
    estimator = FpfhEstimator(CATALOGUE, FpfhConfig())
    found = [estimator.estimate(frame, box, "mustard", seed=seed) for seed in (0, 1, 2, 0)]
    off = [pose_error(X, X_WO, CATALOGUE["mustard"].symmetry)[0] for X in found]
    assert min(off) < 0.02, "of three seeds one at least"
    np.testing.assert_allclose(found[0], found[3], atol=1e-6, err_msg="ICP's threads add in any order")


def test_without_points_there_is_no_estimate(seen):
    _, frame, _ = seen
    estimator = FpfhEstimator(CATALOGUE, FpfhConfig())
    assert estimator.estimate(frame, (0.0, 0.0, 2.0, 2.0), "mustard", seed=0) is None
    assert estimator.estimate(frame, (-50.0, -50.0, 10.0, 10.0), "mustard", seed=0) is None
