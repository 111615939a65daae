"""Many runs, kept one by one: DIR/SEED/ run folders with episode.json, and DIR/batch.json of what they come to.

A run is kept whole, by renaming its folder, or not at all; called again, a batch goes on with what is missing. What a
run does depends on its scenario and seed alone, so order and number of workers change nothing.
"""

import dataclasses
import functools
import json
import shutil
import tempfile
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import Any, Protocol

from sum_drake.assets import InputError, one_line
from sum_drake.batch_figures import COSTS, batch_figures, causes, errors, losses
from sum_drake.doctor import commit, device, versions
from sum_drake.episodes import SCHEMA as EPISODE
from sum_drake.episodes import STATES, Episode, EpisodeSpec, Running, run_episode
from sum_drake.files import PART, alone
from sum_drake.fingerprint import different
from sum_drake.json_shape import check_shape
from sum_drake.jsonio import write_json
from sum_drake.summary_schema import ATTEMPT, FAULT, LIMITS, OBJECT, OUTCOMES

SCHEMA = "sum-drake/batch/1"
WORK = ".work"
"""Folder in the batch's of what is not done."""
OFTEN_S, WRITING = 2.0, 0.05
"""Seconds between writes of batch.json while many runs end, and the share of the time that may go into them: which runs
are kept is told by their folders."""
Progress = Callable[[str, int, int], None]


class Executor(Protocol):
    """Runs episodes somewhere."""

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[Episode, None, None]:
        """Each episode once, as it ends. work: a folder for what is under way."""
        ...


@dataclasses.dataclass(frozen=True)
class Processes:
    """So many processes on this machine, each for one episode."""

    workers: int

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[Episode, None, None]:
        """As `Executor.run`; what is under way when it is interrupted is ended."""
        running = Running()
        with ThreadPoolExecutor(self.workers) as pool:
            pending = {pool.submit(run_episode, spec, work, running) for spec in specs}
            try:
                while pending:
                    done, pending = wait(pending, return_when=FIRST_COMPLETED)
                    while done:  # whose files are not kept in memory any longer than it takes to write them
                        yield done.pop().result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                running.end()
                raise


def run_batch(
    out: Path,
    specs: Sequence[EpisodeSpec],
    settings: Mapping[str, Any],
    executor: Executor,
    progress: Progress,
) -> dict[str, Any]:
    """Runs what is missing of a batch; returns what batch.json then holds.

    settings: what the runs of a batch have in common. Raises InputError for a folder that holds a batch of other
    settings, that another batch is at, or in which something else has the name of a run.
    """
    check_batch(out, settings)
    work = out / WORK
    out.mkdir(parents=True, exist_ok=True)
    with alone(out, "another batch"):
        shutil.rmtree(work, ignore_errors=True)  # of a batch that was killed
        work.mkdir(exist_ok=True)  # what was killed may not be quite dead
        asked = {"objects_asked": settings["objects"]}
        rows = {spec.seed: row | asked for spec in specs if (row := read_episode(out / str(spec.seed))) is not None}
        left = [spec for spec in specs if spec.seed not in rows]
        for folder in (out / str(spec.seed) for spec in left):
            if folder.exists():  # runs are kept whole, so that it is nobody's here
                raise InputError(
                    f"{folder}: holds no episode.json; expected a run of the batch, or nothing: move it away"
                )
        seeds = [spec.seed for spec in specs]
        begun_by = read_batch(out).get("commit") if (out / "batch.json").is_file() else commit()
        write = functools.partial(_write, out, settings, seeds, rows, begun_by)
        write()
        written, wait_s = time.monotonic(), OFTEN_S
        progress("running", len(rows), len(specs))
        with closing(executor.run(left, work)) as episodes:
            for episode in episodes:
                keep(episode, out)
                rows[episode.seed] = episode.row() | asked
                begun = time.monotonic()
                if begun > written + wait_s:
                    write()
                    written = time.monotonic()
                    wait_s = max(OFTEN_S, (written - begun) / WRITING)
                progress("running", len(rows), len(specs))
        told = write()
        shutil.rmtree(work, ignore_errors=True)
    return told


def check_batch(out: Path, settings: Mapping[str, Any]) -> None:
    """Raises InputError unless a folder is new, empty, or holds a batch of these settings and of these packages."""
    file = out / "batch.json"
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: a file; expected a folder or a new name")
    if not file.is_file():
        if any(out.glob("*/episode.json")):
            raise InputError(f"--out {out}: lost the batch.json that tells what its runs are of; expected a new --out")
        if out.is_dir() and any(path.name != WORK and not path.name.endswith(PART) for path in out.iterdir()):
            raise InputError(f"--out {out}: exists and holds no batch; expected a new folder, or one of a batch")
        return
    begun = read_batch(out)
    other = different({**begun["settings"], **begun["versions"]}, {**settings, **versions()})
    if other:
        raise InputError(f"{file}: is of {other}; expected a new --out")


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
    "causes": {str: int}, "losses": [{"seed": int, "label": str, "place": str, "cause": str}], "episodes": [dict],
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
        raise InputError(f"{file}: {error}: not as `batch` writes it; restore it, or take a new --out") from None
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


def keep(episode: Episode, out: Path) -> None:
    """Puts an episode's folder into the batch's, whole."""
    folder = Path(tempfile.mkdtemp(dir=out / WORK, prefix=f"{episode.seed}.kept."))
    folder.chmod(0o755)
    for name, content in episode.files.items():
        (folder / name).write_bytes(content)
    if episode.reason:
        (folder / "log.txt").write_text(episode.log)
    write_json(folder / "episode.json", episode.row())
    folder.rename(out / str(episode.seed))


BRIEF = (
    "seed", "state", "reason", "outcome", "objects_asked", "objects_total", "objects_sorted", "objects_missorted",
    "manipulation_trials", "manipulation_errors", "timing", "limits", "digest", "cpu_s", "wall_s", "peak_memory_mib",
)  # fmt: skip
"""What batch.json, and results of benches, tell of each run."""


def brief(row: Mapping[str, Any]) -> dict[str, Any]:
    """What there is of BRIEF."""
    return {key: row[key] for key in BRIEF if key in row}


def _write(
    out: Path,
    settings: Mapping[str, Any],
    seeds: Sequence[int],
    rows: Mapping[int, Mapping[str, Any]],
    begun_by: str | None,
) -> dict[str, Any]:
    done = [rows[seed] for seed in seeds if seed in rows]
    devices = dict.fromkeys(row["device"] for row in done if "device" in row)
    told = {
        "schema": SCHEMA,
        "settings": dict(settings),
        "seeds": [min(seeds), max(seeds)],
        "runs": len(seeds),
        "done": len(done),
        "figures": batch_figures(done),
        "causes": causes(done),
        "errors": errors(done),
        "losses": losses(done),
        "episodes": [brief(row) for row in done],
        "versions": versions(),
        "commit": begun_by,
        "device": "; ".join(devices) or device(),
    }
    write_json(out / "batch.json", told)
    return told
