"""The values that flow between the parts: small, frozen, with read-only arrays.

Frames follow Drake's monogram notation. W is the world (z up, x ahead of the robot, origin on the floor under the
robot's base), C the camera (x right, y down, z forward), O an object's mesh frame, G the gripper (x out of the palm,
y the direction in which the fingers close, origin between the finger tips). SI units throughout.

Drake deep-copies abstract values at every update of the state they live in. These are deeply immutable, so a copy is
the value itself.
"""

import dataclasses
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def readonly(array: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """A read-only copy of `array` as `dtype`."""
    copy = np.array(array, dtype=dtype)
    copy.flags.writeable = False
    return copy


def shaped(what: str, value: ArrayLike, *shape: int) -> Array:
    """`value` as finite numbers of this shape, -1 for any length. Raises ValueError, one line that starts with what."""
    wanted = f"({', '.join('n' if length < 0 else str(length) for length in shape)}{',' * (len(shape) == 1)})"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what}: is no array of numbers; expected the shape {wanted}") from error
    if array.ndim != len(shape) or any(b not in (a, -1) for a, b in zip(array.shape, shape, strict=True)):
        raise ValueError(f"{what}: has the shape {array.shape}; expected {wanted}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: is not finite; expected numbers")
    return array


APART = {"apart": True}
"""Metadata of a field that records, and digests of them, leave out: it is logged in a record of its own."""


class Immutable:
    """Makes `copy` and `deepcopy` return the value itself, which is what immutability means."""

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self


@dataclasses.dataclass(frozen=True)
class Camera(Immutable):
    """A pinhole camera with pixel centres at integers, as in OpenCV and ROS (RenderEngineVtk's lie at + .5)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclasses.dataclass(frozen=True, eq=False)
class Frame(Immutable):
    """One RGB-D observation."""

    observation: int
    """Number of the observation, 0 for the first of a run."""
    color: NDArray[np.uint8]
    """(h, w, 3), RGB."""
    depth: NDArray[np.float32]
    """(h, w), z-depth in metres, 0 where the sensor returned nothing."""
    camera: Camera
    X_WC: Array
    """(4, 4)."""
    time: float = 0.0


Box = tuple[float, float, float, float]
"""x, y, w, h in pixels: covers the pixel centres x <= u < x + w, y <= v < y + h."""


@dataclasses.dataclass(frozen=True)
class Detection(Immutable):
    """One box that the detector proposes, with its distribution over labels."""

    box: Box
    p_box: float
    """p(b | z): the box holds an object (Sui et al. 2017, eq. 3)."""
    p_labels: tuple[tuple[str, float], ...]
    """p(o | b, z) of the labels that passed the sigma_c rule (eq. 5), most likely first; sums to at most 1."""


@dataclasses.dataclass(frozen=True)
class Detections(Immutable):
    """What the detector says of one observation."""

    observation: int
    boxes: tuple[Detection, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class PoseBelief(Immutable):
    """Bel(q): weighted particles of one object's pose. Raises ValueError for what is none."""

    X_WOs: Array
    """(n, 4, 4), finite."""
    weights: Array
    """(n,), not negative, sum to 1."""

    def __post_init__(self) -> None:
        if self.X_WOs.shape != (len(self.weights), 4, 4) or not np.isfinite(self.X_WOs).all():
            raise ValueError(f"no belief: poses {self.X_WOs.shape}; expected finite ones, one for each weight")
        if not ((self.weights >= 0).all() and abs(self.weights.sum() - 1.0) < 1e-6):  # nor is NaN
            raise ValueError(f"no belief: weights sum to {self.weights.sum():g}; expected 1, and none below 0")


