"""Looks at a table between which something happens that the robot did not mean: is what changed found again, or given
up?

An action is told as the robot knows it: its commands and what its fingers felt. What happens to the objects is not.
"""

import dataclasses
from collections.abc import Callable

import cv2
import numpy as np

from sum_drake.bench.hypotheses import SEEN_PIXELS, Judged, is_right, is_visible, judge
from sum_drake.bench.poured_tables import TABLE_TOP, Sight, Table, Thing, changed
from sum_drake.bench.watching import Matched, Setting, Tables, Update, Watcher
from sum_drake.detection.scene_rendering import body_of
from sum_drake.existence import LIKELY
from sum_drake.faults import blinded
from sum_drake.geometry import rotation_from_quaternion, rotation_from_vector, transform
from sum_drake.objects import Catalogue
from sum_drake.rendering import predicted_box
from sum_drake.types import Detection, Immutable, PickPlace, Track, readonly
from sum_drake.visual_mesh import visual_mesh

LOOKS = 2
"""Observations after what happened, within which it must be dealt with."""
BIN = np.array([0.12, 0.62, 0.47])
"""Where things go: out of the camera's sight."""
GAP = 0.05
"""Between fingers that hold something, metres."""


@dataclasses.dataclass(frozen=True)
class Outcome(Immutable):
    """What became of one object that something happened to."""

    table: int
    fault: str
    label: str
    on_table: bool
    """Whether it is still there, and enough of it can be seen."""
    handled_after: int
    """Observations until it was found where it is, or until no track of it was likely any more; 0: never."""
    happened: str
    """To the action's target, of `action_model.OUTCOMES`; empty where it was no target."""
    believed: str
    """The same as believed after the first look."""


@dataclasses.dataclass(frozen=True, eq=False)
class Event(Immutable):
    """Something that happens to a table."""

    table: Table
    """Afterwards."""
    action: PickPlace | None
    """As the robot knows it."""
    affected: tuple[str, ...]
    """Labels."""
    happened: str = ""
    """To the action's target."""
    blind: bool = False
    """Whether the camera delivers nothing at the first look after it."""


Fault = Callable[[Table, Watcher, Tables, np.random.Generator], Event | None]
"""Given what is believed after the first look; None: there is nothing on the table that it could happen to."""


def _target(table: Table, watcher: Watcher, tables: Tables) -> Track | None:
    """The likeliest accepted track that is right: what the robot would pick next, if it picks well."""
    known = [t for t in watcher.belief.tracks if t.accepted and is_right(t, table, tables.catalogue)]
    return max(known, key=lambda track: track.probability, default=None)


def _pick(track: Track, *, lifted: bool, held: bool) -> PickPlace:
    X_WG = transform(np.eye(3), track.X_WO[:3, 3] + [0.0, 0.0, 0.1])
    X_WO_place = transform(track.X_WO[:3, :3], BIN)
    gaps = GAP if lifted else 0.0, GAP if held else 0.0
    return PickPlace(
        0, "pick_place", track.id, track.label, readonly(X_WG), readonly(X_WO_place), "bin", *gaps, released=lifted
    )


