"""`sum-drake bench sort`: the paper's sequences, and what larger batches come to."""

import argparse
from pathlib import Path

from sum_drake.commands.batch import prepare
from sum_drake.commands.common import (
    AGAIN,
    Commands,
    Counting,
    add_command,
    add_parallel,
    add_quiet,
    check_count,
    check_free,
)


def add(benches: Commands) -> None:
    """Declares the command."""
    text = "sequential sorting: the paper's table beside eight sequences, and figures of larger batches"
    one = add_command(benches, "sort", _bench_sort, text, "bench sort --out out/sort --batch out/b60")
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help=AGAIN)
    one.add_argument("--quick", action="store_true", help="two sequences of two objects")
    one.add_argument("--seed", type=int, metavar="S", default=500, help="of the first sequence (default: 500)")
    one.add_argument(
        "--batch", type=Path, metavar="DIR", action="append", default=[],
        help="folder of `sum-drake batch` whose runs the figures are of; may be given again",
    )  # fmt: skip
    add_parallel(one, "--workers", "runs at a time")
    add_quiet(one)


def _bench_sort(options: argparse.Namespace) -> None:
    from sum_drake.batch import Processes, check_batch
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.sort import AIMS, FILES, OBJECTS, SEQUENCES, bench_sort, read_batch
    from sum_drake.doctor import require_rendering
    from sum_drake.systems.scenario import load_scenario

    check_count("--seed", options.seed, 0)
    check_count("--workers", options.workers)
    for folder in options.batch:
        read_batch(folder)  # what cannot be read is said before anything is run
    check_free(options.out, FILES, force=True, what="bench")
    runs, objects = (2, 2) if options.quick else (SEQUENCES, OBJECTS)
    specs, settings = prepare(load_scenario(seed=options.seed, objects=objects), options.seed, runs)
    check_batch(options.out / "sequences", settings)
    require_rendering()
    try:
        found = bench_sort(
            options.out,
            specs,
            settings,
            Processes(options.workers),
            options.batch,
            quick=options.quick,
            progress=Counting(quiet=options.quiet),
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{options.out / 'sequences'} keeps what was done: the same command goes on") from None
    print(format_figures(found, AIMS))
    print(options.out / "report.html")
