"""The command `sum-drake`."""

import argparse
import contextlib
import logging
import os
import shlex
import signal
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from sum_drake import __version__
from sum_drake.assets import InputError
from sum_drake.files import write_whole

if TYPE_CHECKING:
    from sum_drake.detection.dataset_job import Plan

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Returns 0: done; 1: the run itself failed; 2: bad input, said in one line on stderr."""
    # Perception and planning are single-threaded by design; idle pools of threads only get in each other's way.
    for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    options = _parser().parse_args(arguments)
    try:
        with _interrupts_between_imports():
            options.command(options)
    except InputError as error:
        print(f"sum-drake: {error}", file=sys.stderr)
        return BAD_INPUT
    except RuntimeError as error:
        print(f"sum-drake: failed: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt as interrupt:
        print("; ".join(["sum-drake: interrupted", *map(str, interrupt.args)]), file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # whoever read the output has had enough of it
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115
        return 0
    except OSError as error:
        print(f"sum-drake: {error.filename}: {error.strerror}; expected a place that can be written", file=sys.stderr)
        return BAD_INPUT
    return 0


@contextlib.contextmanager
def _interrupts_between_imports() -> Iterator[None]:
    """Within, Ctrl-C waits for the end of an import: Drake takes an interrupted one for a broken installation."""

    def interrupt(number: int, frame: types.FrameType | None) -> None:
        while frame is not None:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                signal.setitimer(signal.ITIMER_REAL, 0.05)  # and again
                return
            frame = frame.f_back
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGALRM)}
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with the arguments."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message}; expected arguments as in {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="sum-drake",
        description="Sequential Scene Understanding and Manipulation with Drake: perceive a poured table and sort it",
        epilog="example: sum-drake sort --seed 1",
    )
    parser.add_argument("--version", action="version", version=f"sum-drake {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    sort = _add(
        commands, "sort", _sort, "pour objects on the table, perceive and sort them", "sort --seed 3 --objects 5"
    )
    sort.description = (
        "Pour objects on the table, perceive and sort them. The exit code is 0 when the run came to its own end, with"
        " objects left on the table, too: the last line printed, outcome in summary.json and report.html tell how many"
        " were sorted and why it stopped. 1: the run failed; 2: bad input."
    )
    sort.add_argument("--scenario-file", type=Path, metavar="FILE", help="scenarios (default: the package's)")
    sort.add_argument("--scenario-name", metavar="NAME", help="which of them (default: the first)")
    sort.add_argument("--scenario-text", metavar="YAML", help="fields that go over the scenario's")
    sort.add_argument("--seed", type=int, metavar="S", help="seed of the run (default: the scenario's random_seed)")
    sort.add_argument("--objects", type=int, metavar="N", help="how many objects are poured, 1 to 15")
    sort.add_argument("--catalogue", type=Path, metavar="FILE", help="objects (default: the scenario's)")
    sort.add_argument("--graphviz", type=Path, metavar="FILE", help="write the diagram in Graphviz's format, too")
    sort.add_argument("--out", type=Path, metavar="DIR", help="run folder (default: runs/SEED)")
    sort.add_argument("--force", action="store_true", help="replace the run that is in the folder")
    sort.add_argument("--quiet", action="store_true", help="no progress")

    text = "the catalogue, or your own"
    objects = commands.add_parser("objects", help=text, description=text, epilog="example: sum-drake objects list")
    kinds = objects.add_subparsers(required=True, metavar="WHAT")
    for name, command, text in (
        ("list", _objects_list, "labels, categories, sizes, masses and symmetries"),
        ("check", _objects_check, "whether each mesh is fit for use"),
        ("render", _objects_render, "a contact sheet"),
    ):
        one = _add(kinds, name, command, text, f"objects {name}" + (" --out sheet.png" if name == "render" else ""))
        one.add_argument("--catalogue", type=Path, metavar="FILE", help="objects (default: the package's fifteen)")
        if name == "render":
            one.add_argument("--out", type=Path, metavar="FILE", default=Path("objects.png"), help="PNG to write")
            one.add_argument("--force", action="store_true", help="replace the file that is there")

    dataset = _add(
        commands, "dataset", _dataset, "render the detector's data set; called again, it goes on", "dataset --quick"
    )
    dataset.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("data/detect"), help="where to (default: data/detect)"
    )
    dataset.add_argument(
        "--scenes", type=int, nargs=4, metavar=("TRAIN", "VALIDATION", "TEST", "SHIFT"),
        help="how many of each split (default: 560 60 200 200)",
    )  # fmt: skip
    dataset.add_argument("--seed", type=int, metavar="S", default=0, help="seed of the scenes (default: 0)")
    dataset.add_argument("--catalogue", type=Path, metavar="FILE", help="objects (default: the package's fifteen)")
    dataset.add_argument("--quick", action="store_true", help="a small set, in about a minute")
    dataset.add_argument(
        "--workers", type=int, metavar="W", default=os.cpu_count() or 1, help="processes that render (default: all)"
    )
    dataset.add_argument("--quiet", action="store_true", help="no progress")

    train = _add(commands, "train", _train, "train the detector", "train --data data/detect --out out/train")
    train.add_argument("--data", type=Path, metavar="DIR", help="data set, as sum-drake dataset writes it")
    train.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("out/train"), help="where to (default: out/train)"
    )
    train.add_argument("--seed", type=int, metavar="S", default=0, help="seed of the training (default: 0)")
    train.add_argument("--epochs", type=int, metavar="N", help="times that every picture is seen")
    train.add_argument(
        "--start", choices=("imagenet", "random"), default="imagenet", help="what the backbone begins as"
    )
    train.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    train.add_argument(
        "--threads", type=int, metavar="N", default=os.cpu_count() or 1, help="of the CPU (default: all)"
    )
    train.add_argument("--quick", action="store_true", help="the whole path on a small set that is rendered first")
    train.add_argument("--catalogue", type=Path, metavar="FILE", help="objects, with --quick (default: the package's)")
    train.add_argument("--quiet", action="store_true", help="no progress")

    detect = _add(
        commands, "detect", _detect, "the objects in a picture of your own", "detect photo.jpg --out out/photo"
    )
    detect.add_argument("picture", type=Path, metavar="PICTURE", help="PNG or JPEG, 160 to 4096 pixels a side")
    detect.add_argument("--depth", type=Path, metavar="FILE", help="its depth, PNG of 16 bits; 0 where it is missing")
    detect.add_argument(
        "--depth-scale", type=float, metavar="M", default=0.001, help="metres a unit of the depth (default: 0.001)"
    )
    detect.add_argument("--weights", type=Path, metavar="FILE", help="detector (default: the package's)")
    detect.add_argument("--out", type=Path, metavar="DIR", help="where to (default: out/detected/PICTURE)")
    detect.add_argument("--force", action="store_true", help="replace the detections that are in the folder")

    text = "the experiments: figures, tables and plots"
    bench = commands.add_parser("bench", help=text, description=text, epilog="example: sum-drake bench detect --help")
    benches = bench.add_subparsers(required=True, metavar="WHAT")
    one = _add(
        benches, "detect", _bench_detect, "the detector on scenes it has not seen", "bench detect --out out/detect"
    )
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help="where results.json and report.html go")
    one.add_argument("--quick", action="store_true", help="a tenth of the pictures")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of the scenes that are rendered (default: 0)")
    one.add_argument("--data", type=Path, metavar="DIR", help="pictures of sum-drake dataset instead of rendering some")
    one.add_argument("--weights", type=Path, metavar="FILE", help="detector (default: the package's)")
    one.add_argument("--catalogue", type=Path, metavar="FILE", help="objects (default: the package's fifteen)")
    one.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    one.add_argument("--workers", type=int, metavar="W", default=os.cpu_count() or 1, help="processes (default: all)")
    one.add_argument("--force", action="store_true", help="replace the results that are in the folder")
    one.add_argument("--quiet", action="store_true", help="no progress")

    report = _add(commands, "report", _report, "write a run's HTML report again", "report runs/3 --force")
    report.add_argument("run", type=Path, metavar="RUN", help="run folder")
    report.add_argument("--force", action="store_true", help="replace the report that is there")

    _add(commands, "doctor", _doctor, "what this machine has and lacks", "doctor")
    return parser


def _add(
    commands: "argparse._SubParsersAction[_Parser]",
    name: str,
    command: Callable[[argparse.Namespace], None],
    text: str,
    example: str,
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=text, description=text, epilog=f"example: sum-drake {example}")
    parser.set_defaults(command=command)
    return parser


def _sort(options: argparse.Namespace) -> None:
    from pydrake.systems.framework import Diagram

    from sum_drake.doctor import device, require_rendering, versions
    from sum_drake.jsonio import write_json
    from sum_drake.objects import load_catalogue
    from sum_drake.report import write_report
    from sum_drake.runlog import RunLogWriter
    from sum_drake.systems.episode import run
    from sum_drake.systems.scenario import catalogue_of, dump_scenario, load_scenario
    from sum_drake.systems.verdict import score

    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake has set it on import
    scenario = load_scenario(
        options.scenario_file,
        options.scenario_name,
        options.scenario_text,
        seed=options.seed,
        objects=options.objects,
        catalogue=None if options.catalogue is None else load_catalogue(options.catalogue),
    )
    catalogue = catalogue_of(scenario)
    out = options.out if options.out is not None else Path("runs") / str(scenario.random_seed)
    _check_free(out, RUN_FILES, force=options.force)
    if options.graphviz is not None:
        _check_writable(options.graphviz)
    require_rendering()
    progress = _Progress(quiet=options.quiet)
    written = "nothing was written"
    stack = contextlib.ExitStack()

    def open_log() -> RunLogWriter:
        """Only now, when everything has been made, is anything written."""
        nonlocal written
        out.mkdir(parents=True, exist_ok=True)
        for name in RUN_FILES:
            (out / name).unlink(missing_ok=True)
        write_whole(out / "scenario.yaml", dump_scenario(scenario))
        log = RunLogWriter(out / "run.mcap", metadata={"seed": str(scenario.random_seed)})
        written = f"{out} holds what was done until then: sum-drake report {shlex.quote(str(out))}"
        return stack.enter_context(log)

    def draw(diagram: Diagram) -> None:
        if options.graphviz is not None:
            write_whole(options.graphviz, diagram.GetGraphvizString())

    try:
        with stack:
            episode = run(scenario, catalogue, open_log=open_log, progress=progress, on_diagram=draw)
        summary = score(episode, scenario, catalogue, versions=versions(), device=device())
        write_json(out / "summary.json", summary)
        write_report(out, catalogue)
    except KeyboardInterrupt:
        progress.clear()
        raise KeyboardInterrupt(written) from None
    progress.done(
        f"{summary['outcome']}: {summary['objects_sorted']} of {summary['objects_total']} objects sorted, "
        f"{summary['objects_missorted']} missorted, {summary['manipulation_trials']} trials, "
        f"{episode.sim_time_s:.0f} s simulated in {episode.wall_s:.0f} s; {out / 'report.html'}"
    )
    if episode.error is not None:
        raise RuntimeError(summary["outcome"].removeprefix("stopped: failed: ")) from episode.error


RUN_FILES = ("scenario.yaml", "run.mcap", "summary.json", "report.html")


def _check_free(out: Path, names: Sequence[str], *, force: bool, what: str = "run") -> None:
    """Refuses a folder that holds anything, unless it is a run, or what else, to be replaced: files of these names."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: a file; expected a folder or a new name")
    if not out.is_dir() or not any(out.iterdir()):
        return
    if not force:
        raise InputError(
            f"--out {out}: exists and is not empty; expected a new folder, or --force to replace the {what}"
        )
    foreign = sorted(path.name for path in out.iterdir() if path.name not in names)
    if foreign:
        raise InputError(f"--out {out}: holds {foreign[0]!r}, which is no part of a {what}; expected a {what} folder")


