"""Writes README.md and plots/*.svg here, and the results in the project's README, from results/*.json.

    python benchmarks/tables.py

No figure is typed by hand.

Run it whenever a result is committed; a test fails where it was forgotten.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sum_drake.bench import detect_figures, faults, plan, pose_figures, reject_figures, sort, speed
from sum_drake.bench.aims import Aims, aim, number
from sum_drake.plots import Series, interval_plot, line_plot
from sum_drake.reliability import reliability

HERE = Path(__file__).resolve().parent
BENCHES: dict[str, tuple[str, Aims]] = {
    "detect": ("The detector, on pictures it has not seen", detect_figures.AIMS),
    "pose": ("Poses in boxes of poured clutter, beside other methods", pose_figures.AIMS),
    "reject": ("A belief that can be trusted, and what it makes of what goes wrong", reject_figures.AIMS),
    "plan": ("Inverse kinematics, paths, and picks with true poses", plan.AIMS),
    "sort": ("Sequential sorting", sort.AIMS),
    "faults": ("Runs with faults", faults.AIMS),
    "ablations": ("What each ingredient of the whole system is worth, on the same pours", {}),
    "speed": ("What an object's pose costs", speed.AIMS),
}
BATCHES: dict[str, tuple[str, Aims]] = {
    "batch5": ("Five poured objects, sorted", sort.AIMS),
    "batch10": ("Ten poured objects, sorted", {"objects_sorted_share": sort.AIMS["objects_sorted_share_10"]}),
}
"""What `sum-drake batch` has collected (batch.json), beside the benches."""
WITHIN_M = np.linspace(0.0025, 0.2, 80)
"""Distances of the plot of poses, metres."""


def tables(results: Mapping[str, Mapping[str, Any]]) -> str:
    """README.md of the committed results, by bench."""
    lines = [
        "# Measurements",
        "",
        "Written by `tables.py` from `results/*.json`, which the commands below wrote; do not edit. Scripts beside",
        "this file measure one choice each, and say so in their first lines.",
        "",
    ]
    for name, (title, aims) in BENCHES.items():
        if name not in results:
            continue
        data = results[name]
        lines += [f"## {title}", "", *(f"`sum-drake {line}`\n" for line in _commands(name, data))]
        lines += _plots(results, name)
        lines += _figures(data, sort.aims_for(_rows(data, "run")) if name == "sort" else aims)
        seeds = ", ".join(f"{what} {seed}" for what, seed in data["seeds"].items())
        lines += ["", *(f"{sort.told_of(batch)}\n" for batch in _batches(data))]
        of = f"Commit {data['commit']}. " if data.get("commit") else ""
        lines += [f"{of}On {data['device']}; {_packages(data)}; seeds: {seeds}.", ""]
    for name, (title, aims) in BATCHES.items():
        if name in results:
            lines += _batch(title, aims, results[name], _plots(results, name))
    return "\n".join(lines)


def _plots(results: Mapping[str, Mapping[str, Any]], name: str) -> list[str]:
    return [
        line for plot in drawn(results) if PLOTS[plot][0][0] == name for line in (f"![{plot}](plots/{plot}.svg)", "")
    ]


def _figures(data: Mapping[str, Any], aims: Aims) -> list[str]:
    rows = [
        f"| {figure} | {_number(value)} | {aim(aims, figure, float('nan') if value is None else value)} |"
        for figure, value in data["figures"].items()
    ]
    return ["| figure | value | aim |", "|---|---|---|", *rows]


def _batch(title: str, aims: Aims, data: Mapping[str, Any], plots: Sequence[str]) -> list[str]:
    """What a batch has come to, and what it lost. plots: lines that show them."""
    lines = [f"## {title}", "", f"`sum-drake {_batch_command(data)}`", "", *plots, *_figures(data, aims), ""]
    lost = [f"| {loss['seed']} | {loss['label']} | {loss['place']} | {loss['cause']} |" for loss in data["losses"]]
    failed = [f"| {cause} | {trials} |" for cause, trials in data["errors"].items()]
    lines += ["| seed | lost | ended | cause |", "|---|---|---|---|", *lost, ""] if lost else []
    lines += ["| manipulation error | trials |", "|---|---|", *failed, ""] if failed else []
    return [*lines, sort.told_of(data), "", f"With {_packages(data)}.", ""]


def _packages(data: Mapping[str, Any]) -> str:
    return ", ".join(f"{package} {data['versions'][package]}" for package in ("python", "drake", "torch", "numpy"))


def _batch_command(data: Mapping[str, Any]) -> str:
    (first, last), objects = data["seeds"], data["settings"]["objects"]
    return f"batch --runs {last - first + 1} --first-seed {first} --objects {objects} --out out/b{objects}"


def _batches(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What was run beside a bench, for it: `batch.made_by` of each."""
    settings = data["settings"]
    return [*settings.get("batches", ()), *([settings["default"]] if data["bench"] == "ablations" else [])]


