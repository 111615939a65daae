"""Many runs, kept one by one: DIR/SEED/ run folders with episode.json, and DIR/batch.json of what they come to.

A run is kept whole, by renaming its folder, or not at all; called again, a batch goes on with what is missing. What a
run does depends on its scenario and seed alone, so order and number of workers change nothing.
"""

import dataclasses
import functools
import shutil
import tempfile
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import Any, Protocol

from sum_drake.assets import InputError
from sum_drake.batch_figures import batch_figures, causes, errors, losses
from sum_drake.batch_folder import SCHEMA, brief, read_batch, read_episode
from sum_drake.doctor import commit, device, versions
from sum_drake.episodes import EpisodeResult, EpisodeSpec, Running, run_episode
from sum_drake.files import PART, alone
from sum_drake.fingerprint import different
from sum_drake.jsonio import write_json

WORK = ".work"
"""Folder in the batch's of what is not done."""
OFTEN_S, WRITING = 2.0, 0.05
"""Seconds between writes of batch.json while many runs end, and the share of the time that may go into them: which runs
are kept is told by their folders."""
Progress = Callable[[str, int, int], None]


class Executor(Protocol):
    """Runs episodes somewhere."""

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[EpisodeResult, None, None]:
        """Each episode once, as it ends. work: a folder for what is under way."""
        ...


@dataclasses.dataclass(frozen=True)
class Processes:
    """So many processes on this machine, each for one episode."""

    workers: int

    def run(self, specs: Sequence[EpisodeSpec], work: Path) -> Generator[EpisodeResult, None, None]:
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


def keep(episode: EpisodeResult, out: Path) -> None:
    """Puts an episode's folder into the batch's, whole."""
    folder = Path(tempfile.mkdtemp(dir=out / WORK, prefix=f"{episode.seed}.kept."))
    folder.chmod(0o755)
    for name, content in episode.files.items():
        (folder / name).write_bytes(content)
    if episode.reason:
        (folder / "log.txt").write_text(episode.log)
    write_json(folder / "episode.json", episode.row())
    folder.rename(out / str(episode.seed))


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
