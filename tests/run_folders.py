"""Run folders for tests: two looks, between them a pick and place that the joints and events tell of."""

import dataclasses
from pathlib import Path

import numpy as np
from test_drawing import make_perception

from sum_drake.evaluation import Truth, digest, score_attempts, score_observation, summary
from sum_drake.geometry import transform
from sum_drake.jsonio import write_json
from sum_drake.kinematics import Arm
from sum_drake.objects import Catalogue
from sum_drake.robot import ARM_JOINTS, JOINTS, VIEW
from sum_drake.runlog import RunLogWriter
from sum_drake.types import Array, Attempt, Gone, Perception, PickPlace, Region, readonly

REGIONS = {
    "table": Region("table", readonly([0.7, 0.0, 0.9]), readonly([0.25, 0.35, 0.2])),
    "left": Region("left", readonly([0.12, 0.62, 0.5]), readonly([0.18, 0.18, 0.1])),
}
SCENARIO = """resolved:
  random_seed: 7
  regions:
    table: {p_W: [0.7, 0.0, 0.9], half_extents: [0.25, 0.35, 0.2]}
    left: {p_W: [0.12, 0.62, 0.5], half_extents: [0.18, 0.18, 0.1]}
"""
X_WG_PICK = readonly(transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.7, 0.1, 0.76])))
"""From above, at the can of `make_perception`."""
X_WO_PLACE = readonly(transform(np.eye(3), np.array([0.12, 0.62, 0.7])))


def looks(catalogue: Catalogue) -> list[Perception]:
    """At 0 and 10 s; by the second the can is gone, as placed."""
    first, second = (make_perception(step, catalogue) for step in range(2))
    left = tuple(track for track in second.posterior.tracks if track.id != 0)
    posterior = dataclasses.replace(second.posterior, tracks=left, gone=(Gone(0, "soup_can", 1, "placed"),))
    return [first, dataclasses.replace(second, posterior=posterior)]


def executed(*, released: bool = True, held: bool = True) -> Attempt:
    """The can, into the bin on the left."""
    action = PickPlace(
        0, "pick_place", 0, "soup_can", X_WG_PICK, X_WO_PLACE, "left", 0.066 if held else 0.0,
        0.066 if released else 0.0, released, held_lift=held, held_place=released,
    )  # fmt: skip
    reason = "executed" if released else "lost_in_transport" if held else "empty_hand"
    why = "most_likely 0.93"
    return Attempt(0, 0, "soup_can", "left", "pick_place", reason, 40, (("ik", 30),), action, None, why)


def joints(turn: float) -> Array:
    """Positions of JOINTS with the shoulder turned."""
    q = np.zeros(len(JOINTS))
    q[: len(ARM_JOINTS)] = VIEW
    q[1] -= turn
    return q


def X_WG(turn: float) -> Array:
    """Where the hand then is."""
    return Arm().forward(joints(turn)[: len(ARM_JOINTS)])


def write_run(folder: Path, catalogue: Catalogue, attempt: Attempt | None = None, *, seed: int = 7) -> Path:
    """A finished run; the arm lifts at 3 s, opens at 6 s and is back at 9 s."""
    attempt = executed() if attempt is None else attempt
    folder.mkdir()
    perceptions = looks(catalogue)
    with RunLogWriter(folder / "run.mcap", metadata={"seed": str(seed)}) as writer:
        writer.write_perception(perceptions[0])
        segments = {2.0: "reach", 3.0: "lift", 4.5: "transport", 6.0: "open", 7.0: "return"}
        names = [joint.name for joint in JOINTS]
        for i in range(20):
            time = 0.5 * i
            if time in segments:
                writer.write_event(time, "segment_begun", {"motion": 0, "segment": segments[time]})
            writer.write_joint_state(time, names, joints(0.1 * time))
        writer.write_attempt(9.8, attempt)
        writer.write_perception(perceptions[1])
        writer.write_event(10.2, "run_ended", {"outcome": "cleared"})
    X_WO = perceptions[0].posterior.tracks[0].X_WO
    truths = [Truth(0, (("soup_can", X_WO),)), Truth(1, (("soup_can", transform(np.eye(3), [0.1, 0.6, 0.45])),))]
    goal = {"soup_can": "left"}
    data = summary(
        seed=seed, outcome="cleared", final=truths[-1], regions=REGIONS, goal=goal,
        observations=[score_observation(p, t, catalogue) for p, t in zip(perceptions, truths, strict=True)],
        attempts=score_attempts([attempt], truths, regions=REGIONS, goal=goal, slips=[0.0012]),
        timing={"perception_cpu_s": 3.25, "wall_s": 8.0}, digest=digest(perceptions, [attempt], truths[-1]),
        versions={"drake": "1.51.1"}, device="a machine",
    )  # fmt: skip
    write_json(folder / "summary.json", data)
    (folder / "scenario.yaml").write_text(SCENARIO)
    return folder
