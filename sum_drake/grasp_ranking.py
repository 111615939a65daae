"""The order of an object's grasps in a scene: what hand, table, neighbours and belief leave of them, best first."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from sum_drake.geometry import apply, inverse
from sum_drake.grasping import Cloud, GraspConfig, Indices, Mask, contacts, opening, surface
from sum_drake.objects import ObjectModel
from sum_drake.resampling import systematic
from sum_drake.robot import FINGERS, HAND
from sum_drake.types import Array, Grasp, Immutable, PoseBelief, readonly

DEFAULT_MASS = 0.4
"""Kilograms, of objects whose catalogue does not say."""
DOUBT = 0.2
"""How much less probable it is that a grasp holds whose contact is bad, or which has no room."""
ENOUGH, ROUNDS = 10, 3
"""The next best grasps are tried out on the belief until so many hold, or so many times."""
DROPPED = 200
"""Of the candidates that are dropped about this many are told one by one."""
RANKING_POINTS = 5000
"""At most this many surface points are used while ranking, where time is short."""

CAUSES = (
    "approach_from_below", "table", "neighbour_finger", "neighbour_palm", "neighbour_approach", "belief_too_wide",
    "outranked",
)  # fmt: skip
"""Why `rank_grasps` drops a candidate, in the order in which the causes are tested:

approach_from_below: the approach direction is more than `max_tilt` away from straight down; table: the hand would come
closer to the table than `table_clearance`; neighbour_finger, neighbour_palm, neighbour_approach: an obstacle point
lies in or between the fingers, in the palm, or in the volume the hand sweeps on its way (counted as CAUSE_NAME where
it is known whose point that is); belief_too_wide: the grasp holds for less than `min_survival` of the belief;
outranked: it was not tried out on the belief, as better ones hold, or the arm is too short for it.
"""
NEIGHBOUR_CAUSES = ("neighbour_finger", "neighbour_palm", "neighbour_approach")

HAND_PARTS = ("fingers", "palm", "approach")
"""The volumes of `hand_clearances`, in its order."""


@dataclasses.dataclass(frozen=True, eq=False)
class RankedGrasps(Immutable):
    """What is left of an object's candidates in a scene, best first."""

    grasps: tuple[Grasp, ...]
    X_WGs: Array
    """(n, 4, 4) at the estimated pose of the object."""
    gaps: Array
    """(n,): distance between the fingers during the approach; neighbours were tested with it, so open no wider."""
    scores: Array
    """(n,); 0 where the arm is too short."""
    rejected_by: tuple[tuple[str, int], ...]
    """Number of candidates dropped for each of CAUSES."""
    holds: Array = dataclasses.field(default_factory=lambda: readonly(np.empty(0)))
    """(n,): about the probability that the hand gets hold of the object, if it is one of the belief's particles; 0
    where the arm is too short."""
    X_WDs: Array = dataclasses.field(default_factory=lambda: readonly(np.empty((0, 4, 4))))
    """(d, 4, 4): a sample of the candidates that were dropped."""
    causes: tuple[str, ...] = ()
    """(d,): the cause of each, as in `rejected_by`."""


