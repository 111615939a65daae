"""Edge Boxes: a box is a good proposal when many contours lie wholly inside it (Zitnick and Dollár, ECCV 2014).

Edge pixels are joined to groups of little bend. Two near groups are akin when one continues the other. A box is scored
by the edges of its groups, less those that hang together with what crosses its border, less its middle. All boxes of a
grid over position, scale and aspect ratio are scored, the good ones refined, the overlapping ones suppressed.

The loops are compiled with numba; the machine code is kept, so that only the first use on a machine takes seconds.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError
from sum_drake.compiled import compiled
from sum_drake.detection.edge_groups import (
    LEAST_AFFINITY,
    Affinities,
    Floats,
    Groups,
    Ints,
    affinities,
    describe_groups,
    group_edges,
)
from sum_drake.detection.edges import Edges, EdgesConfig, find_edges
from sum_drake.detection.proposals import Proposals, make_proposals
from sum_drake.types import Array, Immutable


@dataclasses.dataclass
class EdgeBoxesConfig:
    """Parameters of the search, in the paper's symbols. Its variant for IoU .7 (its section 4) is the default."""

    alpha: float = 0.65
    """IoU of neighbouring windows of the grid: its step in position, scale and aspect ratio."""
    beta: float = 0.75
    """IoU over which the worse of two boxes is suppressed."""
    eta: float = 0.999
    """Factor on beta after each box kept, down to .5, as in the authors' code: spreads the later boxes. 1: none."""
    gamma: float = 2.0
    """Exponent of the affinity of two groups (eq. 1)."""
    kappa: float = 1.5
    """Exponent of the box's size in its score (eq. 3); larger favours smaller boxes."""
    finest_step: int = 2
    """Refinement moves borders by steps that halve down to this, pixels of the edge map; 3 in the authors' code."""
    min_score: float = 0.01
    """Boxes that score less are dropped."""
    max_boxes: int = 1000
    """The most boxes returned."""
    min_box_area: float = 1000.0
    """Area of the smallest windows, pixels of the picture."""
    max_aspect_ratio: float = 3.0
    """Of the windows, either way."""
    edge_min_magnitude: float = 0.1
    """Edge pixels of less are ignored."""
    group_bend: float = 0.5
    """A group ends where its orientations have turned by this in sum, in units of pi."""
    group_min_magnitude: float = 0.5
    """Groups whose magnitudes sum to less are given to their neighbours."""

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "eta"):
            if not 0 < getattr(self, name) <= 1 or (name == "alpha" and self.alpha == 1):
                raise InputError(f"edge boxes: {name} is {getattr(self, name)}, expected a number between 0 and 1")
        for name in ("max_boxes", "finest_step"):
            if not getattr(self, name) >= 1:
                raise InputError(f"edge boxes: {name} is {getattr(self, name)}, expected at least 1")
        if not self.min_box_area >= 16:
            raise InputError(f"edge boxes: min_box_area is {self.min_box_area}, expected at least 16 pixels")
        if not self.max_aspect_ratio >= 1:
            raise InputError(f"edge boxes: max_aspect_ratio is {self.max_aspect_ratio}, expected at least 1")
        for name in ("gamma", "kappa", "min_score", "edge_min_magnitude", "group_bend", "group_min_magnitude"):
            if not getattr(self, name) >= 0:
                raise InputError(f"edge boxes: {name} is {getattr(self, name)}, expected a number >= 0")


@dataclasses.dataclass(frozen=True)
class EdgeBoxes(Immutable):
    """The proposer: edges of colour and, where there is one, depth; then their boxes."""

    edges: EdgesConfig = dataclasses.field(default_factory=EdgesConfig)
    search: EdgeBoxesConfig = dataclasses.field(default_factory=EdgeBoxesConfig)

    def __call__(self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None = None) -> Proposals:
        """Boxes of color (h, w, 3), RGB, and depth (h, w), metres, 0 where it is missing. See `find_edges`."""
        return edge_boxes(find_edges(color, depth, self.edges), self.search)


