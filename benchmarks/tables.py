"""Writes README.md and plots/*.svg here, and the results in the project's README, from results/*.json.

    python benchmarks/tables.py

No figure is typed by hand.

Run it whenever a result is committed; a test fails where it was forgotten.
"""

import functools
import json
import string
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake.batch_figures import objects_of
from sum_drake.batch_parts import packages, told_of
from sum_drake.bench import ablations, detect_figures, faults, plan, pose_figures, reject_figures, sort, speed
from sum_drake.bench.aims import Aims, aim, number
from sum_drake.bench.result_plots import (
    belief_plot,
    centimetres,
    gain_plot,
    lost_plot,
    plan_plot,
    pose_plot,
    rows_of,
    telling_plot,
    trials_plot,
)
from sum_drake.executed import KINDS

HERE = Path(__file__).resolve().parent
BENCHES: dict[str, tuple[str, Aims]] = {
    "detect": ("The detector, on pictures it has not seen", detect_figures.AIMS),
    "pose": ("Poses in boxes of poured clutter, beside other methods", pose_figures.AIMS),
    "reject": ("A belief that can be trusted, and what it makes of what goes wrong", reject_figures.AIMS),
    "plan": ("Inverse kinematics, paths, and picks with true poses", plan.AIMS),
    "sort": ("Sequential sorting", sort.AIMS),
    "faults": ("Runs with faults", faults.AIMS),
    "ablations": ("What each ingredient of the whole system is worth, on the same pours", {}),
    "fault_ablations": ("The same, where things go wrong", {}),
    "speed": ("What an object's pose costs", speed.AIMS),
}
BATCHES: dict[str, tuple[str, Aims]] = {
    "batch5": ("Five poured objects, sorted", sort.AIMS),
    "batch10": (
        "Ten poured objects, sorted",
        {"objects_sorted_share": sort.AIMS["objects_sorted_share_10"]}
        | {name: sort.AIMS[name] for name in ("crashes", "hangs", "missorted", "limit_violations")},
    ),
}
"""What `sum-drake batch` has collected (batch.json), beside the benches."""


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
        lines += BEFORE.get(name, _nothing)(data)
        if data["bench"] != "ablations":
            lines += _figures(data, sort.aims_for(rows_of(data, "run")) if name == "sort" else aims)
        lines += ["", *_lost(rows_of(data, "loss"), rows_of(data, "error"))]
        seeds = ", ".join(f"{what} {seed}" for what, seed in data["seeds"].items())
        lines += ["", *(f"{told_of(batch)}\n" for batch in _batches(data))]
        of = f"Commit {data['commit']}. " if data.get("commit") else ""
        lines += [f"{of}On {data['device']}; {_packages(data)}; seeds: {seeds}.", ""]
    for name, (title, aims) in BATCHES.items():
        if name in results:
            lines += _batch(title, aims, results[name], _plots(results, name))
    return "\n".join(lines)


def _nothing(data: Mapping[str, Any]) -> list[str]:
    return []


def _sequences(data: Mapping[str, Any]) -> list[str]:
    """The paper's table, and ours in its rows."""
    ours = [
        {
            "of": f"ours, seed {row['seed']}",
            "objects": objects_of(row),
            "failed": row.get("manipulation_errors", 0),
            "trials": row.get("manipulation_trials", 0),
            "completion": row.get("objects_sorted", 0) / objects_of(row),
        }
        for row in rows_of(data, "sequence")
    ]
    papers = [
        {"of": f"the paper's ({'abcdefgh'[i]})", **{name: values[i] for name, values in sort.PAPER.items()}}
        for i in range(len(sort.PAPER["objects"]))
    ]
    lines = ["| sequence | objects | manipulation errors | trials | completion ratio |", "|---|---|---|---|---|"]
    for rows, whole in ((papers, "the paper's, all"), (ours, "ours, all")):
        sums = {name: sum(row[name] for row in rows) for name in ("objects", "failed", "trials")}
        done = sum(row["completion"] * row["objects"] for row in rows) / sums["objects"]
        for row in (*rows, {"of": whole, **sums, "completion": done}):
            lines.append(
                f"| {row['of']} | {row['objects']:.0f} | {row['failed']:.0f} | {row['trials']:.0f} "
                f"| {number(row['completion'])} |"
            )
    return [*lines, ""]


def _worth(data: Mapping[str, Any]) -> list[str]:
    """What each ingredient is worth."""
    heads, *rows = ablations.worth_table(data["figures"])
    return [
        "Gain: of the objects, how many more are sorted than by what a variant is compared with, over pairs of runs of",
        "the same pour (95 % interval); p: how often signs drawn at random make as large a difference.",
        "",
        f"| {' | '.join(heads)} |",
        f"|{'---|' * len(heads)}",
        *(f"| `{name}` | {' | '.join(cells)} |" for name, *cells in rows),
        "",
    ]


