"""The robot and what stands around it as convex bodies, and compiled checks of where it is free to move.

Made from Drake's collision checker, so that there is one truth of what may touch what and how close; what Drake takes
some 50 us for takes one or two here. A motion is not sampled blindly: from a configuration at which two bodies are d
apart, they cannot meet before one has moved by d against the other, and how fast a point of a link moves at most is
known from the joints between. So most of a motion through the open is settled by a few checks, and none is finer than
`step`, where things are close (conservative advancement, Mirtich 1996; halving as of Schwarzer et al. 2005).
"""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sum_drake import collision_kernels as kernels
from sum_drake.collision_kernels import Ints
from sum_drake.convex import CYLINDER, HULL, Bodies
from sum_drake.geometry import inverse, rotation_from_vector, transform
from sum_drake.types import Array, Immutable

if TYPE_CHECKING:
    from pydrake.geometry import Shape
    from pydrake.math import RigidTransform
    from pydrake.multibody.tree import Joint
    from pydrake.planning import SceneGraphCollisionChecker

REVOLUTE, PRISMATIC = 0, 1
FILTERED = -1e9
"""In place of a distance to keep: these two may touch."""
UNLIMITED = 3.0
"""Metres that a sliding joint without limits is taken to slide at most."""


@dataclasses.dataclass(frozen=True, eq=False)
class Links(Immutable):
    """The moving joints as a tree. Link 0 is the world; joint k, of q[k], moves link k + 1."""

    kind: Ints
    """(n,): REVOLUTE or PRISMATIC."""
    parent: Ints
    """(n,): the link that joint k sits on, which comes before link k + 1."""
    X_PF: Array
    """(n, 4, 4): the joint in its parent link; it turns about, or moves along, `axis` of F. F is the link's frame."""
    axis: Array
    """(n, 3)."""

    @functools.cached_property
    def carries(self) -> Array:
        """(n, n + 1): 1 where joint k moves link l, else 0."""
        n = len(self.kind)
        found = np.zeros((n, n + 1))
        for link in range(1, n + 1):
            at = link
            while at > 0:
                found[at - 1, link] = 1.0
                at = int(self.parent[at - 1])
        return found

    def poses(self, q: Array) -> Array:
        """X_WL (n + 1, 4, 4) of q (n,)."""
        X_WLs = np.tile(np.eye(4), (len(self.kind) + 1, 1, 1))
        R, p = np.ascontiguousarray(X_WLs[:, :3, :3]), np.ascontiguousarray(X_WLs[:, :3, 3])
        kernels.move(self.kind, self.parent, self.X_PF, self.axis, np.asarray(q, dtype=float), R, p)
        X_WLs[:, :3, :3], X_WLs[:, :3, 3] = R, p
        return X_WLs