def rank_grasps(
    candidates: Sequence[Grasp],
    *,
    model: ObjectModel,
    X_WO: Array,
    belief: PoseBelief,
    points_W: Array,
    table_height: float,
    config: GraspConfig,
    owners: Sequence[str] | None = None,
    reaches: Callable[[Array], bool] | None = None,
) -> RankedGrasps:
    """Drops the candidates that the scene forbids and orders the others, best first.

    A grasp that comes too close to the table is drawn back along its approach direction before it is dropped, so that
    the grasps returned are not always among the candidates. What the arm is too short for comes last, so that it takes
    no room among what is tried out; why it is no way to grasp is for the planner to say.

    Args:
        candidates: of `grasp_candidates(model, ...)`.
        X_WO: (4, 4), the estimated pose, on which the hand poses are based.
        belief: the particles over which a grasp should hold.
        points_W: (m, 3) on surfaces that the hand must not touch: neighbours and unexplained depth.
        table_height: of the table's top, metres.
        owners: whose surface each of points_W is on, to be named where it is in the way; None: not told.
        reaches: whether the arm is long enough for a hand at X_WG (4, 4); None: for all.
    """
    X_OGs = np.array([grasp.X_OG for grasp in candidates]).reshape(-1, 4, 4)
    widths = np.array([grasp.width for grasp in candidates])
    qualities = np.array([grasp.quality for grasp in candidates])
    X_WGs = X_WO @ X_OGs
    gaps = opening(widths, config)
    cloud = surface(model, config.spacing)

    cause = np.full(len(X_WGs), -1)

    def reject(which: str, bad: Mask) -> None:
        cause[(cause < 0) & bad] = CAUSES.index(which)

    above = -X_WGs[:, 2, 0]  # cosine of the approach direction with straight down
    reject("approach_from_below", above < np.cos(config.max_tilt))
    # A hand that would touch the table is drawn back from the object just far enough, if it still holds it then.
    below = table_height + config.table_clearance - lowest_point(X_WGs, gaps)
    back = np.maximum(below, 0.0) / np.maximum(above, 1e-3)
    reject("table", back > HAND.pad_x[1] - HAND.pad_x[0])
    X_WGs[:, :3, 3] -= back[:, None] * X_WGs[:, :3, 0]
    drawn = np.flatnonzero((cause < 0) & (back > 0))
    lows, highs, qualities[drawn] = _contacts_of(cloud, inverse(X_WGs[drawn]) @ X_WO, gaps[drawn], config)
    off_centre = np.abs(lows + highs) > config.min_clearance
    qualities[drawn[off_centre]] = 0.0
    widths[drawn] = highs - lows
    reject("table", qualities == 0)
    clearances = np.full((len(X_WGs), len(HAND_PARTS)), np.inf)
    nearest = np.zeros((len(X_WGs), len(HAND_PARTS)), dtype=int)
    left = cause < 0
    clearances[left], nearest[left] = _clearances(X_WGs[left], gaps[left], points_W, config.approach)
    for part, which in enumerate(NEIGHBOUR_CAUSES):
        reject(which, clearances[:, part] < config.neighbour_clearance)

    # The mean of the surface stands for the centre of mass, which no catalogue tells.
    arm_W = apply(X_WO, cloud.p_OQs.mean(0)[None])[0] - X_WGs[:, :3, 3]
    # The weight's moment about the closing axis twists the object between the pads, which only friction within them
    # resists, the less the smaller and the more slanted the contacts are. Across that axis the friction of one pad
    # works against the other's, the better the wider they are apart; half of it is left for that, as friction carries
    # the weight, too.
    weight = 9.81 * (DEFAULT_MASS if model.mass is None else model.mass)
    twist = np.abs(arm_W[:, 1] * X_WGs[:, 0, 1] - arm_W[:, 0] * X_WGs[:, 1, 1])
    across = np.sqrt(np.maximum((arm_W[:, :2] ** 2).sum(1) - twist**2, 0.0))
    borne_across = 0.5 * config.friction * FINGERS[0].effort * np.maximum(widths, 1e-3)
    borne_twist = config.torque * np.maximum(qualities, 1e-3)
    balance = 1.0 / (1.0 + (weight * twist / borne_twist) ** 2 + (weight * across / borne_across) ** 2)
    room = np.clip(clearances.min(1) / 0.02, 0.0, 1.0)
    merit = config.weight_contact * qualities + config.weight_above * above + config.weight_room * room
    near, left = np.ones(len(X_WGs)), cause < 0
    if reaches is not None:
        near[left] = [reaches(X_WG) for X_WG in X_WGs[left]]
    scores = np.where(left, near * balance * np.maximum(merit, 0.0), -1.0)

    ranked = np.argsort(-scores, kind="stable")[: np.count_nonzero(cause < 0)]
    survival = np.ones(len(X_WGs))
    tried = 0
    for _ in range(ROUNDS):
        batch = ranked[tried : tried + config.tried]
        survival[batch] = _survival(cloud, X_WO, X_WGs[batch], gaps[batch], belief, config)
        tried += len(batch)
        if np.count_nonzero(survival[ranked[:tried]] >= config.min_survival) >= ENOUGH or tried == len(ranked):
            break
    best = ranked[:tried]
    reject("belief_too_wide", survival < config.min_survival)
    outranked = np.ones(len(X_WGs), dtype=bool)
    outranked[best] = False
    reject("outranked", outranked)
    # What stands over or beside the hand on its way up is no obstacle for certain, but room is better.
    room[best] = np.minimum(
        room[best], np.clip(_lift_clearances(X_WGs[best], gaps[best], points_W, config) / 0.02, 0, 1)
    )
    scores[best] *= 1.0 - config.weight_lift * (1.0 - room[best])
    scores *= survival
    holds = near * survival * (1.0 - DOUBT * (1.0 - balance * qualities)) * (1.0 - DOUBT * (1.0 - room))
    order = best[np.argsort(-scores[best], kind="stable")]
    order = order[cause[order] < 0]
    X_OGs = inverse(X_WO) @ X_WGs
    dropped = _sample(cause)
    return RankedGrasps(
        grasps=tuple(Grasp(model.label, readonly(X_OGs[i]), float(widths[i]), float(qualities[i])) for i in order),
        X_WGs=readonly(X_WGs[order]),
        gaps=readonly(gaps[order]),
        scores=readonly(scores[order]),
        rejected_by=_counts(cause, nearest, owners),
        holds=readonly(holds[order]),
        X_WDs=readonly(X_WGs[dropped]),
        causes=tuple(_named(int(cause[i]), nearest[i], owners) for i in dropped),
    )


