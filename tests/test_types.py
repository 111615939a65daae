import copy

import numpy as np
import pytest

from sum_drake.types import Camera, PoseBelief, Region, readonly


def test_values_are_their_own_copies():
    camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    assert copy.copy(camera) is camera
    assert copy.deepcopy([camera])[0] is camera


def test_readonly_copies_and_cannot_be_written():
    source = np.zeros(3)
    array = readonly(source)
    source[0] = 1.0
    assert array[0] == 0.0
    with pytest.raises(ValueError):
        array[0] = 2.0
    belief = PoseBelief(readonly(np.eye(4)[None]), readonly([1.0]))
    with pytest.raises(ValueError):
        belief.X_WOs[0, 0, 0] = 5.0


@pytest.mark.parametrize(
    ("X_WOs", "weights", "said"),
    [
        (np.eye(4)[None], [0.5, 0.5], r"poses \(1, 4, 4\); expected finite ones, one for each weight"),
        (np.full((1, 4, 4), np.nan), [1.0], "expected finite ones"),
        (np.eye(4)[None], [0.9], "weights sum to 0.9; expected 1"),
        (np.stack([np.eye(4)] * 2), [1.5, -0.5], "none below 0"),
        (np.eye(4)[None], [np.nan], "weights sum to nan"),
    ],
)
def test_what_is_no_belief_of_a_pose_cannot_be_made(X_WOs, weights, said):
    with pytest.raises(ValueError, match=said):
        PoseBelief(readonly(X_WOs), readonly(weights))


def test_region_knows_its_floor_and_rim():
    region = Region("bin", readonly([0.1, 0.6, 0.5]), readonly([0.2, 0.2, 0.1]))
    assert region.floor_height == pytest.approx(0.4)
    assert region.rim_height == pytest.approx(0.6)
