"""`sum-drake report`: a run's report, written again."""

import argparse
from pathlib import Path

from sum_drake.assets import InputError
from sum_drake.commands.common import Commands, add_command


def add(commands: Commands) -> None:
    """Declares the command."""
    report = add_command(commands, "report", _report, "write a run's HTML report again", "report runs/3 --force")
    report.add_argument("run", type=Path, metavar="RUN", help="run folder")
    report.add_argument("--force", action="store_true", help="replace the report that is there")


def _report(options: argparse.Namespace) -> None:
    from sum_drake.report import write_report

    if not options.run.is_dir():
        what = "a file" if options.run.exists() else "no such folder"
        raise InputError(f"{options.run}: {what}; expected the folder of a run, as sum-drake sort writes it")
    if (options.run / "report.html").exists() and not options.force:
        raise InputError(f"{options.run / 'report.html'}: exists; expected --force to replace it")
    print(write_report(options.run))
