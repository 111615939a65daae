# %% [markdown]
# # The results, plotted
#
# Everything below is read from the JSON that the benches wrote, as it is committed in `benchmarks/results/`: no figure
# is typed by hand. Name a folder of your own in `SUM_DRAKE_RESULTS` to see yours; what is not there is left out.

# %%
import json
import os
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from sum_drake.bench.pose_figures import DEGREES, curve_of
from sum_drake.reliability import reliability

here = Path(__file__).resolve().parents[1] if "__file__" in globals() else Path.cwd()
folder = Path(os.environ.get("SUM_DRAKE_RESULTS", here / "benchmarks" / "results"))
results: dict[str, Any] = {
    name: json.loads(path.read_text())
    for name in ("detect", "pose", "reject", "plan", "sort", "batch5", "batch10", "ablations")
    if (path := folder / f"{name}.json").is_file()
}
for name, data in results.items():
    count = len(data.get("rows", data.get("episodes")))
    print(f"{name}: {count} rows, on {data['device']}, drake {data['versions']['drake']}")


def rows_of(bench: str, table: str) -> list[dict[str, Any]]:
    return [row for row in results.get(bench, {"rows": []})["rows"] if row["table"] == table]


# %% [markdown]
# ## Poses beside the paper's filter and FPFH
#
# The paper's four plots: the share of estimates within a translation bound, over a rotation bound. In the trained
# detector's boxes, if that was measured; in boxes that are off, else.

# %%
estimates = [row for row in rows_of("pose", "estimate") if not row["wrong_box"]]
detected = [row for row in estimates if row.get("detected", False)]
chosen = detected or estimates
if chosen:
    compared = [m for m in ("default", "paper", "fpfh", "fpfh_icp") if any(row["method"] == m for row in chosen)]
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.4), sharey=True)
    for axis, metres in zip(axes, (0.01, 0.05, 0.10, 0.20), strict=True):
        for method in compared:
            own = [row for row in chosen if row["method"] == method]
            off = ([row[error] for row in own] for error in ("translation_m", "rotation_deg"))
            axis.plot(DEGREES, curve_of(*off, metres, DEGREES), label=method)
        axis.set(title=f"within {100 * metres:.0f} cm", xlabel="rotation bound, degrees", ylim=(0, 1.02))
    axes[0].set_ylabel("share of the estimates")
    axes[-1].legend()
    plt.tight_layout()
    plt.show()
    print(f"{len(chosen)} estimates {'in the detector’s own boxes' if detected else 'in boxes that are off'}")

# %% [markdown]
# ## Can a stated probability be trusted?
#
# Hypotheses of poured tables, in bins of equal mass: what was stated, and how often it came true.

# %%
hypotheses = rows_of("reject", "hypothesis")
if hypotheses:
    told = reliability([row["probability"] for row in hypotheses], [row["right"] for row in hypotheses])
    plt.plot([0, 1], [0, 1], "--", color="grey")
    plt.plot(told.stated, told.observed, "o-")
    plt.gca().set(xlabel="stated", ylabel="came true", title=f"calibration error {told.error:.3f}", aspect="equal")
    plt.show()

# %% [markdown]
# ## What tells right hypotheses from wrong ones
#
# The share of the wrong ones that is rejected, over the share of the right ones that is kept.

# %%
if hypotheses:
    right = np.array([row["right"] for row in hypotheses])
    sayers = {
        "belief": [row["probability"] for row in hypotheses],
        "the paper's p(x)": [row["p_box"] * row["p_label"] * row["likelihood"] for row in hypotheses],
        "detector": [row["p_box"] * row["p_label"] for row in hypotheses],
    }
    for name, said in sayers.items():
        thresholds = np.unique(said)
        kept = [(np.array(said)[right] >= t).mean() for t in thresholds]
        rejected = [(np.array(said)[~right] < t).mean() for t in thresholds]
        plt.plot(kept, rejected, label=name)
    plt.gca().set(xlabel="right ones kept", ylabel="wrong ones rejected", xlim=(0.5, 1.01))
    plt.legend()
    plt.show()

# %% [markdown]
# ## Paths
#
# The share of planning problems that is solved within so many CPU seconds.

# %%
kinds: dict[str, list[float]] = {
    "pick": [row["cpu_s"] if row["solved"] else np.inf for row in rows_of("plan", "query")]
}
for row in rows_of("plan", "problem"):
    kinds.setdefault(row["kind"], []).append(row["time_s"] if row["solved"] else np.inf)
if kinds["pick"]:
    at = np.geomspace(0.01, 10.0, 80)
    for kind, taken in kinds.items():
        plt.semilogx(at, [(np.array(taken) <= seconds).mean() for seconds in at], label=kind.replace("_", " "))
    plt.gca().set(xlabel="CPU s", ylabel="share solved")
    plt.legend()
    plt.show()

# %% [markdown]
# ## Sequential sorting
#
# The eight sequences in the paper's rows, and how many objects of how many pours were sorted.

# %%
for row in rows_of("sort", "sequence"):
    print(
        f"sequence {row['seed']}: {row.get('objects_sorted', 0)} of {row.get('objects_total', '?')} objects,"
        f" {row.get('manipulation_errors', '?')} errors, {row.get('manipulation_trials', '?')} trials"
    )
batches = [results[name] for name in ("batch5", "batch10") if name in results]
for batch in batches:
    number, own = batch["settings"]["objects"], batch["episodes"]
    total = np.cumsum([row.get("objects_total", number) for row in own])
    lost = total - np.cumsum([row.get("objects_sorted", 0) for row in own])
    plt.step(total, lost, where="post", label=f"{number} at a time")
    print(f"{total[-1] - lost[-1]} of {total[-1]} objects sorted in {len(own)} runs of {number}")
if batches:
    plt.gca().set(xlabel="objects poured", ylabel="objects lost")
    plt.legend()
    plt.show()
for batch in batches:
    for row in batch["losses"]:
        print(f"  seed {row['seed']}: {row['label']} ended {row['place']}: {row['cause']}")
    for cause, trials in batch["errors"].items():
        print(f"  {batch['settings']['objects']} at a time: {trials} manipulation errors {cause}")

# %% [markdown]
# ## What each ingredient is worth
#
# The same pours with one thing changed: how much more of the objects are sorted, with the 95 % interval over pairs of
# runs.

# %%
gains = results.get("ablations", {"figures": {}})["figures"]
names = [name.removesuffix(".gain") for name in gains if name.endswith(".gain") and gains[name] is not None]
if names:
    value, low, high = (np.array([gains[f"{name}.gain{end}"] for name in names]) for end in ("", "_low95", "_high95"))
    plt.errorbar(value, range(len(names)), xerr=[value - low, high - value], fmt="o")
    plt.axvline(0.0, color="grey")
    plt.yticks(range(len(names)), [name.replace("_", " ") for name in names])
    plt.gca().set(xlabel="share of the objects, against the default")
    plt.tight_layout()
    plt.show()
