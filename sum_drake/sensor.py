"""The head camera: intrinsics, what a structured-light sensor makes of a perfect depth image, and back-projection."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.sensors import CameraInfo

from sum_drake.assets import InputError
from sum_drake.types import Array, Camera

LARGEST = 1000.0
"""No number of a noise model is larger."""

DepthImage = NDArray[np.float32]
"""(h, w), z-depth in metres, 0 where nothing was returned."""


@dataclasses.dataclass
class HeadCameraConfig:
    """The RGB-D camera on the head, like the Primesense Carmine of the Fetch."""

    width: int = 640
    """Pixels."""
    height: int = 480
    """Pixels."""
    focal_length: float = 525.0
    """Pixels, along both axes; the principal point is the picture's centre."""
    depth_min: float = 0.35
    """Metres: nearer surfaces give no depth."""
    depth_max: float = 3.0
    """Metres: farther surfaces give no depth."""

    def __post_init__(self) -> None:
        if self.width < 16 or self.height < 16:
            raise InputError(f"camera: width x height is {self.width} x {self.height}, expected at least 16 x 16")
        if not self.focal_length > 0:
            raise InputError(f"camera: focal_length is {self.focal_length}, expected a positive number of pixels")
        if not 0 < self.depth_min < self.depth_max:
            raise InputError(
                f"camera: depth range is {self.depth_min} to {self.depth_max}, expected 0 < depth_min < depth_max"
            )


@dataclasses.dataclass
class DepthNoiseConfig:
    """Errors of a structured-light depth camera.

    Axial noise after Nguyen, Izadi and Lovell, "Modeling Kinect Sensor Noise", 2012; disparity steps, shadows and
    dropouts after Khoshelham and Elberink, "Accuracy and Resolution of Kinect Depth Data", 2012.
    """

    enabled: bool = True
    """False: the renderer's depth, only cut to the camera's range."""
    axial_constant: float = 0.0012
    """Metres: standard deviation of depth at .4 m."""
    axial_quadratic: float = 0.0019
    """1/metres: its growth with (z - .4)^2."""
    baseline: float = 0.075
    """Metres from the camera to the projector on its right."""
    disparity_step: float = 0.125
    """Pixels: disparities are multiples of it, so depth has steps of step z^2 / (f baseline); 0: none."""
    lateral: float = 0.35
    """Pixels: standard deviation of the place at which a pixel really measures."""
    shadows: bool = True
    """Whether what the projector does not reach has no depth: a band on the left of what stands out."""
    edge_jump: float = 0.02
    """Relative step of depth between neighbours that counts as an edge."""
    edge_erosion: int = 0
    """Pixels by which the background spreads over the left side of what stands out, as stereo matching does."""
    edge_dropout: float = 0.45
    """Probability that a pixel beside an edge returns nothing."""
    grazing_start: float = 1.22
    """Radians between ray and normal from which returns go missing."""
    grazing_end: float = 1.48
    """Radians from which all are missing."""
    dropout: float = 0.002
    """Probability that any other pixel returns nothing."""

    def __post_init__(self) -> None:
        for name in ("enabled", "shadows"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"noise: {name} is {getattr(self, name)!r}, expected true or false")
        for name in (
            "axial_constant", "axial_quadratic", "baseline", "disparity_step", "lateral", "edge_jump", "edge_erosion",
        ):  # fmt: skip
            if not 0 <= getattr(self, name) <= LARGEST:
                raise InputError(f"noise: {name} is {getattr(self, name)}, expected a number from 0 to {LARGEST:g}")
        if self.edge_erosion != int(self.edge_erosion):
            raise InputError(f"noise: edge_erosion is {self.edge_erosion}, expected a whole number of pixels")
        for name in ("edge_dropout", "dropout"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"noise: {name} is {getattr(self, name)}, expected a probability")
        if not self.grazing_start < self.grazing_end:
            raise InputError("noise: grazing_start is not below grazing_end, expected two increasing angles")


def make_camera_info(config: HeadCameraConfig) -> CameraInfo:
    """Drake's intrinsics. RenderEngineVtk puts the centre of pixel i at i + .5, so the picture's centre is at w / 2."""
    f = config.focal_length
    return CameraInfo(config.width, config.height, f, f, config.width / 2, config.height / 2)


def camera_from_info(info: CameraInfo) -> Camera:
    """The camera, with pixel centres at integers, that describes RenderEngineVtk's pictures for these intrinsics."""
    return Camera(
        info.width(), info.height(), info.focal_x(), info.focal_y(), info.center_x() - 0.5, info.center_y() - 0.5
    )


