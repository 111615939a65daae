"""A detector that is sure of what is not there."""

from collections.abc import Callable, Mapping

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from sum_drake.systems.ports import abstract
from sum_drake.types import Detection, Detections, Frame

Mistake = Callable[[Frame], Detection]
"""What is falsely seen in a frame; the same in every frame of one camera pose."""


class DetectionFault(LeafSystem):
    """Passes detections on, with false ones among those of some observations.

    .. pydrake_system::

        name: DetectionFault
        input_ports:
        - frame
        - detections
        output_ports:
        - faulty_detections
    """

    def __init__(self, *, mistakes: Mapping[int, tuple[Mistake, ...]]) -> None:
        """mistakes: by observation."""
        super().__init__()
        self._mistakes = dict(mistakes)
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self._detections = self.DeclareAbstractInputPort("detections", abstract())
        self.DeclareAbstractOutputPort(
            "faulty_detections",
            abstract,
            self._calc_detections,
            prerequisites_of_calc={self._frame.ticket(), self._detections.ticket()},
        )

    def _calc_detections(self, context: Context, output: Value[object]) -> None:
        detections: Detections = self._detections.Eval(context)
        mistakes = self._mistakes.get(detections.observation, ())
        if mistakes:
            frame: Frame = self._frame.Eval(context)
            false = tuple(mistake(frame) for mistake in mistakes)
            detections = Detections(detections.observation, (*detections.boxes, *false))
        output.set_value(detections)