def _sample(cause: Indices) -> Indices:
    """Indices of about DROPPED dropped candidates: of each cause its share, and at least one."""
    dropped = np.flatnonzero(cause >= 0)
    by_cause = dropped[np.argsort(cause[dropped], kind="stable")]
    if len(by_cause) <= DROPPED:
        return by_cause
    spread = np.linspace(0, len(by_cause) - 1, DROPPED).round().astype(int)
    firsts = np.unique(cause[by_cause], return_index=True)[1]
    sample: Indices = by_cause[np.union1d(spread, firsts)]
    return sample


def _named(cause: int, nearest: Indices, owners: Sequence[str] | None) -> str:
    """A cause, with whose point is in the way where that is known; nearest: (3,), of the parts of one hand."""
    name = CAUSES[cause]
    if owners is None or name not in NEIGHBOUR_CAUSES:
        return name
    return f"{name}_{owners[nearest[NEIGHBOUR_CAUSES.index(name)]]}"


def _counts(cause: Indices, nearest: Indices, owners: Sequence[str] | None) -> tuple[tuple[str, int], ...]:
    """Candidates by cause; neighbours by whose point is in the way, if that is known, most often met first."""
    counts: list[tuple[str, int]] = []
    for i, name in enumerate(CAUSES):
        if owners is None or name not in NEIGHBOUR_CAUSES:
            counts.append((name, int(np.count_nonzero(cause == i))))
            continue
        met = Counter(owners[point] for point in nearest[cause == i, NEIGHBOUR_CAUSES.index(name)])
        counts += [(f"{name}_{owner}", count) for owner, count in sorted(met.items(), key=lambda kv: (-kv[1], kv[0]))]
    return tuple(counts)


def hand_clearances(X_WGs: Array, gaps: Array, points_W: Array, *, approach: float) -> Array:
    """How far obstacle points stay away from each of HAND_PARTS, metres; negative inside; inf without points.

    Distances are to boxes in the largest-component norm, which never exceeds the Euclidean distance. `fingers` takes
    in the space between them, since what stands there is grasped too; `approach` is the space behind the palm that the
    hand passes through on a straight approach of that length.

    Args:
        X_WGs: (n, 4, 4).
        gaps: (n,) distances between the fingers.
        points_W: (m, 3).

    Returns:
        (n, 3).
    """
    return _clearances(X_WGs, gaps, points_W, approach)[0]


def _lift_clearances(X_WGs: Array, gaps: Array, points_W: Array, config: GraspConfig) -> Array:
    """(n,): the least clearance of fingers and palm on their way straight up."""
    # The points sink instead of the hand rising.
    sunk = [points_W - [0.0, 0.0, height] for height in config.lift * np.linspace(0.25, 1.0, 4)]
    return np.asarray(np.min([_clearances(X_WGs, gaps, p_W, 0.0)[0][:, :2].min(1) for p_W in sunk], axis=0))


def _clearances(X_WGs: Array, gaps: Array, points_W: Array, approach: float) -> tuple[Array, Indices]:
    """`hand_clearances` and, (n, 3), the index of the point that is nearest."""
    clearances = np.full((len(X_WGs), len(HAND_PARTS)), np.inf)
    nearest = np.zeros(clearances.shape, dtype=int)
    if len(X_WGs) == 0:
        return clearances, nearest
    reach = np.hypot(HAND.pad_x[1] - HAND.palm_x[0] + approach, 0.1)
    centre = X_WGs[:, :3, 3].mean(0)
    radius = np.linalg.norm(X_WGs[:, :3, 3] - centre, axis=1).max() + reach
    close = np.flatnonzero(np.linalg.norm(points_W - centre, axis=1) < radius)
    if len(close) == 0:
        return clearances, nearest
    points_W = points_W[close]
    lower, upper = _hand_boxes(gaps, approach)
    for i, X_GW in enumerate(inverse(X_WGs)):
        x, y, z = apply(X_GW, points_W).T
        y, z = np.abs(y), np.abs(z)  # the boxes are symmetric in both
        for part in range(len(HAND_PARTS)):
            along = np.maximum(lower[i, part, 0] - x, x - upper[i, part, 0])
            across = np.maximum(y - upper[i, part, 1], z - upper[i, part, 2])
            distances = np.maximum(along, across)
            first = int(distances.argmin())
            clearances[i, part], nearest[i, part] = distances[first], close[first]
    return clearances, nearest


