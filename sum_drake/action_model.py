"""What an action of the robot does to the belief over an object's pose (Sui et al. 2017, eq. 10)."""

import numpy as np

from sum_drake.filter_config import FilterConfig
from sum_drake.geometry import rotation_from_vector
from sum_drake.resampling import systematic
from sum_drake.types import PickPlace, PoseBelief, readonly


def predict(
    belief: PoseBelief,
    action: PickPlace | None,
    *,
    is_target: bool,
    rng: np.random.Generator,
    config: FilterConfig,
) -> PoseBelief:
    """The belief after an action, before the next observation (Sui et al. 2017, eq. 10).

    The action's target is at the action's X_WO_place with sigma_place, with probability w_place, or else still where
    it was, with sigma_stay; the latter for certain when the hand was not opened at the place. Any other object is where
    it was, with sigma_other. None, or an action of kind "none": nothing was touched, and the belief is
    returned as it is. Noise is on positions, and on rotation vectors by radians_per_metre.
    """
    if action is None or action.kind == "none":
        return belief
    n = len(belief.weights)
    X_WOs = belief.X_WOs[systematic(belief.weights, n, rng.random())]
    sigma = np.full(n, config.sigma_other)
    if is_target:
        placed = rng.random(n) < (config.w_place if action.released else 0.0)
        X_WOs[placed] = action.X_WO_place
        sigma = np.where(placed, config.sigma_place, config.sigma_stay)
    X_WOs[:, :3, 3] += sigma[:, None] * rng.normal(size=(n, 3))
    turn = config.radians_per_metre * sigma[:, None] * rng.normal(size=(n, 3))
    X_WOs[:, :3, :3] = rotation_from_vector(turn) @ X_WOs[:, :3, :3]
    return PoseBelief(readonly(X_WOs), readonly(np.full(n, 1.0 / n)))