def make_camera(config: HeadCameraConfig) -> Camera:
    """The head camera's intrinsics, pixel centres at integers."""
    return camera_from_info(make_camera_info(config))


def back_project(depth: NDArray[np.floating], camera: Camera) -> Array:
    """Points p_CQ (h, w, 3) of a depth image (h, w); the origin where depth is missing."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1)
    return np.asarray(rays * np.asarray(depth, dtype=np.float64)[..., None])


def add_depth_noise(
    depth: NDArray[np.floating], camera: Camera, rng: np.random.Generator, config: DepthNoiseConfig
) -> DepthImage:
    """What the sensor reports of perfect depth (h, w) in metres; 0 and non-finite values mean missing, in and out 0."""
    true = np.where(np.isfinite(depth), depth, 0.0).astype(np.float64)
    if not config.enabled:
        return true.astype(np.float32)
    for _ in range(config.edge_erosion):
        left = np.roll(true, 1, axis=1)
        left[:, 0] = true[:, 0]
        true = np.where((true > 0) & (left > true * (1 + config.edge_jump)), left, true)
    missing = _unseen(true, camera, rng, config)
    # A pixel measures a little beside its centre; that makes edges ragged.
    offset = np.rint(rng.normal(0.0, config.lateral, (2, *true.shape))).astype(int)
    v, u = np.mgrid[: camera.height, : camera.width]
    z = true[np.clip(v + offset[0], 0, camera.height - 1), np.clip(u + offset[1], 0, camera.width - 1)]
    missing |= (z <= 0) | (true <= 0)
    z = np.maximum(z + _axial(z, config) * rng.standard_normal(z.shape), 1e-3)
    if config.disparity_step > 0 and config.baseline > 0:
        scale = camera.fx * config.baseline
        steps = np.maximum(np.rint(scale / z / config.disparity_step), 1)
        z = scale / (steps * config.disparity_step)
    return np.where(missing, 0.0, z).astype(np.float32)


def _axial(z: Array, config: DepthNoiseConfig) -> Array:
    return config.axial_constant + config.axial_quadratic * (z - 0.4) ** 2


def depth_sigma(config: DepthNoiseConfig, camera: Camera, z: float) -> float:
    """Standard deviation of depth measured z metres away: noise along the ray, and what steps of disparity add."""
    if not config.enabled:
        return 0.0
    step = config.disparity_step * z**2 / (camera.fx * config.baseline) if config.baseline > 0 else 0.0
    return float(np.hypot(_axial(np.array(z), config), step / np.sqrt(12)))


def _unseen(z: Array, camera: Camera, rng: np.random.Generator, config: DepthNoiseConfig) -> NDArray[np.bool_]:
    """Pixels that return nothing (h, w): shadows of the projector, edges, grazing rays, and a few at random."""
    valid = z > 0
    inverse = np.divide(1.0, z, out=np.zeros_like(z), where=valid)

    # The projector lights a point of column u at its own column u - disparity. Seen from both sides the order of
    # columns is the same; where a pixel further right comes before, it stands in this one's light.
    column = np.arange(camera.width) - camera.fx * config.baseline * inverse
    first_to_the_right = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    unseen = (column > first_to_the_right + 0.5) if config.shadows else np.zeros(z.shape, dtype=bool)

    # Inverse depth of a plane is affine in the pixel, 1/z = a u + b v + c. So its second difference shows edges, and no
    # steep plane, and (fx a, fy b, c at the centre) is the plane's normal.
    padded = np.pad(inverse, 1, mode="edge")
    bend_x = padded[1:-1, :-2] - 2 * inverse + padded[1:-1, 2:]
    bend_y = padded[:-2, 1:-1] - 2 * inverse + padded[2:, 1:-1]
    edge = np.maximum(np.abs(bend_x), np.abs(bend_y)) > config.edge_jump * inverse
    b, a = np.gradient(inverse)
    n_x, n_y = camera.fx * a, camera.fy * b
    v, u = np.mgrid[: camera.height, : camera.width]
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    n_z = inverse - n_x * x - n_y * y
    ray, normal = np.sqrt(x * x + y * y + 1), np.sqrt(n_x**2 + n_y**2 + n_z**2)
    cosine = np.divide(inverse, ray * normal, out=np.ones_like(z), where=normal > 0)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    grazing = (angle - config.grazing_start) / (config.grazing_end - config.grazing_start)

    # Across an edge the slope says nothing about the surface: the edge's own rate holds there.
    rate = np.where(edge, config.edge_dropout, np.clip(grazing, config.dropout, 1.0))
    return np.asarray(unseen | (rng.random(z.shape) < rate))
