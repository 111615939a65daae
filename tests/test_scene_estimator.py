"""The system that holds the belief: when it updates, what it latches, and that a record is of one observation."""

import functools

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scenes import observe, standing

from sum_drake import belief
from sum_drake.association import AssociationConfig
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.objects import load_catalogue
from sum_drake.presence import PresenceCheck
from sum_drake.systems.data_associator import DataAssociator
from sum_drake.systems.ports import abstract, unpack
from sum_drake.systems.scene_estimator import SceneEstimator
from sum_drake.types import Associations, Camera, Detection, Detections, Frame, PickPlace, SceneBelief, readonly

EYE = readonly(np.eye(4))
ACTION = PickPlace(0, "pick_place", 0, "mug", EYE, EYE, "bin", 0.04, 0.04, True)
FILTER = FilterConfig(particles=200, iterations=4)
ASSOCIATION = AssociationConfig()


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def update_belief(catalogue):
    """`belief.update` as the sorting diagram binds it, with fewer particles."""
    return functools.partial(
        belief.update, estimator=PoseEstimator(catalogue, FILTER), presence=PresenceCheck(catalogue),
        catalogue=catalogue, config=belief.BeliefConfig(FILTER, ASSOCIATION, belief.AcceptanceConfig(), True, 1),
    )  # fmt: skip


class Bench:
    """The estimator between ports that the test turns, with an update that counts."""

    def __init__(self, update_belief=None):
        self.calls = []

        def count(held, frame, detections, associations, action):
            self.calls.append((held.observation, frame, detections, associations, action))
            return SceneBelief(frame.observation, (), held.next_id + 1)

        self.system = SceneEstimator(update_belief=update_belief or count, period=0.1)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.fix("executed_action", None)

    def fix(self, port, value):
        self.system.GetInputPort(port).FixValue(self.context, abstract(value))

    def count(self, observations):
        self.system.GetInputPort("observe").FixValue(self.context, [float(observations)])

    def show(self, frame, detections=(), pairs=()):
        self.fix("frame", frame)
        self.fix("detections", Detections(frame.observation, tuple(detections)))
        self.fix("associations", Associations(frame.observation, tuple(pairs)))

    def wait(self, seconds=0.25):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def out(self, port):
        return unpack(self.system.GetOutputPort(port).Eval(self.context))


def blank(observation):
    color, depth = np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2), np.float32)
    return Frame(observation, readonly(color, np.uint8), readonly(depth, np.float32), Camera(2, 2, 1, 1, 0.5, 0.5), EYE)


def test_before_the_first_observation_it_holds_nothing_and_pulls_nothing():
    bench = Bench()
    bench.count(0)
    bench.wait(1.0)  # frame, detections and associations are not even connected: to evaluate one would raise
    assert bench.calls == []
    assert bench.out("perception") is None
    assert bench.out("scene_belief").observation == -1
    assert bench.out("scene_belief").tracks == ()


def test_each_rise_of_the_counter_is_latched_once():
    bench = Bench()
    for step in range(3):
        bench.count(step + 1)
        bench.show(blank(step))
        bench.fix("executed_action", ACTION if step else None)
        bench.wait(0.55)
        assert len(bench.calls) == step + 1, "polled five times, updated once"
        record = bench.out("perception")
        assert (record.step, record.frame.observation) == (step, step)
        assert record.action is (ACTION if step else None)
        assert record.posterior is bench.out("scene_belief")
        assert (record.prior.observation, record.posterior.observation) == (step - 1, step)
    assert [held for held, *_ in bench.calls] == [-1, 0, 1], "each update goes on from the one before"


def test_what_changes_on_the_ports_while_the_counter_stands_still_is_not_taken_in():
    bench = Bench()
    bench.count(1)
    bench.show(blank(0))
    bench.wait()
    record = bench.out("perception")
    bench.show(blank(7))
    bench.fix("executed_action", ACTION)
    bench.wait(1.0)
    assert len(bench.calls) == 1
    assert bench.out("perception") is record
    assert record.frame.observation == 0


