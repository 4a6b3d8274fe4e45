"""python -m validation.sweep: many runs of the FMU, a row each."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from math import ceil, floor, isfinite
from pathlib import Path
from time import perf_counter
from typing import Self

from ..command import INTERRUPTED, Parser, cores, reason, shown
from ..fmu import DEFAULT_PATH, OUTPUTS, Fmu, UnusableFmuError, describe
from ..report import screen
from .errors import BrokenError, WrongUseError
from .files import FORMATS, TRAJECTORIES, Store, locked
from .interface import Interface, interface
from .plan import FORMS, Common, Plan, Runs, Values, axis, of_axes, of_file
from .row import Row, Trajectory, columns, run

EXTRA = "pip install '.[sweep]'"
MOST_STEPS = 1e8  # of a run, whose communication points are in memory
DIVIDES = 1e-9  # relative: decimal numbers are rounded, and nobody writes them with more digits
Outcomes = Generator[tuple[Row, Trajectory | None]]
Executor = Callable[[Iterator[Values]], Outcomes]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return 0 if every run has its row, 1 if the sweep broke off, 130 if it was interrupted."""
    parser = _parser()
    options = parser.parse_args(arguments)
    with parser.interruptible():
        try:
            plan = _plan(options)
            _check(options)
            with Interrupts() as interrupts, locked(options.output):
                store = Store(options.output, columns(plan.common), plan.common.record, options.resume)
                with _executor(options, plan, interrupts) as done_by:
                    begin = perf_counter()
                    tally, ended_by = _sweep(plan, store, done_by, interrupts)
                    spent = perf_counter() - begin
        except (WrongUseError, UnusableFmuError) as error:
            parser.error(str(error))
        except OSError as error:  # before or behind the runs: theirs is `ended_by`
            parser.error(f"cannot use {error.filename or options.output}: {reason(error)}")
        if not isinstance(ended_by, OSError):
            print(f"{tally} in {spent:.1f} s: {shown(options.output)}")
    match ended_by:
        case None:
            return 0
        case KeyboardInterrupt():
            said = "interrupted"
        case OSError():
            said = f"{options.output} cannot be written: {reason(ended_by)}"
        case _:
            said = str(ended_by)
    print(f"{parser.prog}: {said}; --resume goes on", file=sys.stderr)
    return INTERRUPTED if said == "interrupted" else 1


def _parser() -> Parser:
    parser = Parser(prog="python -m validation.sweep", description="Run the FMU many times, a row a run.")
    parser.add_argument("axes", nargs="*", metavar="axis", help=FORMS)
    parser.add_argument(
        "--runs",
        type=Path,
        metavar="FILE.csv",
        help="the runs instead of axes: a column a variable, a line a run",
    )
    parser.add_argument("--fmu", type=Path, default=DEFAULT_PATH, metavar="FILE.fmu", help="the FMU")
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("sweep.csv"),
        metavar="FILE",
        help=f"where the rows go, {' or '.join(FORMATS)} (default: %(default)s)",
    )
    parser.add_argument("--stop-time", type=float, metavar="S", help="end of the runs (default: the FMU's)")
    parser.add_argument(
        "--output-interval",
        type=float,
        metavar="S",
        help="communication step, which no substep exceeds (default: the FMU's)",
    )
    parser.add_argument(
        "--record",
        type=lambda text: tuple(text.split(",")),
        default=(),
        metavar="NAME,...",
        help=f"write trajectories of these outputs, too, into FILE with {TRAJECTORIES} before its suffix",
    )
    parser.add_argument(
        "--series",
        action="store_true",
        help="where no closed form is known, compare with a Taylor series, which takes its time",
    )
    parser.add_argument("--resume", action="store_true", help="keep the rows of FILE and run what it lacks")
    parser.add_argument(
        "--jobs", type=int, default=cores(), metavar="N", help="processes (default: cores, %(default)s here)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on the workers of this Dask scheduler instead"
    )
    return parser


def _plan(options: argparse.Namespace) -> Plan:
    known = interface(describe(options.fmu))
    if bool(options.axes) == (options.runs is not None):
        raise WrongUseError(f"the runs are either axes ({FORMS}) or --runs FILE.csv")
    names, count, runs = _runs(options, known)
    stop = known.stop if options.stop_time is None else options.stop_time
    interval = known.step if options.output_interval is None else options.output_interval
    for name, value in (("--stop-time", stop), ("--output-interval", interval)):
        if not (isfinite(value) and value > 0):
            raise WrongUseError(f"{name} {value:g}: must be finite and > 0")
    _check_steps(stop, interval)
    for name in options.record:
        if name not in OUTPUTS:
            raise WrongUseError(f"--record: {name!r} is no output (allowed: {', '.join(OUTPUTS)})")
    return Plan(Common(known, names, stop, interval, options.record, options.series), count, runs)


