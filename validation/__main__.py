"""python -m validation: run the studies, print their tables, write the report."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from . import faults, studies
from .checks import Maps, Plot, Result
from .command import Parser, reason, shown
from .fmu import DEFAULT_PATH, Fmu, UnusableFmuError
from .report import figures, page, screen
from .report.section import Section, summary

LEADING = ("work_precision",)  # studies with a picture at the top of the report


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return 0 if all checks hold, 1 if not, 130 if it was interrupted."""
    parser = Parser(prog="python -m validation", description="Hold the FMU against exact answers.")
    known = ", ".join(studies.NAMES)
    parser.add_argument("studies", nargs="*", metavar="study", help=f"{known} (default: all)")
    parser.add_argument("--fmu", type=Path, default=DEFAULT_PATH, metavar="FILE.fmu", help="the FMU")
    parser.add_argument(
        "--output", type=Path, default=Path("report"), metavar="DIR", help="where the report goes"
    )
    parser.add_argument(
        "--no-faults", action="store_true", help="leave out which faults of the FMU break which rows"
    )
    parser.add_argument("--no-plots", action="store_true", help="leave out the pictures")
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="FILE.png",
        help="write the leading picture of the chosen studies, too",
    )
    options = parser.parse_args(arguments)
    chosen = list(dict.fromkeys(options.studies)) or studies.NAMES
    with parser.interruptible():
        _check(parser, options, chosen)
        draw = None if options.no_plots or find_spec("matplotlib") is None else cache(figures.svg)
        if draw is None and not options.no_plots:
            print("pictures are left out: they need matplotlib, pip install '.[report]'", file=sys.stderr)
        try:
            with Fmu(options.fmu) as fmu:
                _make_folder(parser, options.output)
                sections = run(fmu, chosen, draw, not options.no_faults)
        except UnusableFmuError as error:
            parser.error(str(error))
        except BrokenProcessPool:
            parser.error("one of the processes that study the faults has ended (--no-faults leaves them out)")
        try:
            written = page.write(sections, options.output, options.fmu, draw)
            if options.picture is not None:
                plots = (plot for section in sections for plot in section.of(Plot) if plot.headline)
                options.picture.write_bytes(figures.png(next(plots)))
        except OSError as error:
            parser.error(
                f"the report cannot be written: {reason(error)} ({error.filename or options.output})"
            )
        print(f"\n{summary(sections)}\nreport: {shown(written)}")
    return 0 if all(check.holds for section in sections for check in section.checks) else 1


def _check(parser: Parser, options: Namespace, chosen: Sequence[str]) -> None:
    """Refuse what cannot be done."""
    for name in chosen:
        if name not in studies.NAMES:
            parser.error(f"unknown study {name!r} (allowed: {', '.join(studies.NAMES)})")
    if options.picture is not None:
        if not set(chosen) & set(LEADING):
            allowed = ", ".join(LEADING)
            parser.error(f"--picture: the chosen studies have no leading picture (allowed: {allowed})")
        if find_spec("matplotlib") is None:
            parser.error("--picture needs matplotlib: pip install '.[report]'")
        if not options.picture.parent.is_dir():
            parser.error(f"--picture {options.picture}: must be a file in a directory that exists")


def _make_folder(parser: Parser, folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--output {folder}: must be a directory ({reason(error)})")


def run(fmu: Fmu, names: Sequence[str], draw: page.Draw | None, with_faults: bool) -> list[Section]:
    """Run the studies `names`, and that of the faults, and return them in this order."""
    chosen = [studies.load(name) for name in names]
    racing = [study for study in chosen if study.races]
    others = [study for study in chosen if not study.races]
    with ExitStack() as stack:
        sections = list(run_studies(fmu, racing))  # while nothing else runs
        noticed = [stack.enter_context(faults.study(names, fmu.path))] if with_faults else []
        sections += run_studies(fmu, others)
        if draw:
            draw_pictures(sections, draw)
        sections += run_studies(fmu, noticed)
    return sorted(sections, key=lambda section: [*names, faults.NAME].index(section.name))


def run_studies(fmu: Fmu, chosen: Sequence[studies.Study]) -> Iterator[Section]:
    """Run studies, show their progress and print each when it is done."""
    console = screen.console()
    with screen.progress() as progress:
        task = progress.add_task("", total=sum(len(study.scenes) + len(study.races) for study in chosen))
        for study in chosen:
            results: list[Result] = []
            for scene in (*study.scenes, *study.races):
                progress.update(task, description=f"{study.name}: {scene.name}")
                results += scene.run(fmu)
                progress.advance(task)
            section = Section(study.name, study.title, study.formula, results)
            screen.show(section, console)
            yield section


def draw_pictures(sections: Sequence[Section], draw: page.Draw) -> None:
    """Draw all pictures, which `draw` keeps, and show the progress."""
    plots = [result for section in sections for result in section.results if isinstance(result, Plot | Maps)]
    with screen.progress() as progress:
        for plot in progress.track(plots, description="pictures"):
            draw(plot)


if __name__ == "__main__":
    sys.exit(main())
