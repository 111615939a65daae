"""Detections and held belief in, associations out."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from sum_drake.association import AssociationConfig, associate_frame
from sum_drake.objects import Catalogue
from sum_drake.systems.ports import abstract, unpack
from sum_drake.types import Array, Detections, Frame, PickPlace, SceneBelief


class DataAssociator(LeafSystem):
    """Matches detections with the tracks of the belief as held (Sui et al. 2017, eq. 11).

    .. pydrake_system::

        name: DataAssociator
        input_ports:
        - detections
        - frame
        - scene_belief
        - executed_action
        output_ports:
        - associations

    The frame is for its camera alone: tracks are expected where their estimates are, and where the action put them.
    """

    def __init__(self, *, catalogue: Catalogue, config: AssociationConfig) -> None:
        super().__init__()
        self._catalogue, self._config = catalogue, config
        self._detections = self.DeclareAbstractInputPort("detections", abstract())
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self._belief = self.DeclareAbstractInputPort("scene_belief", abstract())
        self._action = self.DeclareAbstractInputPort("executed_action", abstract())
        inputs = self._detections, self._frame, self._belief, self._action
        self.DeclareAbstractOutputPort(
            "associations",
            abstract,
            self._calc_associations,
            prerequisites_of_calc={port.ticket() for port in inputs},
        )

    def _calc_associations(self, context: Context, output: Value[object]) -> None:
        detections: Detections = self._detections.Eval(context)
        frame: Frame = self._frame.Eval(context)
        held: SceneBelief = self._belief.Eval(context)
        action: PickPlace | None = unpack(self._action.Eval(context))
        output.set_value(associate_frame(held, frame, detections, action, self._vertices, self._config))

    def _vertices(self, label: str) -> Array:
        return np.asarray(self._catalogue[label].load_mesh().vertices)
