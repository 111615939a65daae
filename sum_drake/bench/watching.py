"""Perception as the sorting robot's, without a robot, that watches poured tables of all kinds.

Half of the tables are seen by the trained detector, half by a simulated one that takes a quarter of the objects for
something else and sees some where there are none. On half there are things that no label fits, half are looked at from
elsewhere than the robot's head, half through a stereo camera, and half of the estimators know meshes that are off.
"""

import dataclasses
import functools
import time
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from sum_drake import belief
from sum_drake.appearance import Appearances
from sum_drake.association import (
    AssociationConfig,
    associate,
    expected_boxes,
    greedy_matches,
    matching_scores,
)
from sum_drake.belief import AcceptanceConfig, BeliefConfig
from sum_drake.bench.pose_scenes import FIRST_SCENE, SENSORS
from sum_drake.bench.poured_tables import TABLE_TOP, Onlooker, Sight, Table, pour_table
from sum_drake.detection.inference import Detector
from sum_drake.detection.simulated import SimulatedDetectorConfig, simulate_detections
from sum_drake.filter_config import FilterConfig
from sum_drake.filtering import PoseEstimate, PoseEstimator, PoseRequest
from sum_drake.objects import Catalogue
from sum_drake.presence import PresenceCheck
from sum_drake.rendering import DepthRenderer
from sum_drake.seeds import derive
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


@dataclasses.dataclass(frozen=True)
class Update(Immutable):
    """What it cost to bring a belief up to date."""

    observation: int
    tracked: int
    """Tracks that were estimated anew from what was believed of them."""
    spawned: int
    tracking_cpu_s: float
    """All but what estimates of new tracks took: association, what was not detected and rivals, too."""
    spawning_cpu_s: float


@dataclasses.dataclass(frozen=True)
class Matched(Immutable):
    """Greedy association of a look beside the best one there is."""

    observation: int
    greedy: int
    """Pairs matched."""
    best: int
    same: bool
    """Whether both match the same pairs."""
    greedy_score: float
    """Sum over the pairs."""
    best_score: float


class _Stopwatch:
    """An estimator that says what its estimates from scratch took; what is made ready once for a label aside."""

    def __init__(self, estimator: PoseEstimator) -> None:
        self._estimator = estimator
        self.warming_s, self.scratch_s, self.tracked = 0.0, 0.0, 0

    def estimate_all(self, frame: Frame, requests: Sequence[PoseRequest]) -> list[PoseEstimate]:
        """As `PoseEstimator.estimate_all`."""
        found = []
        for one in requests:
            start = time.process_time()
            self._estimator.warm(one.label)
            warm = time.process_time()
            found += self._estimator.estimate_all(frame, [one])
            self.warming_s += warm - start
            self.scratch_s += time.process_time() - warm if one.prior is None else 0.0
            self.tracked += one.prior is not None
        return found


