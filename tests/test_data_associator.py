import numpy as np

from sum_drake.association import AssociationConfig, associate
from sum_drake.systems.data_associator import DataAssociator
from sum_drake.systems.ports import abstract
from sum_drake.types import Detection, Detections, PoseBelief, SceneBelief, Track, readonly

BELIEF = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
TRACK = Track(5, "mug", (10, 10, 50, 50), 0.9, 0.9, BELIEF, BELIEF.X_WOs[0], 0.5, 0.5, True, 0, 0)


def test_associations_are_those_of_the_pure_function_and_carry_the_observation():
    config = AssociationConfig()
    system = DataAssociator(config=config)
    context = system.CreateDefaultContext()
    boxes = (Detection((12, 10, 50, 50), 0.8, (("mug", 0.9),)), Detection((300, 10, 50, 50), 0.8, (("toy", 0.9),)))
    system.GetInputPort("detections").FixValue(context, abstract(Detections(4, boxes)))
    system.GetInputPort("scene_belief").FixValue(context, abstract(SceneBelief(3, (TRACK,), 6)))
    result = system.GetOutputPort("associations").Eval(context)
    assert result.observation == 4
    assert result.pairs == associate((TRACK,), boxes, config)
    assert [pair.track for pair in result.pairs] == [5, None]