def edge_boxes(edges: Edges, config: EdgeBoxesConfig) -> Proposals:
    """Proposals of an edge map, in pixels of the picture that it was made from."""
    ids = group_edges(
        edges.magnitude, edges.orientation, config.edge_min_magnitude, config.group_bend, config.group_min_magnitude
    )
    groups = describe_groups(ids, edges.magnitude, edges.orientation)
    index = _index(
        np.where(edges.magnitude > config.edge_min_magnitude, edges.magnitude, 0),
        groups,
        affinities(groups, config.gamma),
        config.kappa,
    )
    windows = make_windows(ids.shape, config.alpha, config.min_box_area * edges.scale**2, config.max_aspect_ratio)
    boxes, scores = _search(windows, index, _shift(config.alpha), config.finest_step, config.min_score)
    order = np.argsort(-scores, kind="stable")
    kept = order[_suppress(boxes[order], config.beta, config.eta, config.max_boxes)]
    # The border of a scored box crosses no contour: what it holds begins a pixel inside, and ends before its last one.
    inner = boxes[kept] + np.array([1, 1, -1, -1])
    return make_proposals(inner / edges.scale, scores[kept])


class _Index(NamedTuple):
    """What makes the score of a box quick (section 3.3)."""

    group_sums: Array
    """(h + 1, w + 1): integral image of the groups' magnitudes, each at one pixel of its group."""
    pixel_sums: Array
    """(h + 1, w + 1): integral image of the edge pixels' magnitudes."""
    magnitude: Array
    """(n,): of the groups."""
    x: Ints
    """(n,): the pixel at which the group stands in `group_sums`."""
    y: Ints
    row_run: Ints
    """(h, w): number of the run of one id, along its row, that the pixel lies in ..."""
    row_group: Ints
    """... and that run's id."""
    column_run: Ints
    """(w, h): the same along columns."""
    column_group: Ints
    affinities: Affinities
    size_factor: Floats
    """(h + w,): 1 / (b_w + b_h)^kappa by b_w + b_h."""
    chain: Floats
    """(n,), scratch: strength of the strongest chain that ties the i-th group reached to the box's border."""
    reached: Ints
    """(n,), scratch: the groups reached."""
    place: Ints
    """(n,), scratch: the group's place in `reached` ..."""
    stamp: NDArray[np.int64]
    """... if this is the number, at [n], of the box being scored."""


def _index(magnitude: Floats, groups: Groups, ties: Affinities, kappa: float) -> _Index:
    """magnitude: (h, w), 0 where it does not count."""
    h, w = groups.ids.shape
    n = len(groups.magnitude)
    columns, rows = np.nonzero(groups.ids.T > 0)
    x, y = np.zeros(n, np.int32), np.zeros(n, np.int32)
    # Of the pixels of a group the last one stays.
    x[groups.ids[rows, columns]], y[groups.ids[rows, columns]] = columns, rows
    at = np.zeros((h, w))
    at[y[1:], x[1:]] = groups.magnitude[1:]
    half_sides = np.maximum(np.arange(h + w), 1.0)
    return _Index(
        _integral(at), _integral(magnitude), groups.magnitude, x, y, *_runs(groups.ids), *_runs(groups.ids.T), ties,
        (half_sides**-kappa).astype(np.float32), np.zeros(n, np.float32), np.zeros(n, np.int32), np.zeros(n, np.int32),
        np.zeros(n + 1, np.int64),
    )  # fmt: skip


def _integral(image: NDArray[Any]) -> Array:
    return np.pad(np.cumsum(np.cumsum(image, 0, dtype=np.float64), 1), ((1, 0), (1, 0)))


def _runs(ids: Ints) -> tuple[Ints, Ints]:
    """Numbers the runs of equal ids along each row: (h, w) -> the pixel's run (h, w), the run's id."""
    begins = np.ones(ids.shape, dtype=bool)
    begins[:, 1:] = ids[:, 1:] != ids[:, :-1]
    return (np.cumsum(begins) - 1).astype(np.int32).reshape(ids.shape), ids[begins]


