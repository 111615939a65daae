"""A depth camera's errors, as a system between the renderer and whoever looks."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageDepth32F

from sum_drake.sensor import DepthNoiseConfig, add_depth_noise
from sum_drake.types import Camera


class DepthNoise(LeafSystem):
    """Makes a sensor's depth image of a perfect one.

    .. pydrake_system::

        name: DepthNoise
        input_ports:
        - depth_image
        output_ports:
        - noisy_depth_image

    Both images are ImageDepth32F in metres. Missing depth is 0 or infinite in the input and 0 in the output. The noise
    is a function of the seed and the context's time, so that a cloned context that is replayed gives the same picture.
    """

    def __init__(self, *, camera: Camera, config: DepthNoiseConfig, seed: int) -> None:
        """
        Args:
            camera: intrinsics of the picture.
            config: the noise model.
            seed: of the noise; pictures of different times differ all the same.
        """
        super().__init__()
        self._camera = camera
        self._config = config
        self._seed = seed
        self._depth_image = self.DeclareAbstractInputPort("depth_image", Value(ImageDepth32F()))
        self.DeclareAbstractOutputPort(
            "noisy_depth_image",
            lambda: Value(ImageDepth32F()),
            self._calc_noisy_depth_image,
            prerequisites_of_calc={self._depth_image.ticket(), self.time_ticket()},
        )

    def _calc_noisy_depth_image(self, context: Context, output: Value) -> None:
        depth = self._depth_image.Eval(context).data[..., 0]  # (h, w)
        rng = np.random.default_rng([self._seed, round(context.get_time() * 1e6)])
        image = ImageDepth32F(self._camera.width, self._camera.height)
        image.mutable_data[..., 0] = add_depth_noise(depth, self._camera, rng, self._config)
        output.set_value(image)