def _commands(name: str, data: Mapping[str, Any]) -> list[str]:
    """That make a result."""
    lines, more = [], ""
    for batch in data["settings"].get("batches", ()):
        lines.append(_batch_command(batch))
        more += f" --batch out/b{batch['settings']['objects']}"
    return [*lines, f"bench {name} --out out/{name}{more}"]


def _number(value: float | None, digits: int = 4) -> str:
    return "unknown" if value is None else number(value, digits)


HEADLINES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "batch5": (
        ("five poured objects: of them sorted; the 95 % interval is from, to",
         ("objects_sorted_share", "objects_sorted_low95", "objects_sorted_high95")),
        ("objects in the wrong bin; runs", ("missorted", "runs")),
        ("trials an object sorted (the paper: 43 for 38)", ("trials_per_object",)),
        ("CPU seconds a run, median", ("cpu_s_per_run_median",)),
    ),
    "batch10": (
        ("ten poured objects: of them sorted; the 95 % interval is from, to",
         ("objects_sorted_share", "objects_sorted_low95", "objects_sorted_high95")),
    ),
    "sort": (
        ("the paper's eight sequences: objects sorted of 40 (the paper: 38), trials (the paper: 43)",
         ("sequences_objects_sorted", "sequences_trials")),
    ),
    "detect": (
        ("detector: mAP@.5; under lights, textures and a shading it never saw", ("map50", "map50_shift")),
        ("likeliest label right on true boxes; there", ("top1_on_true_boxes", "top1_on_true_boxes_shift")),
    ),
    "pose": (
        ("poses within 2 cm and 20 degrees: ours, the paper's filter, FPFH with ICP",
         ("default.within_2cm_20deg", "paper.within_2cm_20deg", "fpfh_icp.within_2cm_20deg")),
        ("the paper's scenes: how much the curve within 5 cm is above the best baseline's, at least (95 %); measured",
         ("trials.lead_5cm_low95", "trials.lead_5cm")),
        ("CPU seconds a pose: the same three",
         ("default.cpu_s_per_object", "paper.cpu_s_per_object", "fpfh_icp.cpu_s_per_object")),
    ),
    "reject": (
        ("wrong hypotheses rejected", ("false_rejected",)),
        ("of the trained detector's alone", ("trained.false_rejected",)),
        ("objects that some hypothesis has right, kept", ("true_kept",)),
        ("calibration error of a stated probability", ("calibration_error",)),
        ("the paper's experiment: false positives rejected (the paper: .84)", ("paper.false_rejected",)),
        ("found again, or given up, within two looks of what happened to it", ("recovered_within_2",)),
    ),
    "plan": (
        ("inverse kinematics: reachable poses solved; median seconds", ("ik_success", "ik_median_s")),
        ("paths of picks found within 1 CPU s; median seconds", ("plan_success_1s", "plan_median_s")),
        ("picks with true poses that succeed: of objects alone, from tables of five",
         ("pick_success_alone", "pick_success_clutter")),
        ("samples over a joint's limits, in all picks", ("limit_violations",)),
    ),
}  # fmt: skip
"""What the project's README tells, by bench: in words, and the figures. The first is beside what is aimed at."""
README = HERE.parent / "README.md"
BEGIN, END = "<!-- results: written by benchmarks/tables.py -->", "<!-- end of results -->"


def headlines(results: Mapping[str, Mapping[str, Any]]) -> str:
    """The project's README's table."""
    lines = ["| measured | value | aim | by |", "|---|---|---|---|"]
    aims_of = {name: aims for name, (_, aims) in (BENCHES | BATCHES).items()}
    for bench, rows in HEADLINES.items():
        figures = results[bench]["figures"] if bench in results else {}
        made_by = "batch" if bench in BATCHES else bench
        for words, names in rows:
            if all(name in figures for name in names):
                first = figures[names[0]]
                told = aim(aims_of[bench], names[0], float("nan") if first is None else first)
                value = ", ".join(_number(figures[name], 3) for name in names)
                lines.append(f"| {words} | {value} | {told} | `{made_by}` |")
    return "\n".join(lines)


