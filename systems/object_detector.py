"""A frame's picture and depth in, detections out: the trained detector as a system."""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from sum_drake.systems.ports import abstract
from sum_drake.types import Detection, Detections, Frame

Detect = Callable[[NDArray[np.uint8], NDArray[np.float32]], tuple[Detection, ...]]
"""Detections in a picture (h, w, 3) RGB with its depth (h, w) in metres; `detection.inference.Detector` is one."""


@dataclasses.dataclass
class ObjectDetectorConfig:
    """Which detector, and when it speaks up."""

    weights: str = ""
    """File of its weights; empty is the package's. A relative path starts at the scenario's file."""
    proposer: str = "learned"
    """What proposes boxes: `learned`, or a name of `detection.proposers.PROPOSERS`."""
    threshold: float | None = None
    """Least p(b | z) p(o | b, z) of a detection's likeliest label; left out: the weights' own."""


class ObjectDetector(LeafSystem):
    """Detections of the objects in a frame: p(b | z) and p(o | b, z) of Sui et al. 2017, eq. 3.

    .. pydrake_system::

        name: ObjectDetector
        input_ports:
        - frame
        output_ports:
        - detections

    All it knows of the scene is the frame.
    """

    def __init__(self, *, detect: Detect) -> None:
        super().__init__()
        self._detect = detect
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self.DeclareAbstractOutputPort(
            "detections", abstract, self._calc_detections, prerequisites_of_calc={self._frame.ticket()}
        )

    def _calc_detections(self, context: Context, output: Value[object]) -> None:
        frame: Frame = self._frame.Eval(context)
        output.set_value(Detections(frame.observation, self._detect(frame.color, frame.depth)))
