# %% [markdown]
# # One scene, from pixels to accepted poses
#
# Objects are poured on the table, the head camera looks once, a detector proposes boxes with labels, and for every
# (box, label) a particle filter says where the object would be and how well that explains the depth.

# %%
import os

import numpy as np
from pydrake.systems.analysis import Simulator

from sum_drake.geometry import pose_error
from sum_drake.objects import load_catalogue
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.sorting import make_sorting, pour_scene
from sum_drake.systems.station import set_home

catalogue = load_catalogue()
count = int(os.environ.get("SUM_DRAKE_NOTEBOOK_OBJECTS", "5"))
scenario = load_scenario(seed=7, objects=count, catalogue=catalogue)
X_WOs = pour_scene(scenario, catalogue)  # the truth: for the diagram's physics, and for the comparison at the end
print("poured:", ", ".join(X_WOs))

# %% [markdown]
# The whole of SUM is one diagram. Six tenths of a second in, arm and objects have come to rest, the planner has asked
# for an observation, and the estimator has latched it.

# %%
diagram = make_sorting(scenario, X_WOs, catalogue)
simulator = Simulator(diagram)
set_home(diagram.GetSubsystemByName("station"), simulator.get_mutable_context())
simulator.AdvanceTo(0.65)
estimator = diagram.GetSubsystemByName("scene_estimator")
perception = estimator.GetOutputPort("perception").Eval(estimator.GetMyContextFromRoot(simulator.get_context()))
print(len(perception.detections), "boxes")
for detection in perception.detections:
    print([round(side) for side in detection.box], round(detection.p_box, 2), detection.p_labels)

# %% [markdown]
# The belief: one track for each label that a box may have. Rivals for a box contest it; the likelier one is accepted.

# %%
for track in perception.posterior.tracks:
    spread = np.sqrt(track.belief.weights @ ((track.belief.X_WOs[:, :3, 3] - track.X_WO[:3, 3]) ** 2).sum(-1))
    words = f"{track.label:13s} likelihood {track.likelihood:.2f}  probability {track.probability:.2f}"
    print(words, f"spread {1e3 * spread:5.1f} mm", "accepted" if track.accepted else "")

# %% [markdown]
# Against the truth, which no part of the diagram but the referee has seen.

# %%
for track in perception.posterior.tracks:
    if track.accepted and track.label in X_WOs:
        translation, rotation = pose_error(track.X_WO, X_WOs[track.label], catalogue[track.label].symmetry)
        print(f"{track.label:13s} off by {1e3 * translation:5.1f} mm and {np.degrees(rotation):5.1f} degrees")
