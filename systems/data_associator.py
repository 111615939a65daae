"""Detections and held belief in, associations out."""

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from sum_drake.association import AssociationConfig, associate
from sum_drake.systems.ports import abstract
from sum_drake.types import Associations, Detections, SceneBelief


class DataAssociator(LeafSystem):
    """Matches detections with the tracks of the belief as held (Sui et al. 2017, eq. 11).

    .. pydrake_system::

        name: DataAssociator
        input_ports:
        - detections
        - scene_belief
        output_ports:
        - associations
    """

    def __init__(self, *, config: AssociationConfig) -> None:
        super().__init__()
        self._config = config
        self._detections = self.DeclareAbstractInputPort("detections", abstract())
        self._belief = self.DeclareAbstractInputPort("scene_belief", abstract())
        self.DeclareAbstractOutputPort(
            "associations",
            abstract,
            self._calc_associations,
            prerequisites_of_calc={self._detections.ticket(), self._belief.ticket()},
        )

    def _calc_associations(self, context: Context, output: Value[object]) -> None:
        detections: Detections = self._detections.Eval(context)
        held: SceneBelief = self._belief.Eval(context)
        pairs = associate(held.tracks, detections.boxes, self._config)
        output.set_value(Associations(detections.observation, pairs))
