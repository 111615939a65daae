"""Which detection feeds which track: greedy matching after Sui et al. 2017, eq. 11."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from sum_drake.geometry import iou
from sum_drake.types import Array, Association, Detection, Track


@dataclasses.dataclass
class AssociationConfig:
    """What the paper leaves open about association."""

    match_threshold: float = 0.05
    """Least score of an association."""
    spawn_threshold: float = 0.05
    """Least p(b | z) p(o | b, z) of an unmatched (box, label) for a new track."""
    max_missed: int = 2
    """K: a track ends after this many observations in a row without an association."""


def matching_scores(tracks: Sequence[Track], detections: Sequence[Detection]) -> tuple[Array, list[tuple[int, str]]]:
    """s = IoU(b_{t-1}, b_t) p(b_t | z) p(o | b_t, z) of every track with every (detection, label), eq. 11.

    Returns scores (tracks, pairs), 0 where the labels differ, and the pairs (detection index, label). A box appears
    once for each of its labels, so that rivals for one object are matched, and contest it, side by side.
    """
    pairs = [(d, label) for d, detection in enumerate(detections) for label, _ in detection.p_labels]
    overlaps = iou([track.box for track in tracks], [detection.box for detection in detections])
    scores = np.zeros((len(tracks), len(pairs)))
    for j, (d, label) in enumerate(pairs):
        confidence = detections[d].p_box * dict(detections[d].p_labels)[label]
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
    tracks: Sequence[Track], detections: Sequence[Detection], config: AssociationConfig
) -> tuple[Association, ...]:
    """Associations in the order of the detections and their labels; a `track` of None spawns a new one."""
    scores, pairs = matching_scores(tracks, detections)
    matched = {j: (tracks[i].id, float(scores[i, j])) for i, j in greedy_matches(scores, config.match_threshold)}
    associations = []
    for j, (d, label) in enumerate(pairs):
        if j in matched:
            track, score = matched[j]
            associations.append(Association(d, label, track, score))
            continue
        confidence = detections[d].p_box * dict(detections[d].p_labels)[label]
        if confidence >= config.spawn_threshold:
            associations.append(Association(d, label, None, confidence))
    return tuple(associations)
