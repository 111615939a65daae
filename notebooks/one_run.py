# %% [markdown]
# # A sort run, told from its log
#
# Everything below is read from a run folder: what was observed, what was believed, what was tried and how it ended.
# Name a folder of your own in `SUM_RUN`; without it a short run with one object is made.

# %%
import json
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from sum_drake import cli
from sum_drake.drawing import draw_perception
from sum_drake.runlog_reader import read_what_there_is
from sum_drake.systems.scenario import catalogue_of, load_scenario

folder = os.environ.get("SUM_RUN", "")
if not folder:
    folder = str(Path(tempfile.mkdtemp()) / "run")
    short = ["sort", "--seed", "5", "--scenario-text", "{objects: {labels: [sugar]}}", "--out", folder]
    assert cli.main([*short, "--workers", "1"]) == 0  # in this process: a notebook has no main guard for others
record = read_what_there_is(Path(folder) / "run.mcap")  # a log that ends early is read as far as it goes
print(folder, record.problem or "is whole")

# %% [markdown]
# ## What was observed
#
# Each observation is one record: the picture, the detector's boxes, which track each fed, and the belief before and
# after. Thin boxes are detections, filled outlines accepted tracks, dashed ones rejected or unseen tracks.

# %%
for perception in record.perceptions:
    tracks = perception.posterior.tracks
    accepted = ", ".join(f"{track.label} {track.probability:.2f}" for track in tracks if track.accepted)
    words = f"{len(perception.detections)} boxes, {len(tracks)} tracks; accepted: {accepted or 'none'}"
    print(f"observation {perception.step} at {perception.frame.time:.1f} s: {words}")

# %%
if record.perceptions:
    catalogue = catalogue_of(load_scenario(Path(folder) / "scenario.yaml"))
    plt.imshow(draw_perception(record.perceptions[0], catalogue))
    plt.axis("off")
    plt.title("observation 0")
    plt.show()

# %% [markdown]
# ## What was believed, over time
#
# The probability of each track that was ever at least as likely as not. A line that ends is a track that ended; the
# reason stands in `gone`.

# %%
lines: dict[tuple[int, str], list[tuple[float, float]]] = {}
for perception in record.perceptions:
    for track in perception.posterior.tracks:
        lines.setdefault((track.id, track.label), []).append((perception.frame.time, track.probability))
for (number, label), points in lines.items():
    if max(probability for _, probability in points) >= 0.5:
        times, probabilities = zip(*points, strict=True)
        plt.plot(times, probabilities, "o-", label=f"{label} ({number})")
        print(f"{label} ({number}):", " ".join(f"{probability:.2f}" for probability in probabilities))
plt.xlabel("simulated time, s")
plt.ylabel("probability")
plt.ylim(0, 1.05)
if plt.gca().lines:
    plt.legend()
plt.show()
for perception in record.perceptions:
    for gone in perception.posterior.gone:
        print(f"observation {gone.observation} ended {gone.label} ({gone.track}): {gone.reason}")

# %% [markdown]
# How far the belief of an accepted track is spread: it sharpens where looks agree.

# %%
for perception in record.perceptions:
    for track in perception.posterior.tracks:
        if track.accepted:
            off = ((track.belief.X_WOs[:, :3, 3] - track.X_WO[:3, 3]) ** 2).sum(-1)
            spread = np.sqrt(track.belief.weights @ off)
            print(f"observation {perception.step}: {track.label:13s} {1e3 * spread:5.1f} mm")

# %% [markdown]
# ## What was tried
#
# An attempt says what the robot knows of it: why this object, what became of the grasps, and how it ended. The truth of
# it, `outcome` and slip, is the referee's, and stands in `summary.json` alone.

# %%
summary_file = Path(folder) / "summary.json"
rows = json.loads(summary_file.read_text())["attempts"] if summary_file.is_file() else []
for number, (time, attempt) in enumerate(record.attempts):
    print(f"{time:6.1f} s: {attempt.label} to {attempt.region}: {attempt.reason}")
    if attempt.why:
        print(f"    why: {attempt.why}")
    dropped = ", ".join(f"{count} {cause}" for cause, count in attempt.rejected_by if count)
    print(f"    {attempt.grasp_candidates} grasps were looked at; dropped: {dropped or 'none'}")
    if attempt.action is not None:
        action = attempt.action
        gaps = f"{1e3 * action.gap_lift:.0f} mm after the lift, {1e3 * action.gap_place:.0f} before the release"
        print(f"    between the fingers were {gaps}")
    if number < len(rows):
        slip = rows[number]["slip_m"]
        print(f"    in truth: {rows[number]['outcome']}" + ("" if slip is None else f", slipped {1e3 * slip:.1f} mm"))
for perception in record.perceptions:
    believed = perception.posterior.believed
    if believed is not None:
        shares = ", ".join(f"{outcome} {p:.2f}" for outcome, p in believed.outcomes if p >= 0.005)
        print(f"observation {perception.step} makes of what was done to {believed.label}: {shares}")

# %% [markdown]
# ## What the arm did
#
# Segments of the motions, and the joints, by the log's ten samples a second.

# %%
for event in record.events:
    detail = " ".join(str(value) for value in event["detail"].values())
    print(f"{event['time']:6.1f} s: {event['name']} {detail}")
plt.plot(record.joint_times, record.joint_positions, linewidth=0.8)
plt.xlabel("simulated time, s")
plt.ylabel("joint position, rad or m")
plt.show()
