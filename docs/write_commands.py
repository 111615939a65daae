"""Writes docs/commands.md from the parsers that `sum-drake` itself uses.

    python docs/write_commands.py

To be called again when a command or an argument has changed.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

from sum_drake.cli import _parser

PAGE = Path(__file__).parent / "commands.md"
HEAD = """# Commands

Made from the command line's own parsers by `python docs/write_commands.py`; a test fails where the two differ. Each
command says the same with `--help`.

Exit codes of all: 0, done; 1, the run itself failed, with the reason on the error output; 2, bad input, in one line
that says what, where, and what was expected; 130, interrupted by Ctrl-C; 143, ended by SIGTERM. Results go to the
standard output, progress to the error output. A folder of finished results is replaced with `--force` only.
"""


def commands(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.ArgumentParser, bool]]:
    """Each parser below one, depth first, and whether it is a command itself rather than a group of some."""
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    for action in below:
        for one in dict.fromkeys(action.choices.values()):
            yield one, not any(isinstance(inner, argparse._SubParsersAction) for inner in one._actions)
            yield from commands(one)


def call(parser: argparse.ArgumentParser) -> str:
    """What is typed for a command, with what it cannot do without."""
    words = [parser.prog]
    for action in parser._actions:
        if not action.option_strings and not isinstance(action, argparse._SubParsersAction):
            several = f"{name(action)} ..." if action.nargs in ("+", "*") else name(action)
            words.append(f"[{several}]" if action.nargs in ("?", "*") else several)
        elif action.option_strings and action.required:
            words.append(f"{action.option_strings[0]} {name(action)}")
    return " ".join(words)


def name(action: argparse.Action) -> str:
    """What stands for an argument's values."""
    if action.metavar is None and action.choices is not None:
        return "{" + ",".join(map(str, action.choices)) + "}"
    values = action.metavar or action.dest.upper()
    return values if isinstance(values, str) else " ".join(values)


def rows(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Table rows of a command's arguments, --help aside."""
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction | argparse._SubParsersAction):
            continue
        value = "" if action.nargs == 0 else f" {name(action)}" + (" ..." if action.nargs == "+" else "")
        shown = ", ".join(action.option_strings) + value if action.option_strings else name(action)
        words = " ".join(parser._get_formatter()._expand_help(action).split()).replace("|", "\\|")
        yield f"| `{shown}` | {words}{' (needed)' if action.option_strings and action.required else ''} |"


def page() -> str:
    """The page as Markdown."""
    parts = [HEAD]
    parser = _parser()
    for one, is_command in commands(parser):
        depth = len(one.prog.split()) - len(parser.prog.split())
        text = " ".join((one.description or "").split())
        text = text[:1].upper() + text[1:].removesuffix(".")
        text += "" if text.endswith("?") else "."
        parts.append(f"{'#' * (depth + 1)} {one.prog}\n\n{text}\n")
        if is_command:
            parts.append(f"```sh\n{call(one)}\n```\n")
            listed = list(rows(one))
            if listed:
                parts.append("| argument | meaning |\n|---|---|\n" + "\n".join(listed) + "\n")
            example = (one.epilog or "").removeprefix("example: ")
            if example:
                parts.append(f"Example: `{example}`\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page())
    print(PAGE)
