"""What hangs on the hand, as physics has it, and the way of an arm that goes to get rid of it."""

import dataclasses
import itertools

import numpy as np
import pytest
from pydrake.multibody.parsing import LoadModelDirectives
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from test_picking import ARM, plan

from sum_drake import timing
from sum_drake.action_model import HANGS
from sum_drake.assets import MODELS
from sum_drake.dynamics import ArmDynamics
from sum_drake.geometry import transform
from sum_drake.pick_config import PickConfig
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene
from sum_drake.playback import segment_ends
from sum_drake.robot import FINGERS, HAND, VIEW, arm_positions
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig
from sum_drake.shaking import GAPS, HEIGHTS, RISE, SHAKES, plan_shaking
from sum_drake.systems.arm_controller import ArmController
from sum_drake.systems.ports import abstract
from sum_drake.systems.station import default_plant_config, make_station
from sum_drake.types import Motion


@pytest.fixture(scope="module")
def scene():
    return PlanningScene()


@pytest.fixture(scope="module")
def made(scene):
    answer = plan(scene)
    assert isinstance(answer, PickPlan)
    return answer


def shake(scene, made, times=0, q_now=VIEW, **more):
    return plan_shaking(
        arm=ARM, scene=scene, plan=made, q_now=q_now, motion_id=9, times=times, seed=1, config=PickConfig(), **more
    )


def assert_sound(scene, motion):
    """Continuous, free, and within limits."""
    for before, after in itertools.pairwise(motion.segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    for segment in motion.segments:
        assert scene.with_gap(segment.gap).free_many(timing.sample(segment.trajectory, 0.01)).all()
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6


@pytest.mark.parametrize("times", range(SHAKES))
def test_it_goes_to_the_place_rolls_the_hand_that_points_down_and_comes_back(scene, made, times):
    motion = shake(scene, made, times)
    assert (motion.id, motion.load) == (9, None)
    assert [segment.name for segment in motion.segments] == [
        "shake", "weigh", "shake", "shake", "open", "shake", "return",
    ]  # fmt: skip
    there, weighing, _, rolling, *_, back = motion.segments
    came = made.place.segments[-1]
    assert [segment.gap for segment in motion.segments] == [*[came.gap] * 3, GAPS[times], *[came.gap] * 3]
    np.testing.assert_array_equal(back.trajectory.positions, there.trajectory.positions[::-1])
    X_WGs = [ARM.forward_many(trajectory.positions) for trajectory in (back.trajectory, came.trajectory)]
    np.testing.assert_allclose(*X_WGs, atol=1e-9)
    np.testing.assert_allclose(there.trajectory.positions[0], VIEW, atol=1e-6)
    assert weighing.trajectory.times[-1] >= 0.5 and not np.ptp(weighing.trajectory.positions, axis=0).any()
    X_WGs = ARM.forward_many(timing.sample(rolling.trajectory, 0.05))
    over = X_WGs[:, :3, 3] - made.X_WG_place[:3, 3]
    assert any(np.allclose(over, [0.0, 0.0, height], atol=1e-4) for height in HEIGHTS)
    np.testing.assert_allclose(X_WGs[:, :3, 0], np.tile([0.0, 0.0, -1.0], (len(X_WGs), 1)), atol=1e-5)
    assert np.ptp(timing.sample(rolling.trajectory, 0.05)[:, 7]) > 1.9
    assert_sound(scene, motion)


@pytest.mark.parametrize("done", [0.0, 0.6])
def test_an_arm_that_was_stopped_on_its_way_back_or_has_not_begun_it_goes_from_there(scene, made, done):
    came = made.place.segments[-1]
    on_way = timing.evaluate(came.trajectory, done * came.trajectory.times[-1])[0]
    q_now = on_way + np.array([0.0, 0.01, -0.01, 2 * np.pi, 0.01, 0.0, 0.0, -2 * np.pi])
    motion = shake(scene, made, q_now=q_now)
    assert [segment.name for segment in motion.segments] == [
        "shake", "weigh", "shake", "shake", "open", "shake", "return",
    ]  # fmt: skip
    there, back = motion.segments[0].trajectory, motion.segments[-1].trajectory
    np.testing.assert_allclose(there.positions[0], q_now, atol=1e-9)
    assert there.times[-1] < 1.5 * came.trajectory.times[-1]
    np.testing.assert_allclose(ARM.forward(back.positions[-1]), ARM.forward(VIEW), atol=1e-6)
    assert_sound(scene, motion)
    with pytest.raises(RuntimeError, match=r"neither where it came by nor over the place"):
        shake(scene, made, q_now=q_now + np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))