def readme(text: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """The project's README with the table of now."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n\n{headlines(results)}\n\n{END}{rest.split(END)[1]}"


def _rows(data: Mapping[str, Any], table: str) -> list[dict[str, Any]]:
    return [row for row in data["rows"] if row["table"] == table]


def pose_plot(data: Mapping[str, Any]) -> str:
    """Share of estimates in right boxes whose distance is less than so much, whatever their angle, by method."""
    rows = [row for row in _rows(data, "estimate") if not row["wrong_box"] and not row.get("detected", False)]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    off = {m: np.array([row["translation_m"] for row in rows if row["method"] == m], float) for m in methods}
    series = [Series(m, 100 * WITHIN_M, [(off[m] <= d).mean() for d in WITHIN_M]) for m in methods]
    return line_plot(
        series, title="Poses within a distance", x_label="cm", y_label="share", y_range=(0, 1), size=(640, 340)
    )  # fmt: skip


def trials_plot(data: Mapping[str, Any]) -> str:
    """The paper's experiment: share of estimates in the detector's boxes within 5 cm and a rotation bound."""
    rows = [row for row in _rows(data, "estimate") if row.get("detected", False)]
    degrees, off = pose_figures.DEGREES, {}
    for row in rows:
        off.setdefault(row["method"], []).append((row["translation_m"], row["rotation_deg"]))
    series = [
        Series(method, degrees, pose_figures.curve_of(*np.array(of, float).T, 0.05, degrees))
        for method, of in off.items()
    ]
    return line_plot(
        series, title="The paper's scenes: poses within 5 cm", x_label="rotation bound, degrees", y_label="share",
        x_range=(0, 180), y_range=(0, 1), size=(640, 340),
    )  # fmt: skip


def gain_plot(data: Mapping[str, Any]) -> str:
    """What is lost without each ingredient: share of the objects sorted more than by default, and its interval."""
    figures = data["figures"]
    names = [name.removesuffix(".gain") for name in figures if name.endswith(".gain")]
    rows = []
    for name in names:
        gain = (figures[f"{name}.gain{end}"] for end in ("", "_low95", "_high95"))
        value, low, high = (float("nan") if one is None else float(one) for one in gain)
        rows.append((name.replace("_", " "), value, low, high))
    return interval_plot(rows, title="Objects sorted, against the default", x_label="share of the objects")


def belief_plot(data: Mapping[str, Any]) -> str:
    """How often what was stated came true."""
    rows = _rows(data, "hypothesis")
    told = reliability([row["probability"] for row in rows], [row["right"] for row in rows])
    diagonal = Series("", [0, 1], [0, 1], dashed=True)
    return line_plot(
        [diagonal, Series("belief", told.stated, told.observed, dots=True)],
        title="Stated probability, and how often it came true",
        x_label="stated", y_label="came true", x_range=(0, 1), y_range=(0, 1),
    )  # fmt: skip


def plan_plot(data: Mapping[str, Any]) -> str:
    """Share of planning problems that is solved within so many CPU seconds."""
    seconds = np.geomspace(0.01, 10.0, 80)
    kinds = {"pick": [row["cpu_s"] if row["solved"] else np.inf for row in _rows(data, "query")]}
    for row in _rows(data, "problem"):
        kinds.setdefault(row["kind"], []).append(row["time_s"] if row["solved"] else np.inf)
    series = [Series(kind, seconds, [(np.array(t) <= s).mean() for s in seconds]) for kind, t in kinds.items()]
    return line_plot(
        series, title="Paths found", x_label="CPU s", y_label="share", y_range=(0, 1), log_x=True, size=(640, 340)
    )  # fmt: skip


def lost_plot(*batches: Mapping[str, Any]) -> str:
    """Objects lost, over objects poured, run after run; by how many were poured at a time."""
    series = []
    for batch in batches:
        asked = batch["settings"]["objects"]
        poured = np.array([0, *(row.get("objects_total", asked) for row in batch["episodes"])])
        done = np.array([0, *(row.get("objects_sorted", 0) for row in batch["episodes"])])
        series.append(Series(f"{asked} at a time", np.cumsum(poured), np.cumsum(poured - done)))
    return line_plot(series, title="Objects lost", x_label="objects poured", y_label="objects lost")


PLOTS: dict[str, tuple[tuple[str, ...], Callable[..., str]]] = {
    "poses": (("pose",), pose_plot),
    "trials": (("pose",), trials_plot),
    "belief": (("reject",), belief_plot),
    "paths": (("plan",), plan_plot),
    "sorted": (("batch5", "batch10"), lost_plot),
    "gains": (("ablations",), gain_plot),
}
"""Name of a file -> the results it is of, the first of which has to be there, and how they are drawn."""


def drawn(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The plots for which there are results."""
    told = {plot: of[0] for plot, (of, _) in PLOTS.items() if of[0] in results}
    return [plot for plot, of in told.items() if plot != "trials" or "trials.scenes" in results[of]["figures"]]


def read_results(folder: Path) -> dict[str, dict[str, Any]]:
    """results/BENCH.json by bench, and those of batches, that there are."""
    names = (*BENCHES, *BATCHES)
    return {name: json.loads(path.read_text()) for name in names if (path := folder / f"{name}.json").is_file()}


def files(results: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """What is to be written, by path below this folder."""
    plots = {}
    for plot in drawn(results):
        of, draw = PLOTS[plot]
        plots[f"plots/{plot}.svg"] = draw(*(results[name] for name in of if name in results))
    return {"README.md": tables(results), **plots}


def main() -> None:
    """Writes the files."""
    (HERE / "plots").mkdir(exist_ok=True)
    results = read_results(HERE / "results")
    for name, text in files(results).items():
        (HERE / name).write_text(text)
        print(HERE / name)
    README.write_text(readme(README.read_text(), results))
    print(README)


if __name__ == "__main__":
    main()