def succeeds(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """A pick that works: the object is in the bin."""
    track = _target(table, watcher, tables)
    if track is None:
        return None
    after = changed(table, {track.label: None})
    return Event(after, _pick(track, lifted=True, held=True), (track.label,), "placed")


def misses(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """The hand closes on nothing, and nothing moves."""
    track = _target(table, watcher, tables)
    return None if track is None else Event(table, _pick(track, lifted=False, held=False), (track.label,), "stayed")


def slips(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """The object slips out of the hand as it is lifted, and falls beside where it was."""
    track = _target(table, watcher, tables)
    if track is None:
        return None
    X_WO = table.X_WOs[track.label].copy()
    X_WO[:3, 3] += [*rng.uniform(-0.05, 0.05, 2), 0.08]
    X_WO[:3, :3] = rotation_from_vector(rng.normal(0, 0.4, 3)) @ X_WO[:3, :3]
    after = changed(table, {track.label: X_WO})
    return Event(after, _pick(track, lifted=False, held=False), (track.label,), "slipped")


def drops(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """The object falls on the way to the bin: onto the table, or past it."""
    track = _target(table, watcher, tables)
    if track is None:
        return None
    start = table.X_WOs[track.label][:3, 3]
    p = start + rng.uniform(0.15, 0.9) * (BIN - start) * [1, 1, 0] + [0, 0, 0.25]
    X_WO = transform(rotation_from_quaternion(rng.normal(size=4)), p)
    over = np.all(np.abs(p[:2] - TABLE_TOP.p_W[:2]) < TABLE_TOP.half_extents[:2])
    after = changed(table, {track.label: X_WO if over else None})
    happened = "dropped" if track.label in after.X_WOs else "lost"
    return Event(after, _pick(track, lifted=True, held=False), (track.label,), happened)


def sweeps(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """A pick that works, but the arm pushes the nearest other object aside."""
    track = _target(table, watcher, tables)
    others = [label for label in table.X_WOs if track is not None and label != track.label]
    if track is None or not others:
        return None
    from_target = {label: table.X_WOs[label][:3, 3] - track.X_WO[:3, 3] for label in others}
    near = min(others, key=lambda label: float(np.linalg.norm(from_target[label])))
    away = from_target[near][:2] / max(float(np.linalg.norm(from_target[near][:2])), 1e-6)
    velocity = np.array([0, 0, rng.normal(0, 2), *(rng.uniform(0.6, 1.0) * away), 0.0])
    after = changed(table, {track.label: None}, velocities={near: velocity})
    return Event(after, _pick(track, lifted=True, held=True), (near,), "placed")


def taken(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """Somebody takes an object away while the robot does nothing."""
    track = _target(table, watcher, tables)
    return None if track is None else Event(changed(table, {track.label: None}), None, (track.label,))


def added(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """Somebody drops another object onto the table."""
    absent = [label for label in tables.catalogue.labels if label not in table.X_WOs]
    if not absent:
        return None
    model = tables.catalogue[str(rng.choice(absent))]
    p = TABLE_TOP.p_W + TABLE_TOP.half_extents * [*rng.uniform(-0.6, 0.6, 2), 0.0]
    X_WO = transform(rotation_from_quaternion(rng.normal(size=4)), p)
    thing = Thing(model.label, True, body_of(model), visual_mesh(model), readonly(X_WO))
    return Event(changed(table, {}, added=(thing,)), None, (model.label,))


def misses_a_frame(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """The camera delivers a black picture without depth, once. What was known is still so."""
    known = tuple(t.label for t in watcher.belief.tracks if t.accepted and is_right(t, table, tables.catalogue))
    return Event(table, None, known, blind=True) if known else None


def repeats(table: Table, watcher: Watcher, tables: Tables, rng: np.random.Generator) -> Event | None:
    """The detector goes on to be sure of what is not there, see `mistake`. Nothing happens."""
    return Event(table, None, tuple(label for one in watcher.mistaken for label, _ in one.p_labels))


FAULTS: dict[str, Fault] = {
    "succeeds": succeeds, "misses": misses, "slips": slips, "drops": drops, "sweeps": sweeps, "taken": taken,
    "added": added, "frame_missing": misses_a_frame, "wrong_repeated": repeats,
}  # fmt: skip


def mistake(table: Table, sight: Sight, catalogue: Catalogue, rng: np.random.Generator) -> Detection | None:
    """A label that is not on the table, seen with confidence: in another thing's box, or anywhere on the table.

    None where all labels are there.
    """
    absent = [label for label in catalogue.labels if label not in table.X_WOs]
    if not absent:
        return None
    label = str(rng.choice(absent))
    seen = [i for i in range(1, len(table.things) + 1) if np.count_nonzero(sight.owners == i) >= SEEN_PIXELS]
    if seen and rng.random() < 0.5:
        mask = (sight.owners == rng.choice(seen)).astype(np.uint8)
        box = tuple(map(float, cv2.boundingRect(mask)))
    else:
        p = TABLE_TOP.p_W + TABLE_TOP.half_extents * [*rng.uniform(-0.7, 0.7, 2), -0.9]
        X_WO = transform(rotation_from_quaternion(rng.normal(size=4)), p)
        box = predicted_box(np.asarray(catalogue[label].load_mesh().vertices), X_WO, sight.frame)
    return Detection((box[0], box[1], box[2], box[3]), 0.9, ((label, 0.9),))


@dataclasses.dataclass(frozen=True, eq=False)
class Followed(Immutable):
    """What became of a table over several looks."""

    outcomes: tuple[Outcome, ...]
    """Of what something happened to, and can be asked for."""
    judged: tuple[Judged, ...]
    """Every hypothesis after every look."""
    updates: tuple[Update, ...]
    matched: tuple[Matched, ...]


def run_sequence(tables: Tables, at: Setting, fault: str) -> Followed | None:
    """A look, what happens, and LOOKS more looks. None where it can happen to nothing on the table."""
    table, onlooker, watcher, rng = tables.begin(at)
    first = onlooker.look(table, 0, rng)
    if fault == "wrong_repeated":
        wrong = mistake(table, first, tables.catalogue, rng)
        watcher.mistaken = () if wrong is None else (wrong,)
    judged = judge(watcher.observe(table, first), table, at, tables.catalogue)
    event = FAULTS[fault](table, watcher, tables, rng)
    if event is None or not event.affected:
        return None
    handled: dict[str, int] = {}
    visible: dict[str, bool] = {}
    believed = ""
    for k in range(1, LOOKS + 1):
        sight = onlooker.look(event.table, k, rng)
        if event.blind and k == 1:
            watcher.observe(event.table, Sight(blinded(sight.frame), np.zeros_like(sight.owners)))
            continue
        record = watcher.observe(event.table, sight, event.action if k == 1 else None)
        judged += judge(record, event.table, at, tables.catalogue)
        if k == 1 and record.posterior.believed is not None:
            believed = record.posterior.believed.outcome
        for label in event.affected:
            visible[label] = is_visible(label, event.table, sight, tables.exact)
            if _is_handled(label, event.table, visible[label], record.posterior.tracks, tables):
                handled.setdefault(label, k)
            else:
                handled.pop(label, None)  # What is right must stay right.
    outcomes = tuple(
        Outcome(at.seed, fault, label, visible[label], handled.get(label, 0), event.happened, believed)
        for label in event.affected
        if visible[label] or label not in event.table.X_WOs
    )
    return Followed(outcomes, tuple(judged), tuple(watcher.updates), tuple(watcher.matched))


def _is_handled(label: str, table: Table, visible: bool, tracks: tuple[Track, ...], tables: Tables) -> bool:
    """Accepted where it is; or, where it cannot be seen, not likely to be anywhere, accepted or not."""
    own = [track for track in tracks if track.label == label]
    if visible:
        return any(track.accepted and is_right(track, table, tables.catalogue) for track in own)
    return all(track.probability < LIKELY for track in own)