@dataclasses.dataclass(frozen=True, eq=False)
class CollisionModel(Immutable):
    """What may touch what. Bodies of the same link do not: those of link 0 stand still."""

    links: Links
    bodies: Bodies
    link: Ints
    """(b,): of each body, in ascending order."""
    X_LB: Array
    """(b, 4, 4)."""
    padding: Array
    """(b, b): distance that two bodies must keep, metres; FILTERED where they may touch."""
    speed: Array
    """(n, l): how far a point of link l moves at most when joint k moves by 1, metres."""

    @functools.cached_property
    def tables(self) -> tuple[Any, ...]:
        """What the compiled functions work on."""
        links, bodies, n = self.links, self.bodies, len(self.links.kind)
        first = np.searchsorted(self.link, np.arange(n + 2)).astype(np.int64)
        balls = np.full((n + 1, 4), -1.0)
        """Of links: a ball about the bodies of each, in the link's frame; radius < 0: it has none."""
        for link in range(1, n + 1):
            own = slice(first[link], first[link + 1])
            p_LB = self.X_LB[own, :3, 3]
            if len(p_LB):
                balls[link, :3] = p_LB.mean(0)
                balls[link, 3] = (np.linalg.norm(p_LB - p_LB.mean(0), axis=1) + bodies.radius[own]).max()
        boxes = np.array([_bounds(bodies, i, self.X_LB[i]) for i in range(first[1])]).reshape(-1, 2, 3)
        # Of pairs of links the most that some of their bodies must keep apart.
        some = np.flatnonzero(np.diff(first) > 0)
        widest = np.full((n + 1, n + 1), FILTERED)
        if len(some):
            rows = np.maximum.reduceat(self.padding, first[some], axis=0)
            widest[np.ix_(some, some)] = np.maximum.reduceat(rows, first[some], axis=1)
        to_world = self.padding[:, : first[1]].max(axis=1, initial=FILTERED)
        return (
            links.kind, links.parent, links.X_PF, links.axis,
            bodies.kind, bodies.first, bodies.points, bodies.swell, bodies.radius,
            first, np.ascontiguousarray(self.X_LB[:, :3, :3]), np.ascontiguousarray(self.X_LB[:, :3, 3]),
            self.padding, self.speed, balls, boxes, widest, links.carries, to_world,
        )  # fmt: skip

    def is_free(self, q: Array) -> bool:
        """Whether no two bodies are closer at q (n,) than they must keep."""
        return bool(kernels.free(self.tables, np.asarray(q, dtype=float)))

    def free_many(self, qs: Array) -> NDArray[np.bool_]:
        """`is_free` of qs (m, n), (m,)."""
        qs = np.ascontiguousarray(qs, dtype=float)
        return np.asarray(kernels.free_many(self.tables, qs))

    def edge_free(self, q0: Array, q1: Array, step: float) -> bool:
        """Whether the straight line from q0 to q1 is free: proven, or looked at wherever a joint has moved by `step`.

        Both ends are looked at.
        """
        q0, q1 = np.asarray(q0, dtype=float), np.asarray(q1, dtype=float)
        return bool(kernels.edge_free(self.tables, q0, q1, step))

    def path_free(self, qs: Array, step: float) -> bool:
        """`edge_free` of every piece of a polyline (k, n)."""
        qs = np.ascontiguousarray(qs, dtype=float)
        if len(qs) == 1:
            return self.is_free(qs[0])
        return all(self.edge_free(q0, q1, step) for q0, q1 in itertools.pairwise(qs))


def _bounds(bodies: Bodies, i: int, X_WB: Array) -> Array:
    """(2, 3): corners of the upright box about a body."""
    points, swell = bodies.points[bodies.first[i] : bodies.first[i + 1]], bodies.swell[i]
    if bodies.kind[i] == CYLINDER:
        r, _, h = points[0]
        axis = np.abs(X_WB[:3, 2])
        half = h * axis + r * np.sqrt(np.maximum(1 - axis**2, 0.0)) + swell
        return np.stack([X_WB[:3, 3] - half, X_WB[:3, 3] + half])
    p_W = points @ X_WB[:3, :3].T + X_WB[:3, 3]
    return np.stack([p_W.min(0) - swell, p_W.max(0) + swell])


# From Drake's checker.

Collider = tuple[int, Array, float, Array]
"""What collides of a body: kind, points and swell as of `convex.Bodies`, and its pose X_BG (4, 4) on Drake's body."""


