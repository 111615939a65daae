# %% [markdown]
# # The results, plotted
#
# Everything below is read from the JSON that the benches wrote, as it is committed in `benchmarks/results/`: no figure
# is typed by hand. Name a folder of your own in `SUM_DRAKE_RESULTS` to see yours; what is not there is left out.

# %%
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from sum_drake.bench.pose_figures import PAPER_BOUNDS
from sum_drake.bench.result_plots import (
    belief_series,
    centimetres,
    gain_rows,
    lost_series,
    plan_series,
    pose_series,
    rows_of,
    telling_series,
    trials_series,
)
from sum_drake.plots import Series

here = Path(__file__).resolve().parents[1] if "__file__" in globals() else Path.cwd()
folder = Path(os.environ.get("SUM_DRAKE_RESULTS", here / "benchmarks" / "results"))
NAMES = ("detect", "pose", "reject", "plan", "sort", "batch5", "batch10", "faults", "ablations", "fault_ablations")
results: dict[str, Any] = {
    name: json.loads(path.read_text()) for name in NAMES if (path := folder / f"{name}.json").is_file()
}
for name, data in results.items():
    count = len(data.get("rows", data.get("episodes")))
    print(f"{name}: {count} rows, on {data['device']}, drake {data['versions']['drake']}")


def draw(axis: Any, series: Sequence[Series], **labels: Any) -> None:
    for one in series:
        look = "--" if one.dashed else "o-" if one.dots else "-"
        axis.plot(one.x, one.y, look, label=one.name or None, color=None if one.name else "grey")
    axis.set(**labels)
    axis.legend()


# %% [markdown]
# ## Poses beside the paper's filter and FPFH
#
# The paper's four plots: in the trained detector's boxes, the share of estimates within a translation bound, over a
# rotation bound. Then estimates in boxes that are off, within a distance.

# %%
if "pose" in results and "trials.scenes" in results["pose"]["figures"]:
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.4), sharey=True)
    for axis, metres in zip(axes, PAPER_BOUNDS, strict=True):
        title = f"within {centimetres(metres)} cm"
        draw(
            axis, trials_series(results["pose"], metres), title=title, xlabel="rotation bound, degrees", ylim=(0, 1.02)
        )
    axes[0].set_ylabel("share of the estimates")
    plt.tight_layout()
    plt.show()
    count = sum(row.get("detected", False) for row in rows_of(results["pose"], "estimate"))
    print(f"{count} estimates in the detector's own boxes")
if "pose" in results:
    draw(plt.gca(), pose_series(results["pose"]), xlabel="cm", ylabel="share of the estimates", ylim=(0, 1.02))
    plt.show()

# %% [markdown]
# ## Can a stated probability be trusted?
#
# Hypotheses of poured tables, in bins of equal mass: what was stated, and how often it came true.

# %%
if "reject" in results:
    error = results["reject"]["figures"]["calibration_error"]
    told = {"xlabel": "stated", "ylabel": "came true", "title": f"calibration error {error:.3f}", "aspect": "equal"}
    draw(plt.gca(), belief_series(results["reject"]), **told)
    plt.show()

# %% [markdown]
# ## What tells right hypotheses from wrong ones
#
# The share of the wrong ones that is rejected, over the share of the right ones that is kept.

# %%
if "reject" in results:
    series = telling_series(results["reject"])
    draw(plt.gca(), series, xlabel="right ones kept", ylabel="wrong ones rejected", xlim=(0.5, 1.01))
    plt.show()

# %% [markdown]
# ## Paths
#
# The share of planning problems that is solved within so many CPU seconds.

# %%
if "plan" in results:
    draw(plt.gca(), plan_series(results["plan"]), xlabel="CPU s", ylabel="share solved", xscale="log")
    plt.show()

# %% [markdown]
# ## Sequential sorting
#
# The eight sequences in the paper's rows, and how many objects of how many pours were sorted.

# %%
for row in rows_of(results["sort"], "sequence") if "sort" in results else ():
    print(
        f"sequence {row['seed']}: {row.get('objects_sorted', 0)} of {row.get('objects_total', '?')} objects,"
        f" {row.get('manipulation_errors', '?')} errors, {row.get('manipulation_trials', '?')} trials"
    )
batches = [results[name] for name in ("batch5", "batch10") if name in results]
if batches:
    draw(plt.gca(), lost_series(*batches), xlabel="objects poured", ylabel="objects lost")
    plt.show()
for batch in batches:
    number = batch["settings"]["objects"]
    print(f"{batch['figures']['objects_sorted_share']:.3f} of the objects sorted in {batch['done']} runs of {number}")
    for row in batch["losses"]:
        print(f"  seed {row['seed']}: {row['label']} ended {row['place']}: {row['cause']}")
    for cause, trials in batch.get("errors", {}).items():
        print(f"  {trials} manipulation errors {cause}")

# %% [markdown]
# ## Where things go wrong
#
# Runs in which things slip, are dropped, swept, taken and added on purpose, and camera and detector fail: the share of
# these faults that the belief has dealt with within two looks.

# %%
for name, value in results.get("faults", {"figures": {}})["figures"].items():
    if name.startswith("dealt_with_within_2"):
        print(f"{name}: {value:.3f}")

# %% [markdown]
# ## What each ingredient is worth
#
# The same pours with one thing changed: how much more of the objects are sorted than by what a variant is compared
# with, with the 95 % interval over pairs of runs; then the same where things go wrong.

# %%
for bench in ("ablations", "fault_ablations"):
    rows = [row for row in gain_rows(results[bench]) if np.isfinite(row[1])] if bench in results else []
    if rows:
        names, *gains = zip(*rows, strict=True)
        value, low, high = np.array(gains)
        plt.errorbar(value, range(len(names)), xerr=[value - low, high - value], fmt="o")
        plt.axvline(0.0, color="grey")
        plt.yticks(range(len(names)), names)
        plt.gca().set(xlabel="share of the objects, against what it is compared with")
        plt.tight_layout()
        plt.show()