def _over_limits(data: Mapping[str, Any]) -> list[str]:
    """Runs in which a joint exceeded something."""
    rows = [(row["seed"], (row.get("limits") or {}).get("violations", {})) for row in rows_of(data, "run")]
    told = [
        f"| {seed} | {' | '.join(str(of.get(kind, 0)) for kind in KINDS)} |" for seed, of in rows if any(of.values())
    ]
    return (
        ["| seed | samples over a limit of position | of speed | of effort |", "|---|---|---|---|", *told, ""]
        if told
        else []
    )


BEFORE: dict[str, Callable[[Mapping[str, Any]], list[str]]] = {
    "sort": _sequences,
    "faults": _over_limits,
    "ablations": _worth,
    "fault_ablations": _worth,
}
"""What stands before the figures of a bench."""


def _plots(results: Mapping[str, Mapping[str, Any]], name: str) -> list[str]:
    plots = [f"![{plot}](plots/{plot}.svg)" for plot in drawn(results) if PLOTS[plot][0][0] == name]
    if name == "pose" and results[name]["figures"].get("trials.false_positives"):
        plots += [
            "Looks at the ten scenes with false positives: what was detected, all hypotheses, what is accepted.",
            "![corrected](plots/corrected.jpg)",
        ]
    return [line for plot in plots for line in (plot, "")]


def _figures(data: Mapping[str, Any], aims: Aims) -> list[str]:
    rows = [
        f"| {figure} | {_number(value)} | {aim(aims, figure, float('nan') if value is None else value)} |"
        for figure, value in data["figures"].items()
    ]
    return ["| figure | value | aim |", "|---|---|---|", *rows]


def _batch(title: str, aims: Aims, data: Mapping[str, Any], plots: Sequence[str]) -> list[str]:
    """What a batch has come to, and what it lost. plots: lines that show them."""
    lines = [f"## {title}", "", f"`sum-drake {_batch_command(data)}`", "", *plots, *_figures(data, aims), ""]
    lines += _lost(data["losses"], [{"cause": cause, "trials": n} for cause, n in data.get("errors", {}).items()])
    return [*lines, told_of(data), "", f"With {_packages(data)}.", ""]


