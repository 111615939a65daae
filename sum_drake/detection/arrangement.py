"""Where things lie in a picture of the data set: poured by a short, cheap simulation, or tossed without any.

The sorting task's own pour waits until all is at rest and within reach (`systems/pouring.py`). For a picture that is
no matter: here a second or so is simulated, with point contact and long steps, and what fell off is left out.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.geometry import Box, Convex, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from sum_drake.geometry import rotation_from_quaternion, rotation_from_vector, transform
from sum_drake.rendering import fibonacci_sphere
from sum_drake.types import Array, Immutable, readonly

TABLE = 0.70
"""Height of the table's top in W, metres."""
_FRICTION = CoulombFriction(0.5, 0.5)


@dataclasses.dataclass(frozen=True, eq=False)
class Body(Immutable):
    """A thing as physics sees it, in its own frame O."""

    mass: float
    """Kilograms."""
    pieces: tuple[Array, ...]
    """Points (n, 3) each, whose convex hulls make up the body."""

    @property
    def points(self) -> Array:
        """All of them, (n, 3)."""
        return np.concatenate(self.pieces)


@dataclasses.dataclass(frozen=True, eq=False)
class Ground(Immutable):
    """The table's top, and the region of it that things are meant for; x and y in W, metres."""

    center: Array
    """(2,): of the top."""
    half: Array
    """(2,): half its sides."""
    region_center: Array
    """(2,)."""
    region_half: Array
    """(2,)."""

    def holds(self, p_W: Array) -> bool:
        """Whether a point (3,) is over or on the table."""
        return bool(p_W[2] > TABLE - 0.02 and np.all(np.abs(p_W[:2] - self.center) < self.half))


def pour(
    bodies: Sequence[Body], ground: Ground, rng: np.random.Generator, *, duration: float = 1.2, step: float = 0.006
) -> list[Array | None]:
    """Drops the bodies over the region in layers, turned at random; X_WO (4, 4) of each, None for what fell off.

    duration, step: seconds. Not everything is at rest then. A pour that Drake cannot step through is tossed instead.
    """
    try:
        return settle(bodies, _layers(bodies, ground, rng), ground, duration=duration, step=step)
    except RuntimeError:
        return toss(bodies, ground, rng)


def settle(
    bodies: Sequence[Body],
    X_WOs: Sequence[Array],
    ground: Ground,
    *,
    velocities: Mapping[int, Array] | None = None,
    duration: float = 1.2,
    step: float = 0.006,
) -> list[Array | None]:
    """Where bodies are that were let go at X_WOs (4, 4) each: X_WO (4, 4), or None for what fell off the table.

    velocities: (6,) of some bodies, by index, of turning and of moving, in W; the others start at rest. duration, step:
    seconds. Raises RuntimeError where Drake cannot step through it.
    """
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=step, contact_model="point", discrete_contact_approximation="lagged")
    plant, _ = AddMultibodyPlant(config, builder)
    depth = 1.0  # A thick slab: what lands hard does not end up below it.
    slab = Box(2 * ground.half[0], 2 * ground.half[1], depth)
    X_WS = RigidTransform([*ground.center, TABLE - depth / 2])
    plant.RegisterCollisionGeometry(plant.world_body(), X_WS, slab, "table", _FRICTION)
    links = []
    for i, body in enumerate(bodies):
        low, high = body.points.min(axis=0), body.points.max(axis=0)
        inertia = SpatialInertia.SolidBoxWithMass(body.mass, *np.maximum(high - low, 0.02)).Shift(-(low + high) / 2)
        link = plant.AddRigidBody(f"body{i}", inertia)
        for k, piece in enumerate(body.pieces):
            shape = Convex(points=piece.T, label=f"piece{i}_{k}")
            plant.RegisterCollisionGeometry(link, RigidTransform(), shape, f"piece{i}_{k}", _FRICTION)
        # Two convex shapes touch in a single point, on which a box rocks and sinks in; feet give it more of them.
        feet = np.unique((body.points @ fibonacci_sphere(14).T).argmax(axis=0))
        for k in feet.tolist():
            X_OF = RigidTransform(body.points[k])
            plant.RegisterCollisionGeometry(link, X_OF, Sphere(1e-3), f"foot{i}_{k}", _FRICTION)
        links.append(link)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for link, X_WO in zip(links, X_WOs, strict=True):
        plant.SetFloatingBaseBodyPoseInWorldFrame(context, link, RigidTransform(X_WO))
    for i, V_WO in (velocities or {}).items():
        plant.SetFreeBodySpatialVelocity(context, links[i], SpatialVelocity(V_WO))
    try:
        simulator.AdvanceTo(duration)
    except SystemExit as error:  # how a failed DRAKE_DEMAND reaches Python
        raise RuntimeError(str(error)) from error
    found = [plant.EvalBodyPoseInWorld(context, link).GetAsMatrix4() for link in links]
    if not np.isfinite(found).all():
        raise RuntimeError("a body's pose is not finite")
    centers = [
        (X_WO @ [*(b.points.min(0) + b.points.max(0)) / 2, 1])[:3] for X_WO, b in zip(found, bodies, strict=True)
    ]
    return [readonly(X_WO) if ground.holds(p) else None for X_WO, p in zip(found, centers, strict=True)]