def _check_device(name: str) -> None:
    import torch

    try:
        kind = torch.device(name).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda"):
        raise InputError(f"--device {name}: unknown; expected cpu or cuda")
    if kind == "cuda" and not torch.cuda.is_available():
        raise InputError(f"--device {name}: torch finds no CUDA device; expected cpu")


def _check_writable(file: Path) -> None:
    if file.is_dir() or not file.parent.is_dir():
        raise InputError(f"{file}: cannot be written; expected a file in a folder that exists")


class _Progress:
    """What is being done: line by line; on a terminal with a bar below that is redrawn in place; nothing if quiet."""

    WIDTH = 24

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._terminal, self._start = quiet, sys.stderr.isatty(), time.monotonic()

    def __call__(self, what: str, sim_time: float, share: float = 0.0) -> None:
        """what: a step that was taken, "" between steps; share: of the objects that were let go where they belong."""
        if self._quiet:
            return
        now = f"{time.monotonic() - self._start:6.1f} s, simulated {sim_time:6.1f} s"
        if what:
            print(f"{self._clear()}[{now}] {what}", file=sys.stderr, flush=True)
        if self._terminal:
            done = round(self.WIDTH * share)
            print(f"{self._clear()}[{'#' * done:-<{self.WIDTH}}] {now}", end="", file=sys.stderr, flush=True)

    def done(self, what: str) -> None:
        """The last line, on standard output."""
        if not self._quiet:
            self.clear()
            print(what)

    def clear(self) -> None:
        """Takes the bar away."""
        if not self._quiet:
            print(self._clear(), end="", file=sys.stderr, flush=True)

    def _clear(self) -> str:
        return "\r\033[K" if self._terminal else ""


