"""What a batch's folder holds, read back and checked: DIR/batch.json, and episode.json of each run."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sum_drake.assets import InputError, one_line
from sum_drake.batch_figures import COSTS
from sum_drake.episodes import SCHEMA as EPISODE
from sum_drake.episodes import STATES
from sum_drake.json_shape import check_shape
from sum_drake.summary_schema import ATTEMPT, FAULT, LIMITS, OBJECT, OUTCOMES

SCHEMA = "sum-drake/batch/1"
ROW: dict[str, Any] = {"seed": int, "state": str, "reason": str, "cpu_s": float, "peak_memory_mib": float}
"""Of episode.json, and of a row of batch.json, whatever became of the run."""
SUMMED: dict[str, Any] = {
    "objects_total": int, "objects_sorted": int, "objects_missorted": int, "manipulation_trials": int,
    "manipulation_errors": int, "timing": dict.fromkeys(COSTS, float | None), "outcome": str, "digest": str,
}  # fmt: skip
"""The same, of a run that came to its own end, and of others where there is a summary."""
TOLD: dict[str, Any] = {"objects": [OBJECT], "attempts": [ATTEMPT], "versions": {str: str}, "device": str}
"""Of episode.json alone, with a summary."""
FIELDS = {
    "settings": {"objects": int}, "seeds": [int], "runs": int, "done": int, "figures": {str: float | None},
    "causes": {str: int}, "losses": [{"seed": int, "label": str, "place": str, "cause": str}], "episodes": [{}],
    "versions": {str: str}, "device": str,
}  # fmt: skip
"""Of batch.json, in which those of older versions have no `errors` and no `commit`."""


def read_batch(folder: Path) -> dict[str, Any]:
    """batch.json of a folder. Raises InputError for one that cannot be read, is newer, or is not a batch's."""
    file = folder / "batch.json"
    try:
        data = _read(file, SCHEMA, "batch")
        check_shape(data, FIELDS, "batch")
        for i, row in enumerate(data["episodes"]):
            _check_row(row, SUMMED, f"batch.episodes[{i}]")
        if len(data["seeds"]) != 2:
            raise InputError(f"batch.seeds: {data['seeds']}; expected a first and a last one")
        check_shape(data.get("errors", {}), {str: int}, "batch.errors")
        check_shape(data.get("commit"), str | None, "batch.commit")
    except OSError as error:
        raise InputError(f"{folder}: no batch ({error.strerror}: batch.json); expected a folder of `batch`") from None
    except InputError as error:
        raise InputError(f"{file}: {error}: not as `batch` writes it; restore it, or take another folder") from None
    return data | {"episodes": [{"objects_asked": data["settings"]["objects"], **row} for row in data["episodes"]]}


def _read(file: Path, schema: str, where: str) -> dict[str, Any]:
    """An object of JSON. Raises InputError for what is none, or of another schema, OSError for what cannot be read."""
    try:
        data = json.loads(file.read_text())
    except ValueError as error:
        raise InputError(f"no JSON ({one_line(error)})") from None
    check_shape(data, {"schema": str}, where)
    if data["schema"] != schema:
        raise InputError(f"{where}.schema: {data['schema']!r}; expected {schema!r}")
    return dict(data)


def _check_row(row: Any, summed: Mapping[str, Any], where: str) -> None:
    """Raises InputError for what is no row of a run; summed: what it holds of a summary, where there is one."""
    check_shape(row, ROW, where)
    if row["state"] not in STATES:
        raise InputError(f"{where}.state: {row['state']!r}; expected one of {', '.join(STATES)}")
    for name in ("cpu_s", "peak_memory_mib"):
        _check_least(row, name, where)
    if row["state"] == "ended" or "objects_total" in row:
        check_shape(row, summed, where)
        for name in ("objects_missorted", "manipulation_trials", "manipulation_errors"):
            _check_least(row, name, where)
        if not 0 <= row["objects_sorted"] <= row["objects_total"]:
            raise InputError(f"{where}.objects_sorted: {row['objects_sorted']}; expected 0 to {row['objects_total']}")
        for i, attempt in enumerate(row["attempts"] if "attempts" in summed else ()):
            if attempt["outcome"] not in OUTCOMES:
                raise InputError(
                    f"{where}.attempts[{i}].outcome: {attempt['outcome']!r}; expected one of {', '.join(OUTCOMES)}"
                )
    if row.get("limits") is not None:
        check_shape(row["limits"], LIMITS, f"{where}.limits")
    check_shape(row.get("faults", []), [FAULT], f"{where}.faults")


def _check_least(row: Mapping[str, Any], name: str, where: str) -> None:
    if row[name] < 0:
        raise InputError(f"{where}.{name}: {row[name]}; expected 0 or more")


def read_episode(folder: Path) -> dict[str, Any] | None:
    """episode.json of a run that was kept; None where there is none. Raises InputError for one that cannot be used."""
    file = folder / "episode.json"
    if not file.is_file():
        return None
    try:
        row = _read(file, EPISODE, "episode")
        _check_row(row, SUMMED | TOLD, "episode")
        if str(row["seed"]) != folder.name:
            raise InputError(f"episode.seed: {row['seed']}; expected {folder.name}, as the folder")
    except InputError as error:
        raise InputError(f"{file}: {error}: remove {folder} to run it again") from None
    return row


def read_episodes(folder: Path) -> list[dict[str, Any]]:
    """The runs of a batch that are done, by seed. Raises InputError for a folder that is none.

    What else is in the folder, as a batch may have been asked for fewer runs since, is no part of it.
    """
    batch = read_batch(folder)
    asked, (first, last) = {"objects_asked": batch["settings"]["objects"]}, batch["seeds"]
    found = (read_episode(folder / str(seed)) for seed in range(first, last + 1))
    return [row | asked for row in found if row is not None]


def made_by(folder: Path) -> dict[str, Any]:
    """Which program, on what, has made a batch, and which runs it is of."""
    batch = read_batch(folder)
    return {name: batch.get(name) for name in ("seeds", "runs", "done", "settings", "commit", "versions", "device")}


BRIEF = (
    "seed", "state", "reason", "outcome", "objects_asked", "objects_total", "objects_sorted", "objects_missorted",
    "manipulation_trials", "manipulation_errors", "timing", "limits", "digest", "cpu_s", "wall_s", "peak_memory_mib",
    "device",
)  # fmt: skip
"""What batch.json, and results of benches, tell of each run."""


def brief(row: Mapping[str, Any]) -> dict[str, Any]:
    """What there is of BRIEF."""
    return {key: row[key] for key in BRIEF if key in row}
