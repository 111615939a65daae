"""Which detection feeds which track: greedy matching after Sui et al. 2017, eq. 11."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from sum_drake.existence import LEAST
from sum_drake.geometry import iou
from sum_drake.rendering import predicted_box
from sum_drake.types import (
    Array,
    Association,
    Associations,
    Box,
    Detection,
    Detections,
    Frame,
    PickPlace,
    SceneBelief,
    Track,
)


@dataclasses.dataclass
class AssociationConfig:
    """What the paper leaves open about association."""

    match_threshold: float = 0.05
    """Least score of an association."""
    spawn_threshold: float = 0.05
    """Least p(b | z) p(o | b, z) of an unmatched (box, label) for a new track."""
    max_missed: int = 2
    """K: a track that is less probable than accepted ones ends after this many looks in a row that could see it and did
    not detect it."""
    max_tracks: int = 60
    """The most that are followed at a time: the surest detections spawn first, until there is no room. Tracks that are
    less probable than `existence.LEAST` take none, and give way."""
    carry: bool = True
    """Whether tracks are carried from look to look, and across actions; otherwise each look begins with none."""


def expected_boxes(
    tracks: Sequence[Track], action: PickPlace | None, frame: Frame, vertices: Callable[[str], Array]
) -> list[list[Box]]:
    """Boxes in which each track may be seen now: where its estimate is, and where the action was to put its target.

    vertices: (v, 3) of a label's mesh. What is out of the picture has no box.
    """
    found = []
    for track in tracks:
        X_WOs = [track.X_WO]
        if action is not None and action.track == track.id and action.released:
            X_WOs.append(action.X_WO_place)
        boxes = [predicted_box(vertices(track.label), X_WO, frame) for X_WO in X_WOs]
        found.append([box for box in boxes if min(box[2:]) > 0])
    return found


def matching_scores(
    tracks: Sequence[Track], detections: Sequence[Detection], expected: Sequence[Sequence[Box]] | None = None
) -> tuple[Array, list[tuple[int, str]]]:
    """s = IoU(b_{t-1}, b_t) p(b_t | z) p(o | b_t, z) of every track with every (detection, label), eq. 11.

    The overlap is the largest with the box before, as published, and with those that are expected of each track.

    Returns scores (tracks, pairs), 0 where the labels differ, and the pairs (detection index, label). A box appears
    once for each of its labels, so that rivals for one object are matched, and contest it, side by side.
    """
    pairs = [(d, label) for d, detection in enumerate(detections) for label, _ in detection.p_labels]
    boxes = [detection.box for detection in detections]
    overlaps = iou([track.box for track in tracks], boxes)
    for i, own in enumerate(expected or ()):
        overlaps[i] = np.max([overlaps[i], *iou(list(own), boxes)], axis=0)
    scores = np.zeros((len(tracks), len(pairs)))
    for j, (d, label) in enumerate(pairs):
        confidence = _confidence(detections[d], label)
        for i, track in enumerate(tracks):
            if track.label == label:
                scores[i, j] = overlaps[i, d] * confidence
    return scores, pairs


def greedy_matches(scores: Array, threshold: float) -> list[tuple[int, int]]:
    """(row, column) pairs, best first; each row and column at most once; every score at least `threshold` and > 0."""
    remaining = scores.copy()
    matches = []
    while remaining.size:
        i, j = np.unravel_index(int(np.argmax(remaining)), remaining.shape)
        if remaining[i, j] <= 0.0 or remaining[i, j] < threshold:
            break
        matches.append((int(i), int(j)))
        remaining[i, :] = 0.0
        remaining[:, j] = 0.0
    return matches


def associate(
    tracks: Sequence[Track],
    detections: Sequence[Detection],
    config: AssociationConfig,
    expected: Sequence[Sequence[Box]] | None = None,
) -> tuple[Association, ...]:
    """Associations in the order of the detections and their labels; a `track` of None spawns a new one."""
    scores, pairs = matching_scores(tracks, detections, expected)
    matched = {j: (tracks[i].id, float(scores[i, j])) for i, j in greedy_matches(scores, config.match_threshold)}
    unmatched = [(j, _confidence(detections[d], label)) for j, (d, label) in enumerate(pairs) if j not in matched]
    wanted = [(j, confidence) for j, confidence in unmatched if confidence >= config.spawn_threshold]
    room = max(config.max_tracks - sum(track.own_probability >= LEAST for track in tracks), 0)
    surest = sorted(wanted, key=lambda one: (-one[1], one[0]))[:room]
    spawned = dict(surest)
    return tuple(
        Association(d, label, *(matched[j] if j in matched else (None, spawned[j])))
        for j, (d, label) in enumerate(pairs)
        if j in matched or j in spawned
    )


def associate_frame(
    held: SceneBelief,
    frame: Frame,
    detections: Detections,
    action: PickPlace | None,
    vertices: Callable[[str], Array],
    config: AssociationConfig,
) -> Associations:
    """`associate` with the belief as held, its tracks expected where they were and where the action put its target.

    vertices: (v, 3) of a label's mesh. The frame is for its camera alone.
    """
    tracks = held.tracks if config.carry else ()
    expected = expected_boxes(tracks, action, frame, vertices)
    return Associations(detections.observation, associate(tracks, detections.boxes, config, expected))


def _confidence(detection: Detection, label: str) -> float:
    """p(b | z) p(o | b, z); 0 for what is no number, and no more than 1 each."""
    return probability(detection.p_box) * probability(dict(detection.p_labels)[label])


def probability(told: float) -> float:
    """What a detector told, as a probability: 0 for what is no number."""
    return min(max(float(told), 0.0), 1.0) if np.isfinite(told) else 0.0
