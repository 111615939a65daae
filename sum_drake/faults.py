"""What goes wrong in a run because a scenario says so, and what the belief made of it."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake.assets import InputError
from sum_drake.consistency import agree
from sum_drake.evaluation import Truth, where_is
from sum_drake.existence import LIKELY
from sum_drake.geometry import rotation_from_quaternion, transform
from sum_drake.rendering import predicted_box
from sum_drake.types import Array, Attempt, Detection, Frame, Immutable, Perception, Region, readonly

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

KINDS = {
    "slipped": "the fingers of the first lift after it let go for a moment",
    "dropped": "the fingers let go for a moment while the first object after it is carried",
    "camera": "its picture is black and without depth",
    "false_detection": "in it and in the next two the detector is sure of an object that is not there",
    "swept": "after it a hand pushes an object aside",
    "taken": "after it a hand takes an object away",
    "added": "after it a hand drops one more object onto the table",
}
"""Kinds of fault, by what happens at an observation or after it."""
GRIP, HAND = ("slipped", "dropped"), ("swept", "taken", "added")
"""Kinds that are faults of the fingers, and those that are a hand's doing."""
NEED_ABSENT = ("added", "false_detection")
"""Kinds that need an object which is not on the table."""
REPEATED = 3
"""Observations in which a false detection is made."""
SURE = 0.9
"""p(b | z) and p(o | b, z) of a false detection."""


@dataclasses.dataclass
class FaultConfig:
    """One thing that goes wrong."""

    kind: str = ""
    """One of KINDS."""
    observation: int = 0
    """At which, or after which."""
    object: str = ""
    """Label of what is swept, taken, added or falsely detected; empty: drawn by the seed."""


@dataclasses.dataclass(frozen=True)
class HandAct(Immutable):
    """What a hand did, for the scorer alone."""

    fault: int
    """Which of the scenario's, from 0."""
    kind: str
    observation: int
    """The last one before it."""
    time: float
    label: str


def absent_labels(faults: Sequence[FaultConfig], labels: Sequence[str], poured: Sequence[str], seed: int) -> list[str]:
    """For each fault the label that it needs of an object that is not on the table; "" for one that needs none.

    labels: all there are; poured: those on the table. What is named stays; others are drawn, no label twice. Raises
    InputError for one that is named but on the table, or twice, and where none is left.
    """
    named = [fault.object for fault in faults if fault.kind in NEED_ABSENT and fault.object]
    for label in named:
        if label in poured:
            raise InputError(f"faults: {label} is on the table; expected an object that is not poured")
        if named.count(label) > 1:
            raise InputError(f"faults: {label} is named twice; expected one fault an object that is not there")
    rng = np.random.default_rng(seed)
    left = [label for label in labels if label not in poured and label not in {fault.object for fault in faults}]
    left = [left[i] for i in rng.permutation(len(left))]
    found = []
    for fault in faults:
        if fault.kind not in NEED_ABSENT:
            found.append("")
        elif fault.object:
            found.append(fault.object)
        elif left:
            found.append(left.pop())
        else:
            raise InputError(f"faults: no label is left for kind {fault.kind}; expected fewer objects")
    return found


def false_detection(label: str, frame: Frame, table: Region, vertices: Array, rng: np.random.Generator) -> Detection:
    """A sure detection of an object that might lie anywhere on the table. vertices: (v, 3) of its mesh."""
    p_WO = table.p_W + table.half_extents * [*rng.uniform(-0.6, 0.6, 2), -0.9]
    box = predicted_box(vertices, transform(rotation_from_quaternion(rng.normal(size=4)), p_WO), frame)
    return Detection(box, SURE, ((label, SURE),))


def blinded(frame: Frame) -> Frame:
    """The frame of a camera that failed: black and without depth."""
    black = readonly(np.zeros_like(frame.color), np.uint8)
    return dataclasses.replace(frame, color=black, depth=readonly(np.zeros_like(frame.depth), np.float32))


def score_faults(
    faults: Sequence[FaultConfig],
    labels: Sequence[str],
    acts: Sequence[HandAct],
    perceptions: Sequence[Perception],
    attempts: Sequence[Attempt],
    truths: Sequence[Truth],
    regions: Mapping[str, Region],
    catalogue: "Catalogue",
) -> list[dict[str, Any]]:
    """The rows of `faults` in summary.json.

    labels: of `absent_labels`; truths: of observations 0, 1, ... Each row tells what happened to which object, after
    how many observations the belief had it right (null: not while the run went on), and in words what it then said.
    """
    scorer, struck = _Scorer(perceptions, truths, regions, catalogue), _struck(faults, attempts)
    rows = []
    for i, (fault, absent) in enumerate(zip(faults, labels, strict=True)):
        row = {"kind": fault.kind, "observation": fault.observation, "object": absent or None}
        begun: int | None = None
        if fault.kind in HAND:
            act = next((act for act in acts if act.fault == i), None)
            if act is not None:
                begun, row["object"] = act.observation, act.label
        elif fault.kind in GRIP:
            attempt = struck.get(i)
            if attempt is not None:
                begun, row["object"] = attempt.step, attempt.label
        elif len(perceptions) > fault.observation:
            begun = fault.observation
        row |= {"observation": fault.observation if begun is None else begun, "happened": begun is not None}
        after, words = (None, "it did not come to it") if begun is None else scorer.judge(fault.kind, begun, row)
        rows.append(row | {"dealt_with_after": after, "belief": words})
    return rows


