"""`sum-drake bench`: the experiments."""

import argparse
from pathlib import Path

from sum_drake.commands import bench_plan, bench_runs
from sum_drake.commands.common import (
    AGAIN,
    Commands,
    Counting,
    add_catalogue,
    add_command,
    add_group,
    add_parallel,
    add_quiet,
    anew_if_interrupted,
    check_count,
    check_device,
    check_free,
    check_free_or_begun,
    kept_if_interrupted,
)


def add(commands: Commands) -> None:
    """Declares the commands."""
    text = "the experiments: figures, tables and plots"
    benches = add_group(commands, "bench", text, "WHAT", "bench detect --help")
    one = add_command(
        benches, "detect", _bench_detect, "the detector on scenes it has not seen", "bench detect --out out/detect"
    )
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help="where results.json and report.html go")
    one.add_argument("--quick", action="store_true", help="a tenth of the pictures")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of the scenes that are rendered (default: 0)")
    one.add_argument("--data", type=Path, metavar="DIR", help="pictures of sum-drake dataset instead of rendering some")
    one.add_argument("--weights", type=Path, metavar="FILE", help="detector (default: the package's)")
    add_catalogue(one)
    one.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    add_parallel(one, "--workers", "processes")
    one.add_argument("--force", action="store_true", help="replace the results that are in the folder")
    add_quiet(one)
    _add_pose(benches)
    _add_reject(benches)
    bench_plan.add(benches)
    bench_runs.add(benches)
    _add_speed(benches)


def _add_speed(benches: Commands) -> None:
    one = add_command(benches, "speed", _bench_speed, "what an object's pose costs", "bench speed --out out/speed")
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help="where results.json and report.html go")
    one.add_argument("--quick", action="store_true", help="fewer particles, each measured once")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of the scene (default: 0)")
    add_catalogue(one)
    one.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    one.add_argument("--force", action="store_true", help="replace the results that are in the folder")
    add_quiet(one)


def _bench_speed(options: argparse.Namespace) -> None:
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.speed import AIMS, FILES, bench_speed
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    check_free(options.out, FILES, force=options.force, what="bench")
    check_count("--seed", options.seed, least=0)
    check_device(options.device)
    catalogue = load_catalogue(options.catalogue)
    require_rendering()
    progress = Counting(quiet=options.quiet)
    with anew_if_interrupted(options.out, quiet=options.quiet):
        found = bench_speed(
            options.out, catalogue, quick=options.quick, seed=options.seed, device=options.device, progress=progress
        )
    print(format_figures(found, AIMS))
    print(options.out / "report.html")


def _add_pose(benches: Commands) -> None:
    one = add_command(benches, "pose", _bench_pose, "pose estimates beside other methods", "bench pose --out out/pose")
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help=AGAIN)
    one.add_argument("--quick", action="store_true", help="a tenth of the scenes, one seed")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of scenes and meshes (default: 0)")
    one.add_argument("--scenes", type=int, metavar="N", help="how many scenes (default: 40, or 4 with --quick)")
    one.add_argument(
        "--methods", nargs="+", metavar="NAME", help="some methods, ablations too (default: all but those)"
    )
    add_catalogue(one)
    one.add_argument("--device", default="cpu", metavar="D", help="cpu (default) or cuda")
    add_parallel(one, "--workers", "processes")
    one.add_argument("--force", action="store_true", help="start anew in the folder")
    add_quiet(one)


def _bench_pose(options: argparse.Namespace) -> None:
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.pose import FILES, bench_pose
    from sum_drake.bench.pose_figures import AIMS
    from sum_drake.bench.pose_methods import METHODS
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    check_count("--scenes", options.scenes)
    check_device(options.device)
    check_free_or_begun(options, FILES)
    catalogue = load_catalogue(options.catalogue)
    require_rendering()
    with kept_if_interrupted(options):
        found = bench_pose(
            options.out,
            catalogue,
            quick=options.quick,
            scenes=options.scenes,
            seed=options.seed,
            methods=options.methods or tuple(METHODS),
            workers=options.workers,
            device=options.device,
            anew=options.force,
            progress=Counting(quiet=options.quiet),
        )
    print(format_figures(found, AIMS))
    print(options.out / "report.html")


def _add_reject(benches: Commands) -> None:
    text = "whether a belief can be trusted, and what it makes of faults"
    one = add_command(benches, "reject", _bench_reject, text, "bench reject --out out/reject")
    one.add_argument("--out", type=Path, metavar="DIR", required=True, help=AGAIN)
    one.add_argument("--quick", action="store_true", help="fewer tables, scenes and sequences")
    one.add_argument("--seed", type=int, metavar="S", default=0, help="of tables and meshes (default: 0)")
    add_catalogue(one)
    add_parallel(one, "--workers", "processes")
    one.add_argument("--force", action="store_true", help="start anew in the folder")
    add_quiet(one)


def _bench_reject(options: argparse.Namespace) -> None:
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.reject import FILES, FULL, QUICK, bench_reject
    from sum_drake.bench.reject_figures import AIMS
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    check_free_or_begun(options, FILES)
    catalogue = load_catalogue(options.catalogue)
    require_rendering()
    with kept_if_interrupted(options):
        found = bench_reject(
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


def _bench_detect(options: argparse.Namespace) -> None:
    from sum_drake.bench.aims import format_figures
    from sum_drake.bench.detect import FILES, bench_detect
    from sum_drake.bench.detect_figures import AIMS
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    check_free(options.out, FILES, force=options.force, what="bench")
    check_device(options.device)
    check_count("--seed", options.seed, least=0)
    check_count("--workers", options.workers)
    catalogue = load_catalogue(options.catalogue)
    if options.data is None:
        require_rendering()
    with anew_if_interrupted(options.out, quiet=options.quiet):
        found = bench_detect(
            options.out,
            catalogue,
            quick=options.quick,
            seed=options.seed,
            data=options.data,
            weights=options.weights,
            device=options.device,
            workers=options.workers,
            progress=Counting(quiet=options.quiet),
        )
    print(format_figures(found, AIMS))
    print(options.out / "report.html")
