"""How a sweep ends early."""


class WrongUseError(Exception):
    """What was asked for cannot be done, in one sentence."""


class BrokenError(Exception):
    """A sweep that cannot go on, with the reason in one sentence."""


def reason(error: Exception) -> str:
    """Return what an error says in one line, or its kind if it says nothing."""
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).split("\n", 1)[0]
