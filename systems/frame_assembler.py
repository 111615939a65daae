"""Pictures and camera pose as one numbered frame."""

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from sum_drake.systems.ports import abstract
from sum_drake.types import Camera, Frame, readonly


class FrameAssembler(LeafSystem):
    """The camera's pictures with its pose, as a `types.Frame` that carries the number of the observation.

    .. pydrake_system::

        name: FrameAssembler
        input_ports:
        - color_image
        - depth_image
        - X_WC
        - observe
        output_ports:
        - frame

    The frame is assembled when it is asked for: nothing renders in between.
    """

    def __init__(self, *, camera: Camera) -> None:
        super().__init__()
        self._camera = camera
        self._color = self.DeclareAbstractInputPort("color_image", Value[ImageRgba8U]())
        self._depth = self.DeclareAbstractInputPort("depth_image", Value[ImageDepth32F]())
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value[RigidTransform]())
        self._observe = self.DeclareVectorInputPort("observe", BasicVector(1))
        self.DeclareAbstractOutputPort("frame", abstract, self._calc_frame)

    def _calc_frame(self, context: Context, output: Value[object]) -> None:
        color = self._color.Eval(context).data[:, :, :3]
        depth = np.nan_to_num(self._depth.Eval(context).data[:, :, 0], posinf=0.0)
        output.set_value(
            Frame(
                observation=round(self._observe.Eval(context)[0]) - 1,
                color=readonly(color, np.uint8),
                depth=readonly(depth, np.float32),
                camera=self._camera,
                X_WC=readonly(self._X_WC.Eval(context).GetAsMatrix4()),
                time=context.get_time(),
            )
        )