class Watcher:
    """Perception as the sorting robot's, without a robot: sees a table, look after look, and believes.

    catalogue: what the estimator knows.
    """

    def __init__(
        self,
        at: Setting,
        catalogue: Catalogue,
        detector: Detector,
        estimator: PoseEstimator,
        presence: PresenceCheck,
        config: FilterConfig,
        trial: int,
    ) -> None:
        self.belief = SceneBelief()
        self.updates: list[Update] = []
        self.matched: list[Matched] = []
        self.mistaken: tuple[Detection, ...] = ()
        """Detections of every look that the detector has not made."""
        self._at, self._catalogue, self._detector = at, catalogue, detector
        self._estimator, self._presence = estimator, presence
        self._trial = trial
        seed = derive(at.seed, f"estimation {trial}")
        self._config = BeliefConfig(config, AssociationConfig(), AcceptanceConfig(), True, seed, TABLE_TOP)

    def observe(self, table: Table, sight: Sight, action: PickPlace | None = None) -> Perception:
        """The record of a look after an action."""
        step = sight.frame.observation
        found = Detections(step, self.detect(table, sight))
        watch, start = _Stopwatch(self._estimator), time.process_time()
        expected = expected_boxes(self.belief.tracks, action, sight.frame, self._vertices)
        pairs = associate(self.belief.tracks, found.boxes, self._config.association, expected)
        posterior = belief.update(
            self.belief,
            sight.frame,
            found,
            Associations(step, pairs),
            action,
            watch,
            self._presence,
            self._catalogue,
            self._config,
        )
        rest = time.process_time() - start - watch.warming_s - watch.scratch_s
        if self.belief.tracks:
            scores, _ = matching_scores(self.belief.tracks, found.boxes, expected)
            self.matched.append(compare_matches(scores, self._config.association.match_threshold, step))
        spawned = sum(pair.track is None for pair in pairs)
        self.updates.append(Update(step, watch.tracked, spawned, rest, watch.scratch_s))
        record = Perception(step, sight.frame, found.boxes, pairs, self.belief, posterior, action)
        self.belief = posterior
        return record

    def detect(self, table: Table, sight: Sight) -> tuple[Detection, ...]:
        """What the detector of the setting sees. The simulated one takes things that no label fits for objects."""
        if self._at.trained:
            return self._detector(sight.frame.color, sight.frame.depth) + self.mistaken
        rng = np.random.default_rng([derive(self._at.seed, "detection"), self._trial, sight.frame.observation])
        labels = self._catalogue.labels
        taken_for = [str(rng.choice(labels)) for _ in table.things]
        shown = {
            i: thing.name if thing.is_object else taken_for[i - 1] for i, thing in enumerate(table.things, start=1)
        }
        return simulate_detections(sight.owners, shown, labels, sigma_c=0.1, config=ERRORS, rng=rng) + self.mistaken

    def _vertices(self, label: str) -> Array:
        return np.asarray(self._catalogue[label].load_mesh().vertices)


def compare_matches(scores: Array, threshold: float, observation: int) -> Matched:
    """Of matching scores (tracks, pairs); the best matches have the largest sum of all (the Hungarian assignment)."""
    worth = np.where(scores >= threshold, scores, 0.0)
    rows, columns = linear_sum_assignment(worth, maximize=True)
    best = {(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if worth[i, j] > 0}
    greedy = set(greedy_matches(scores, threshold))
    sums = [float(sum(scores[i, j] for i, j in sorted(pairs))) for pairs in (greedy, best)]
    return Matched(observation, len(greedy), len(best), greedy == best, *sums)


def set_table(catalogue: Catalogue, at: Setting) -> tuple[Table, Onlooker, np.random.Generator]:
    """The table, who looks at it, and where the rest of the draws come from. catalogue: the true meshes."""
    rng = np.random.default_rng([derive(at.seed, "table")])
    table = pour_table(catalogue, rng, objects=at.objects, others=at.others)
    return table, Onlooker(rng, head=at.head, noise=SENSORS[at.sensor]), rng


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

    @property
    def exact(self) -> DepthRenderer:
        """Of the true meshes."""
        return self._renderer(True)

    def _make_estimator(self, own: bool, sensor: str) -> PoseEstimator:
        return PoseEstimator(
            self._catalogues[own],
            self._config,
            noise=SENSORS[sensor],
            appearances=self._appearances(own),
            renderer=self._renderer(own),
        )

    def begin(self, at: Setting, trial: int = 0) -> tuple[Table, Onlooker, Watcher, np.random.Generator]:
        """The table, who looks at it, who believes, and where the rest of the draws come from.

        trial: another one is of the same table, but of other noise and draws.
        """
        table, onlooker, rng = set_table(self.catalogue, at)
        watcher = Watcher(
            at,
            self._catalogues[at.own_meshes],
            self._detector,
            self._estimator(at.own_meshes, at.sensor),
            PresenceCheck(
                self._catalogues[at.own_meshes], noise=SENSORS[at.sensor], renderer=self._renderer(at.own_meshes)
            ),
            self._config,
            trial,
        )
        return table, onlooker, watcher, rng if trial == 0 else rng.spawn(trial)[-1]
