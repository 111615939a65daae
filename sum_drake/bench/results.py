"""results.json, which every bench leaves: schema "sum-drake/bench/1"."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sum_drake.doctor import commit, device, versions
from sum_drake.fingerprint import code
from sum_drake.jsonio import encode, write_json

SCHEMA = "sum-drake/bench/1"


def made_with() -> dict[str, Any]:
    """What every committed result tells of where it comes from: versions, commit and device."""
    return {"versions": versions(), "commit": commit(), "device": device()}


def write_results(
    out: Path,
    bench: str,
    *,
    quick: bool,
    settings: Mapping[str, Any],
    seeds: Mapping[str, int],
    figures: Mapping[str, float],
    rows: Sequence[Mapping[str, Any]],
    batches: Sequence[Mapping[str, Any]] = (),
) -> None:
    """Writes `out`/results.json, whole or not at all.

    Args:
        bench: its name.
        settings: what else it depends on, beside the program's code; a batch's own, which leaves benches out, is not
            told.
        seeds: by what they are for.
        figures: name -> number; shares are 0 to 1. What cannot be known (nan) becomes null, in rows, too.
        rows: the tables behind the figures; each row names its table under "table".
        batches: `batch_folder.made_by` of those that the rows are of. Commit and device are then theirs, not of whoever
            counts.
    """
    data = {
        "schema": SCHEMA,
        "bench": bench,
        "quick": quick,
        "settings": {**settings, "code": code()},
        "seeds": seeds,
        **made_with(),
        **({field: _all_of(batches, field) for field in ("commit", "device")} if batches else {}),
        "figures": figures,
        "rows": rows,
    }
    write_json(out / "results.json", _without_nan(encode(data)))


def _all_of(batches: Sequence[Mapping[str, Any]], field: str) -> str:
    """What batches tell under a name, each once."""
    return "; ".join(dict.fromkeys(part for batch in batches for part in str(batch[field] or "unknown").split("; ")))


def _without_nan(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _without_nan(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_without_nan(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
