"""`sum-drake bench plan`: this project's own experiments, or a user's problems and robot."""

import argparse
import sys
from pathlib import Path

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    AGAIN,
    Commands,
    Counting,
    add_catalogue,
    add_command,
    add_parallel,
    add_quiet,
    check_count,
    check_free_or_begun,
    kept_if_interrupted,
)


def add(benches: Commands) -> None:
    """Declares the command."""
    text = "inverse kinematics, paths, picks with true poses; or problems of your own"
    one = add_command(benches, "plan", _bench_plan, text, "bench plan --out out/plan")
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help=AGAIN)
    one.add_argument("--quick", action="store_true", help="a few of each, under 5 minutes on two idle cores")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of poses, picks and searches (default: 0)")
    add_catalogue(one)
    add_parallel(one, "--workers", "processes")
    one.add_argument("--force", action="store_true", help="start anew in the folder")
    own = one.add_argument_group("problems of your own, which are solved instead; writes plan.json")
    own.add_argument("--problems", type=Path, metavar="FILE.json", help="list of problems, see docs/formats.md")
    own.add_argument("--urdf", type=Path, metavar="ROBOT.urdf", help="robot they are for")
    own.add_argument("--srdf", type=Path, metavar="FILE", help="pairs of its links that may touch")
    own.add_argument("--time-limit", type=float, metavar="S", help="CPU seconds for each problem (default: 10)")
    add_quiet(one)


def _bench_plan(options: argparse.Namespace) -> None:
    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    if options.problems is not None:
        _solve_problems(options)
        return
    for name in ("urdf", "srdf", "time_limit"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: goes with problems of your own; expected --problems, too")
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.plan import AIMS, FILES, FULL, QUICK, bench_plan
    from sum_drake.objects import load_catalogue

    check_free_or_begun(options, FILES)
    catalogue = load_catalogue(options.catalogue)
    with kept_if_interrupted(options):
        found = bench_plan(
            options.out,
            catalogue,
            size=QUICK if options.quick else FULL,
            seed=options.seed,
            workers=options.workers,
            anew=options.force,
            progress=Counting(quiet=options.quiet),
        )
    print(format_figures(found, AIMS))
    print(options.out / "report.html")


def _solve_problems(options: argparse.Namespace) -> None:
    if options.urdf is None:
        raise InputError("--problems: are for a robot; expected --urdf, too")
    if options.time_limit is not None and not options.time_limit > 0:
        raise InputError(f"--time-limit: {options.time_limit:g} given; expected more than 0 seconds")
    for name in ("quick", "catalogue"):
        if getattr(options, name):
            raise InputError(f"--{name}: says nothing of problems of your own; expected it left out")
    from sum_drake.bench.plan_own import FILES, TIME_LIMIT, bench_problems

    check_free_or_begun(options, FILES)
    with kept_if_interrupted(options):
        found, notes = bench_problems(
            options.out,
            options.problems,
            options.urdf,
            options.srdf,
            time_limit=options.time_limit or TIME_LIMIT,
            seed=options.seed,
            workers=options.workers,
            anew=options.force,
            progress=Counting(quiet=options.quiet),
        )
    if not options.quiet:
        for note in notes:
            print(note, file=sys.stderr)
    for one in found:
        print(
            f"{one.request}: {f'path of {len(one.path)} waypoints' if one.solved else one.message}, {one.time_s:.2f} s"
        )
    print(f"{sum(one.solved for one in found)} of {len(found)} solved; {options.out / 'plan.json'}")
