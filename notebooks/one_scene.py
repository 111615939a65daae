# %% [markdown]
# # One scene, from pixels to accepted poses
#
# Objects are poured on the table, the head camera looks once, a detector proposes boxes with labels, and for every
# (box, label) a particle filter says where the object would be and how well that explains the depth.

# %%
import os

import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator

from sum_drake.drawing import draw_perception
from sum_drake.filter_config import filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.geometry import pose_error
from sum_drake.objects import load_catalogue
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.sorting import make_sorting, pour_scene
from sum_drake.systems.station import set_home
from sum_drake.types import PoseBelief

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

# %%
plt.imshow(perception.frame.color)
for detection in perception.detections:
    x, y, w, h = detection.box
    plt.gca().add_patch(plt.Rectangle((x, y), w, h, fill=False, color="yellow"))
    plt.text(x, y, detection.p_labels[0][0], color="black", backgroundcolor="yellow", fontsize=7)
plt.axis("off")
plt.title("what the camera saw, and the detector's boxes")
plt.show()

# %% [markdown]
# ## The belief as it sharpens
#
# In the surest box, once more: the pose filter's particles, iteration after iteration. At first they are wherever the
# box allows; each is weighted by how well what it would show explains the depth, and drawn again by its weight. Above,
# where the origin of the object would be in the picture, the darker the more weight; below, how far the particles are
# from the estimate, and how far they are turned from it.

# %%
surest = max(perception.detections, key=lambda one: one.p_box * one.p_labels[0][1])
label = surest.p_labels[0][0]
beliefs: list[PoseBelief] = []
estimator_of_poses = PoseEstimator(catalogue, filter_config(scenario.filter), noise=scenario.depth_noise)
rng = np.random.default_rng(scenario.random_seed)
estimate = estimator_of_poses.estimate(perception.frame, surest.box, label, rng=rng, watch=beliefs.append)
beliefs.append(estimate.belief)

camera, X_CW = perception.frame.camera, np.linalg.inv(perception.frame.X_WC)
shown = sorted({0, 1, len(beliefs) // 2, len(beliefs) - 1})
figure, axes = plt.subplots(2, len(shown), figsize=(3.2 * len(shown), 5.6))
x, y, w, h = surest.box
for column, i in enumerate(shown):
    belief = beliefs[i]
    best = estimate.X_WO
    p_C = belief.X_WOs[:, :3, 3] @ X_CW[:3, :3].T + X_CW[:3, 3]
    u, v = camera.fx * p_C[:, 0] / p_C[:, 2] + camera.cx, camera.fy * p_C[:, 1] / p_C[:, 2] + camera.cy
    weight = belief.weights / belief.weights.max()
    axes[0, column].imshow(perception.frame.color, alpha=0.5)
    axes[0, column].scatter(u, v, s=6, c="navy", alpha=0.08 + 0.92 * weight, linewidths=0)
    axes[0, column].set(xlim=(x - w / 2, x + 1.5 * w), ylim=(y + 1.5 * h, y - h / 2), xticks=[], yticks=[])
    axes[0, column].set_title("the belief at the end" if i == len(beliefs) - 1 else f"iteration {i + 1}")
    away, turned = pose_error(belief.X_WOs, best, catalogue[label].symmetry)
    axes[1, column].scatter(1e3 * away, np.degrees(turned), s=6, c="navy", alpha=0.08 + 0.92 * weight, linewidths=0)
    axes[1, column].set(xlim=(0.1, 500), ylim=(0, 180), xscale="log", xlabel="mm from the estimate")
    near = belief.weights[(away < 0.02) & (np.degrees(turned) < 20)].sum()
    name = "the end" if i == len(beliefs) - 1 else f"iteration {i + 1}"
    print(f"{label}, {name}: {len(belief.weights)} particles, {near:.2f} of their weight within 2 cm and 20 degrees")
axes[1, 0].set_ylabel("degrees from the estimate")
plt.tight_layout()
plt.show()

# %% [markdown]
# ## What is believed of the scene
#
# One track for each label that a box may have. Rivals for a box contest it; the likelier one is accepted.

# %%
for track in perception.posterior.tracks:
    spread = np.sqrt(track.belief.weights @ ((track.belief.X_WOs[:, :3, 3] - track.X_WO[:3, 3]) ** 2).sum(-1))
    words = f"{track.label:13s} likelihood {track.likelihood:.2f}  probability {track.probability:.2f}"
    print(words, f"spread {1e3 * spread:5.1f} mm", "accepted" if track.accepted else "")

# %%
plt.imshow(draw_perception(perception, catalogue))
plt.axis("off")
plt.title("accepted: filled; rejected: dashed")
plt.show()

# %% [markdown]
# Against the truth, which no part of the diagram but the referee has seen.

# %%
for track in perception.posterior.tracks:
    if track.accepted and track.label in X_WOs:
        translation, rotation = pose_error(track.X_WO, X_WOs[track.label], catalogue[track.label].symmetry)
        print(f"{track.label:13s} off by {1e3 * translation:5.1f} mm and {np.degrees(rotation):5.1f} degrees")