@dataclasses.dataclass(frozen=True, eq=False)
class Track(Immutable):
    """One hypothesised object, carried from observation to observation."""

    id: int
    label: str
    box: Box
    """The detection's box it was last associated with."""
    p_box: float
    p_label: float
    belief: PoseBelief
    X_WO: Array
    """(4, 4): the pose estimate."""
    likelihood: float
    """How well the pose estimate explains the depth in the box, in [0, 1] (eq. 8 or its successor)."""
    probability: float
    """That the object is there and within 2 cm and 20 degrees of X_WO."""
    accepted: bool
    born: int
    """Observation that spawned it."""
    seen: int
    """Observation it was last associated in."""
    features: tuple[tuple[str, float], ...] = ()
    """Named figures of the last pose estimate: inliers, free space, effective sample size ..."""
    uncontended: float | None = None
    """The probability by its own evidence, rivals aside, which the next look goes on from; None: as `probability`."""
    missed: int = 0
    """Looks in a row that could see it, and did not detect it."""

    @property
    def own_probability(self) -> float:
        """`uncontended`, or `probability` where nothing contends."""
        return self.probability if self.uncontended is None else self.uncontended


@dataclasses.dataclass(frozen=True)
class Gone(Immutable):
    """A track that ended, and why."""

    track: int
    label: str
    observation: int
    """That ended it."""
    reason: str
    """One of `belief.ENDS`."""


@dataclasses.dataclass(frozen=True)
class Believed(Immutable):
    """What is believed of the last action, by what the hand felt and what was seen afterwards."""

    step: int
    track: int
    label: str
    outcomes: tuple[tuple[str, float], ...]
    """Probabilities of `action_model.OUTCOMES`."""

    @property
    def outcome(self) -> str:
        """The likeliest."""
        return max(self.outcomes, key=lambda pair: pair[1])[0]


@dataclasses.dataclass(frozen=True, eq=False)
class SceneBelief(Immutable):
    """Everything believed about the table after an observation (-1: before the first)."""

    observation: int = -1
    tracks: tuple[Track, ...] = ()
    next_id: int = 0
    gone: tuple[Gone, ...] = ()
    """Tracks that this observation ended."""
    believed: Believed | None = None
    """Of the action before this observation; None where nothing was done."""


@dataclasses.dataclass(frozen=True)
class Association(Immutable):
    """A (box, label) pair of a detection and the track it feeds (eq. 11)."""

    detection: int
    """Index into the frame's detections."""
    label: str
    track: int | None
    """Track id; None spawns a new one."""
    score: float


