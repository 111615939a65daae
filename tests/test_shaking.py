"""What hangs on the hand, as physics has it, and the way of an arm that goes to get rid of it."""

import itertools

import numpy as np
import pytest
from pydrake.multibody.parsing import LoadModelDirectives
from pydrake.systems.analysis import Simulator
from test_picking import ARM, plan

from sum_drake import timing
from sum_drake.action_model import HANGS
from sum_drake.assets import MODELS
from sum_drake.dynamics import ArmDynamics
from sum_drake.geometry import transform
from sum_drake.pick_config import PickConfig
from sum_drake.picking import PickPlan
from sum_drake.planning_scene import PlanningScene
from sum_drake.robot import HAND, VIEW, arm_positions, desired_state
from sum_drake.sensor import DepthNoiseConfig, HeadCameraConfig
from sum_drake.shaking import GAPS, HEIGHTS, SHAKES, plan_shaking
from sum_drake.systems.station import default_plant_config, make_station


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
    for before, after in itertools.pairwise(motion.segments):
        np.testing.assert_allclose(before.trajectory.positions[-1], after.trajectory.positions[0], atol=1e-6)
    X_WGs = ARM.forward_many(timing.sample(rolling.trajectory, 0.05))
    over = X_WGs[:, :3, 3] - made.X_WG_place[:3, 3]
    assert any(np.allclose(over, [0.0, 0.0, height], atol=1e-4) for height in HEIGHTS)
    np.testing.assert_allclose(X_WGs[:, :3, 0], np.tile([0.0, 0.0, -1.0], (len(X_WGs), 1)), atol=1e-5)
    assert np.ptp(timing.sample(rolling.trajectory, 0.05)[:, 7]) > 1.9
    for segment in motion.segments:
        assert scene.with_gap(segment.gap).free_many(timing.sample(segment.trajectory, 0.01)).all()
        assert max(timing.limit_use(segment.trajectory)) <= 1.0 + 1e-6


def test_where_there_is_no_way_it_is_said_why(scene, made):
    full = made.X_WG_place[:3, 3] + np.mgrid[-6:7, -6:7, 0:25].reshape(3, -1).T / 80
    with pytest.raises(RuntimeError, match=r"no free way to shake off .*: no way to hold the hand there"):
        shake(scene, made, points_W=full)


RING_MASS = 0.06
"""Of the catalogue's lightest object."""


def write_ring(path):
    """An SDF file of a square ring around z, wide enough for a finger."""
    bars = [(0.025, 0.0, 0.01, 0.06), (-0.025, 0.0, 0.01, 0.06), (0.0, 0.025, 0.04, 0.01), (0.0, -0.025, 0.04, 0.01)]
    shapes = "".join(
        f"""<collision name="c{i}"><pose>{x} {y} 0 0 0 0</pose><geometry><box><size>{a} {b} .01</size></box></geometry>
        <drake:proximity_properties><drake:compliant_hydroelastic/>
        <drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus><drake:mu_static>.6</drake:mu_static>
        <drake:mu_dynamic>.6</drake:mu_dynamic></drake:proximity_properties></collision>"""
        for i, (x, y, a, b) in enumerate(bars)
    )
    inertia = RING_MASS * 0.03**2
    path.write_text(
        f"""<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="ring"><link name="body"><inertial>
        <mass>{RING_MASS}</mass><inertia><ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{2 * inertia}</izz></inertia>
        </inertial>{shapes}</link></model></sdf>"""
    )
    return str(path)


def test_it_sets_out_only_from_where_the_place_has_ended(scene, made):
    with pytest.raises(RuntimeError, match="the arm is not where the place ended"):
        shake(scene, made, q_now=VIEW + 0.1)


def test_a_ring_on_a_finger_is_felt(tmp_path):
    # At the viewing pose the fingers point up, like pegs: the ring is around one of them, just above the palm.
    p_WR = (ARM.forward(VIEW) @ np.array([-0.02, HAND.gap_max / 2 + HAND.pad_thickness / 2, 0.0, 1.0]))[:3]
    station = make_station(
        plant_config=default_plant_config(),
        directives=LoadModelDirectives(str(MODELS / "scenes" / "sorting.dmd.yaml")).directives,
        camera=HeadCameraConfig(),
        noise=DepthNoiseConfig(),
        objects={"ring": (write_ring(tmp_path / "ring.sdf"), transform(np.eye(3), p_WR))},
        seed=0,
    )
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("fetch.desired_state").FixValue(context, desired_state(VIEW, HAND.gap_max))
    simulator.AdvanceTo(0.5)
    state, effort = (station.GetOutputPort(f"fetch.{what}").Eval(context) for what in ("state", "effort"))
    weight = ArmDynamics().hanging(arm_positions(state), effort[:8])
    assert weight == pytest.approx(RING_MASS, rel=0.05) and weight > 2 * HANGS
