"""The default experiment with FMPy, its period and impulse response printed beside the exact ones."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from math import pi
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from . import references
from .checks import Curve, Plot
from .command import Parser, reason, shown
from .fmu import DEFAULT_PATH, K2, W02, Fmu, UnusableFmuError
from .metrics import upward_crossings
from .report import figures

PURPOSE = (
    "Run the default experiment with FMPy and print its period and impulse response beside the exact ones."
)
IMPULSE_RATE = 1e-6  # initial rate after the impulse [rad/s], small enough for the linear answer to hold
SHOWN = (0.5, 1.0, 2.0, 5.0, 10.0)  # [s]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = Parser(prog="python -m validation.quickstart", description=PURPOSE)
    parser.add_argument("--fmu", type=Path, default=DEFAULT_PATH, metavar="FILE.fmu", help="the FMU")
    parser.add_argument(
        "--plot",
        nargs="?",
        const=Path("report", "quickstart.png"),
        type=Path,
        metavar="FILE.png",
        help="draw a picture, too (default: report/quickstart.png)",
    )
    options = parser.parse_args(arguments)
    if options.plot is not None and options.plot.suffix != ".png":
        parser.error(f"--plot {options.plot}: must be a file that ends in .png")
    if options.plot is not None and find_spec("matplotlib") is None:
        parser.error("--plot needs matplotlib: pip install '.[report]'")
    with parser.interruptible():
        try:
            Fmu(options.fmu).close()
        except UnusableFmuError as error:
            parser.error(str(error))
        default, undamped, impulse = (
            fmpy.simulate_fmu(str(options.fmu), start_values=start)
            for start in ({}, {"gamma": 0.0}, {"phi_start": 0.0, "w_start": IMPULSE_RATE})
        )
        report(default, undamped, impulse)
        if options.plot is not None:
            try:
                draw(default, impulse, options.plot)
            except OSError as error:
                parser.error(f"--plot {options.plot}: {reason(error)}")
            print(f"\npicture: {shown(options.plot)}")
    return 0


def report(default: Any, undamped: Any, impulse: Any) -> None:
    """Print the end of the default experiment, the period without damping and the impulse response."""
    print(f"default experiment: phi({default['time'][-1]:g} s) = {default['phi'][-1]:.15f} rad")
    crossings = upward_crossings(*(undamped[name] for name in ("time", "phi", "w", "a")))
    measured, exact = np.mean(np.diff(crossings)), references.period(pi / 6, W02)
    print("\nperiod at 30 deg without damping, T = 2*pi/(w0*AGM(1, cos(15 deg)))")
    print(f"measured {measured:.15f} s\nexact    {exact:.15f} s\nerror    {measured - exact:.1e} s")
    print("\nimpulse response with damping, phi/w(0)")
    print(f"{'t [s]':>6}  {'measured [s]':>18}  {'exact [s]':>18}  {'error [s]':>10}")
    for t in SHOWN:
        (i,) = np.flatnonzero(np.isclose(impulse["time"], t))
        measured = impulse["phi"][i] / IMPULSE_RATE
        exact = float(references.impulse_response(t, K2, W02)[0])
        print(f"{t:6g}  {measured:18.12f}  {exact:18.12f}  {measured - exact:10.1e}")


def draw(default: Any, impulse: Any, path: Path) -> None:
    """Write a picture of the default experiment and of the impulse response."""
    t = default["time"]
    exact = references.impulse_response(t, K2, W02)[0]
    plot = Plot(
        "Default experiment, from 30 deg with drag (above), and impulse response (below)",
        "t [s]",
        "phi [rad]",
        [Curve("FMU, RK4", t, default["phi"])],
        below=[
            Curve("FMU, RK4", t[::10], impulse["phi"][::10] / IMPULSE_RATE, line="", marker="o"),
            Curve("exact", t, exact),
        ],
        below_label="phi/w(0) [s]",
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(figures.png(plot))


if __name__ == "__main__":
    sys.exit(main())
