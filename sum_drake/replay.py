"""Perception once more, on what a log holds of a run, and how what is believed differs from what was."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake.faults import REPEATED, FaultConfig
from sum_drake.geometry import pose_error
from sum_drake.jsonio import canonical, decode, encode
from sum_drake.objects import Catalogue
from sum_drake.runlog import thin
from sum_drake.types import (
    Array,
    Associations,
    Detection,
    Detections,
    Frame,
    Immutable,
    Perception,
    PickPlace,
    SceneBelief,
    Track,
)

See = Callable[[Perception], tuple[Detection, ...]]
"""The detections in the frame of a record."""
Associate = Callable[[SceneBelief, Frame, Detections, PickPlace | None], Associations]
"""`association.associate_frame` with meshes and configuration bound."""
Update = Callable[[SceneBelief, Frame, Detections, Associations, PickPlace | None], SceneBelief]
"""`belief.update` with its estimator and configuration bound."""


def replay(perceptions: Sequence[Perception], see: See, associate: Associate, update: Update) -> Iterator[Perception]:
    """Each record of a log as perception makes it now, of its frame and its action alone.

    What is held from one observation to the next is the replay's own belief, whole, as in a run.
    """
    held = SceneBelief()
    for logged in perceptions:
        frame, action = logged.frame, logged.action
        detections = Detections(frame.observation, see(logged))
        associations = associate(held, frame, detections, action)
        posterior = update(held, frame, detections, associations, action)
        yield Perception(logged.step, frame, detections.boxes, associations.pairs, held, posterior, action)
        held = posterior


def false_detections(faults: Sequence[FaultConfig], observation: int) -> int:
    """How many of an observation's detections, the last ones, a scenario's faults have put there."""
    return sum(
        fault.kind == "false_detection" and fault.observation <= observation < fault.observation + REPEATED
        for fault in faults
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Stand(Immutable):
    """A track as one side has it."""

    track: int
    """Its id."""
    accepted: bool
    probability: float
    X_WO: Array
    """(4, 4)."""


@dataclasses.dataclass(frozen=True, eq=False)
class TrackComparison(Immutable):
    """What log and replay believe of one object after an observation."""

    label: str
    log: Stand | None
    """None: there is no such track."""
    replay: Stand | None
    translation_m: float | None
    """Between the two poses; None where one is missing."""
    rotation_rad: float | None
    """The smallest over the object's symmetry group."""
    differs: tuple[str, ...]
    """"there"; or "accepted", "probability", "pose", "particles" and further fields of `types.Track` that differ."""


@dataclasses.dataclass(frozen=True)
class Difference(Immutable):
    """Anything else of an observation that differs, in words."""

    what: str
    """detections, associations, ended, action, tracks so far."""
    log: str
    replay: str


@dataclasses.dataclass(frozen=True, eq=False)
class ObservationComparison(Immutable):
    """Log and replay after one observation."""

    observation: int
    identical: bool
    """To the last bit, particles included as far as the log keeps them."""
    tracks: tuple[TrackComparison, ...]
    """All of them, those that do not differ, too."""
    others: tuple[Difference, ...]


def compare(logged: Perception, replayed: Perception, catalogue: Catalogue) -> ObservationComparison:
    """How a record of a log and its replay differ in detections, associations and belief.

    Tracks of one label are paired by how near they are, in whole centimetres, and then by their ids. Raises
    `objects.UnknownLabel` for a label that the catalogue lacks.
    """
    log, now = logged.posterior, replayed.posterior
    paired = _paired(log.tracks, now.tracks)
    tracks = tuple(_compare_tracks(a, b, catalogue) for a, b in paired)
    sides = (
        ("detections", *_counted(logged.detections, replayed.detections)),
        ("associations", *_counted(logged.associations, replayed.associations)),
        ("ended", _ended(log), _ended(now)),
        ("action", _became(log), _became(now)),
        ("tracks so far", str(log.next_id), str(now.next_id)),
    )
    same = (
        _same(logged.detections, replayed.detections),
        _same(logged.associations, replayed.associations),
        _same(log.gone, now.gone),
        _same(log.believed, now.believed),
        log.next_id == now.next_id,
    )
    others = tuple(Difference(*side) for side, equal in zip(sides, same, strict=True) if not equal)
    identical = not others and not any(track.differs for track in tracks)
    return ObservationComparison(logged.step, identical, tracks, others)


def _same(a: Any, b: Any) -> bool:
    return canonical(a) == canonical(b)


def _paired(log: Sequence[Track], now: Sequence[Track]) -> list[tuple[Track | None, Track | None]]:
    """Tracks of the log with those of the replay, each at most once; in the order of the ids."""
    near = []
    for i, a in enumerate(log):
        for j, b in enumerate(now):
            if a.label == b.label:
                apart = float(np.linalg.norm(a.X_WO[:3, 3] - b.X_WO[:3, 3]))
                near.append((round(apart, 2), a.id != b.id, apart, i, j))
    of_log: dict[int, int] = {}
    for *_, i, j in sorted(near):
        if i not in of_log and j not in of_log.values():
            of_log[i] = j
    pairs: list[tuple[Track | None, Track | None]] = [
        (a, now[of_log[i]] if i in of_log else None) for i, a in enumerate(log)
    ]
    return pairs + [(None, b) for j, b in enumerate(now) if j not in of_log.values()]