def _check_steps(stop: float, interval: float) -> None:
    """Refuse a communication step that does not divide the end, or divides it too finely."""
    steps = stop / interval
    if steps > MOST_STEPS:
        raise WrongUseError(
            f"--output-interval {interval:g}: {steps:.4g} steps a run (allowed: up to {MOST_STEPS:g})"
        )
    if abs(steps - round(steps)) > DIVIDES * steps:
        nearest = min((stop / n for n in (floor(steps), ceil(steps)) if n), key=lambda x: abs(x - interval))
        what = f"--output-interval {interval:g} does not divide --stop-time {stop:g}"
        raise WrongUseError(f"{what} (the nearest that does: {nearest!r})")


def _runs(options: argparse.Namespace, known: Interface) -> Runs:
    if options.runs is not None:
        return of_file(options.runs, known)
    return of_axes([axis(text, known) for text in options.axes])


def _check(options: argparse.Namespace) -> None:
    if options.output.suffix not in FORMATS:
        raise WrongUseError(f"--output {options.output}: must end in {' or '.join(FORMATS)}")
    if options.output.stem.endswith(TRAJECTORIES):
        ending = f"{TRAJECTORIES}{options.output.suffix}"
        raise WrongUseError(f"--output {options.output}: must not end in {ending}, which --record writes")
    if options.output.suffix == ".parquet" and find_spec("pyarrow") is None:
        raise WrongUseError(f"--output {options.output} needs pyarrow: {EXTRA}")
    if options.scheduler is not None and find_spec("distributed") is None:
        raise WrongUseError(f"--scheduler needs dask.distributed: {EXTRA}")
    if options.jobs < 1:
        raise WrongUseError(f"--jobs {options.jobs}: must be > 0")
    if not options.output.parent.is_dir():
        raise WrongUseError(f"--output {options.output}: {options.output.parent} is no directory")


@contextmanager
def _executor(options: argparse.Namespace, plan: Plan, interrupts: Interrupts) -> Iterator[Executor]:
    """Yield what runs the runs: Dask, or this process where it is not installed."""
    if find_spec("distributed") is None:
        print(f"one process: more need dask.distributed, {EXTRA}", file=sys.stderr)
        with Fmu(options.fmu) as fmu:
            yield lambda runs: (run(fmu, plan.common, values) for values in runs)
        return
    from . import workers

    jobs = min(options.jobs, plan.count)
    with (
        workers.local(jobs, interrupts.held())
        if options.scheduler is None
        else workers.remote(options.scheduler)
    ) as client:
        if not client.nthreads():
            print(f"{options.scheduler} has no workers yet", file=sys.stderr)
        yield lambda runs: workers.outcomes(client, options.fmu, plan.common, runs)


class Interrupts:
    """Ctrl-C, and SIGTERM, which ends batch jobs, as one KeyboardInterrupt; while they are held they wait."""

    def __init__(self) -> None:
        self._held = self._waiting = self._ignored = False

    def __enter__(self) -> Self:
        self._before = {one: signal.signal(one, self._arrived) for one in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for one, handler in self._before.items():
            signal.signal(one, handler)

    def _arrived(self, *_: object) -> None:
        if self._held:
            self._waiting = True
        elif not self._ignored:
            self._ignored = True  # those that follow would break what this one ends
            raise KeyboardInterrupt

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let them wait."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
            if self._waiting:
                self._arrived()

    def ignore(self) -> None:
        """Hear no more of them."""
        self._ignored = True


@dataclass
class Tally:
    """What a sweep did."""

    planned: int
    there: int = 0
    written: int = 0
    failed: int = 0
    warned: int = 0

    def add(self, row: Row) -> None:
        """Count a row."""
        self.written += 1
        self.failed += bool(row["failure"])
        self.warned += bool(row["warnings"])

    def __str__(self) -> str:
        there = f", {self.there} were there" if self.there else ""
        notes = f"{self.failed} failed, {self.warned} with a warning"
        return f"{self.written} of {self.planned} runs ({notes}){there}"


def _sweep(
    plan: Plan, store: Store, done_by: Executor, interrupts: Interrupts
) -> tuple[Tally, BaseException | None]:
    """Write the rows that are not there; return what was done, and why it is not all."""
    tally = Tally(plan.count)
    with screen.progress() as progress:
        task = progress.add_task("", total=plan.count)

        def missing() -> Iterator[Values]:
            for values in plan.runs():
                if store.done and plan.common.identity(values) in store.done:
                    tally.there += 1
                    progress.advance(task)
                else:
                    yield values

        ended_by: BaseException | None = None
        try:
            with closing(done_by(missing())) as done:
                for row, trajectory in done:
                    with interrupts.held():
                        store.add(row, trajectory)
                        tally.add(row)
                    progress.update(task, advance=1, description=f"{tally.failed} failed")
        except (BrokenError, KeyboardInterrupt, OSError) as error:
            ended_by = error
        finally:
            interrupts.ignore()
            try:
                store.close()
            except OSError as error:
                ended_by = error
    return tally, ended_by


if __name__ == "__main__":
    sys.exit(main())