def _objects_list(options: argparse.Namespace) -> None:
    from sum_drake.objects import describe, load_catalogue

    print(describe(load_catalogue(options.catalogue)))


def _objects_check(options: argparse.Namespace) -> None:
    from sum_drake.objects import CATALOGUE, check

    findings = check(options.catalogue)
    print("\n".join(finding.line for finding in findings), flush=True)
    broken = sum(not finding.usable for finding in findings)
    if broken:
        raise InputError(
            f"{options.catalogue or CATALOGUE}: {broken} of {len(findings)} objects cannot be used; expected none"
        )


def _objects_render(options: argparse.Namespace) -> None:
    import cv2

    from sum_drake.contact_sheet import render_contact_sheet
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    _check_writable(options.out)
    if options.out.exists() and not options.force:
        raise InputError(f"--out {options.out}: exists; expected a new name, or --force to replace it")
    catalogue = load_catalogue(options.catalogue)
    require_rendering()
    _, png = cv2.imencode(".png", cv2.cvtColor(render_contact_sheet(catalogue), cv2.COLOR_RGB2BGR))
    write_whole(options.out, png.tobytes())
    print(options.out)


def _report(options: argparse.Namespace) -> None:
    from sum_drake.report import write_report

    if not options.run.is_dir():
        what = "a file" if options.run.exists() else "no such folder"
        raise InputError(f"{options.run}: {what}; expected the folder of a run, as sum-drake sort writes it")
    if (options.run / "report.html").exists() and not options.force:
        raise InputError(f"{options.run / 'report.html'}: exists; expected --force to replace it")
    print(write_report(options.run))


