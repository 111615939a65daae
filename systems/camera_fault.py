"""A camera that fails now and then."""

from collections.abc import Collection

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from sum_drake.faults import blinded
from sum_drake.systems.ports import abstract
from sum_drake.types import Frame


class CameraFault(LeafSystem):
    """Passes frames on, but for those of some observations, which it makes black and without depth.

    .. pydrake_system::

        name: CameraFault
        input_ports:
        - frame
        output_ports:
        - faulty_frame
    """

    def __init__(self, *, observations: Collection[int]) -> None:
        super().__init__()
        self._observations = frozenset(observations)
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self.DeclareAbstractOutputPort(
            "faulty_frame", abstract, self._calc_frame, prerequisites_of_calc={self._frame.ticket()}
        )

    def _calc_frame(self, context: Context, output: Value[object]) -> None:
        frame: Frame = self._frame.Eval(context)
        if frame.observation in self._observations:
            frame = blinded(frame)
        output.set_value(frame)