def _struck(faults: Sequence[FaultConfig], attempts: Sequence[Attempt]) -> dict[int, Attempt]:
    """The attempts that faults of the fingers struck, by fault: each in its turn the first that is left."""
    left, found = [a for a in attempts if a.action is not None and a.reason != "cut_off"], {}
    carried = [
        a for a in left
        if a.reason == "lost_in_transport" or (a.action is not None and (a.action.released or a.action.held_lift))
    ]  # fmt: skip
    # A motion that was broken off before the hand held anything was no lift.
    lifted = [a for a in left if a.reason not in ("unexpected_effort", "tracking_error") or a in carried]
    for i, fault in sorted(enumerate(faults), key=lambda one: (one[1].observation, one[0])):
        of = {"slipped": lifted, "dropped": carried}.get(fault.kind, [])
        attempt = next((a for a in of if a.step >= fault.observation), None)
        if attempt is not None:
            of.remove(attempt)
            found[i] = attempt
    return found


@dataclasses.dataclass(frozen=True, eq=False)
class _Scorer:
    perceptions: Sequence[Perception]
    truths: Sequence[Truth]
    regions: Mapping[str, Region]
    catalogue: "Catalogue"

    def judge(self, kind: str, begun: int, row: Mapping[str, Any]) -> tuple[int | None, str]:
        if kind == "camera":
            return self._kept(begun)
        label = row["object"]
        false = kind == "false_detection"
        first = begun if false else begun + 1
        last = min(begun + REPEATED, len(self.perceptions)) if false else len(self.perceptions)
        # A look that shows nothing settles nothing.
        seeing = [step for step in range(first, last) if self.perceptions[step].frame.depth.any()]
        for i, step in enumerate(seeing):
            words = [self._right(k, label, first) for k in (seeing[i:] if false else seeing[i : i + 2])]
            if all(words):  # Right once might be luck.
                return step - begun + false, words[0]
        if first >= len(self.perceptions):
            return None, "the run was over before the next observation"
        return None, self._wrong(last - 1, label)

    def _right(self, step: int, label: str, first: int) -> str:
        """What the belief says of an object after an observation, if it is right; else empty."""
        tracks = [track for track in self.perceptions[step].posterior.tracks if track.label == label]
        X_WO = dict(self.truths[step].X_WOs).get(label)
        if X_WO is None or where_is(X_WO, self.regions) != "table":
            fallen = [track for track in tracks if track.accepted and self._is_right(step, label, track.X_WO)]
            if fallen:
                return f"found where it fell, {fallen[0].probability:.2f}"
            ended = [gone.reason for past in self.perceptions[first : step + 1] for gone in past.posterior.gone
                     if gone.label == label]  # fmt: skip
            if any(track.probability >= LIKELY for track in tracks):
                return ""
            return f"gone: {ended[-1]}" if ended else "not believed in"
        for track in tracks:
            if track.accepted and self._is_right(step, label, track.X_WO):
                return f"found again, {track.probability:.2f}"
        return ""

    def _wrong(self, step: int, label: str) -> str:
        tracks = [track for track in self.perceptions[step].posterior.tracks if track.label == label]
        if not tracks:
            return "not found"
        best = max(tracks, key=lambda track: track.probability)
        where = "where it is" if self._is_right(step, label, best.X_WO) else "where it is not"
        return f"{'accepted' if best.accepted else 'held'} {where}, {best.probability:.2f}"

    def _kept(self, begun: int) -> tuple[int | None, str]:
        """What was known before the camera failed, and whether it still is once it works."""
        if begun + 1 >= len(self.perceptions):
            return None, "the run was over before the next observation"
        before = self.perceptions[begun].prior.tracks
        again = self.perceptions[begun + 1].posterior.tracks
        known = [track for track in before if track.accepted and self._is_right(begun, track.label, track.X_WO)]
        kept = [
            track.label
            for track in known
            if any(t.accepted and t.label == track.label and self._is_right(begun + 1, t.label, t.X_WO) for t in again)
        ]
        if not known:
            return None, "nothing was known before"
        return 1 if len(kept) == len(known) else None, f"{len(kept)} of {len(known)} known before are known after"

    def _is_right(self, step: int, label: str, X_WO: Array) -> bool:
        truth = dict(self.truths[step].X_WOs).get(label)
        return truth is not None and agree(X_WO, truth, label, self.catalogue)
