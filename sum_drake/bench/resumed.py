"""Tasks of a bench, done in processes of their own and kept in rows.jsonl as they are done: called again with the same
settings, a bench goes on where it was cut off.
"""

import functools
import json
import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Generic, TypeVar

from sum_drake.assets import InputError, one_line
from sum_drake.doctor import versions
from sum_drake.files import write_whole
from sum_drake.fingerprint import different
from sum_drake.jsonio import decode, encode
from sum_drake.workers import belong_to_parent, give_up, one_thread_each

Task = tuple[str | int, ...]
"""What tells a task from others."""
Progress = Callable[[str, int, int], None]
Result = TypeVar("Result")


class RowLog(Generic[Result]):
    """rows.jsonl: settings and versions of packages in the first line, then one line for each task that is done.

    kind: the type of a task's result, which `jsonio.encode` can write. Raises InputError for a file of other settings
    or another shape; a last line that was cut off while it was written is dropped.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any], kind: type[Result]) -> None:
        self._path = out / "rows.jsonl"
        self.done: dict[Task, Result] = {}
        settings = {**settings, **versions()}
        out.mkdir(parents=True, exist_ok=True)
        where = str(self._path)
        try:
            text = self._path.read_text() if self._path.is_file() else ""
            if not text.endswith("\n"):
                text = text[: text.rfind("\n") + 1]
                write_whole(self._path, text)
            lines = text.splitlines()
            if not lines:
                self._path.write_text(json.dumps(settings) + "\n")
                return
            where = f"{self._path}, line 1"
            other = different(json.loads(lines[0]), settings)
            if other:
                raise InputError(f"{self._path}: is of {other}; expected a new --out, or --force")
            for number, line in enumerate(lines[1:], start=2):
                where = f"{self._path}, line {number}"
                entry = json.loads(line)
                self.done[tuple(entry["task"])] = decode(kind, entry["result"])
        except InputError:
            raise
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{where}: {one_line(error)}; expected a row of this bench, or a new --out") from error

    def add(self, task: Task, result: Result) -> None:
        """What came of a task."""
        with self._path.open("a") as file:
            file.write(json.dumps({"task": task, "result": encode(result)}) + "\n")
        self.done[task] = result


def run_tasks(
    tasks: Sequence[Task],
    log: RowLog[Result],
    measure: Callable[..., Result],
    *,
    workers: int,
    begin: Callable[..., None],
    arguments: tuple[Any, ...],
    progress: Progress,
) -> list[Result]:
    """Results of `measure(*task)` in the order of the tasks; only what is not in the log is done.

    begin: called with the arguments in each process before its first task. All three must pickle.
    """
    left = [task for task in tasks if task not in log.done]
    progress("measuring", len(tasks) - len(left), len(tasks))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, functools.partial(_begin, begin), arguments) as pool:
        try:
            with one_thread_each():
                futures = {pool.submit(measure, *task): task for task in left}
            for future in as_completed(futures):
                log.add(futures[future], future.result())
                progress("measuring", sum(task in log.done for task in tasks), len(tasks))
        except BaseException:
            give_up(pool)  # what they are at takes minutes, and is lost either way
            raise
    return [log.done[task] for task in tasks]


def _begin(begin: Callable[..., None], *arguments: Any) -> None:
    import torch

    belong_to_parent()
    torch.set_num_threads(1)
    begin(*arguments)
