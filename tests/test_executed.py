import numpy as np
import pytest

from sum_drake.executed import KINDS, limit_use
from sum_drake.robot import ACCELERATION, ARM_JOINTS, HAND, JOINTS, STATE_JOINTS, VIEW, desired_state


def at_rest(count=5):
    """States (n, 24) and efforts (n, 12) of a robot that stands at VIEW."""
    wanted = desired_state(VIEW, HAND.gap_max)[: len(JOINTS)]
    state = np.zeros(2 * len(STATE_JOINTS))
    state[: len(STATE_JOINTS)] = [wanted[JOINTS.index(joint)] for joint in STATE_JOINTS]
    return np.tile(state, (count, 1)), np.zeros((count, len(JOINTS)))


def test_a_robot_at_rest_uses_its_joints_range_and_nothing_else():
    use = limit_use(*at_rest(), 0.004)
    assert use.samples == 5
    assert use.violated == 0
    assert use.position.max() <= 1.0 and use.position[1] == pytest.approx(1.32 / 1.6056)
    assert [use.position[i] for i in (3, 5, 7)] == [0.0] * 3, "those turn without end"
    assert not any(shares.any() for shares in (use.speed, use.acceleration, use.effort, use.at_full_effort))


@pytest.mark.parametrize("joint", range(len(JOINTS)))
def test_shares_go_with_their_joint(joint):
    states, efforts = at_rest()
    states[2, len(JOINTS) + STATE_JOINTS.index(JOINTS[joint])] = -0.5 * JOINTS[joint].velocity
    efforts[3, joint] = JOINTS[joint].effort
    use = limit_use(states, efforts, 0.004)
    assert use.speed[joint] == pytest.approx(0.5) and np.count_nonzero(use.speed) == 1
    assert use.effort[joint] == pytest.approx(1.0) and np.count_nonzero(use.effort) == 1
    assert use.at_full_effort[joint] == pytest.approx(0.2)
    if joint < len(ARM_JOINTS):
        assert use.acceleration[joint] == pytest.approx(0.5 * JOINTS[joint].velocity / 0.004 / ACCELERATION[joint])
    arm = joint < len(ARM_JOINTS)
    assert dict(use.violations) == {"position": 0, "speed": 0, "effort": int(arm)}, "fingers are meant to give all"


def test_what_is_beyond_a_limit_is_counted_by_kind():
    states, efforts = at_rest()
    states[1, 1] = 1.7  # shoulder pan, which ends at 1.6056
    states[2:4, len(JOINTS) + 6] = 2.5  # wrist flex, 2.268 at most
    efforts[3:, 7] = -JOINTS[7].effort
    efforts[0, 6] = 0.99 * JOINTS[6].effort
    use = limit_use(states, efforts, 0.004)
    assert dict(use.violations) == {"position": 1, "speed": 2, "effort": 2}
    assert dict(use.violated_by) == {JOINTS[1].name: 1, JOINTS[6].name: 2, JOINTS[7].name: 2}


def test_the_row_of_a_summary_tells_the_most_that_any_joint_used():
    states, efforts = at_rest()
    states[2, len(JOINTS) + 1] = 0.628
    efforts[:, -1] = -60.0
    row = limit_use(states, efforts, 0.004).row()
    assert row["speed_use"] == pytest.approx(0.5)
    assert row["effort_use"] == 0.0, "the fingers push with all they have"
    assert row["violations"] == dict.fromkeys(KINDS, 0) and row["violated_by"] == {}


def test_nothing_done_uses_nothing():
    use = limit_use(np.empty((0, 24)), np.empty((0, 12)), 0.004)
    assert (use.samples, use.violated) == (0, 0)
    assert tuple(kind for kind, _ in use.violations) == KINDS
