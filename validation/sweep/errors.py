"""How a sweep ends early."""

from pathlib import Path


class WrongUseError(Exception):
    """What was asked for cannot be done, in one sentence."""


class BrokenError(Exception):
    """A sweep that cannot go on, with the reason in one sentence."""


def shown(path: Path) -> str:
    """Return a path that any stream can print: names of files may be of no characters at all."""
    return str(path).encode(errors="backslashreplace").decode()


def reason(error: BaseException) -> str:
    """Return what an error says in one line, or its kind if it says nothing."""
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).split("\n", 1)[0]