def _dataset(options: argparse.Namespace) -> None:
    import dataclasses

    from sum_drake.detection.dataset import SPLITS
    from sum_drake.detection.dataset_job import FULL, QUICK, describe

    plan = dataclasses.replace(QUICK if options.quick else FULL, seed=options.seed)
    if options.scenes is not None:
        if min(options.scenes) < 1:
            raise InputError(f"--scenes {' '.join(map(str, options.scenes))}: expected four counts of at least 1")
        plan = dataclasses.replace(plan, scenes=dict(zip(SPLITS, options.scenes, strict=True)))
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: expected 0 or more")
    if options.workers < 1:
        raise InputError(f"--workers {options.workers}: expected at least 1")
    _render_dataset(options.catalogue, options.out, plan, workers=options.workers, quiet=options.quiet)
    print(describe(options.out))


def _render_dataset(catalogue: Path | None, out: Path, plan: "Plan", *, workers: int, quiet: bool) -> None:
    from sum_drake.detection.dataset_job import render_dataset
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    objects = load_catalogue(catalogue)
    require_rendering()
    render_dataset(objects, out, plan, workers=workers, report=_Counting(quiet=quiet))


def _train(options: argparse.Namespace) -> None:
    import dataclasses
    import datetime

    import torch

    from sum_drake.detection.dataset import ImageSet
    from sum_drake.detection.dataset_job import QUICK
    from sum_drake.detection.evaluation import evaluate
    from sum_drake.detection.inference import Detector
    from sum_drake.detection.training import Recipe, read_log, train
    from sum_drake.detection.training_report import write_results
    from sum_drake.doctor import versions

    _check_device(options.device)
    if options.epochs is not None and options.epochs < 1:
        raise InputError(f"--epochs {options.epochs}: expected at least 1")
    if options.threads < 1:
        raise InputError(f"--threads {options.threads}: expected at least 1")
    data = options.data
    if data is None and not options.quick:
        raise InputError("--data is missing; expected the folder of a data set (sum-drake dataset), or --quick")
    torch.set_num_threads(options.threads)
    recipe = Recipe(seed=options.seed, start=options.start, **({"epochs": options.epochs} if options.epochs else {}))

    def say(line: str) -> None:
        if not options.quiet:
            print(line, file=sys.stderr, flush=True)

    if data is None:
        data = options.out / "data"
        plan = dataclasses.replace(QUICK, seed=options.seed)
        _render_dataset(options.catalogue, data, plan, workers=options.threads, quiet=options.quiet)
        recipe = dataclasses.replace(recipe, epochs=options.epochs or 6, warm_up=40, averaging=0.98)
    weights = train(data, options.out, recipe, device=options.device, report=say)
    images = evaluate(Detector(weights), ImageSet(data, "validation"))
    file = write_results(
        options.out,
        weights,
        images=images,
        log=read_log(options.out / "log.jsonl"),
        recipe=dataclasses.asdict(recipe),
        data=ImageSet(data, "train").settings,
        date=datetime.date.today().isoformat(),
        versions=versions(),
    )
    print(file)


