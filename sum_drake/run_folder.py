"""A run folder as reports read it: whatever of summary, log and scenario there is."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake.assets import InputError, one_line
from sum_drake.jsonio import encode
from sum_drake.runlog_reader import RunRecord, read_what_there_is
from sum_drake.summary_schema import validate_summary
from sum_drake.types import Attempt, Perception, Region, readonly, shaped
from sum_drake.yamlio import parse_yaml

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


@dataclasses.dataclass(frozen=True, eq=False)
class Tried:
    """One attempt, by whoever knows of it."""

    row: Mapping[str, Any]
    """As in summary.json; without an outcome where there is no summary."""
    attempt: Attempt | None
    """As in the log."""
    look: Perception | None
    """On which it was decided, as in the log."""
    number: int | None
    """Counts, from 1, the attempts for which the arm set out, if the log tells; None for the others."""


@dataclasses.dataclass(frozen=True, eq=False)
class RunFolder:
    """What a run folder holds."""

    name: str
    summary: Mapping[str, Any] | None
    record: RunRecord | None
    scenario: str | None
    problems: tuple[str, ...]
    """What is missing or broken, one line each."""

    @property
    def perceptions(self) -> tuple[Perception, ...]:
        """Of the log."""
        return () if self.record is None else self.record.perceptions

    @property
    def seed(self) -> str:
        """`?` where nothing tells it."""
        if self.summary is not None:
            return str(self.summary["seed"])
        return "?" if self.record is None else self.record.metadata.get("seed", "?")

    @property
    def outcome(self) -> str:
        """As in summary.json, else as the log's last event tells; "unfinished" where neither does."""
        if self.summary is not None:
            return str(self.summary["outcome"])
        events = () if self.record is None else self.record.events
        ended = [event["detail"].get("outcome") for event in events if event["name"] == "run_ended"]
        return str(ended[-1]) if ended and ended[-1] else "unfinished"

    def tried(self) -> list[Tried]:
        """All attempts, in their order."""
        logged = [] if self.record is None else [attempt for _, attempt in self.record.attempts]
        looks = {look.step: look for look in self.perceptions}
        rows = [_row(attempt) for attempt in logged] if self.summary is None else list(self.summary["attempts"])
        tried, number = [], 0
        for i, row in enumerate(rows):
            attempt = logged[i] if i < len(logged) and _same(row, logged[i]) else None
            acted = attempt is not None and attempt.action is not None
            number += acted
            tried.append(Tried(row, attempt, looks.get(row["step"]), number if acted else None))
        return tried

    def resolved(self) -> Mapping[str, Any]:
        """The scenario's fields; none where it is missing or broken."""
        return _resolved(self.scenario or "")

    def regions(self) -> dict[str, Region]:
        """The scenario's, by name; what cannot be read is left out."""
        named = self.resolved().get("regions")
        regions = {}
        for name, config in named.items() if isinstance(named, dict) else ():
            try:
                center, half = (readonly(shaped(key, config[key], 3)) for key in ("p_W", "half_extents"))
            except (ValueError, TypeError, KeyError):
                continue
            regions[str(name)] = Region(str(name), center, half)
        return regions


def read_run_folder(folder: Path) -> RunFolder:
    """Reads what there is. Raises InputError for a folder that holds neither a summary nor a log that can be read."""
    problems, summary, record, scenario = [], None, None, None
    try:
        data = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        validate_summary(data)
        summary = data
    except FileNotFoundError:
        problems.append("There is no summary.json: the run did not finish, or goes on. Nothing is known of the truth.")
    except (OSError, ValueError) as error:
        problems.append(f"summary.json cannot be used: {one_line(error)}")
    try:
        record = read_what_there_is(folder / "run.mcap")
        if record.problem is not None:
            problems.append(f"Read as far as it goes: {record.problem}")
    except InputError as error:
        problems.append(str(error))
    if summary is None and record is None:
        raise InputError(
            f"{folder}: nothing to report; expected a run folder with summary.json or run.mcap, or a batch"
        )
    if (folder / "scenario.yaml").is_file():
        scenario = (folder / "scenario.yaml").read_text(encoding="utf-8", errors="replace")
    if scenario is None:
        problems.append("There is no scenario.yaml: table and bins are not known.")
    elif not _resolved(scenario):
        problems.append("scenario.yaml holds no scenario that can be read: table and bins are not known.")
    logged = None if record is None else record.metadata.get("seed")
    if summary is not None and logged is not None and logged != str(summary["seed"]):
        told = f"summary.json is of seed {summary['seed']}, run.mcap of seed {logged}"
        problems.append(f"{told}: expected files of one run. What is said of looks is the log's.")
    here = f"{folder}/"  # A report is passed on: it need not tell where the folder lay.
    return RunFolder(folder.resolve().name, summary, record, scenario, tuple(p.replace(here, "") for p in problems))


def _resolved(scenario: str) -> Mapping[str, Any]:
    """The fields of a resolved scenario's text; none where it is broken."""
    try:
        data = parse_yaml(scenario, "scenario.yaml")
    except InputError:
        return {}
    resolved = data.get("resolved") if isinstance(data, dict) else None
    return resolved if isinstance(resolved, dict) else {}


def catalogue_of_run(run: RunFolder) -> tuple["Catalogue", str | None]:
    """The objects that a run's scenario names, or the package's and why only those."""
    from sum_drake.objects import load_catalogue

    named = run.resolved().get("catalogue")
    try:
        return load_catalogue(Path(named) if isinstance(named, str) and named else None), None
    except InputError as error:
        return load_catalogue(), f"Only objects of the package can be drawn: {error}"


def _row(attempt: Attempt) -> Mapping[str, Any]:
    return {**encode(attempt), "rejected_by": dict(attempt.rejected_by), "outcome": None, "slip_m": None}


def _same(row: Mapping[str, Any], attempt: Attempt) -> bool:
    """Whether a row of the summary is of this attempt: both tell them in their order."""
    return all(row[key] == getattr(attempt, key) for key in ("step", "track", "label"))
