"""Baselines of pose estimation: FPFH features matched by RANSAC, and refined by ICP, as Open3D has them.

What the paper compares itself with (Rusu et al., "Fast Point Feature Histograms", ICRA 2009). Needs the extra `bench`.
"""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake.assets import InputError
from sum_drake.boxes import distance, pixels_in
from sum_drake.depth_tolerance import depth_tolerance
from sum_drake.geometry import transform
from sum_drake.likelihood import LEAST_LEFT
from sum_drake.objects import Catalogue, sample_surface
from sum_drake.sensor import DepthNoiseConfig, back_project
from sum_drake.support import support_plane
from sum_drake.types import Array, Box, Frame

if TYPE_CHECKING:
    import open3d


@dataclasses.dataclass
class FpfhConfig:
    """Parameters of the baseline, metres, tuned on the filter's own tuning scenes (`benchmarks/fpfh_fit.py`)."""

    voxel: float = 0.007
    """Size of the cells to which both clouds are thinned out."""
    normal_radius: float = 0.012
    """Of the neighbourhood that a normal is fitted to."""
    feature_radius: float = 0.045
    """Of the neighbourhood that a feature describes."""
    inlier: float = 0.0075
    """Distance of a match that counts, in RANSAC and ICP."""
    iterations: int = 100_000
    """Of RANSAC at most."""
    confidence: float = 0.999
    """RANSAC stops when it is so sure."""
    support: bool = True
    """Whether points of the plane that the object stands on are left out, as by the filter."""
    refine: bool = True
    """Whether point-to-plane ICP follows."""


class FpfhEstimator:
    """Estimates poses by feature matching; keeps the features of each label's mesh."""

    def __init__(self, catalogue: Catalogue, config: FpfhConfig) -> None:
        self._catalogue, self._config = catalogue, config
        self._models: dict[str, tuple[open3d.geometry.PointCloud, Any]] = {}

    def warm(self, label: str) -> None:
        """Describes a label's mesh."""
        if label not in self._models:
            points, normals = sample_surface(self._catalogue[label], 20_000, np.random.default_rng(0))
            self._models[label] = self._describe(points, normals)

    def estimate(self, frame: Frame, box: Box, label: str, *, seed: int) -> Array | None:
        """X_WO (4, 4) of the object in a box; None where there are too few points for any match.

        A seed gives the same but for rounding: Open3D's threads add in any order.
        """
        o3d = _open3d()
        self.warm(label)
        model, model_features = self._models[label]
        points = _points(frame, box, np.random.default_rng(seed) if self._config.support else None)
        if len(points) < 10:
            return None
        seen, features = self._describe(points, None)
        if len(seen.points) < 10:
            return None
        o3d.utility.random.seed(seed)
        config, registration = self._config, o3d.pipelines.registration
        found = registration.registration_ransac_based_on_feature_matching(
            model,
            seen,
            model_features,
            features,
            True,
            config.inlier,
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                registration.CorrespondenceCheckerBasedOnDistance(config.inlier),
            ],
            registration.RANSACConvergenceCriteria(config.iterations, config.confidence),
        )
        X_CO = np.array(found.transformation)
        if config.refine:
            # From what is seen to the model: the model's far side has no counterpart.
            refined = registration.registration_icp(
                seen,
                model,
                config.inlier,
                np.linalg.inv(X_CO),
                registration.TransformationEstimationPointToPlane(),
            )
            X_CO = np.linalg.inv(np.array(refined.transformation))
        u, _, vt = np.linalg.svd(X_CO[:3, :3])
        return np.asarray(frame.X_WC @ transform(u @ vt, X_CO[:3, 3]))

    def _describe(self, points: Array, normals: Array | None) -> "tuple[open3d.geometry.PointCloud, Any]":
        o3d = _open3d()
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        if normals is not None:
            cloud.normals = o3d.utility.Vector3dVector(normals)
        cloud = cloud.voxel_down_sample(self._config.voxel)
        if normals is None:
            cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(self._config.normal_radius, 30))
            cloud.orient_normals_towards_camera_location(np.zeros(3))
        search = o3d.geometry.KDTreeSearchParamHybrid(self._config.feature_radius, 100)
        return cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search)


def _points(frame: Frame, box: Box, rng: np.random.Generator | None) -> Array:
    """p_CQ (n, 3) of what was measured in a box; given an rng to find it with, without the plane that it stands on."""
    inside = back_project(frame.depth, frame.camera)[pixels_in(box, frame.camera)].reshape(-1, 3)
    inside = inside[inside[:, 2] > 0]
    if rng is None or not len(inside):
        return inside
    tolerance = depth_tolerance(DepthNoiseConfig(), frame.camera, distance(frame, box)).plane
    plane = support_plane(frame, box, rng, tolerance=tolerance)
    if plane is None:
        return inside
    above = np.abs(plane.height(inside)) >= tolerance
    return inside[above] if above.mean() > LEAST_LEFT else inside


def _open3d() -> Any:
    try:
        import open3d
    except ImportError as error:
        raise InputError(
            f"the baselines need Open3D ({error}); expected pip install 'sum-drake[bench]' and Debian's libusb-1.0-0"
        ) from error
    # Its warnings of features that few points share are nothing that a user could act on.
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d