def _lost(losses: Sequence[Mapping[str, Any]], errors: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every object that was lost, and errors by cause; of what is told apart, if anything is, the first column says."""
    heads = [*dict.fromkeys(head for row in (*losses, *errors) for head in ("variant", "of") if head in row)]
    lost = _table((*heads, "seed", "label", "place", "cause"), ("lost", "ended"), losses)
    failed = _table((*heads, "cause", "trials"), ("manipulation error", "trials"), errors)
    return [*lost, *failed]


def _table(keys: Sequence[str], said: tuple[str, str], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Rows under heads, nothing for none. said: what stands for the two that are told differently."""
    if not rows:
        return []
    words = {"label": said[0], "place": said[1]} if "label" in keys else {"cause": said[0], "trials": said[1]}
    return [
        f"| {' | '.join(words.get(key, key) for key in keys)} |",
        f"|{'---|' * len(keys)}",
        *(f"| {' | '.join(str(row.get(key, '')) for key in keys)} |" for row in rows),
        "",
    ]


def _packages(data: Mapping[str, Any]) -> str:
    return packages(data, ("python", "drake", "torch", "numpy"))


def _batch_command(data: Mapping[str, Any]) -> str:
    (first, last), objects = data["seeds"], data["settings"]["objects"]
    return f"batch --runs {last - first + 1} --first-seed {first} --objects {objects} --out out/b{objects}"


def _batches(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What was run beside a bench, for it: `batch_folder.made_by` of each."""
    return list(data["settings"].get("batches", ()))


def _commands(name: str, data: Mapping[str, Any]) -> list[str]:
    """That make a result."""
    settings, lines, more = data["settings"], [], ""
    for batch in settings.get("batches", ()):
        lines.append(_batch_command(batch))
        more += f" --batch out/b{batch['settings']['objects']}"
    if data["bench"] == "ablations":
        more = f" --seed {data['seeds']['first']} --runs {data['figures']['default.runs']:.0f}"
        more += " --faults" if settings.get("faults") else ""
        left_out = ablations.VARIANTS.keys() - settings["variants"].keys()
        more += f" --variants {' '.join(settings['variants'])}" if left_out else ""
    return [*lines, f"bench {data['bench']} --out out/{name}{more}"]


def _number(value: float | None, digits: int = 4) -> str:
    return "unknown" if value is None else number(value, digits)


SORTED = "{objects_sorted_share} ({objects_sorted_low95} to {objects_sorted_high95})"
HEADLINES: dict[str, tuple[tuple[str, str], ...]] = {
    "batch5": (
        ("five poured objects: share sorted (95 % interval)", SORTED),
        ("pours", "{runs}"),
        ("objects in the wrong bin", "{missorted}"),
        ("trials an object sorted (the paper: 43 for 38)", "{trials_per_object}"),
        ("CPU seconds a run, median", "{cpu_s_per_run_median}"),
        ("samples over a joint's limits", "{limit_violations}"),
    ),
    "batch10": (
        ("ten poured objects: share sorted (95 % interval)", SORTED),
        ("pours", "{runs}"),
    ),
    "sort": (
        ("the paper's eight sequences: objects sorted, of 40 (the paper: 38)", "{sequences_objects_sorted}"),
        ("trials in them (the paper: 43)", "{sequences_trials}"),
    ),
    "faults": (
        ("ten runs with seven faults each: share dealt with within two looks", "{dealt_with_within_2}"),
        ("crashes, hangs, impossible beliefs", "{crashes}, {hangs}, {invalid_beliefs}"),
        ("samples over a joint's limits", "{limit_violations}"),
    ),
    "detect": (
        ("detector: mAP@.5", "{map50}"),
        ("under lights, textures and a shading it never saw", "{map50_shift}"),
        ("likeliest label right on true boxes", "{top1_on_true_boxes}"),
        ("the same, under what it never saw", "{top1_on_true_boxes_shift}"),
    ),
    "pose": (
        ("poses within 2 cm and 20 degrees", "{default.within_2cm_20deg}"),
        ("the same by the paper's filter", "{paper.within_2cm_20deg}"),
        ("the same by FPFH with ICP", "{fpfh_icp.within_2cm_20deg}"),
        ("ten scenes as the paper's, eight objects each: lead of the area under the curve within 5 cm over the best "
         "baseline (95 % interval from)",
         "{trials.lead_5cm} ({trials.lead_5cm_low95})"),
        ("CPU seconds a pose", "{default.cpu_s_per_object}"),
        ("the same by the paper's filter", "{paper.cpu_s_per_object}"),
    ),
    "reject": (
        ("wrong hypotheses rejected, of two detectors, one of which errs on purpose", "{false_rejected}"),
        ("of the trained detector's alone", "{trained.false_rejected}"),
        ("objects that some hypothesis has right, kept", "{true_kept}"),
        ("calibration error of a stated probability", "{calibration_error}"),
        ("false positives rejected in ten scenes as the paper's, five objects each (the paper: .84), of one that errs "
         "on purpose", "{paper.false_rejected}"),
        ("found again, or given up, within two looks of what happened to it", "{recovered_within_2}"),
    ),
    "plan": (
        ("inverse kinematics: reachable poses solved", "{ik_success}"),
        ("seconds each, median", "{ik_median_s}"),
        ("paths of picks found within 1 CPU s", "{plan_success_1s}"),
        ("seconds each, median", "{plan_median_s}"),
        ("picks with true poses that succeed: of objects alone", "{pick_success_alone}"),
        ("the same from tables of five", "{pick_success_clutter}"),
        ("samples over a joint's limits, in all picks", "{limit_violations}"),
    ),
    "speed": (
        ("a particle in the atlas, times as fast as one rendered alone", "{atlas_speedup}"),
    ),
}  # fmt: skip
"""What the project's README tells, by bench: in words, and the figures, beside what is aimed at."""
README = HERE.parent / "README.md"
BEGIN, END = "<!-- results: written by benchmarks/tables.py -->", "<!-- end of results -->"


def headlines(results: Mapping[str, Mapping[str, Any]]) -> str:
    """The project's README's table."""
    lines = ["| measured | value | aim | by | at commit |", "|---|---|---|---|---|"]
    aims_of = {name: aims for name, (_, aims) in (BENCHES | BATCHES).items()}
    for bench, rows in HEADLINES.items():
        data = results.get(bench, {})
        figures = {name: float("nan") if value is None else value for name, value in data.get("figures", {}).items()}
        made_by = "batch" if bench in BATCHES else bench
        for words, template in rows:
            names = names_in(template)
            if names <= figures.keys():
                value = template
                for name in names:
                    value = value.replace(f"{{{name}}}", _number(data["figures"][name], 3))
                told = [aim(aims_of[bench], name, figures[name]) for name in figures if name in names]
                of = "; ".join(dict.fromkeys(one for one in told if one))
                lines.append(f"| {words} | {value} | {of} | `{made_by}` | {data.get('commit') or 'not told'} |")
    return "\n".join(lines)


def names_in(template: str) -> set[str]:
    """Figures that a cell tells."""
    return {name for _, name, _, _ in string.Formatter().parse(template) if name}


def readme(text: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """The project's README with the table of now."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n\n{headlines(results)}\n\n{END}{rest.split(END)[1]}"


PLOTS: dict[str, tuple[tuple[str, ...], Callable[..., str]]] = {
    "poses": (("pose",), pose_plot),
    **{
        f"trials_{centimetres(metres)}cm": (("pose",), functools.partial(trials_plot, metres=metres))
        for metres in pose_figures.PAPER_BOUNDS
    },
    "belief": (("reject",), belief_plot),
    "telling": (("reject",), telling_plot),
    "paths": (("plan",), plan_plot),
    "sorted": (("batch5", "batch10"), lost_plot),
    "gains": (("ablations",), gain_plot),
    "fault_gains": (("fault_ablations",), gain_plot),
}
"""Name of a file -> the results it is of, the first of which has to be there, and how they are drawn."""


def drawn(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The plots for which there are results."""
    told = {plot: of[0] for plot, (of, _) in PLOTS.items() if of[0] in results}
    return [
        plot for plot, of in told.items() if not plot.startswith("trials") or "trials.scenes" in results[of]["figures"]
    ]


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
