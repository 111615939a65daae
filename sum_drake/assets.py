"""Where the data of the package lies, and the one error that bad input raises, in one line."""

from pathlib import Path

MODELS = Path(__file__).resolve().parent / "models"
PACKAGE_XML = MODELS / "package.xml"


class InputError(ValueError):
    """Input that cannot be used: one line that says what, where and what was expected. The command exits with 2."""


def one_line(error: BaseException) -> str:
    """What an error says, without line breaks; its type where it says nothing."""
    return " ".join(str(error).split()) or type(error).__name__


def asset(uri: str) -> Path:
    """The file behind `package://sum_drake/...`, or the path itself when it is no such URI."""
    prefix = "package://sum_drake/"
    return MODELS / uri.removeprefix(prefix) if uri.startswith(prefix) else Path(uri)