@dataclasses.dataclass(frozen=True, eq=False)
class Skeleton(Immutable):
    """What all models of a checker and its clones share: the plant's bodies, joints and what collides of them."""

    body: Ints
    """(b,): the plant's bodies but the world, each after its parent."""
    parent: Ints
    """(b,): the plant's body that each hangs on."""
    active: Ints
    """(b,): which of q the joint between is; -1 where it stands still."""
    kind: Ints
    """(b,): REVOLUTE or PRISMATIC; -1 where it is welded."""
    position: Ints
    """(b,): of the joint among the plant's positions."""
    axis: Array
    """(b, 3)."""
    X_PF: Array
    """(b, 4, 4): the joint on the parent body."""
    X_MB: Array
    """(b, 4, 4): the body as seen from the joint's moving side."""
    slide: Array
    """(n,): how far each of q may shift what hangs on it, metres."""
    colliders: tuple[tuple[int, Collider], ...]
    """What collides, and of which body."""

    @staticmethod
    def of(checker: "SceneGraphCollisionChecker", joints: Sequence[str]) -> "Skeleton":
        """Raises ValueError for one of `joints` that does not turn or slide, and for a shape that is not convex."""
        from pydrake.multibody.tree import BodyIndex

        plant, inspector = checker.plant(), checker.model().scene_graph().model_inspector()
        active = {int(plant.GetJointByName(name).index()): k for k, name in enumerate(joints)}
        children: dict[int, list[Joint]] = {}
        for index in plant.GetJointIndices():
            children.setdefault(int(plant.get_joint(index).parent_body().index()), []).append(plant.get_joint(index))
        rows: list[tuple[Any, ...]] = []
        waiting = [0]
        while waiting:
            at = waiting.pop()
            for joint in children.get(at, []):
                kind, axis = _kind_and_axis(joint)
                k = active.get(int(joint.index()), -1)
                if k >= 0 and kind < 0:
                    raise ValueError(f"joint {joint.name()} is {joint.type_name()}; expected one that turns or slides")
                child = int(joint.child_body().index())
                X_PF = _matrix(joint.frame_on_parent().GetFixedPoseInBodyFrame())
                if joint.type_name() == "weld":
                    X_PF = X_PF @ _matrix(joint.X_FM())
                X_MB = inverse(_matrix(joint.frame_on_child().GetFixedPoseInBodyFrame()))
                rows.append((child, at, k, kind, joint.position_start(), axis, X_PF, X_MB))
                waiting.append(child)
        body, parent, which, kinds, position, axes, X_PFs, X_MBs = zip(*rows, strict=True)
        return Skeleton(
            body=np.array(body, dtype=np.int64),
            parent=np.array(parent, dtype=np.int64),
            active=np.array(which, dtype=np.int64),
            kind=np.array(kinds, dtype=np.int64),
            position=np.array(position, dtype=np.int64),
            axis=np.array(axes),
            X_PF=np.array(X_PFs),
            X_MB=np.array(X_MBs),
            slide=np.array([_slide(plant.GetJointByName(name)) for name in joints]),
            colliders=tuple(
                (i, _collider(inspector.GetShape(geometry), _matrix(inspector.GetPoseInFrame(geometry))))
                for i in range(plant.num_bodies())
                for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(BodyIndex(i)))
            ),
        )


def collision_model(checker: "SceneGraphCollisionChecker", skeleton: Skeleton, q_full: Array) -> CollisionModel:
    """The model of a checker's robot, whose joints stay as in q_full, the plant's positions, but for those of `q`.

    Shapes that were added to the checker, paddings and filters are taken over as they are now. Raises ValueError for a
    joint of q that hangs on one that comes after it, and for a shape that is not convex.
    """
    plant, n = checker.plant(), len(skeleton.slide)
    link_of = np.zeros(plant.num_bodies(), dtype=np.int64)
    X_L = np.tile(np.eye(4), (plant.num_bodies(), 1, 1))  # of bodies in their links
    kind, parent = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    X_PF, axis = np.zeros((n, 4, 4)), np.zeros((n, 3))
    for i, body in enumerate(skeleton.body):
        above, k = skeleton.parent[i], skeleton.active[i]
        X_LF = X_L[above] @ skeleton.X_PF[i]
        if k < 0:
            link_of[body] = link_of[above]
            X_L[body] = X_LF @ _moved(skeleton, i, q_full) @ skeleton.X_MB[i]
        else:
            link_of[body], X_L[body] = k + 1, skeleton.X_MB[i]
            kind[k], parent[k], X_PF[k], axis[k] = skeleton.kind[i], link_of[above], X_LF, skeleton.axis[i]
    if not np.all(parent <= np.arange(n)):
        raise ValueError("a joint hangs on one that comes after it; expected joints from the base outwards")
    links = Links(kind, parent, X_PF, axis)
    found = list(skeleton.colliders)
    for added in (one for shapes in checker.GetAllAddedCollisionShapes().values() for one in shapes):
        instance = plant.GetModelInstanceByName(added.model_instance_name())
        body = int(plant.GetBodyByName(added.body_name(), instance).index())
        found.append((body, _collider(added.shape(), _matrix(added.pose_in_body()))))
    found.sort(key=lambda one: link_of[one[0]])
    of_body = np.array([body for body, _ in found], dtype=np.int64)
    link = link_of[of_body]
    kinds, points, swells, X_BGs = zip(*(one for _, one in found), strict=True)
    bodies, X_LB = Bodies.make(kinds, points, swells), X_L[of_body] @ np.array(X_BGs)
    padding, filtered = np.array(checker.GetPaddingMatrix()), np.array(checker.GetFilteredCollisionMatrix())
    pairs = np.where(filtered != 0, FILTERED, padding)[np.ix_(of_body, of_body)]
    pairs = np.where(link[:, None] != link[None, :], pairs, FILTERED)
    speed = _speeds(links, bodies, link, X_LB, skeleton.slide)
    return CollisionModel(links, bodies, link, X_LB, pairs, speed)