def _detect(options: argparse.Namespace) -> None:
    import cv2

    from sum_drake.detection.inference import load_detector
    from sum_drake.detection.listing import detection_rows, detection_table, draw_detections
    from sum_drake.detection.picture import read_depth, read_picture
    from sum_drake.jsonio import write_json

    out = options.out if options.out is not None else Path("out/detected") / options.picture.stem
    names = ("detections.json", "detections.png")
    _check_free(out, names, force=options.force, what="detection")
    color = read_picture(options.picture)
    depth = read_depth(options.depth, color.shape[:2], scale=options.depth_scale) if options.depth is not None else None
    detector = load_detector(options.weights)
    detections = detector(color, depth)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / names[0], detection_rows(detections))
    drawn = draw_detections(color, detections, detector.labels)
    _, png = cv2.imencode(".png", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR))
    write_whole(out / names[1], png.tobytes())
    print(detection_table(detections))
    print(out / names[1])


def _bench_detect(options: argparse.Namespace) -> None:
    from sum_drake.bench.detect import FILES, bench_detect
    from sum_drake.bench.detect_figures import format_figures
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    _check_free(options.out, FILES, force=options.force, what="bench")
    _check_device(options.device)
    catalogue = load_catalogue(options.catalogue)
    if options.data is None:
        require_rendering()
    found = bench_detect(
        options.out,
        catalogue,
        quick=options.quick,
        seed=options.seed,
        data=options.data,
        weights=options.weights,
        device=options.device,
        workers=options.workers,
        progress=_Counting(quiet=options.quiet),
    )
    print(format_figures(found))
    print(options.out / "report.html")


class _Counting:
    """How many of how many, and the time left: a line redrawn on a terminal, else one each half minute."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._terminal = quiet, sys.stderr.isatty()
        self._told, self._of = float("-inf"), (0, 0)

    def __call__(self, what: str, done: int, total: int) -> None:
        """what: that is being done; done: of `total`, from 0 or 1 on."""
        now = time.monotonic()
        if self._of[1] != total or done < self._of[0]:
            self._begun, self._from, self._told = now, done, float("-inf")
        self._of = (done, total)
        if self._quiet or not (self._terminal or done == total or now - self._told > 30):
            return
        self._told = now
        left = (now - self._begun) / (done - self._from) * (total - done) if done > self._from else None
        line = f"{what}: {done} of {total}" + ("" if left is None else f", {_duration(left)} left")
        end = "" if self._terminal and done < total else "\n"
        print(f"\r\033[K{line}" if self._terminal else line, end=end, file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def _doctor(options: argparse.Namespace) -> None:
    from sum_drake import doctor

    checks = doctor.diagnose()
    print(doctor.format_checks(checks))
    if any(check.status == "bad" for check in checks):
        raise RuntimeError("this machine lacks something that sum-drake needs; see above")


if __name__ == "__main__":
    sys.exit(main())
