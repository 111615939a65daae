"""What a detector takes for objects on poured tables, estimated and judged: the rows that trust is measured on.

Half of the tables are seen by the trained detector, half by a simulated one that takes a quarter of the objects for
something else and sees some where there are none. On half there are things that no label fits, half are looked at from
elsewhere than the robot's head, half through a stereo camera, and half of the estimators know meshes that are off.
"""

import dataclasses
import functools

import numpy as np

from sum_drake import belief
from sum_drake.appearance import Appearances
from sum_drake.association import AssociationConfig, associate
from sum_drake.belief import AcceptanceConfig
from sum_drake.bench.pose_scenes import FIRST_SCENE, SENSORS
from sum_drake.bench.tables import TABLE_TOP, Onlooker, Sight, Table, pour_table
from sum_drake.detection.inference import Detector
from sum_drake.detection.simulated import SimulatedDetectorConfig, simulate_detections
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.modes import RIGHT
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.seeds import derive
from sum_drake.support import sunk
from sum_drake.types import (
    Array,
    Associations,
    Detection,
    Detections,
    Immutable,
    Perception,
    PickPlace,
    SceneBelief,
    Track,
)

ERRORS = SimulatedDetectorConfig(wrong_label_rate=0.25, false_boxes=1.5)


@dataclasses.dataclass(frozen=True)
class Setting(Immutable):
    """How a table is made and looked at."""

    seed: int
    objects: int
    others: int
    head: bool
    """Whether the camera is the robot's; else it stands anywhere."""
    sensor: str
    trained: bool
    """Whether the trained detector looks, or the simulated one."""
    own_meshes: bool
    """Whether the estimator knows the true meshes."""


def setting(seed: int) -> Setting:
    """Of a table's seed."""
    rng = np.random.default_rng([derive(seed, "setting of a table")])
    return Setting(
        seed,
        objects=int(rng.integers(3, 11)),
        others=int(rng.integers(1, 4)) if rng.random() < 0.5 else 0,
        head=bool(rng.random() < 0.5),
        sensor="structured_light" if rng.random() < 0.5 else "stereo" if seed < FIRST_SCENE else "wide_stereo",
        trained=seed % 2 == 0,
        own_meshes=bool(rng.random() < 0.5),
    )


class Watcher:
    """Perception as the sorting robot's, without a robot: sees a table, look after look, and believes.

    catalogue: the true meshes, by which it is told how far an estimate reaches below the table.
    """

    def __init__(
        self, at: Setting, catalogue: Catalogue, detector: Detector, estimator: PoseEstimator, config: FilterConfig
    ) -> None:
        self.belief = SceneBelief()
        self._at, self._catalogue, self._detector = at, catalogue, detector
        self._estimator, self._config = estimator, config
        self._association, self._acceptance = AssociationConfig(), AcceptanceConfig()

    def observe(self, table: Table, sight: Sight, action: PickPlace | None = None) -> Perception:
        """The record of a look after an action."""
        step = sight.frame.observation
        found = Detections(step, self.detect(table, sight))
        pairs = associate(self.belief.tracks, found.boxes, self._association)
        posterior = belief.update(
            self.belief,
            sight.frame,
            found,
            Associations(step, pairs),
            action,
            self._estimator,
            filter_config=self._config,
            association_config=self._association,
            acceptance=self._acceptance,
            unique_labels=True,
            seed=derive(self._at.seed, "estimation"),
            sunk=self._sunk,
        )
        record = Perception(step, sight.frame, found.boxes, pairs, self.belief, posterior, action)
        self.belief = posterior
        return record

    def detect(self, table: Table, sight: Sight) -> tuple[Detection, ...]:
        """What the detector of the setting sees. The simulated one takes things that no label fits for objects."""
        if self._at.trained:
            return self._detector(sight.frame.color, sight.frame.depth)
        rng = np.random.default_rng([derive(self._at.seed, "detection"), sight.frame.observation])
        labels = self._catalogue.labels
        taken_for = [str(rng.choice(labels)) for _ in table.things]
        shown = {
            i: thing.name if thing.is_object else taken_for[i - 1] for i, thing in enumerate(table.things, start=1)
        }
        return simulate_detections(sight.owners, shown, labels, sigma_c=0.1, config=ERRORS, rng=rng)

    def _sunk(self, label: str, X_WO: Array) -> float:
        return sunk(np.asarray(self._catalogue[label].load_mesh().vertices), X_WO, TABLE_TOP)


def is_right(track: Track, table: Table, catalogue: Catalogue) -> bool:
    """Whether the track's object is there, and where it says."""
    X_WO = table.X_WOs.get(track.label)
    if X_WO is None:
        return False
    shift, angle = pose_error(track.X_WO, X_WO, catalogue[track.label].symmetry)
    return bool(shift < RIGHT[0] and angle < np.radians(RIGHT[1]))


@dataclasses.dataclass(frozen=True)
class Judged(Immutable):
    """A hypothesis of one look, and whether it is right."""

    table: int
    """Seed of its table."""
    trained: bool
    """Whether the trained detector's."""
    label: str
    p_box: float
    p_label: float
    likelihood: float
    features: tuple[tuple[str, float], ...]
    probability: float
    """As the belief states it."""
    right: bool


class Tables:
    """Makes and looks at tables by their seeds; keeps what was rendered of each label. Use it from one thread.

    catalogue: the true meshes; told: those that half of the estimators know.
    """

    def __init__(self, catalogue: Catalogue, told: Catalogue, detector: Detector, config: FilterConfig) -> None:
        self.catalogue, self._detector, self._config = catalogue, detector, config
        self._catalogues = {True: catalogue, False: told}
        self._estimator = functools.cache(self._make_estimator)
        self._appearances = functools.cache(lambda own: Appearances(self._catalogues[own], config.render))
        self._renderer = functools.cache(lambda own: DepthRenderer(self._catalogues[own]))

    def _make_estimator(self, own: bool, sensor: str) -> PoseEstimator:
        return PoseEstimator(
            self._catalogues[own],
            self._config,
            noise=SENSORS[sensor],
            appearances=self._appearances(own),
            renderer=self._renderer(own),
        )

    def begin(self, at: Setting) -> tuple[Table, Onlooker, Watcher, np.random.Generator]:
        """The table, who looks at it, who believes, and where the rest of the draws come from."""
        rng = np.random.default_rng([derive(at.seed, "table")])
        table = pour_table(self.catalogue, rng, objects=at.objects, others=at.others)
        onlooker = Onlooker(rng, head=at.head, noise=SENSORS[at.sensor])
        estimator = self._estimator(at.own_meshes, at.sensor)
        return table, onlooker, Watcher(at, self.catalogue, self._detector, estimator, self._config), rng

    def first_look(self, seed: int) -> list[Judged]:
        """Every hypothesis of one look at a table."""
        at = setting(seed)
        table, onlooker, watcher, rng = self.begin(at)
        record = watcher.observe(table, onlooker.look(table, 0, rng))
        return [
            Judged(
                table=seed,
                trained=at.trained,
                label=track.label,
                p_box=track.p_box,
                p_label=track.p_label,
                likelihood=track.likelihood,
                features=track.features,
                probability=track.probability,
                right=is_right(track, table, self.catalogue),
            )
            for track in record.posterior.tracks
        ]
