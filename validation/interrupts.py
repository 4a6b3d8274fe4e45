"""Ctrl-C, which reaches all processes of a terminal."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.resource_tracker import ensure_running

INTERRUPTED = 130  # exit status, as shells have it


@contextmanager
def deaf() -> Iterator[None]:
    """Keep Ctrl-C from the threads and processes that begin here; who began them ends them."""
    if sys.platform == "win32":  # signals cannot be blocked
        yield
        return
    ensure_running()  # which would let the signal through again if it were started here
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