def _matrix(X: "RigidTransform") -> Array:
    return np.asarray(X.GetAsMatrix4(), dtype=float)


def _kind_and_axis(joint: "Joint") -> tuple[int, Array]:
    if joint.type_name() == "revolute":
        return REVOLUTE, np.asarray(joint.revolute_axis())
    if joint.type_name() == "prismatic":
        return PRISMATIC, np.asarray(joint.translation_axis())
    return -1, np.zeros(3)


def _slide(joint: "Joint") -> float:
    """How far a joint may shift what hangs on it, metres."""
    if joint.type_name() != "prismatic":
        return 0.0
    ends = np.abs([joint.position_lower_limits()[0], joint.position_upper_limits()[0]])
    return float(ends.max()) if np.isfinite(ends).all() else UNLIMITED


def _moved(skeleton: Skeleton, i: int, q_full: Array) -> Array:
    """X_FM (4, 4) of a joint that stands still."""
    if skeleton.kind[i] < 0:
        return np.eye(4)
    motion = skeleton.axis[i] * q_full[skeleton.position[i]]
    turns = skeleton.kind[i] == REVOLUTE
    return transform(rotation_from_vector(motion), np.zeros(3)) if turns else transform(np.eye(3), motion)


def _collider(shape: "Shape", X_BG: Array) -> Collider:
    """What a shape of Drake's is here. Its frame's origin is moved to its middle."""
    from pydrake import geometry as of

    if isinstance(shape, of.Sphere):
        return HULL, np.zeros((1, 3)), shape.radius(), X_BG
    if isinstance(shape, of.Capsule):
        return HULL, np.array([[0, 0, s * shape.length() / 2] for s in (-1, 1)]), shape.radius(), X_BG
    if isinstance(shape, of.Cylinder):
        return CYLINDER, np.array([[shape.radius(), 0.0, shape.length() / 2]]), 0.0, X_BG
    if isinstance(shape, of.Box):
        corners = np.stack(np.meshgrid(*([-1.0, 1.0],) * 3, indexing="ij"), -1).reshape(-1, 3)
        return HULL, corners * np.asarray(shape.size()) / 2, 0.0, X_BG
    if isinstance(shape, of.Convex | of.Mesh):
        hull = shape.GetConvexHull()
        points = np.array([hull.vertex(i) for i in range(hull.num_vertices())], dtype=float)
        middle = (points.min(0) + points.max(0)) / 2
        X_BM = X_BG.copy()
        X_BM[:3, 3] = X_BG[:3, :3] @ middle + X_BG[:3, 3]
        return HULL, points - middle, 0.0, X_BM
    raise ValueError(f"a {type(shape).__name__} collides; expected a box, cylinder, capsule, sphere or convex mesh")


def _speeds(links: Links, bodies: Bodies, link: Ints, X_LB: Array, slides: Array) -> Array:
    """(n, n + 1): how far a point of a link's bodies moves at most, metres, when a joint moves by 1.

    Of a joint that turns: how far it may lie from the joint's axis, wherever the joints between stand.
    """
    n = len(links.kind)
    speeds = np.zeros((n, n + 1))
    for target in range(1, n + 1):
        own = np.flatnonzero(link == target)
        if not len(own):
            continue
        p_B, radius = X_LB[own, :3, 3], bodies.radius[own]
        chain = []
        at = target
        while at > 0:
            chain.append(at - 1)
            at = int(links.parent[at - 1])
        reach = float((np.linalg.norm(p_B, axis=1) + radius).max())  # from the frame of the joint last looked at
        for i, k in enumerate(chain):
            axis = links.axis[k]
            if links.kind[k] == PRISMATIC:
                speeds[k, target] = 1.0
            elif i == 0:
                off = p_B - np.outer(p_B @ axis, axis)
                speeds[k, target] = float((np.linalg.norm(off, axis=1) + radius).max())
            else:
                nearer = chain[i - 1]
                offset = links.X_PF[nearer, :3, 3]
                across = offset - axis * (offset @ axis)
                speeds[k, target] = float(np.linalg.norm(across)) + slides[nearer] + reach
            if i > 0:
                reach += float(np.linalg.norm(links.X_PF[chain[i - 1], :3, 3])) + slides[chain[i - 1]]
    return speeds
