"""What the command lines share: wrong use, Ctrl-C and the processes that a command begins."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.resource_tracker import ensure_running
from typing import NoReturn

INTERRUPTED = 130  # exit status, as shells have it


class Parser(argparse.ArgumentParser):
    """Command line whose errors, and Ctrl-C, are one line."""

    def error(self, message: str) -> NoReturn:
        """Exit with `message` and status 2."""
        one_line = "\\n".join(message.splitlines())  # names of files may be of several
        self.exit(2, f"{self.prog}: {one_line}\n")

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Exit with status 130 where Ctrl-C comes within."""
        try:
            yield
        except KeyboardInterrupt:
            self.exit(INTERRUPTED, f"{self.prog}: interrupted\n")


@contextmanager
def deaf() -> Iterator[None]:
    """Keep Ctrl-C, which reaches all processes of a terminal, from the threads and processes that begin here.

    Who began them ends them.
    """
    if sys.platform == "win32":  # signals cannot be blocked
        yield
        return
    ensure_running()  # which would let the signal through again if it were started here
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def cores() -> int:
    """Return how many cores this process may use: a batch system gives it some of the machine's."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