def half_turned(scene, made):
    """A shake as far as it comes if the arm is stopped as it turns the hand over the place."""
    there, weighing, turning, *_ = shake(scene, made).segments
    half = timing.time_curve(timing.sample(turning.trajectory, 0.02)[: int(25 * turning.trajectory.times[-1])])
    return Motion(8, (there, weighing, dataclasses.replace(turning, trajectory=half)))


def test_an_arm_that_was_stopped_as_it_turned_the_hand_rises_and_turns_it_there(scene, made):
    stopped = half_turned(scene, made)
    q_now = stopped.segments[-1].trajectory.positions[-1]
    motion = shake(scene, made, 1, q_now=q_now)
    assert (motion.id, motion.load) == (9, None)
    assert [segment.name for segment in motion.segments] == [
        "shake", "weigh", "shake", "shake", "shake", "open", "shake", "return",
    ]  # fmt: skip
    assert [segment.gap for segment in motion.segments[3:5]] == list(GAPS), "it got to neither before"
    rising, weighing, _, *rolls, _, _, back = (segment.trajectory for segment in motion.segments)
    assert weighing.times[-1] >= 0.5
    X_WGs = ARM.forward_many(timing.sample(rising, 0.05))
    np.testing.assert_allclose(X_WGs, [transform(X_WGs[0, :3, :3], X_WG[:3, 3]) for X_WG in X_WGs], atol=1e-3)
    np.testing.assert_allclose(np.ptp(X_WGs[:, :3, 3], axis=0), [0.0, 0.0, RISE], atol=1e-3)
    for roll in rolls:
        X_WGs = ARM.forward_many(timing.sample(roll, 0.05))
        np.testing.assert_allclose(X_WGs[:, :3, 0], np.tile([0.0, 0.0, -1.0], (len(X_WGs), 1)), atol=1e-5)
        np.testing.assert_allclose(X_WGs[:, :2, 3], np.tile(made.X_WG_place[:2, 3], (len(X_WGs), 1)), atol=1e-4)
        assert np.ptp(timing.sample(roll, 0.05)[:, 7]) > 1.9
    np.testing.assert_allclose(ARM.forward(back.positions[-1]), ARM.forward(VIEW), atol=1e-6)
    assert_sound(scene, motion)


def test_an_arm_that_has_not_moved_since_goes_nowhere_before_it_weighs(scene, made):
    rising = made.place.segments[-2].trajectory.positions[-1]
    there, weighing, turning, *_ = shake(scene, made, q_now=rising).segments
    assert there.trajectory.times[-1] == 0.0
    for segment in (there, weighing):
        np.testing.assert_allclose(segment.trajectory.positions, np.tile(rising, (2, 1)), atol=1e-9)
    np.testing.assert_allclose(turning.trajectory.positions[0], rising, atol=1e-9)


def test_where_there_is_no_way_it_is_said_why(scene, made):
    full = made.X_WG_place[:3, 3] + np.mgrid[-6:7, -6:7, 0:25].reshape(3, -1).T / 80
    with pytest.raises(RuntimeError, match=r"no free way to shake off .*: no way to hold the hand there"):
        shake(scene, made, points_W=full)


RING_MASS, RING_THICKNESS = 0.06, 0.01
"""The mass of the catalogue's lightest object."""
AT_REST = 3.0
"""A ring lies still after so long, seconds."""


def write_ring(path, radius):
    """An SDF file of a ring around z, of a dozen rods; radius: of its middle."""
    angles = np.arange(12) * np.pi / 6
    length = 2 * radius * np.tan(np.pi / 12)
    shapes = "".join(
        f"""<collision name="c{i}"><pose>{radius * np.cos(a)} {radius * np.sin(a)} 0 {np.pi / 2} 0 {a}</pose><geometry>
        <capsule><radius>{RING_THICKNESS / 2}</radius><length>{length}</length></capsule></geometry>
        <drake:proximity_properties><drake:compliant_hydroelastic/><drake:mesh_resolution_hint>.004
        </drake:mesh_resolution_hint><drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
        <drake:hunt_crossley_dissipation>5</drake:hunt_crossley_dissipation><drake:mu_static>.6</drake:mu_static>
        <drake:mu_dynamic>.6</drake:mu_dynamic></drake:proximity_properties></collision>"""
        for i, a in enumerate(angles)
    )
    inertia = RING_MASS * radius**2
    path.write_text(
        f"""<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="ring"><link name="body"><inertial>
        <mass>{RING_MASS}</mass><inertia><ixx>{inertia / 2}</ixx><iyy>{inertia / 2}</iyy><izz>{inertia}</izz></inertia>
        </inertial>{shapes}</link></model></sdf>"""
    )
    return str(path)