@compiled
def _sum(integral: Array, x0: int, y0: int, x1: int, y1: int) -> float:
    """Sum over the pixels x0 to x1, y0 to y1, all included."""
    total: float = integral[y1 + 1, x1 + 1] - integral[y0, x1 + 1] - integral[y1 + 1, x0] + integral[y0, x0]
    return total


@compiled
def _score(index: _Index, x0: int, y0: int, x1: int, y1: int, least: float) -> float:
    """h_in of the box whose border runs through the pixels x0, y0, x1, y1 (eq. 2 to 4); 0 where it is below `least`."""
    b_w, b_h = (x1 - x0) // 2, (y1 - y0) // 2
    factor = index.size_factor[b_w + b_h]
    x_in, y_in = x0 + b_w // 2, y0 + b_h // 2
    score = _sum(index.group_sums, x0, y0, x1, y1) - _sum(index.pixel_sums, x_in, y_in, x_in + b_w, y_in + b_h)
    # What follows only takes away.
    if score * factor < least:
        return 0.0

    chain, reached, place, stamp = index.chain, index.reached, index.place, index.stamp
    xs, ys, magnitude = index.x, index.y, index.magnitude
    start, akin, affinity = index.affinities.start, index.affinities.group, index.affinities.value
    last = len(stamp) - 1
    stamp[last] += 1
    number = stamp[last]
    n = 0
    for group, run, line, low, high in (
        (index.row_group, index.row_run, y0, x0, x1),
        (index.row_group, index.row_run, y1, x0, x1),
        (index.column_group, index.column_run, x0, y0, y1),
        (index.column_group, index.column_run, x1, y0, y1),
    ):
        for k in range(run[line, low], run[line, high] + 1):
            j = group[k]
            if j > 0 and stamp[j] != number:
                reached[n], chain[n], stamp[j], place[j] = j, 1.0, number, n
                n += 1
    # w_b of a group is 1 less the strength of the strongest chain of affinities to a group on the border (eq. 4).
    i = 0
    while i < n:
        j = reached[i]
        strength = chain[i]
        again = n
        for k in range(start[j], start[j + 1]):
            tie = strength * affinity[k]
            if tie < LEAST_AFFINITY:
                continue
            q = akin[k]
            if stamp[q] == number:
                if tie > chain[place[q]]:
                    chain[place[q]] = tie
                    again = min(again, place[q])
            elif x0 <= xs[q] <= x1 and y0 <= ys[q] <= y1:
                reached[n], chain[n], stamp[q], place[q] = q, tie, number, n
                n += 1
        # A stronger chain to a group already followed is followed again.
        i = min(i + 1, again)
    for i in range(n):
        j = reached[i]
        if x0 <= xs[j] <= x1 and y0 <= ys[j] <= y1:
            score -= chain[i] * magnitude[j]
    score *= factor
    return score if score >= least else 0.0


def _shift(alpha: float) -> float:
    """The step of a window, as a share of its side, at which it overlaps itself by IoU alpha."""
    return (1 - alpha) / (1 + alpha)


def make_windows(shape: tuple[int, int], alpha: float, min_area: float, max_aspect: float) -> Ints:
    """The grid (n, 4) of x, y, w, h over position, scale and aspect ratio; neighbours overlap by IoU alpha (3.4)."""
    h, w = shape
    scale_step, aspect_step = math.sqrt(1 / alpha), (1 + alpha) / (2 * alpha)
    least = math.sqrt(min_area)
    scales = max(1, math.ceil(math.log(max(w, h) / least) / math.log(scale_step)))
    aspects = int(math.log(max_aspect) / math.log(aspect_step**2))
    grids = []
    for s in range(scales):
        for a in range(-aspects, aspects + 1):
            b_w, b_h = int(least * scale_step**s * aspect_step**a), int(least * scale_step**s / aspect_step**a)
            step_x, step_y = max(2, int(b_w * _shift(alpha))), max(2, int(b_h * _shift(alpha)))
            # One step beyond the border, where the window is cut: nothing next to it is passed by.
            xs, ys = range(0, w - b_w + step_x, step_x), range(0, h - b_h + step_y, step_y)
            x, y = np.meshgrid(xs, ys, indexing="ij")
            grids.append(np.stack([x, y, np.full_like(x, b_w), np.full_like(x, b_h)], -1).reshape(-1, 4))
    return np.concatenate(grids).astype(np.int32)


