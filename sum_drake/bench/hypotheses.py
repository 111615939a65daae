"""What is believed of watched tables, judged: the rows that trust is measured on."""

import dataclasses

import numpy as np

from sum_drake.bench.poured_tables import Sight, Table
from sum_drake.bench.watching import Setting, Tables
from sum_drake.consistency import agree
from sum_drake.evaluation import Truth, score_observation
from sum_drake.geometry import inverse
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.types import (
    Immutable,
    Perception,
    Track,
)

SEEN_SHARE, SEEN_PIXELS = 0.3, 300
"""An object of which less can be seen need not be found."""


def is_right(track: Track, table: Table, catalogue: Catalogue) -> bool:
    """Whether the track's object is there, and where it says."""
    X_WO = table.X_WOs.get(track.label)
    return X_WO is not None and agree(track.X_WO, X_WO, track.label, catalogue)


@dataclasses.dataclass(frozen=True)
class Judged(Immutable):
    """A hypothesis after a look, and whether it is right."""

    table: int
    """Seed of its table."""
    trained: bool
    """Whether the trained detector's."""
    observation: int
    track: int
    seen: bool
    """Whether a detection of this look fed it."""
    label: str
    p_box: float
    p_label: float
    likelihood: float
    features: tuple[tuple[str, float], ...]
    probability: float
    """As the belief states it."""
    accepted: bool
    right: bool


def judge(record: Perception, table: Table, at: Setting, catalogue: Catalogue) -> list[Judged]:
    """Every hypothesis after a look. catalogue: the true meshes."""
    return [
        Judged(
            table=at.seed,
            trained=at.trained,
            observation=record.step,
            track=track.id,
            seen=track.seen == record.step,
            label=track.label,
            p_box=track.p_box,
            p_label=track.p_label,
            likelihood=track.likelihood,
            features=track.features,
            probability=track.probability,
            accepted=track.accepted,
            right=is_right(track, table, catalogue),
        )
        for track in record.posterior.tracks
    ]


@dataclasses.dataclass(frozen=True)
class Counted(Immutable):
    """Hypotheses by whether an object of their label is in their box, as the paper counts (`evaluation.py`)."""

    false_positives: int
    false_positives_rejected: int
    true_tracks: int
    true_tracks_accepted: int


@dataclasses.dataclass(frozen=True)
class FirstLook(Immutable):
    """One look at a table."""

    table: int
    trial: int
    visible: tuple[str, ...]
    """Objects that can be asked for."""
    judged: tuple[Judged, ...]
    counted: Counted


def is_visible(label: str, table: Table, sight: Sight, exact: DepthRenderer) -> bool:
    """Whether enough of an object can be seen for it to be asked for. exact: renders the true meshes."""
    X_WO = table.X_WOs.get(label)
    if X_WO is None:
        return False
    owner = next(i for i, thing in enumerate(table.things, 1) if thing.name == label)
    pixels = int(np.count_nonzero(sight.owners == owner))
    alone = exact.depth(label, inverse(sight.frame.X_WC) @ X_WO, sight.frame.camera)
    return pixels >= max(SEEN_PIXELS, SEEN_SHARE * int(np.count_nonzero(alone)))


def first_look(tables: Tables, at: Setting, trial: int = 0) -> FirstLook:
    """What is believed after one look at a table."""
    table, onlooker, watcher, rng = tables.begin(at, trial)
    sight = onlooker.look(table, 0, rng)
    record = watcher.observe(table, sight)
    scored = score_observation(record, Truth(0, tuple(table.X_WOs.items())), tables.catalogue)
    counts = {field.name: scored[field.name] for field in dataclasses.fields(Counted)}
    visible = tuple(label for label in table.X_WOs if is_visible(label, table, sight, tables.exact))
    return FirstLook(at.seed, trial, visible, tuple(judge(record, table, at, tables.catalogue)), Counted(**counts))
