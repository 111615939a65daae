"""`sum-drake report`: a run's report, written again; a batch's; or two of either side by side."""

import argparse
import functools
import shlex
from pathlib import Path

from sum_drake.assets import InputError
from sum_drake.commands.common import Commands, Counting, add_command, add_quiet, check_writable


def add(commands: Commands) -> None:
    """Declares the command."""
    text = "write the HTML report of a run (again, with a film) or a batch; of two, one that sets them side by side"
    report = add_command(commands, "report", _report, text, "report runs/3 --force")
    report.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="folder of a run or a batch; two are compared"
    )
    report.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="page (default: RUN/report.html; of two, report_RUN_RUN2.html here)",
    )
    report.add_argument("--no-video", action="store_true", help="without the film, which takes some 15 CPU seconds")
    report.add_argument("--force", action="store_true", help="replace the report that is there")
    add_quiet(report)


def _report(options: argparse.Namespace) -> None:
    from sum_drake.batch_report import is_batch, write_batch_report
    from sum_drake.report import write_report
    from sum_drake.report_compare import write_comparison

    if len(options.runs) > 2:
        raise InputError(f"{options.runs[2]}: one too many; expected one run or batch, or two to be compared")
    for run in options.runs:
        if not run.is_dir():
            what = "a file" if run.exists() else "no such folder"
            raise InputError(f"{run}: {what}; expected the folder of a run or a batch")
        if (run / "results.json").is_file() and not is_batch(run):
            raise InputError(f"{run}: of a bench, whose page is {run / 'report.html'}; expected the folder of a run")
    batches = [run for run in options.runs if is_batch(run)]
    if len(options.runs) == 2 and len(batches) == 1:
        (run,) = set(options.runs) - set(batches)
        raise InputError(f"{run}: not a batch, as {batches[0]} is; expected two runs, or two batches")
    if options.no_video and (batches or len(options.runs) == 2):
        raise InputError("--no-video: there is a film of one run alone; expected one run, or to leave it out")
    if options.out is not None:
        out = options.out
    elif len(options.runs) == 2:
        out = Path("report_{}_{}.html".format(*(run.resolve().name for run in options.runs)))
    else:
        out = options.runs[0] / "report.html"
    check_writable(out)
    if out.exists() and not options.force:
        raise InputError(f"{out}: exists; expected --force to replace it")
    try:
        if batches:
            print(write_batch_report(batches, out))
        elif len(options.runs) == 2:
            progress = functools.partial(Counting(quiet=options.quiet), "drawing what was seen")
            print(write_comparison(options.runs[0], options.runs[1], out, progress=progress))
        else:
            progress = functools.partial(Counting(quiet=options.quiet), "rendering the film")
            print(write_report(options.runs[0], out=out, film=not options.no_video, progress=progress))
    except KeyboardInterrupt:
        kept = "the report that was there is as it was" if out.exists() else "nothing was written"
        film = not batches and len(options.runs) == 1
        again = ["sum-drake", "report", *map(str, options.runs), *(["--no-video"] if film else [])]
        again += [*(["--out", str(out)] if options.out is not None else []), *(["--force"] if options.force else [])]
        how = "without the film it is quick" if film else "again"
        raise KeyboardInterrupt(f"{kept}; {how}: {shlex.join(again)}") from None
