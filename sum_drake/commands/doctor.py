"""`sum-drake doctor`: what a machine has and lacks."""

import argparse

from sum_drake.commands.common import Commands, add_command


def add(commands: Commands) -> None:
    """Declares the command."""
    add_command(commands, "doctor", _doctor, "what this machine has and lacks", "doctor")


def _doctor(options: argparse.Namespace) -> None:
    from sum_drake import doctor

    bad = False
    for check in doctor.diagnose():
        print(doctor.format_checks([check]), flush=True)
        bad = bad or check.status == "bad"
    if bad:
        raise RuntimeError("this machine lacks something that sum-drake needs; see above")
