"""What the command lines share: how they end early, what they say then, and the processes that they begin."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
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
        """Exit with a line where Ctrl-C or SIGTERM, which ends batch jobs, comes within, or the system refuses a file.

        Without one where the output is a pipe that nobody reads on, which is how `head` ends.
        """
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            yield
            print(end="", flush=True)  # there may be no stdout
        except KeyboardInterrupt:
            self.exit(INTERRUPTED, f"{self.prog}: interrupted\n")
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes once more
            self.exit(1)
        except OSError as error:
            file = f" ({error.filename})" if error.filename is not None else ""
            self.error(f"cannot go on: {reason(error)}{file}")
        finally:
            signal.signal(signal.SIGTERM, before)


def reason(error: BaseException) -> str:
    """Return what an error says in one line, or its kind if it says nothing."""
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).split("\n", 1)[0]


def shown(path: Path) -> str:
    """Return a path that any stream can print: names of files may be of no characters at all."""
    return str(path).encode(errors="backslashreplace").decode()


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