def lowest_point(X_WGs: Array, gaps: Array) -> Array:
    """Height of the lowest point of hands (n, 4, 4) opened to `gaps` (n,)."""
    lower, upper = _hand_boxes(gaps, 0.0)
    z_G = X_WGs[:, None, 2, :3]  # the world's up in G
    lowest: Array = X_WGs[:, 2, 3] + np.minimum(z_G * lower, z_G * upper).sum(-1).min(1)
    return lowest


def _hand_boxes(gaps: Array, approach: float) -> tuple[Array, Array]:
    """Lower and upper corners in G of HAND_PARTS for each of n openings: (n, 3, 3) each."""
    y, z = HAND.palm_half
    upper = np.tile(
        [
            [HAND.pad_x[1], 0.0, HAND.pad_half_width],
            [HAND.palm_x[1], y, z],
            [HAND.palm_x[0], y, z],
        ],
        (len(gaps), 1, 1),
    )
    upper[:, 0, 1] = gaps / 2 + HAND.pad_thickness
    lower = -upper
    lower[:, :, 0] = HAND.pad_x[0], HAND.palm_x[0], HAND.palm_x[0] - approach
    return lower, upper


def _contacts_of(cloud: Cloud, X_GOs: Array, gaps: Array, config: GraspConfig) -> tuple[Array, Array, Array]:
    """`contacts` of an object at X_GOs (n, 4, 4) in open hands."""
    p_OQs, normals_O = cloud.p_OQs[:RANKING_POINTS], cloud.normals_O[:RANKING_POINTS]
    results = [
        contacts(
            apply(X_GO[None], p_OQs), (normals_O @ X_GO[:3, :3].T)[None], gap[None], cloud.area / len(p_OQs), config
        )
        for X_GO, gap in zip(X_GOs, gaps, strict=True)
    ]
    low, high, quality = np.array(results).reshape(-1, 3).T
    return low, high, quality


def _survival(cloud: Cloud, X_WO: Array, X_WGs: Array, gaps: Array, belief: PoseBelief, config: GraspConfig) -> Array:
    """(n,) share of the belief for which hands at X_WGs reach the object untouched and hold it once closed."""
    X_WOs = belief.X_WOs[systematic(belief.weights, config.particles, 0.5)]
    p_OQs, normals_O = cloud.p_OQs[:RANKING_POINTS], cloud.normals_O[:RANKING_POINTS]
    p_GQs_estimated = apply(inverse(X_WGs) @ X_WO, p_OQs)
    # Far from the hand nothing matters, whichever particle is true.
    near: Mask = np.all(np.abs(p_GQs_estimated) < [0.06, 0.08, 0.05], axis=-1)  # (n, m)
    survival = np.zeros(len(X_WGs))
    for i, X_GW in enumerate(inverse(X_WGs)):
        X_GOs = X_GW @ X_WOs
        p_GQs = apply(X_GOs, p_OQs[near[i]])  # (k, m', 3)
        n_Gs = normals_O[near[i]] @ np.swapaxes(X_GOs[:, :3, :3], 1, 2)
        x, y, z = p_GQs[..., 0], np.abs(p_GQs[..., 1]), np.abs(p_GQs[..., 2])
        finger = (np.abs(x) < HAND.pad_x[1]) & (z < HAND.pad_half_width)
        finger &= (y > gaps[i] / 2) & (y < gaps[i] / 2 + HAND.pad_thickness)
        palm = (x < HAND.palm_x[1]) & (y < HAND.palm_half[0]) & (z < HAND.palm_half[1])
        point_area = cloud.area / len(p_OQs)
        _, _, quality = contacts(p_GQs, n_Gs, np.full(len(X_GOs), gaps[i]), point_area, config)
        survival[i] = np.mean((quality > 0) & ~(finger | palm).any(1))
    return survival
