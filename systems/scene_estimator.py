"""The one place that holds what is believed of the scene."""

import logging
from collections.abc import Callable

from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from sum_drake.systems.ports import abstract, unpack
from sum_drake.types import (
    Associations,
    Detections,
    Frame,
    Perception,
    PickPlace,
    SceneBelief,
)

_LOG = logging.getLogger(__name__)
UpdateBelief = Callable[[SceneBelief, Frame, Detections, Associations, PickPlace | None], SceneBelief]
"""`belief.update` with its estimator and configuration bound."""


class SceneEstimator(LeafSystem):
    """Latches one `types.Perception` for each rise of the `observe` counter; holds the belief in between.

    .. pydrake_system::

        name: SceneEstimator
        input_ports:
        - observe
        - frame
        - detections
        - associations
        - executed_action
        output_ports:
        - scene_belief
        - perception

    Its one update pulls frame, detections and associations, so that all three are of this observation. Systems that
    updated on the counter each for itself would see one another's results of the observation before.
    """

    def __init__(self, *, update_belief: UpdateBelief, period: float) -> None:
        super().__init__()
        self._update_belief = update_belief
        self._told = -1
        self._observe = self.DeclareVectorInputPort("observe", BasicVector(1))
        self._frame = self.DeclareAbstractInputPort("frame", abstract())
        self._detections = self.DeclareAbstractInputPort("detections", abstract())
        self._associations = self.DeclareAbstractInputPort("associations", abstract())
        self._action = self.DeclareAbstractInputPort("executed_action", abstract())
        self._belief = self.DeclareAbstractState(abstract(SceneBelief()))
        self._perception = self.DeclareAbstractState(abstract())
        self.DeclareStateOutputPort("scene_belief", self._belief)
        self.DeclareStateOutputPort("perception", self._perception)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: State) -> EventStatus:
        held: SceneBelief = context.get_abstract_state(self._belief).get_value()
        step = round(self._observe.Eval(context)[0]) - 1
        if step <= held.observation:
            if step < held.observation and step != self._told:  # once, not at each poll
                self._told = step
                _LOG.warning("observation %d after %d: left out, since it is older", step, held.observation)
            return EventStatus.DidNothing()
        frame: Frame = self._frame.Eval(context)
        if frame.observation != step:
            if step != self._told:
                self._told = step
                _LOG.warning("observation %d: the frame is of %d; waiting for its own", step, frame.observation)
            return EventStatus.DidNothing()
        detections: Detections = self._detections.Eval(context)
        associations: Associations = self._associations.Eval(context)
        action: PickPlace | None = unpack(self._action.Eval(context))
        if step > held.observation + 1:
            _LOG.warning("observation %d after %d: %d missing", step, held.observation, step - held.observation - 1)
        fed = {pair.detection for pair in associations.pairs}
        if len(fed) < len(detections.boxes):
            _LOG.info("observation %d: %d of %d detections fed no track", step,
                      len(detections.boxes) - len(fed), len(detections.boxes))  # fmt: skip
        if action is not None and all(track.id != action.track for track in held.tracks):
            _LOG.warning("observation %d: the action's target, track %d, is no longer believed", step, action.track)
        posterior = self._update_belief(held, frame, detections, associations, action)
        record = Perception(step, frame, detections.boxes, associations.pairs, held, posterior, action)
        state.get_mutable_abstract_state(self._belief).set_value(posterior)
        state.get_mutable_abstract_state(self._perception).set_value(record)
        return EventStatus.Succeeded()