@dataclasses.dataclass(frozen=True)
class Associations(Immutable):
    """What the associator says of one observation."""

    observation: int
    pairs: tuple[Association, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class PickPlace(Immutable):
    """An executed action u = (kind, target, pick, place, what the gripper felt); whether it worked is inferred."""

    step: int
    kind: str
    """"pick_place", "move" to a free place on the table, or "none" when the robot only looked again."""
    track: int
    label: str
    X_WG_pick: Array
    """(4, 4)."""
    X_WO_place: Array
    """(4, 4): where the object was to end."""
    region: str
    gap_lift: float
    """Distance between the fingers after the lift, metres; 0 is an empty hand."""
    gap_place: float
    """The same just before the release; equals gap_lift when the pick was given up."""
    released: bool
    """Whether the hand was opened at the place, rather than given up after the lift."""
    squeeze_lift: float | None = None
    """Force with which the fingers were driven together after the lift, newtons; None: not measured."""
    squeeze_place: float | None = None
    """The same just before the release; that after the lift when the pick was given up."""
    held_lift: bool | None = None
    """Whether the robot took that for an object in its hand; None: not told."""
    held_place: bool | None = None
    """The same just before the release."""
    hangs: bool | None = None
    """Whether, with the arm back at the viewing pose, something weighed on the opened hand; None: not weighed."""


@dataclasses.dataclass(frozen=True, eq=False)
class Perception(Immutable):
    """The record of one observation: everything in it carries the same observation number."""

    step: int
    frame: Frame
    detections: tuple[Detection, ...]
    associations: tuple[Association, ...]
    prior: SceneBelief
    posterior: SceneBelief
    action: PickPlace | None
    """The action between the last observation and this one."""


@dataclasses.dataclass(frozen=True, eq=False)
class Grasp(Immutable):
    """A hand pose on an object."""

    label: str
    X_OG: Array
    """(4, 4)."""
    width: float
    """Distance between the two contacts along G's y axis, metres."""
    quality: float
    """Contact quality in [0, 1]."""


@dataclasses.dataclass(frozen=True, eq=False)
class Trajectory(Immutable):
    """Timed positions of the arm's joints (torso first), sampled; interpolate with cubic Hermite segments."""

    times: Array
    """(k,), starts at 0."""
    positions: Array
    """(k, 8)."""
    velocities: Array
    """(k, 8)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Segment(Immutable):
    """A trajectory of the arm together with the opening the fingers are driven to while it runs."""

    name: str
    """approach, reach, close, lift, transport, lower, open, retreat, return, shake or weigh."""
    trajectory: Trajectory
    gap: float
    """Commanded distance between the fingers, metres."""


@dataclasses.dataclass(frozen=True)
class Load(Immutable):
    """What a closed hand is to hold."""

    width: float
    """Between the fingers, metres."""
    mass: float
    """Kilograms."""


@dataclasses.dataclass(frozen=True, eq=False)
class Motion(Immutable):
    """Segments to be executed one after the other; a new id starts a new motion."""

    id: int
    segments: tuple[Segment, ...]
    load: Load | None = None
    """What is in the hand during `lift` and `transport`; None: nothing."""
    insistence: float = 1.0
    """How many times the usual resistance does not stop the arm."""

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(sum(segment.trajectory.times[-1] for segment in self.segments))


LEAVE = "leave"
"""The goal of what is not to be touched."""


@dataclasses.dataclass(frozen=True)
class MotionStatus(Immutable):
    """How far the controller is with the motion it was given last."""

    motion: int
    """Id of the motion; -1 before the first."""
    segment: str
    """Name of the segment that runs, "" when the motion is done."""
    done: bool
    stopped: str = ""
    """Why the controller broke the motion off, one of `reflex.CAUSES`; "" if it did not."""


@dataclasses.dataclass(frozen=True, eq=False)
class GraspCandidates(Immutable):
    """Hand poses that were considered for an attempt, and what became of each; of those that were dropped a sample."""

    X_WGs: Array
    """(n, 4, 4): first those that were ranked, best first, then those that were dropped before."""
    fates: tuple[str, ...]
    """(n,): "chosen", the cause for which it was given up, or "" where it was not looked at."""
    scores: Array
    """(k,): of the k that were ranked."""


@dataclasses.dataclass(frozen=True, eq=False)
class Attempt(Immutable):
    """What the robot knows of one try at one object."""

    step: int
    track: int
    label: str
    region: str
    kind: str
    """"pick_place", "move" to a free place on the table, "none" where the arm did not set out."""
    reason: str
    """"executed", or why it was given up: one of the reasons listed in docs/formats.md."""
    grasp_candidates: int
    rejected_by: tuple[tuple[str, int], ...]
    """Grasp candidates dropped, counted by cause."""
    action: PickPlace | None
    """None when the arm did not set out."""
    X_OG: Array | None = None
    """(4, 4): the grasp that was tried."""
    why: str = ""
    """Why this was to be done next, in words."""
    candidates: GraspCandidates | None = dataclasses.field(default=None, metadata=APART)
    """None where no grasps were looked at."""


@dataclasses.dataclass(frozen=True, eq=False)
class Region(Immutable):
    """A place where objects may end: an axis-aligned box in W, such as the inside of a bin."""

    name: str
    p_W: Array
    """(3,): centre of the box's volume."""
    half_extents: Array
    """(3,)."""

    def holds(self, p_WQ: Array) -> bool:
        """Whether a point (3,) lies in the box."""
        return bool(np.all(np.abs(p_WQ - self.p_W) <= self.half_extents))

    @property
    def floor_height(self) -> float:
        """Height of the box's bottom in W, metres."""
        return float(self.p_W[2] - self.half_extents[2])

    @property
    def rim_height(self) -> float:
        """Height of the box's top in W, metres."""
        return float(self.p_W[2] + self.half_extents[2])
