"""Picks with true poses: `sum-drake bench plan` on grasps, motions and their execution, whatever perception does.

Each of the catalogue's objects lies alone on the table, as it came to rest from a random orientation, several times;
and tables of five objects are poured, from each of which one object is taken. The robot is told where everything
truly is, as a belief without spread. Grasps are ranked, and a motion is planned and played in the station's physics, by
the functions that sorting has them from, but without what `SortingTask` adds: nothing is moved out of the way, and no
bin fills up. From a table, the first object in a random order is taken for which there is a plan. A pick has worked if
its object ends in the region that it belongs in.
How they are done: `plan_pick_trials`.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sum_drake.bench.aims import Aims
from sum_drake.bench.resumed import Task
from sum_drake.jsonio import encode
from sum_drake.objects import Catalogue
from sum_drake.types import Array

FIRST_ALONE, FIRST_TABLE = 700_000_000, 800_000_000
"""Seeds of what is poured, so that no table is in two experiments."""
CLUTTER = 5
"""Objects on a table."""

AIMS: Aims = {
    "pick_success_alone": ("at least", 0.97),
    "pick_success_clutter": ("at least", 0.92),
    "slip_p95_m": ("at most", 0.010),
    "limit_violations": ("at most", 0.0),
}
"""What the figures are to reach."""


@dataclasses.dataclass(frozen=True)
class Size:
    """How much is measured."""

    objects: int
    """Of the catalogue, spread over it; all where it has fewer."""
    poses: int
    """In which each lies alone."""
    tables: int
    """Of five objects, from each of which one is taken."""


FULL, QUICK = Size(objects=15, poses=4, tables=60), Size(objects=2, poses=1, tables=1)


@dataclasses.dataclass(frozen=True)
class Picked:
    """One pick."""

    setting: str
    """alone or clutter."""
    seed: int
    label: str
    succeeded: bool
    """Whether the object ended in its region."""
    place: str
    """Where it ended: a region, table, floor."""
    phase: str
    """In which it failed: plan, motion, grasp, lift, transport, release, simulation; empty where it has not."""
    cause: str
    """Of a failure: why there is no plan, or the attempt's reason."""
    hopeless: bool = False
    """Whether no hand like this could have taken the object, had it an arm for everything; see `no_hand_could`."""
    refused: tuple[tuple[str, str], ...] = ()
    """Objects that the robot would have taken before it, and why there was no plan."""
    knocked_off: tuple[str, ...] = ()
    """Other objects that left the table."""
    pushed_m: float = 0.0
    """How far the other object that moved most was moved."""
    grasp_candidates: int = 0
    rejected_by: tuple[tuple[str, int], ...] = ()
    slip_m: float | None = None
    """How far the object moved in the hand between lift and release; None where it was not carried."""
    slip_from_grasp_m: float | None = None
    """The same from when the hand had closed on it."""
    motion_s: float = 0.0
    """Simulated time from the decision to the end."""
    planning_cpu_s: float = 0.0
    cpu_s: float = 0.0
    position_use: float = 0.0
    """Largest share of a joint's range, speed, acceleration, effort that was used; efforts of the arm alone."""
    speed_use: float = 0.0
    acceleration_use: float = 0.0
    effort_use: float = 0.0
    violations: tuple[tuple[str, int], ...] = ()
    """Samples beyond a limit, of efforts at it, by kind of limit."""
    X_WO: Array | None = None
    """(4, 4): where it lay."""


def pick_tasks(size: Size, catalogue: Catalogue, seed: int = 0) -> list[Task]:
    """Setting, seed of the pour, and the label of what lies alone."""
    count = min(size.objects, len(catalogue))
    labels = [catalogue.labels[i * len(catalogue) // count] for i in range(count)]
    offset = 100_000 * seed
    return [
        *(
            ("alone", FIRST_ALONE + offset + 1000 * pose + catalogue.labels.index(label), label)
            for pose in range(size.poses)
            for label in labels
        ),
        *(("clutter", FIRST_TABLE + offset + table, "") for table in range(size.tables)),
    ]


def pick_figures(picked: Sequence[Picked]) -> dict[str, float]:
    """The figures of picks; nan where there is nothing to measure one on."""
    found: dict[str, float] = {}
    for setting in ("alone", "clutter"):
        of = [one for one in picked if one.setting == setting]
        found[f"picks_{setting}"] = len(of)
        found[f"pick_success_{setting}"] = _share([one.succeeded for one in of])
        found[f"pick_success_{setting}_but_hopeless"] = _share([one.succeeded for one in of if not one.hopeless])
        found[f"pick_success_{setting}_executed"] = _share([one.succeeded for one in of if one.phase != "plan"])
    clutter = [one for one in picked if one.setting == "clutter"]
    tried = sum(1 + len(one.refused) for one in clutter)
    refused = sum(len(one.refused) + (one.phase == "plan") for one in clutter)
    found["clutter_refused"] = refused / tried if tried else np.nan
    found["clutter_knocked_off"] = _share([bool(one.knocked_off) for one in clutter])
    pushed = [one.pushed_m for one in clutter if one.phase != "plan"]
    found["clutter_pushed_median_m"] = float(np.median(pushed)) if pushed else np.nan
    for name in ("slip_m", "slip_from_grasp_m"):
        slips = [slip for one in picked if (slip := getattr(one, name)) is not None]
        found[name.replace("_m", "_p95_m")] = float(np.percentile(slips, 95)) if slips else np.nan
    found["limit_violations"] = sum(count for one in picked for _, count in one.violations)
    for name in ("position", "speed", "acceleration", "effort"):
        found[f"{name}_use"] = max((getattr(one, f"{name}_use") for one in picked), default=np.nan)
    found["hopeless"] = sum(one.hopeless for one in picked)
    for name in ("planning_cpu_s", "motion_s"):
        found[f"pick_{name}_median"] = float(np.median([getattr(one, name) for one in picked])) if picked else np.nan
    return found


def _share(of: Sequence[bool]) -> float:
    return float(np.mean(of)) if of else float("nan")


def pick_rows(picked: Sequence[Picked]) -> list[Mapping[str, Any]]:
    """Rows of results.json: every pick, success by object, failures by cause and which they are of."""
    rows: list[Mapping[str, Any]] = [{"table": "pick"} | encode(one) for one in picked]
    for setting in ("alone", "clutter"):
        of = [one for one in picked if one.setting == setting]
        for label in sorted({one.label for one in of}):
            mine = [one for one in of if one.label == label]
            worked = sum(one.succeeded for one in mine)
            rows.append(
                {"table": "pick_object", "setting": setting, "label": label, "picks": len(mine), "succeeded": worked}
            )
        failed: dict[tuple[str, str], list[str]] = {}
        for one in of:
            if not one.succeeded:
                failed.setdefault((one.phase, one.cause), []).append(f"{one.label} {one.seed}")
        rows += [
            {"table": "pick_failure", "setting": setting, "phase": phase, "cause": cause, "count": len(which)}
            | {"which": which}
            for (phase, cause), which in sorted(failed.items(), key=lambda item: -len(item[1]))
        ]
    return rows
