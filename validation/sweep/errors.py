"""How a sweep ends early."""


class WrongUseError(Exception):
    """What was asked for cannot be done, in one sentence."""


class BrokenError(Exception):
    """A sweep that cannot go on, with the reason in one sentence."""
