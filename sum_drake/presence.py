"""Whether an object is still where it is believed to be, by one render: what a frame shows of it, where nothing was
detected.

An object that a detector missed is there all the same, and one that is hidden may be. Where depth shows what lies
behind it, it is gone.
"""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sum_drake.depth_tolerance import DepthTolerance, depth_tolerance
from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import inverse
from sum_drake.likelihood import count_picture, observe
from sum_drake.rendering import DepthRenderer, predicted_box
from sum_drake.sensor import DepthNoiseConfig
from sum_drake.types import Array, Frame, Immutable

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

LEAST_PIXELS = 40
"""An object that would show fewer pixels with depth says nothing of whether it is there."""


@dataclasses.dataclass(frozen=True)
class Presence(Immutable):
    """What a frame shows where an object should be seen."""

    pixels: float
    """With depth, that would show the object if nothing stood before it; 0 where it is out of the picture."""
    explained: float
    """Share of them at the object's depth."""
    free: float
    """Share of them farther away than the object, edges aside: nothing is there."""
    hidden: float
    """Share of them nearer than the object."""


UNKNOWN = Presence(0.0, 0.0, 0.0, 0.0)


class PresenceCheck:
    """Renders believed objects into frames. Use it from one thread: VTK renders wrongly elsewhere.

    renderer: of the same catalogue, shared; default: its own.
    """

    def __init__(
        self,
        catalogue: "Catalogue",
        *,
        noise: DepthNoiseConfig | None = None,
        renderer: DepthRenderer | None = None,
    ) -> None:
        self._catalogue = catalogue
        self._noise = DepthNoiseConfig() if noise is None else noise
        self._renderer = renderer or DepthRenderer(catalogue)

    def look(self, frame: Frame, label: str, X_WO: Array) -> Presence:
        """What `frame` shows of an object at X_WO (4, 4). Raises InputError for a label that the catalogue lacks."""
        box = predicted_box(np.asarray(self._catalogue[label].load_mesh().vertices), X_WO, frame)
        if min(box[2:]) < 1.0:
            return UNKNOWN
        X_CO = inverse(frame.X_WC) @ X_WO
        tolerance = self._tolerance(frame, X_CO)
        observation = observe(frame, box, margin=0.1, tolerance=tolerance)
        picture = self._renderer.depth(label, X_CO, observation.camera)
        counts = count_picture(observation, picture, tolerance.epsilon(FilterConfig.epsilon))
        pixels = float(counts.rendered[0])
        if pixels < LEAST_PIXELS:
            return UNKNOWN
        return Presence(
            pixels,
            float(counts.inliers[0]) / pixels,
            float(counts.free_space[0]) / pixels,
            float(counts.occluded[0]) / pixels,
        )

    def explained(self, frame: Frame, label: str, X_WO: Array) -> NDArray[np.bool_]:
        """(h, w): the pixels of the frame whose depth is the object's at X_WO (4, 4)."""
        X_CO = inverse(frame.X_WC) @ X_WO
        epsilon = self._tolerance(frame, X_CO).epsilon(FilterConfig.epsilon)
        picture = self._renderer.depth(label, X_CO, frame.camera)
        return np.asarray((picture > 0) & (frame.depth > 0) & (np.abs(picture - frame.depth) < epsilon))

    def _tolerance(self, frame: Frame, X_CO: Array) -> DepthTolerance:
        return depth_tolerance(self._noise, frame.camera, max(float(X_CO[2, 3]), 0.1))
