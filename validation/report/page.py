"""The report as a page with its pictures inside, and CSV files beside it."""

from __future__ import annotations

import csv
import hashlib
import os
import platform
import re
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ..checks import Maps, Note, Plot, Result, Table
from ..race.machine import cpu
from . import figures
from .cells import CHECK_COLUMNS, PAGE_COLUMNS, cell, check_values, page_cells, style, unbroken
from .section import Section, counts, summary
from .words import GLOSSARY, TASKS

FOLDER = Path(__file__).resolve().parent
LONG = 10  # rows of a table that is shown without being opened
Draw = Callable[[Plot | Maps], str]
"""Returns a picture as an element of the page, see figures.svg."""

PACKAGES = ("pythonfmu", "fmpy", "numpy", "scipy")


def write(sections: Sequence[Section], folder: Path, fmu: Path, draw: Draw | None) -> Path:
    """Write index.html and the CSV files into `folder` and return the page's path; `draw` None leaves pictures out."""
    folder.mkdir(parents=True, exist_ok=True)
    checks = [check for section in sections for check in section.checks]
    write_csv(folder / "checks.csv", CHECK_COLUMNS, map(check_values, checks))
    for section in sections:
        for table in section.of(Table):
            write_csv(
                folder / f"{section.name}-{slug(table.title)}.csv", table.columns, table.rows, table.head
            )
    page = folder / "index.html"
    partial = page.with_suffix(".partial")
    try:
        partial.write_text(render(sections, fmu, draw), "utf-8")
        partial.replace(page)
    finally:
        partial.unlink(missing_ok=True)
    return page


def render(sections: Sequence[Section], fmu: Path, draw: Draw | None) -> str:
    """Return the page."""
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "all_hold": lambda checks: all(check.holds for check in checks),
        "cell": cell,
        "cells": page_cells,
        "failing_first": lambda checks: sorted(checks, key=lambda check: check.holds),
        "kind": lambda result: type(result).__name__,
        "style": style,
        "unbroken": unbroken,
    }
    return environment.get_template("page.html.j2").render(
        GLOSSARY=GLOSSARY,
        LONG=LONG,
        PAGE_COLUMNS=PAGE_COLUMNS,
        TASKS=TASKS,
        counts=counts(sections),
        failing=[check for section in sections for check in section.checks if not check.holds],
        headlines=sorted(
            (result for section in sections for result in section.results if is_headline(result)),
            key=lambda result: isinstance(result, Plot),
        ),
        is_headline=is_headline,
        margins=Markup(figures.margins(sections)) if draw else "",
        picture=lambda plot: Markup(draw(plot)) if draw else "",
        pictures=draw is not None,
        provenance=provenance(fmu),
        sections=sections,
        style=Markup((FOLDER / "style.css").read_text("utf-8")),
        summary=summary,
    )


def is_headline(result: Result) -> bool:
    """Return whether a result is shown at the top of the report."""
    return isinstance(result, Plot | Note) and result.headline


def slug(title: str) -> str:
    """Return a title as a part of a file's name."""
    return re.sub(r"[^a-z0-9.]+", "-", title.lower()).strip("-.")


def write_csv(
    path: Path,
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    head: Sequence[tuple[str, str]] = (),
) -> None:
    """Write a CSV file with a header, after lines "# name: value" if there is a head; numbers keep all their digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {name}: {value}\n" for name, value in head)
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)


def provenance(fmu: Path) -> str:
    """Return what was measured where and when: FMU digest, day, machine, versions."""
    digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    day = datetime.now(UTC).date().isoformat()
    return (
        f"{fmu.name}, SHA-256 {digest}; {day}; {platform.system()} {platform.machine()}, {os.cpu_count()} cores "
        f"({cpu()}); Python {platform.python_version()}, {versions}"
    )
