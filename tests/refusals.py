"""Calls of the command line that must be refused."""

from sum_drake.cli import main


def refused(capsys, *arguments):
    """The one line on stderr of a call that must be refused as bad input."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("sum-drake: ")
    return lines[0]