class Hung:
    """The robot at the viewing pose, where its fingers point up like pegs, with a ring around one or both of them."""

    def __init__(self, folder, *, both):
        radius = 0.047 if both else 0.03
        # A narrow one is around one of the opened fingers, these press against a wide one from within.
        gap = 2 * (radius - RING_THICKNESS / 2 - HAND.pad_thickness - 0.004) if both else HAND.gap_max
        y = 0.0 if both else HAND.gap_max / 2 + HAND.pad_thickness / 2
        p_WR = (ARM.forward(VIEW) @ np.array([0.01 if both else -0.02, y, 0.0, 1.0]))[:3]
        builder = DiagramBuilder()
        self.station = builder.AddNamedSystem(
            "station",
            make_station(
                plant_config=default_plant_config(),
                directives=LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml")).directives,
                camera=HeadCameraConfig(),
                noise=DepthNoiseConfig(),
                objects={"ring": (write_ring(folder / "ring.sdf", radius), transform(np.eye(3), p_WR))},
                seed=0,
            ),
        )
        self.controller = builder.AddNamedSystem("arm_controller", ArmController(step=default_plant_config().time_step))
        for name, port in (("fetch.state", "robot_state"), ("fetch.effort", "effort")):
            builder.Connect(self.station.GetOutputPort(name), self.controller.GetInputPort(port))
        builder.Connect(
            self.controller.GetOutputPort("desired_state"), self.station.GetInputPort("fetch.desired_state")
        )
        self.simulator = Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        self.plant = self.station.GetSubsystemByName("plant")
        for finger in FINGERS:
            joint = self.plant.GetJointByName(finger.name)
            joint.set_translation(self.plant.GetMyMutableContextFromRoot(self.root), gap / 2)
        self.play(Motion(-1, ()), AT_REST)

    def play(self, motion, seconds):
        """Lets the arm play a motion."""
        port = self.controller.GetInputPort("motion")
        port.FixValue(self.controller.GetMyMutableContextFromRoot(self.root), abstract(motion))
        self.simulator.AdvanceTo(self.root.get_time() + seconds)

    def weight(self):
        """What the drives feel hanging, kilograms."""
        context = self.station.GetMyContextFromRoot(self.root)
        state, effort = (self.station.GetOutputPort(f"fetch.{what}").Eval(context) for what in ("state", "effort"))
        return ArmDynamics().hanging(arm_positions(state), effort[:8])

    def ring(self):
        """Where it is, (3,)."""
        body = self.plant.GetBodyByName("body")
        return self.plant.EvalBodyPoseInWorld(self.plant.GetMyContextFromRoot(self.root), body).translation()


def test_a_ring_on_a_finger_is_felt_and_slides_off_once_the_hand_points_down(tmp_path, scene, made):
    hung = Hung(tmp_path, both=False)
    assert hung.weight() == pytest.approx(RING_MASS, rel=0.05) and hung.weight() > 2 * HANGS
    motion = shake(scene, made)
    hung.play(motion, segment_ends(motion)[-1] + 0.5)
    assert hung.ring()[2] < made.X_WG_place[2, 3] and hung.weight() < HANGS, "it slid off"


def test_a_ring_that_the_opened_fingers_press_against_comes_off_once_they_are_half_closed(tmp_path, scene, made):
    for times, comes_off in ((0, False), (1, True)):
        hung = Hung(tmp_path, both=True)
        motion = shake(scene, made, times)
        names = [segment.name for segment in motion.segments]
        weighed, rolled = segment_ends(motion)[[names.index("weigh"), names.index("open") - 1]]
        hung.play(motion, weighed)
        assert hung.weight() == pytest.approx(RING_MASS, abs=HANGS), "it is still there over the place"
        hung.simulator.AdvanceTo(AT_REST + rolled)
        assert (abs(hung.weight()) < HANGS) == comes_off
    off = hung.ring()[:2] - made.X_WG_place[:2, 3]
    assert np.linalg.norm(off) < 0.1, "it fell where the object was to be"


def test_a_ring_comes_off_where_the_arm_was_stopped_too(tmp_path, scene, made):
    stopped = half_turned(scene, made)
    hung = Hung(tmp_path, both=True)
    hung.play(stopped, segment_ends(stopped)[-1])
    assert hung.weight() == pytest.approx(RING_MASS, abs=HANGS)
    motion = shake(scene, made, q_now=stopped.segments[-1].trajectory.positions[-1])
    hung.play(motion, segment_ends(motion)[4])
    assert abs(hung.weight()) < HANGS
    assert np.linalg.norm(hung.ring()[:2] - made.X_WG_place[:2, 3]) < 0.15, "it fell where the object was to be"