@compiled
def _search(windows: Ints, index: _Index, shift: float, finest: int, least: float) -> tuple[Ints, Floats]:
    """Scores windows (n, 4), refines those that score, and returns these (m, 4) with their scores (m,)."""
    h, w = index.row_run.shape
    boxes, scores = np.empty((len(windows), 4), np.int32), np.empty(len(windows), np.float32)
    m = 0
    edges = np.empty(4, np.int64)
    for i in range(len(windows)):
        x, y, b_w, b_h = windows[i, 0], windows[i, 1], windows[i, 2], windows[i, 3]
        edges[0], edges[1] = min(x, w - 1), min(y, h - 1)
        edges[2], edges[3] = min(x + b_w, w - 1), min(y + b_h, h - 1)
        score = _score(index, edges[0], edges[1], edges[2], edges[3], least)
        if score > 0:
            score = _refine(index, edges, score, shift, finest, least)
            boxes[m, 0], boxes[m, 1] = edges[0], edges[1]
            boxes[m, 2], boxes[m, 3] = edges[2] - edges[0], edges[3] - edges[1]
            scores[m] = score
            m += 1
    return boxes[:m].copy(), scores[:m].copy()


@compiled
def _refine(index: _Index, edges: NDArray[np.int64], score: float, shift: float, finest: int, least: float) -> float:
    """Moves each border, first outwards, else inwards, where that scores more; steps halve down to `finest` (3.4).

    edges: (4,) x0, y0, x1, y1, changed in place. Returns the new score.
    """
    h, w = index.row_run.shape
    step_x, step_y = int((edges[2] - edges[0]) * shift) // 2, int((edges[3] - edges[1]) * shift) // 2
    tried = np.empty(4, np.int64)
    while max(step_x, step_y) >= finest:
        for side in (1, 3, 0, 2):
            step = max(1, step_x if side % 2 == 0 else step_y)
            outwards = -step if side < 2 else step
            for move in (outwards, -outwards):
                tried[:] = edges
                tried[side] = min(max(tried[side] + move, 0), (h if side % 2 else w) - 1)
                if tried[0] >= tried[2] or tried[1] >= tried[3]:
                    continue
                tried_score = _score(index, tried[0], tried[1], tried[2], tried[3], least)
                if tried_score > score:
                    edges[side], score = tried[side], tried_score
                    break
        step_x, step_y = step_x // 2, step_y // 2
    return score


@compiled
def _suppress(boxes: Ints, beta: float, eta: float, most: int) -> NDArray[np.int64]:
    """Indices of the boxes (n, 4), best first, that overlap none kept before by more than beta; at most `most`."""
    kept = np.empty(min(most, len(boxes)), np.int64)
    n = 0
    for i in range(len(boxes)):
        if n == len(kept):
            break
        x0, y0, w0, h0 = boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3]
        area = w0 * h0
        keep = True
        for k in range(n):
            j = kept[k]
            x, y, w, h = boxes[j, 0], boxes[j, 1], boxes[j, 2], boxes[j, 3]
            width = min(x0 + w0, x + w) - max(x0, x)
            height = min(y0 + h0, y + h) - max(y0, y)
            if width > 0 and height > 0:
                common = width * height
                if common > beta * (area + w * h - common):
                    keep = False
                    break
        if keep:
            kept[n] = i
            n += 1
            if beta > 0.5:
                beta *= eta
    return kept[:n].copy()
