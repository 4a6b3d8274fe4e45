"""The report on the screen: a section as tables without reasons and pictures, and the progress of the studies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as ScreenTable

from ..checks import Note, Table
from .cells import CHECK_COLUMNS, cell, check_cells
from .section import Section

LONG = 50  # rows of a table that is not printed
WIDTH_OF_FILES = 240  # characters of a line where the output is no terminal


def console(stderr: bool = False) -> Console:
    """Return where to print: as wide as the terminal, or wide enough for every row in a file."""
    made = Console(stderr=stderr, highlight=False, soft_wrap=False)
    return made if made.is_terminal else Console(stderr=stderr, highlight=False, width=WIDTH_OF_FILES)


def show(section: Section, to: Console) -> None:
    """Print a section."""
    to.print(f"\n[bold]{section.title}[/bold]")
    to.print(section.formula + "\n", markup=False)
    if section.checks:
        to.print(_table(CHECK_COLUMNS[:-1], (check_cells(check)[:-1] for check in section.checks)))
    for result in section.results:
        if isinstance(result, Table) and (len(result.rows) > LONG or not result.shown):
            to.print(f"\n{result.title}: {len(result.rows)} rows in the report", markup=False)
        elif isinstance(result, Table):
            to.print("\n" + result.title, markup=False)
            to.print(_table(result.columns, (tuple(map(cell, row)) for row in result.rows)))
        elif isinstance(result, Note):
            to.print("\n" + result.text, markup=False)


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> ScreenTable:
    table = ScreenTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column.replace("[", r"\["), overflow="fold")
    for row in rows:
        table.add_row(*(text.replace("[", r"\[") for text in row), style="bold red" if "FAILS" in row else "")
    return table


def progress() -> Progress:
    """Return a progress bar of scenes on stderr, which shows nothing where that is no terminal."""
    to = Console(stderr=True)
    columns = (BarColumn(30), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    return Progress(*columns, console=to, transient=True, disable=not to.is_terminal)