def test_what_comes_late_and_an_action_on_nothing_are_logged_and_harmless(caplog):
    bench = Bench()
    for count, action in ((3, ACTION), (2, None)):
        bench.count(count)
        bench.show(blank(count - 1))
        bench.fix("executed_action", action)
        bench.wait()
    assert len(bench.calls) == 1
    assert bench.out("scene_belief").observation == 2
    missing, gone, late = [record.getMessage() for record in caplog.records]
    assert "observation 2 after -1: 2 missing" in missing
    assert "observation 2: the action's target, track 0, is no longer believed" in gone
    assert "observation 1 after 2: left out, since it is older" in late


def test_no_input_reaches_an_output_within_an_instant():
    assert not Bench().system.HasAnyDirectFeedthrough()


def test_belief_and_record_are_part_of_the_context():
    """A context that is cloned and gone on with is a run of its own; the one it came from stays as it was."""
    bench = Bench()
    bench.count(1)
    bench.show(blank(0))
    bench.wait()
    twin = Simulator(bench.system, bench.context.Clone())
    context = twin.get_mutable_context()
    bench.system.GetInputPort("observe").FixValue(context, [2.0])
    bench.system.GetInputPort("frame").FixValue(context, abstract(blank(1)))
    twin.AdvanceTo(context.get_time() + 0.25)
    assert bench.system.GetOutputPort("scene_belief").Eval(context).observation == 1
    assert bench.out("scene_belief").observation == 0


@pytest.mark.parametrize(
    ("detections", "associations"), [(0, 1), (1, 0), (1, 1)], ids=["associations", "detections", "frame"]
)
def test_inputs_of_different_observations_never_make_a_record(update_belief, detections, associations):
    bench = Bench(update_belief)
    bench.count(1)
    bench.show(blank(0))
    bench.fix("detections", Detections(detections, ()))
    bench.fix("associations", Associations(associations, ()))
    with pytest.raises(ValueError, match="different observations"):
        bench.wait()
    assert bench.out("perception") is None
    assert bench.out("scene_belief").observation == -1


def test_with_its_associator_it_finds_an_object_and_knows_it_again(catalogue, update_belief):
    """The loop through the associator as in the sorting diagram, with the real update of the belief."""
    builder = DiagramBuilder()
    associator = builder.AddNamedSystem("data_associator", DataAssociator(catalogue=catalogue, config=ASSOCIATION))
    estimator = builder.AddNamedSystem("scene_estimator", SceneEstimator(update_belief=update_belief, period=0.1))
    builder.Connect(estimator.GetOutputPort("scene_belief"), associator.GetInputPort("scene_belief"))
    builder.Connect(associator.GetOutputPort("associations"), estimator.GetInputPort("associations"))
    index = builder.ExportInput(associator.GetInputPort("detections"), "detections")
    builder.ConnectInput(index, estimator.GetInputPort("detections"))
    for port in ("frame", "executed_action"):
        builder.ConnectInput(builder.ExportInput(estimator.GetInputPort(port), port), associator.GetInputPort(port))
    builder.ExportInput(estimator.GetInputPort("observe"), "observe")
    builder.ExportOutput(estimator.GetOutputPort("perception"), "perception")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("executed_action").FixValue(context, abstract())

    X_WO = standing(catalogue, "sugar", 0.6, 0.1, yaw=0.4)
    records = []
    for step in range(2):
        frame, boxes = observe(catalogue, {"sugar": X_WO}, observation=step)
        seen = Detections(step, (Detection(boxes["sugar"], 0.9, (("sugar", 0.9),)),))
        diagram.GetInputPort("frame").FixValue(context, abstract(frame))
        diagram.GetInputPort("detections").FixValue(context, abstract(seen))
        diagram.GetInputPort("observe").FixValue(context, [step + 1.0])
        simulator.AdvanceTo(context.get_time() + 0.25)
        records.append(diagram.GetOutputPort("perception").Eval(context))
    assert [record.step for record in records] == [0, 1]
    assert [pair.track for record in records for pair in record.associations] == [None, 0]
    for step, record in enumerate(records):
        (track,) = record.posterior.tracks
        assert (track.id, track.born, track.seen, track.accepted) == (0, 0, step, True)
        translation, rotation = pose_error(track.X_WO, X_WO, catalogue["sugar"].symmetry)
        assert translation < 0.02
        assert rotation < np.radians(20)
