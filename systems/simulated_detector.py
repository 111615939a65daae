"""The simulator's label image, corrupted at set rates, in the place of a detector."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageLabel16I

from sum_drake.detection.simulated import SimulatedDetectorConfig, simulate_detections
from sum_drake.systems.ports import abstract
from sum_drake.types import Detections, Frame


class SimulatedDetector(LeafSystem):
    """Detections with errors at set rates, for diagnosis and ablation: the one reader of the label image.

    .. pydrake_system::

        name: SimulatedDetector
        input_ports:
        - frame
        - label_image
        output_ports:
        - detections

    The errors are a function of the seed and of the frame's observation number.
    """

    def __init__(
        self,
        *,
        objects: Mapping[int, str],
        labels: Sequence[str],
        sigma_c: float,
        config: SimulatedDetectorConfig,
        seed: int,
    ) -> None:
        super().__init__()
        self._objects, self._labels = dict(objects), tuple(labels)
        self._sigma_c, self._config, self._seed = sigma_c, config, seed
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self._label_image = self.DeclareAbstractInputPort("label_image", Value[ImageLabel16I]())
        self.DeclareAbstractOutputPort(
            "detections",
            abstract,
            self._calc_detections,
            prerequisites_of_calc={self._frame.ticket(), self._label_image.ticket()},
        )

    def _calc_detections(self, context: Context, output: Value[object]) -> None:
        frame: Frame = self._frame.Eval(context)
        boxes = simulate_detections(
            self._label_image.Eval(context).data[:, :, 0],
            self._objects,
            self._labels,
            sigma_c=self._sigma_c,
            config=self._config,
            rng=np.random.default_rng([self._seed, frame.observation]),
        )
        output.set_value(Detections(frame.observation, boxes))
