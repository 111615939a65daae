"""`sum-drake bench sort`, `faults`, `ablations` and `all`: experiments of whole runs, and all experiments in turn."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sum_drake.assets import InputError, one_line
from sum_drake.commands.batch import prepare
from sum_drake.commands.common import (
    AGAIN,
    Commands,
    Counting,
    add_command,
    add_parallel,
    add_quiet,
    check_count,
    check_device,
    check_free,
    check_makeable,
    if_interrupted,
)

if TYPE_CHECKING:
    from sum_drake.bench.aims import Aims
    from sum_drake.episodes import EpisodeSpec
    from sum_drake.systems.scenario import Scenario

BENCHES = ("detect", "pose", "reject", "plan", "sort", "faults", "ablations", "speed")
"""In the order of `bench all`."""
FIRST_SEEDS = {"sort": 500, "faults": 710, "ablations": 1300}
"""What each was mended on, and was not, is in benchmarks/seeds.md."""
ANEW = ("detect", "speed")
"""Those that begin anew where they were cut off."""
ON_DEVICE = ("detect", "pose", "speed")
"""Those that take a device."""


def add(benches: Commands) -> None:
    """Declares the commands."""
    text = "sequential sorting: the paper's table beside eight sequences, and figures of larger batches"
    sort = add_command(benches, "sort", _bench_sort, text, "bench sort --out out/sort --batch out/b60")
    _add_usual(sort, "two sequences of two objects", FIRST_SEEDS["sort"])
    sort.add_argument(
        "--batch", type=Path, metavar="DIR", action="append", default=[],
        help="folder of `sum-drake batch` whose runs the figures are of; may be given again",
    )  # fmt: skip
    text = "runs in which things go wrong on purpose: does any of it end badly?"
    faults = add_command(benches, "faults", _bench_faults, text, "bench faults --out out/faults")
    _add_usual(faults, "two runs", FIRST_SEEDS["faults"])
    text = "what each ingredient of the whole system is worth, in objects sorted on the same pours"
    worth = add_command(benches, "ablations", _bench_ablations, text, "bench ablations --out out/ablations")
    _add_usual(worth, "one run of one object each", FIRST_SEEDS["ablations"])
    worth.add_argument(
        "--faults", action="store_true", help="things go wrong on purpose in each run, as in `bench faults`"
    )
    worth.add_argument("--runs", type=int, metavar="N", help="of each variant (default: 20; with --quick 1)")
    worth.add_argument(
        "--variants", nargs="+", metavar="NAME", help="some of them, beside what they are compared with (default: all)"
    )
    worth.add_argument(
        "--default", type=Path, metavar="DIR",
        help="folder of `sum-drake batch` whose runs of the same seeds stand for the default's",
    )  # fmt: skip
    every = add_command(
        benches, "all", _bench_all, f"all of them in turn: {', '.join(BENCHES)}", "bench all --quick --out out/all"
    )
    every.add_argument("--out", type=Path, metavar="DIR", required=True, help="folder of their folders; goes on there")
    every.add_argument("--quick", action="store_true", help="each in its short form")
    every.add_argument("--seed", type=int, metavar="S", help="of each (default: each one's own)")
    every.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda, of those that can use one")
    add_parallel(every, "--workers", "processes")
    add_quiet(every)


def _add_usual(one: argparse.ArgumentParser, quick: str, seed: int) -> None:
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help=AGAIN)
    one.add_argument("--quick", action="store_true", help=quick)
    one.add_argument("--seed", type=int, metavar="S", default=seed, help=f"of the first run (default: {seed})")
    add_parallel(one, "--workers", "runs at a time")
    one.add_argument("--force", action="store_true", help="write results anew where they are; the runs are kept")
    add_quiet(one)


def _check_out(options: argparse.Namespace, files: tuple[str, ...]) -> None:
    """Refuses a folder of something else, and one that is done. files: what the bench leaves, its results first."""
    check_free(options.out, files, force=True, what="bench")
    if (options.out / files[0]).is_file() and not options.force:
        raise InputError(f"--out {options.out}: is done; expected a new folder, or --force to write its results anew")


def _bench_sort(options: argparse.Namespace) -> None:
    from sum_drake.batch import Processes
    from sum_drake.bench.sort import FILES, OBJECTS, SEQUENCES, aims_for, bench_sort, read_batches
    from sum_drake.systems.scenario import load_scenario

    def usual(count: int) -> dict[str, Any]:
        return prepare(load_scenario(objects=count), 0, 1)[1]

    larger = read_batches(options.batch, usual)  # what cannot be read is said before anything is run
    runs, objects = (2, 2) if options.quick else (SEQUENCES, OBJECTS)

    def bench(specs: "list[EpisodeSpec]", settings: dict[str, Any]) -> dict[str, float]:
        executor, progress = Processes(options.workers), Counting(quiet=options.quiet)
        return bench_sort(
            options.out, specs, settings, executor, options.batch, usual=usual, quick=options.quick, progress=progress
        )  # fmt: skip

    check_count("--seed", options.seed, 0)
    _run(options, load_scenario(seed=options.seed, objects=objects), runs, FILES, bench, aims_for(larger))


def _bench_faults(options: argparse.Namespace) -> None:
    from sum_drake.batch import Processes
    from sum_drake.bench.faults import AIMS, FILES, RUNS, SCENARIO, bench_faults
    from sum_drake.systems.scenario import load_scenario

    def bench(specs: "list[EpisodeSpec]", settings: dict[str, Any]) -> dict[str, float]:
        executor, progress = Processes(options.workers), Counting(quiet=options.quiet)
        return bench_faults(options.out, specs, settings, executor, quick=options.quick, progress=progress)

    check_count("--seed", options.seed, 0)
    scenario = load_scenario(name=SCENARIO, seed=options.seed)
    _run(options, scenario, 2 if options.quick else RUNS, FILES, bench, AIMS)


def _bench_ablations(options: argparse.Namespace) -> None:
    from sum_drake.batch import Processes
    from sum_drake.bench.ablations import FILES, OBJECTS, QUICK_OBJECTS, QUICK_RUNS, RUNS, VARIANTS, bench_ablations
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.faults import SCENARIO
    from sum_drake.doctor import require_rendering
    from sum_drake.systems.scenario import load_scenario

    check_count("--workers", options.workers)
    check_count("--seed", options.seed, 0)
    check_count("--runs", options.runs)
    _check_out(options, FILES)
    usual, objects = (QUICK_RUNS, QUICK_OBJECTS) if options.quick else (RUNS, OBJECTS)
    runs = options.runs or usual

    def prepared(text: str) -> "tuple[list[EpisodeSpec], dict[str, Any]]":
        name = SCENARIO if options.faults else None
        return prepare(load_scenario(name=name, text=text, seed=options.seed, objects=objects), options.seed, runs)

    require_rendering()
    kept = f"{options.out} keeps what was done: the same command goes on"
    with if_interrupted(lambda: kept, quiet=options.quiet):
        found = bench_ablations(
            options.out, prepared, Processes(options.workers), variants=options.variants or tuple(VARIANTS),
            default=options.default, faults=options.faults, quick=options.quick, progress=Counting(quiet=options.quiet),
        )  # fmt: skip
    print(format_figures(found, {}))
    print(options.out / "report.html")


def _run(
    options: argparse.Namespace,
    scenario: "Scenario",
    runs: int,
    files: tuple[str, ...],
    bench: "Callable[[list[EpisodeSpec], dict[str, Any]], dict[str, float]]",
    aims: "Aims",
) -> None:
    """A bench whose runs are a batch, the folder named last in `files`."""
    from sum_drake.batch import check_batch
    from sum_drake.bench.aims import format_figures
    from sum_drake.doctor import require_rendering

    check_count("--workers", options.workers)
    _check_out(options, files)
    specs, settings = prepare(scenario, options.seed, runs)
    check_batch(options.out / files[-1], settings)
    require_rendering()
    kept = f"{options.out / files[-1]} keeps what was done: the same command goes on"
    with if_interrupted(lambda: kept, quiet=options.quiet):
        found = bench(specs, settings)
    print(format_figures(found, aims))
    print(options.out / "report.html")


def _bench_all(options: argparse.Namespace) -> None:
    """Those whose results are there are not done again."""
    check_count("--workers", options.workers)
    check_count("--seed", options.seed, 0)
    check_device(options.device)
    check_free(options.out, BENCHES, force=True, what="bench all")
    if not options.out.is_dir():
        check_makeable(options.out)
    done = {name for name in BENCHES if _is_done(options, name)}
    failed = []
    for name in (name for name in BENCHES if name not in done):
        out = options.out / name
        arguments = ["bench", name, "--out", str(out)]
        arguments += ["--quick"] if options.quick else []
        arguments += ["--force"] if name in ANEW and out.is_dir() else []
        arguments += [] if name == "speed" else ["--workers", str(options.workers)]
        arguments += [] if options.seed is None else ["--seed", str(options.seed)]
        arguments += ["--device", options.device] if name in ON_DEVICE else []
        arguments += ["--quiet"] if options.quiet else []
        print(f"sum-drake {' '.join(arguments)}", file=sys.stderr, flush=True)
        code = options.main(arguments)
        if code > 128:  # 128 and the signal: Ctrl-C, or SIGTERM
            raise KeyboardInterrupt("the same command goes on")
        if code != 0:
            failed.append(name)
    if failed:
        raise RuntimeError(f"{', '.join(failed)}: see above")


def _is_done(options: argparse.Namespace, name: str) -> bool:
    """Whether a bench's results are there. Raises InputError where they are others than would be made now."""
    from sum_drake.bench.results import SCHEMA
    from sum_drake.doctor import versions
    from sum_drake.fingerprint import code, different

    file = options.out / name / "results.json"
    if not file.is_file():
        return False
    seed = FIRST_SEEDS.get(name, 0) if options.seed is None else options.seed
    device = {"device": options.device} if name in ON_DEVICE else {}
    key = "first_seed" if name in FIRST_SEEDS else "seed"
    asked = {"code": code(), key: seed, **device, **versions()}
    try:
        told = json.loads(file.read_text())
        found = told["schema"], told["bench"], told["quick"]
        other = different({**told["settings"], **told["versions"]}, asked)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file}: {one_line(error)}; expected results of bench {name}") from None
    if found[:2] != (SCHEMA, name):
        raise InputError(f"{file}: of bench {found[1]}, {found[0]}; expected results of bench {name}, {SCHEMA}")
    if found[2] != options.quick:
        raise InputError(f"{file}: of the {'short' if found[2] else 'long'} form; expected a new --out")
    if other:
        raise InputError(f"{file}: is of {other}; expected a new --out")
    return True