_NAMES = {"X_WO": "pose", "belief": "particles"}
_FIRST = ("accepted", "probability", "pose")
"""What is told of a track before all else."""


def _compare_tracks(log: Track | None, now: Track | None, catalogue: Catalogue) -> TrackComparison:
    one = log if log is not None else now
    assert one is not None
    symmetry = catalogue[one.label].symmetry
    if log is None or now is None:
        return TrackComparison(one.label, _stand(log), _stand(now), None, None, ("there",))
    # As it would be read from a log, where a number is a number: thinned, with every field of its declared type.
    thinned = dataclasses.replace(now, belief=thin(now.belief, len(log.belief.weights)))
    read: Track = decode(Track, encode(thinned))
    names = [field.name for field in dataclasses.fields(Track)]
    differing = [_NAMES.get(name, name) for name in names if not _same(getattr(log, name), getattr(read, name))]
    differs = sorted(differing, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))
    translation, rotation = pose_error(log.X_WO, now.X_WO, symmetry)
    return TrackComparison(log.label, _stand(log), _stand(now), float(translation), float(rotation), tuple(differs))


def _stand(track: Track | None) -> Stand | None:
    return None if track is None else Stand(track.id, track.accepted, float(track.probability), track.X_WO)


def _counted(log: Sequence[Any], now: Sequence[Any]) -> tuple[str, str]:
    """How many there are on each side, and how many of them the other lacks."""
    left, right = [canonical(one) for one in log], [canonical(one) for one in now]

    def said(own: Sequence[str], other: Sequence[str], where: str) -> str:
        lacking = sum(one not in other for one in own)
        return f"{len(own)}" + (f", {lacking} not in the {where}" if lacking else "")

    return said(left, right, "replay"), said(right, left, "log")


def _ended(belief: SceneBelief) -> str:
    return ", ".join(f"{gone.label} ({gone.reason})" for gone in belief.gone) or "none"


def _became(belief: SceneBelief) -> str:
    """What is believed of the action before."""
    if belief.believed is None:
        return "nothing"
    outcome = belief.believed.outcome
    return f"{belief.believed.label} {outcome}, {dict(belief.believed.outcomes)[outcome]:.6g}"


def verdict(comparisons: Sequence[ObservationComparison], *, whole: bool = True) -> str:
    """One line: whether all is identical, or how much differs. whole: whether the log is."""
    tracks = {one.log.track for each in comparisons for one in each.tracks if one.log is not None}
    observations = f"{len(comparisons)} observation{'s' * (len(comparisons) != 1)}"
    as_far = "" if whole else " as far as the log goes"
    differing = [each for each in comparisons if not each.identical]
    if not differing:
        return f"identical{as_far}: {observations}, {len(tracks)} track{'s' * (len(tracks) != 1)}"
    pairs = [track for each in comparisons for track in each.tracks]
    log = sum(one.log is not None and one.log.accepted for one in pairs)
    now = sum(one.replay is not None and one.replay.accepted for one in pairs)
    return (
        f"differences in {len(differing)} of {observations}{as_far}, from observation {differing[0].observation} on; "
        f"objects accepted, over all observations: {log} in the log, {now} in the replay"
    )


def difference_table(comparisons: Sequence[ObservationComparison]) -> str:
    """Aligned text, a line for each thing that differs; "" where nothing does."""
    rows = [("observation", "what", "log", "replay", "differs in")]
    for each in comparisons:
        at = str(each.observation)
        rows += [(at, one.what, one.log, one.replay, "") for one in each.others]
        rows += [
            (at, _named(one), _said(one.log), _said(one.replay), _words(one)) for one in each.tracks if one.differs
        ]
    if len(rows) == 1:
        return ""
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    return "\n".join(
        "  ".join([row[0].rjust(widths[0]), *(row[k].ljust(widths[k]) for k in (1, 2, 3)), row[4]]).rstrip()
        for row in rows
    )


def _named(one: TrackComparison) -> str:
    ids = [stand.track for stand in (one.log, one.replay) if stand is not None]
    return f"{one.label} (track {' and '.join(map(str, dict.fromkeys(ids)))})"


def _said(stand: Stand | None) -> str:
    if stand is None:
        return "not there"
    return f"{'accepted' if stand.accepted else 'not accepted'}, {stand.probability:.4g}"


def _words(one: TrackComparison) -> str:
    first = [name for name in one.differs if name in ("there", *_FIRST)]
    if "pose" in first and one.translation_m is not None and one.rotation_rad is not None:
        mm, degrees = 1e3 * one.translation_m, float(np.degrees(one.rotation_rad))
        far = " ".join([_short(mm), "mm,", _short(degrees), "deg"])
        first[first.index("pose")] = f"pose by {far}"
    return ", ".join(first or one.differs)


def _short(value: float) -> str:
    """To two digits, and not as a power of ten where whole numbers will do."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def summary(comparisons: Sequence[ObservationComparison], about: Mapping[str, Any]) -> dict[str, Any]:
    """Plain data for a file: what is `about` the replay, then the comparison."""
    identical = all(each.identical for each in comparisons)
    data: dict[str, Any] = {**about, "identical": identical, "observations": encode(list(comparisons))}
    return data
