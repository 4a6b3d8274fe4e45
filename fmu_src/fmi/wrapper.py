"""What a slave needs to survive in the wrapper of pythonfmu 0.7, each with its reason."""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from pathlib import Path

REFERENCES_IN_ADVANCE = 2**29  # below 2^30, from which on Python 3.14 takes an object for immortal


def keep_alive(*objects: object) -> None:
    """Give each object references in advance for those that pythonfmu 0.7 releases too often.

    After every exception its wrapper releases the instance, its class and its log queue once more than it holds
    them, whether the exception is one of ours, Control-C between any two lines, or an argument that the wrapper itself
    cannot convert. Nothing that runs after the fact sees them all. An object so kept is never freed.
    """
    for item in objects:
        if object.__basicsize__ == 16:  # the count is the first word, as in every CPython but special builds
            ctypes.c_ssize_t.from_address(id(item)).value += REFERENCES_IN_ADVANCE
        else:
            for _ in range(1000):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))


def hands_on_the_log(logger: int | None) -> bool:
    """Return whether the wrapper whose logger is at this address passes messages to the host, or drops them all.

    The wrapper of pythonfmu 0.7 drops them while the host has not turned on logging. It tells nobody, but the flag is
    the first member of its logger, behind the pointer to the virtual functions.
    """
    return logger is not None and ctypes.c_bool.from_address(logger + ctypes.sizeof(ctypes.c_void_p)).value


def release_wrappers(model_name: str) -> None:
    """Let the wrappers of a model that are loaded release their global state.

    pythonfmu 0.7 does so in a destructor of its library. When the library is unloaded that is early enough; at the end
    of the process, on Linux, that destructor runs after those of C++ have freed the state, which now and then aborts
    the process. Released before, there is nothing left to free twice.
    """
    maps = Path("/proc/self/maps").read_text("utf-8", "surrogateescape")
    paths = {line.removesuffix(" (deleted)").split(maxsplit=5)[-1] for line in maps.splitlines()}
    for path in paths:
        if path.endswith(f"/{model_name}.so"):
            with suppress(OSError):  # loaded under another name, and its file is gone
                ctypes.CDLL(path, mode=os.RTLD_NOLOAD | os.RTLD_NOW).finalizePythonInterpreter()
