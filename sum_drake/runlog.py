"""The log of a run, written: one MCAP file that Foxglove opens and that `runlog_reader` reads back.

What a person looks at is written in Foxglove's schemas, what a program needs to go on from as JSON records of our own:

    /head_camera/color        foxglove.CompressedImage   PNG
    /head_camera/depth        foxglove.RawImage          32FC1, metres, 0 where the sensor returned nothing
    /head_camera/calibration  foxglove.CameraCalibration
    /head_camera/detections   foxglove.ImageAnnotations
    /tf                       foxglove.FrameTransforms   the camera and every track in the world; the hand
    /scene                    foxglove.SceneUpdate       axes and names of the tracks
    /particles                foxglove.PosesInFrame      beliefs, thinned
    /joint_states             foxglove.JointStates
    /perception               sum_drake.Perception       JSON, without the pictures, beliefs thinned
    /associations             sum_drake.Associations     JSON
    /belief                   sum_drake.Belief           JSON, the probability of each track, to be plotted
    /plan                     sum_drake.Motion           JSON, a motion that was planned, thinned
    /grasps                   sum_drake.GraspCandidates  JSON, what was considered for the attempt that follows
    /grasps/scene             foxglove.SceneUpdate       the same as lines, coloured by what became of them
    /attempt                  sum_drake.Attempt          JSON
    /event                    sum_drake.Event            JSON

Colour and depth are lossless, so that perception can be run again on them. Log times are simulation time. The writer
puts whole chunks into the file, one after every record but joints and hand, which go with the next: what a killed
process leaves can be read up to its last chunk by any reader that goes through a file from its start.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from sum_drake.encoders import color_image, quaternion, raw_image, timestamp, transform, vector, without_pictures
from sum_drake.jsonio import encode
from sum_drake.mcap_log import McapLog, nanoseconds
from sum_drake.resampling import systematic
from sum_drake.types import (
    Array,
    Associations,
    Attempt,
    Frame,
    GraspCandidates,
    Motion,
    Perception,
    PoseBelief,
    SceneBelief,
    Track,
    Trajectory,
    readonly,
)

SCHEMA = "sum-drake/log/1"
CAMERA = "head_camera"
HAND_FRAME = "hand"
DIGITS = 6
"""Decimals of planned motions and of the hands of candidate grasps: micrometres and microradians."""
PLAN_RATE, PLAN_POINTS = 50.0, 200
"""Of a segment so many points a second are kept, and at most so many."""
HAND_LINE = 0.05
"""Length of the line that stands for a hand, from between the finger tips back along its approach, metres."""
FATE_COLORS = {
    "chosen": (0.0, 0.8, 0.2, 1.0),
    "": (0.2, 0.5, 1.0, 0.8),
    "ranked": (1.0, 0.6, 0.0, 0.9),
    "dropped": (0.9, 0.1, 0.1, 0.35),
}
"""Of `/grasps/scene`: taken, ranked and not looked at, given up by the planner, dropped before."""


def thin(belief: PoseBelief, count: int) -> PoseBelief:
    """At most `count` particles that stand for the belief: its quantiles, so no draw."""
    if len(belief.weights) <= count:
        return belief
    chosen = systematic(belief.weights, count, 0.5)
    return PoseBelief(readonly(belief.X_WOs[chosen]), readonly(np.full(count, 1.0 / count)))


def _thin_scene(scene: SceneBelief, count: int) -> SceneBelief:
    tracks = tuple(dataclasses.replace(track, belief=thin(track.belief, count)) for track in scene.tracks)
    return dataclasses.replace(scene, tracks=tracks)


def _thin_trajectory(trajectory: Trajectory) -> Trajectory:
    """Some of its points, both ends among them."""
    times = trajectory.times
    count = min(PLAN_POINTS, max(2, int(np.ceil(times[-1] * PLAN_RATE)) + 1))
    if len(times) <= count:
        return trajectory
    kept = np.unique(np.searchsorted(times, np.linspace(0.0, times[-1], count)))
    return Trajectory(*(readonly(part[kept]) for part in (times, trajectory.positions, trajectory.velocities)))


def lean_candidates(candidates: GraspCandidates) -> dict[str, Any]:
    """As plain data: hands as x, y, z and quaternion w, x, y, z; fates as indices into causes."""
    X_WGs = candidates.X_WGs
    quaternions = Rotation.from_matrix(X_WGs[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]] if len(X_WGs) else np.empty((0, 4))
    causes = sorted(set(candidates.fates))
    return {
        "causes": causes,
        "fates": [causes.index(fate) for fate in candidates.fates],
        "hands": np.round(np.hstack([X_WGs[:, :3, 3], quaternions]), DIGITS).tolist(),
        "scores": np.round(candidates.scores, DIGITS).tolist(),
    }


def candidates_of(data: Mapping[str, Any]) -> GraspCandidates:
    """The inverse of `lean_candidates`. Raises ValueError, KeyError, TypeError or IndexError for other data."""
    hands = np.reshape(np.array(data["hands"], dtype=np.float64), (-1, 7))
    X_WGs = np.tile(np.eye(4), (len(hands), 1, 1))
    if len(hands):
        X_WGs[:, :3, :3], X_WGs[:, :3, 3] = Rotation.from_quat(hands[:, [4, 5, 6, 3]]).as_matrix(), hands[:, :3]
    fates = tuple(str(data["causes"][i]) for i in data["fates"])
    if len(fates) != len(hands) or len(data["scores"]) > len(hands):
        raise ValueError(f"{len(fates)} fates and {len(data['scores'])} scores of {len(hands)} hands")
    return GraspCandidates(readonly(X_WGs), fates, readonly(data["scores"]))


def _track_frame(track: Track) -> str:
    return f"track_{track.id}_{track.label}"


class RunLogWriter:
    """Writes a run's log; a context manager. Raises InputError where the file cannot be made.

    Args:
        path: the file; one that exists is replaced.
        metadata: words about the run (seed, scenario), readable from the log without its folder.
        particles: how many particles of each belief are kept.
    """

    def __init__(self, path: Path, *, metadata: Mapping[str, str] | None = None, particles: int = 64) -> None:
        from foxglove import channels

        self.last_step = -1
        """Step of the perception record written last."""
        self.attempts = 0
        """How many attempts were written."""
        self.last_motion = -1
        """Id of the motion written last."""
        self._particles = particles
        self._joint_time = -np.inf
        self._event_time, self._last_events = -np.inf, dict[str, Any]()
        self.file = file = McapLog(path, metadata={"schema": SCHEMA, **(metadata or {})})
        """The file itself, for further topics."""
        context = file.context

        def json_channel(topic: str, title: str, **schema: Any) -> Any:
            return file.json_channel(topic, {"title": title, **schema})

        self._color = channels.CompressedImageChannel(file.claim(f"/{CAMERA}/color"), context=context)
        self._depth = channels.RawImageChannel(file.claim(f"/{CAMERA}/depth"), context=context)
        self._calibration = channels.CameraCalibrationChannel(file.claim(f"/{CAMERA}/calibration"), context=context)
        self._detections = channels.ImageAnnotationsChannel(file.claim(f"/{CAMERA}/detections"), context=context)
        self._transforms = channels.FrameTransformsChannel(file.claim("/tf"), context=context)
        self._scene = channels.SceneUpdateChannel(file.claim("/scene"), context=context)
        self._poses = channels.PosesInFrameChannel(file.claim("/particles"), context=context)
        self._joint_states = channels.JointStatesChannel(file.claim("/joint_states"), context=context)
        self._perception = json_channel("/perception", "sum_drake.Perception")
        self._associations = json_channel("/associations", "sum_drake.Associations")
        self._belief = json_channel("/belief", "sum_drake.Belief", additionalProperties={"type": "number"})
        self._plan = json_channel("/plan", "sum_drake.Motion")
        self._grasps = json_channel("/grasps", "sum_drake.GraspCandidates")
        self._grasp_scene = channels.SceneUpdateChannel(file.claim("/grasps/scene"), context=context)
        self._attempt = json_channel("/attempt", "sum_drake.Attempt")
        self._event = json_channel("/event", "sum_drake.Event")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the file; a log without this is readable all the same, and reads as cut off."""
        self.file.close()

    def write_perception(self, perception: Perception) -> None:
        """One observation: its pictures, then what is shown of it, then the record."""
        frame = perception.frame
        self._write_frame(frame)
        self._write_view(perception)
        lean = dataclasses.replace(
            perception,
            frame=without_pictures(frame),
            prior=_thin_scene(perception.prior, self._particles),
            posterior=_thin_scene(perception.posterior, self._particles),
        )
        pairs = Associations(perception.step, perception.associations)
        self._associations.log(encode(pairs), log_time=nanoseconds(frame.time))
        self._belief.log(
            {f"{track.label}_{track.id}": track.probability for track in perception.posterior.tracks},
            log_time=nanoseconds(frame.time),
        )
        # Last: a record that can be read has its pictures before it.
        self._perception.log(encode(lean), log_time=nanoseconds(frame.time))
        self.file.flush()
        self.last_step = perception.step

    def write_attempt(self, time: float, attempt: Attempt) -> None:
        """One attempt at one object, at simulation time `time`, and the grasps that were considered for it."""
        if attempt.candidates is not None:
            self._write_candidates(time, attempt, attempt.candidates)
        self._attempt.log(encode(attempt), log_time=nanoseconds(time))
        self.file.flush()
        self.attempts += 1

    def write_event(self, time: float, name: str, detail: Mapping[str, Any] | None = None) -> None:
        """Anything else worth knowing: `name` and plain data."""
        said = encode(dict(detail or {}))
        self._event.log({"time": time, "name": name, "detail": said}, log_time=nanoseconds(time))
        self.file.flush()
        self._event_time, self._last_events[name] = time, said

    def write_change(self, time: float, name: str, detail: Mapping[str, Any]) -> None:
        """An event, unless it is the last of its name once more, or a time is told again that the log has passed."""
        if time >= self._event_time and encode(dict(detail)) != self._last_events.get(name):
            self.write_event(time, name, detail)

    def write_motion(self, time: float, motion: Motion, names: Sequence[str]) -> None:
        """A motion as it was planned, of joints with these names, unless it, or a later one, was written before."""
        if motion.id <= self.last_motion:
            return
        segments = tuple(
            dataclasses.replace(segment, trajectory=_thin_trajectory(segment.trajectory)) for segment in motion.segments
        )
        said = encode(dataclasses.replace(motion, segments=segments), lambda number: round(float(number), DIGITS))
        self._plan.log({**said, "joints": list(names)}, log_time=nanoseconds(time))
        self.file.flush()
        self.last_motion = motion.id

    def write_joint_state(self, time: float, names: Sequence[str], positions: Array, X_WG: Array | None = None) -> None:
        """Measured joint positions (n,), rad or m, in the order of `names`, unless the log has passed that time.

        X_WG: (4, 4), where they have the hand.
        """
        from foxglove import messages

        if time <= self._joint_time:
            return
        self._joint_time = time
        joints = [
            messages.JointState(name=name, position=float(position))
            for name, position in zip(names, positions, strict=True)
        ]
        self._joint_states.log(
            messages.JointStates(timestamp=timestamp(time), joints=joints), log_time=nanoseconds(time)
        )
        if X_WG is not None:
            self._transforms.log(
                messages.FrameTransforms(transforms=[transform(X_WG, HAND_FRAME, time)]), log_time=nanoseconds(time)
            )

    def _write_candidates(self, time: float, attempt: Attempt, candidates: GraspCandidates) -> None:
        from foxglove import messages

        said = {"step": attempt.step, "track": attempt.track, "label": attempt.label, **lean_candidates(candidates)}
        self._grasps.log(said, log_time=nanoseconds(time))
        stamp = timestamp(time)
        points, colors = [], []
        for X_WG, fate, ranked in zip(
            candidates.X_WGs, candidates.fates, np.arange(len(candidates.fates)) < len(candidates.scores), strict=True
        ):
            color = FATE_COLORS["chosen" if fate == "chosen" else "" if not fate else "ranked" if ranked else "dropped"]
            for p_WQ in (X_WG[:3, 3], X_WG[:3, 3] - HAND_LINE * X_WG[:3, 0]):
                points.append(messages.Point3(x=float(p_WQ[0]), y=float(p_WQ[1]), z=float(p_WQ[2])))
                colors.append(messages.Color(**dict(zip("rgba", color, strict=True))))
        lines = messages.LinePrimitive(
            type=messages.LinePrimitiveLineType.LineList, thickness=2.0, scale_invariant=True, points=points,
            colors=colors,
        )  # fmt: skip
        entity = messages.SceneEntity(timestamp=stamp, frame_id="world", id="grasps", lines=[lines])
        self._grasp_scene.log(messages.SceneUpdate(entities=[entity]), log_time=nanoseconds(time))

    def _write_frame(self, frame: Frame) -> None:
        from foxglove import messages

        stamp, log_time = timestamp(frame.time), nanoseconds(frame.time)
        self._color.log(color_image(frame.color, frame.time, CAMERA), log_time=log_time)
        self._depth.log(raw_image(frame.depth, frame.time, CAMERA), log_time=log_time)
        c = frame.camera
        self._calibration.log(
            messages.CameraCalibration(
                timestamp=stamp, frame_id=CAMERA, width=c.width, height=c.height,
                K=[c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0],
                R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                P=[c.fx, 0.0, c.cx, 0.0, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            ),
            log_time=log_time,
        )  # fmt: skip

    def _write_view(self, perception: Perception) -> None:
        """What Foxglove shows beside the pictures: boxes, frames, axes and particles."""
        from foxglove import messages

        frame, tracks = perception.frame, perception.posterior.tracks
        stamp, log_time = timestamp(frame.time), nanoseconds(frame.time)

        outlines, texts = [], []
        for detection in perception.detections:
            x, y, w, h = detection.box
            corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
            outlines.append(
                messages.PointsAnnotation(
                    timestamp=stamp, type=messages.PointsAnnotationType.LineLoop, thickness=2.0,
                    points=[messages.Point2(x=u, y=v) for u, v in corners],
                    outline_color=messages.Color(r=1.0, g=0.8, b=0.0, a=1.0),
                )
            )  # fmt: skip
            words = ", ".join(f"{label} {probability:.2f}" for label, probability in detection.p_labels[:3])
            texts.append(
                messages.TextAnnotation(
                    timestamp=stamp, position=messages.Point2(x=x, y=y), text=words, font_size=12.0,
                    text_color=messages.Color(r=0.0, g=0.0, b=0.0, a=1.0),
                    background_color=messages.Color(r=1.0, g=0.8, b=0.0, a=1.0),
                )
            )  # fmt: skip
        self._detections.log(
            messages.ImageAnnotations(timestamp=stamp, points=outlines, texts=texts), log_time=log_time
        )

        transforms = [(CAMERA, frame.X_WC)] + [(_track_frame(track), track.X_WO) for track in tracks]
        self._transforms.log(
            messages.FrameTransforms(transforms=[transform(X, name, frame.time) for name, X in transforms]),
            log_time=log_time,
        )
        deletions = [messages.SceneEntityDeletion(timestamp=stamp, type=messages.SceneEntityDeletionType.All)]
        self._scene.log(
            messages.SceneUpdate(deletions=deletions, entities=[_entity(track, stamp) for track in tracks]),
            log_time=log_time,
        )
        self._poses.log(
            messages.PosesInFrame(
                timestamp=stamp,
                frame_id="world",
                poses=[_pose(X) for track in tracks for X in thin(track.belief, self._particles).X_WOs],
            ),
            log_time=log_time,
        )


def _pose(X: Array) -> Any:
    from foxglove import messages

    return messages.Pose(position=vector(X[:3, 3]), orientation=quaternion(X))


def _entity(track: Track, stamp: Any) -> Any:
    """Axes and name of a track: strong when accepted, faint when not."""
    from foxglove import messages

    alpha = 1.0 if track.accepted else 0.25
    origin = messages.Point3(x=0.0, y=0.0, z=0.0)
    axes, colors = [], []
    for axis in np.eye(3):
        color = messages.Color(r=float(axis[0]), g=float(axis[1]), b=float(axis[2]), a=alpha)
        axes += [origin, messages.Point3(**dict(zip("xyz", 0.08 * axis, strict=True)))]
        colors += [color, color]
    name = messages.TextPrimitive(
        pose=messages.Pose(position=messages.Vector3(x=0.0, y=0.0, z=0.1), orientation=messages.Quaternion(w=1.0)),
        billboard=True, font_size=14.0, scale_invariant=True, text=f"{track.label} {track.probability:.2f}",
        color=messages.Color(r=1.0, g=1.0, b=1.0, a=alpha),
    )  # fmt: skip
    lines = messages.LinePrimitive(
        type=messages.LinePrimitiveLineType.LineList, thickness=3.0, scale_invariant=True, points=axes, colors=colors
    )
    return messages.SceneEntity(
        timestamp=stamp, frame_id=_track_frame(track), id=str(track.id), lines=[lines], texts=[name]
    )
