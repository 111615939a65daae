"""What a depth sensor's noise lets the pose filter ask of a depth image: all that another sensor changes is here.

Noise across the line of sight is left to the edges, which prove nothing anyway.

Errors add up in quadrature: those of the sensor, which grow with the distance, and those that are there under a perfect
one, of meshes and planes.
"""

import dataclasses

import numpy as np

from sum_drake.sensor import DepthNoiseConfig, depth_sigma
from sum_drake.types import Camera, Immutable

SIGMAS = 3.0
"""Depth that is off by more standard deviations than this is not noise."""
PLANE = 0.0058
"""How far off a table is from a plane, metres."""
RELIEF = 0.0167
"""What steps an object's own surface has between neighbouring pixels, metres."""
SURE_MEAN = 0.002
"""SIGMAS standard deviations of the mean depth of what is seen of an object should be less than this, metres."""


@dataclasses.dataclass(frozen=True)
class DepthTolerance(Immutable):
    """Of what is seen at one distance."""

    sigma: float
    """Standard deviation of depth, metres."""
    plane: float
    """Observed points that are so near the support belong to it, metres."""
    jump: float
    """Difference in depth between neighbouring pixels that makes an edge, metres."""
    bleed: int
    """Pixels by which a background spreads over the left side of what stands before it."""
    least_points: int
    """Fewer than these say nothing of where an object is."""

    def epsilon(self, perfect: float) -> float:
        """The inlier distance, metres, of a sensor under which a perfect one's would be `perfect`."""
        return float(np.hypot(perfect, SIGMAS * self.sigma))


def depth_tolerance(noise: DepthNoiseConfig, camera: Camera, z: float) -> DepthTolerance:
    """Of surfaces z metres away."""
    sigma = depth_sigma(noise, camera, z)
    return DepthTolerance(
        sigma,
        plane=float(np.hypot(PLANE, SIGMAS * sigma)),
        # One pixel may be too near while its neighbour is too far.
        jump=float(np.hypot(RELIEF, 2 * SIGMAS * sigma)),
        bleed=int(noise.edge_erosion) if noise.enabled else 0,
        least_points=int(np.ceil((SIGMAS * sigma / SURE_MEAN) ** 2)),
    )


PERFECT = DepthTolerance(0.0, PLANE, RELIEF, 0, 0)
"""Of a sensor without errors."""
