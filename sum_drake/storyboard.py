"""What a film of a run shows when: the robot as its joints were logged, things where it believed them."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from sum_drake.geometry import apply, inverse, shifted
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue
from sum_drake.robot import ARM_JOINTS
from sum_drake.runlog_reader import RunRecord
from sum_drake.types import Array, Attempt, Perception, PickPlace, Region, Track

BELIEVED = 0.5
"""Least probability of a track that is shown, where it was not accepted: a look may have seen nothing."""
_DOING = {
    "approach": "on the way to",
    "reach": "reaching for",
    "close": "gripping",
    "lift": "lifting",
    "transport": "carrying",
    "lower": "setting down",
    "open": "letting go of",
    "retreat": "drawing back from",
    "return": "on the way back from",
    "shake": "shaking off",
    "weigh": "weighing the hand after",
}


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """One picture of the film."""

    time: float
    """Simulated, seconds."""
    positions: Array
    """(n,) of the log's joints."""
    X_WOs: Mapping[int, Array]
    """Poses (4, 4) of the tracks that are shown, by id."""
    caption: str


@dataclasses.dataclass(frozen=True, eq=False)
class Storyboard:
    """The film of a run, before anything is rendered."""

    labels: Mapping[int, str]
    """Of every track that any shot shows, by id."""
    shots: tuple[Shot, ...]
    speed: float
    """How many times as fast as it was, at `fps` shots a second."""


def storyboard(
    record: RunRecord, catalogue: Catalogue, regions: Mapping[str, Region], *, shots: int = 180, fps: float = 10.0
) -> Storyboard:
    """At most `shots` pictures, evenly over the time for which joints were logged; none where none were.

    Things stand where the last look left them. What is lifted moves with the hand until that opens or is found empty;
    then it lies on the floor of its region, or, where it was lost on the way, nowhere until it is seen again.
    """
    chosen = np.unique(np.linspace(0, len(record.joint_times) - 1, min(shots, len(record.joint_times))).astype(int))
    if len(chosen) == 0:
        return Storyboard({}, (), 1.0)
    times, qs = record.joint_times[chosen], record.joint_positions[chosen]
    names = [joint.name for joint in ARM_JOINTS]
    X_WGs = None
    if set(names) <= set(record.joint_names):
        X_WGs = Arm().forward_many(qs[:, [record.joint_names.index(name) for name in names]])
    handled = [_Handled.of(record, time, attempt, catalogue, regions) for time, attempt in record.attempts]
    moved = [one for one in handled if one is not None]
    told = []
    for i, time in enumerate(times):
        look = next((look for look in reversed(record.perceptions) if look.frame.time <= time), None)
        X_WOs = {} if look is None else {track.id: track.X_WO for track in _shown(look)}
        for one in moved:
            one.pose(X_WOs, float(time), look, None if X_WGs is None else X_WGs[i])
        told.append(Shot(float(time), qs[i], X_WOs, _caption(record, float(time), look)))
    shown = {track.id: track.label for look in record.perceptions for track in look.posterior.tracks}
    seen = {id for shot in told for id in shot.X_WOs}
    labels = {id: label for id, label in shown.items() if id in seen and label in catalogue}
    span = float(times[-1] - times[0])
    return Storyboard(labels, tuple(told), max(span * fps / max(len(chosen) - 1, 1), 1e-9))


@dataclasses.dataclass(frozen=True, eq=False)
class _Handled:
    """The way of one object through an attempt for which the arm set out."""

    track: Track
    action: PickPlace
    lifted: float
    """When it left its place; infinite where it never did."""
    let_go: float
    """When the hand opened over the place, or was found empty."""
    seen_again: float
    """When the look after it was taken; infinite where there is none."""
    X_WO_rest: Array | None
    """Where it then is; None: not known."""
    stays: bool
    """Whether it is there for good: no look shows it any more."""

    @staticmethod
    def of(
        record: RunRecord, time: float, attempt: Attempt, catalogue: Catalogue, regions: Mapping[str, Region]
    ) -> "_Handled | None":
        action = attempt.action
        look = next((look for look in record.perceptions if look.step == attempt.step), None)
        if action is None or look is None:
            return None
        track = next((track for track in look.posterior.tracks if track.id == attempt.track), None)
        if track is None or track.label not in catalogue:
            return None
        begun, stopped = [], []
        for event in record.events:
            if look.frame.time <= event["time"] <= time:
                if event["name"] == "segment_begun":
                    begun.append((event["time"], event["detail"].get("segment")))
                elif event["name"] == "motion_stopped":
                    stopped.append(event["time"])
        lifted = next((at for at, segment in begun if segment == "lift"), np.inf)
        ends = [at for at, segment in begun if segment == "open" and at > lifted] + [
            at for at in stopped if at > lifted
        ]
        let_go = min(ends, default=np.inf)
        after = next((one for one in record.perceptions if one.step > look.step), None)
        placed = any(
            gone.track == track.id and gone.reason == "placed" for gone in (after.posterior.gone if after else ())
        )
        rest: Array | None = None
        if action.released:
            rest = _set_down(track.label, action, catalogue, regions)
        elif action.held_lift is False:
            rest = track.X_WO
        seen_again = after.frame.time if after is not None else np.inf
        return _Handled(track, action, lifted, let_go, seen_again, rest, placed and action.released)

    def pose(self, X_WOs: dict[int, Array], time: float, look: Perception | None, X_WG: Array | None) -> None:
        """Puts the object where it is at a time into the poses of what is shown."""
        if time < self.lifted or look is None or (time >= self.seen_again and not self.stays):
            return
        if time >= self.let_go:
            if self.X_WO_rest is None:
                X_WOs.pop(self.track.id, None)
            else:
                X_WOs[self.track.id] = self.X_WO_rest
        elif X_WG is not None:
            X_WOs[self.track.id] = X_WG @ inverse(self.action.X_WG_pick) @ self.track.X_WO


def _shown(look: Perception) -> list[Track]:
    return [track for track in look.posterior.tracks if track.accepted or track.probability >= BELIEVED]


def _set_down(label: str, action: PickPlace, catalogue: Catalogue, regions: Mapping[str, Region]) -> Array:
    """Where it was let go, with its lowest point on the region's floor, which it falls to."""
    X_WO = action.X_WO_place
    if action.region not in regions:
        return X_WO
    lowest = float(apply(X_WO, np.asarray(catalogue[label].load_mesh().vertices))[:, 2].min())
    return shifted(X_WO, np.array([0.0, 0.0, regions[action.region].floor_height - lowest]))


def _caption(record: RunRecord, time: float, look: Perception | None) -> str:
    """What the robot is about, as a line."""
    step = "" if look is None else f"after look {look.step}: "
    last = next((event for event in reversed(record.events) if event["time"] <= time), None)
    if last is not None and last["name"] == "run_ended":
        doing = "the run is over"
    elif last is not None and last["name"] == "motion_stopped":
        doing = f"stopped: {str(last['detail'].get('cause')).replace('_', ' ')}"
    elif last is None or last["name"] != "segment_begun":
        doing = "looking and thinking"
    else:
        segment = str(last["detail"].get("segment"))
        about = next((a for at, a in record.attempts if at >= time and a.action is not None), None)
        target = about.label if about is not None and look is not None and about.step == look.step else "something"
        doing = f"{_DOING.get(segment, segment)} {target}"
    return f"{time:.1f} s  {step}{doing}"