def toss(bodies: Sequence[Body], ground: Ground, rng: np.random.Generator, *, tries: int = 30) -> list[Array | None]:
    """Puts each body on or over the region: standing or lying, turned at random, or in the air; None for lack of room.

    Bodies keep clear of each other: cylinders about them, a little too narrow, don't overlap.
    """
    taken: list[tuple[Array, float, float, float]] = []
    X_WOs: list[Array | None] = []
    for body in bodies:
        placed = None
        for _ in range(tries):
            kind = rng.choice(["axis", "lying", "any"], p=[0.4, 0.3, 0.3])
            R = _orientation(str(kind), rng)
            points = body.points @ R.T
            low, high = points.min(axis=0), points.max(axis=0)
            center = (low + high)[:2] / 2
            radius = 0.85 * float(np.linalg.norm(points[:, :2] - center, axis=1).max())
            xy = ground.region_center + ground.region_half * rng.uniform(-1, 1, 2)
            bottom = TABLE + (rng.uniform(0, 0.15) if kind == "any" and rng.random() < 0.5 else 0.0)
            top = bottom + high[2] - low[2]
            if any(
                np.linalg.norm(xy - p) < radius + r and bottom < upper and lower < top for p, r, lower, upper in taken
            ):
                continue
            taken.append((xy, radius, bottom, top))
            placed = readonly(transform(R, np.array([*(xy - center), bottom - low[2]])))
            break
        X_WOs.append(placed)
    return X_WOs


def _orientation(kind: str, rng: np.random.Generator) -> Array:
    """R_WO: axis: O's z up, or now and then down; lying: it is level; any: anything."""
    if kind == "any":
        return rotation_from_quaternion(rng.normal(size=4))
    about_x = rng.choice([0.0, np.pi], p=[0.85, 0.15]) if kind == "axis" else np.pi / 2
    roll = 0.0 if kind == "axis" else rng.uniform(-np.pi, np.pi)
    R = rotation_from_vector(np.array([0, 0, rng.uniform(-np.pi, np.pi)]))
    return R @ rotation_from_vector(np.array([about_x, 0, 0])) @ rotation_from_vector(np.array([0, 0, roll]))


def _layers(bodies: Sequence[Body], ground: Ground, rng: np.random.Generator) -> list[Array]:
    """X_WO of each body in the air: layer upon layer over the region, clear of each other by their spheres."""
    taken: list[tuple[Array, float]] = []
    X_WOs = []
    for body in bodies:
        R = rotation_from_quaternion(rng.normal(size=4))
        center = (body.points.min(axis=0) + body.points.max(axis=0)) / 2
        radius = float(np.linalg.norm(body.points - center, axis=1).max())
        p = np.array([*(ground.region_center + ground.region_half * rng.uniform(-1, 1, 2)), TABLE + radius + 0.01])
        while any(np.linalg.norm(p - q) < radius + r for q, r in taken):
            p[2] += 0.02
        taken.append((p, radius))
        X_WOs.append(transform(R, p - R @ center))
    return X_WOs
