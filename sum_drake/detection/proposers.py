"""The proposers of this package, by name."""

from collections.abc import Callable, Mapping

from sum_drake.detection.proposals import Proposer

LEARNED = "learned"
"""The network's own proposals, which need its feature map: see `inference.Detector`."""


def _edge_boxes() -> Proposer:
    # numba takes a second to import: only who proposes pays for it.
    from sum_drake.detection.edge_boxes import EdgeBoxes

    return EdgeBoxes()


def _edge_boxes_full() -> Proposer:
    from sum_drake.detection.edge_boxes import EdgeBoxes
    from sum_drake.detection.edges import EdgesConfig

    return EdgeBoxes(EdgesConfig(scale=1.0))


def _depth_segments() -> Proposer:
    from sum_drake.detection.depth_segments import DepthSegments

    return DepthSegments()


def _edge_boxes_and_segments() -> Proposer:
    from sum_drake.detection.depth_segments import EdgeBoxesAndSegments

    return EdgeBoxesAndSegments()


PROPOSERS: Mapping[str, Callable[[], Proposer]] = {
    "edge_boxes": _edge_boxes,
    "edge_boxes_full": _edge_boxes_full,
    "depth_segments": _depth_segments,
    "edge_boxes_and_segments": _edge_boxes_and_segments,
}
"""Proposers by name. `edge_boxes` looks at edges at three quarters of the picture's size, `edge_boxes_full` at all."""
