"""The paper's single scenes: ten cluttered tables, ten trials each, in the boxes that the trained detector finds.

As the paper counts (section VI.A), accuracy is of the detector's true positives: boxes whose intersection over union
with the true one is above .5. Trials of a scene are estimates of the same picture from other random draws.
"""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from sum_drake.bench.hypotheses import judge
from sum_drake.bench.pose_scenes import FIRST_SCENE, Instance, PoseScene
from sum_drake.bench.watching import Setting, Tables, set_table
from sum_drake.detection.inference import Detector
from sum_drake.evaluation import TRUE_IOU, Truth, score_observation
from sum_drake.geometry import inverse, iou, mask_box
from sum_drake.objects import Catalogue
from sum_drake.rendering import DepthRenderer
from sum_drake.types import Box, Detection, Immutable, Perception

SCENES, TRIALS = 10, 10
QUICK_SCENES, QUICK_TRIALS = 2, 1
FIRST = FIRST_SCENE + 60_000
"""Seed of the first scene: none is in another experiment."""
OBJECTS = 8
"""In the clutter of the paper's picture of a scene."""
SENSOR = "structured_light"


def paper_scene(seed: int) -> Setting:
    """How a scene is made and looked at: from the robot's head, by the trained detector; meshes are off."""
    return Setting(seed, objects=OBJECTS, others=0, head=True, sensor=SENSOR, trained=True, own_meshes=False)


def trial_scene(catalogue: Catalogue, exact: DepthRenderer, detector: Detector, seed: int) -> PoseScene:
    """A scene whose instances are the detector's true positives. catalogue: the true meshes, as exact renders them."""
    table, onlooker, rng = set_table(catalogue, paper_scene(seed))
    sight = onlooker.look(table, 0, rng)
    found = detector(sight.frame.color, sight.frame.depth)
    instances = []
    for i, thing in enumerate(table.things, start=1):
        own = sight.owners == i
        if not own.any():
            continue
        box = true_positive(found, thing.name, mask_box(own))
        if box is not None:
            alone = exact.depth(thing.name, inverse(sight.frame.X_WC) @ thing.X_WO, sight.frame.camera)
            share = int(np.count_nonzero(own)) / max(int(np.count_nonzero(alone)), 1)
            instances.append(Instance(thing.name, thing.X_WO, box, min(share, 1.0), wrong_box=False))
    return PoseScene(seed, sight.frame, tuple(instances), SENSOR)


def true_positive(found: Sequence[Detection], label: str, true: Box) -> Box | None:
    """The best of the boxes that the detector takes for the label and that are where it is; None: there is none."""
    boxes = [one.box for one in found if one.p_labels and one.p_labels[0][0] == label]
    overlaps = [float(iou(box, true)[0, 0]) for box in boxes]
    best = int(np.argmax(overlaps)) if overlaps else -1
    return boxes[best] if overlaps and overlaps[best] > TRUE_IOU else None


@dataclasses.dataclass(frozen=True, eq=False)
class Corrected(Immutable):
    """A look at one of the scenes, and how many of its hypotheses were false and did not last."""

    record: Perception
    false: int
    """As the paper counts: no object of the label is in the box."""
    rejected: int
    accepted_wrong: int
    """Accepted ones whose object is not within 2 cm and 20 degrees."""


def looks(tables: Tables, seeds: Sequence[int]) -> Iterator[Corrected]:
    """What is believed of each scene after one look, judged."""
    for seed in seeds:
        at = paper_scene(seed)
        table, onlooker, watcher, rng = tables.begin(at)
        record = watcher.observe(table, onlooker.look(table, 0, rng))
        scored = score_observation(record, Truth(0, tuple(table.X_WOs.items())), tables.catalogue)
        wrong = sum(one.accepted and not one.right for one in judge(record, table, at, tables.catalogue))
        yield Corrected(record, scored["false_positives"], scored["false_positives_rejected"], wrong)


def corrected(looks: Sequence[Corrected]) -> dict[str, float]:
    """Figures of looks; none of none."""
    if not looks:
        return {}
    return {
        "trials.false_positives": sum(look.false for look in looks),
        "trials.false_positives_rejected": sum(look.rejected for look in looks),
        "trials.accepted_wrong": sum(look.accepted_wrong for look in looks),
    }
