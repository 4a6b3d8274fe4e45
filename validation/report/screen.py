"""The report on the screen: a section as tables without reasons and pictures, and the progress of the studies."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column
from rich.table import Table as ScreenTable

from ..checks import Note, Table
from .cells import PAGE_COLUMNS, cell, page_cells
from .section import Section

LONG = 50  # rows of a table that is not printed
NARROW = 14  # characters of a column that keeps its width
REST = 16  # characters that another column needs
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
        to.print(_table(PAGE_COLUMNS[:-1], [page_cells(check)[:-1] for check in section.checks], to.width))
    for result in section.results:
        if isinstance(result, Table) and (len(result.rows) > LONG or not result.shown):
            where = "report" if result.shown else "CSV files"
            to.print(f"\n{result.title}: {len(result.rows)} rows in the {where}", markup=False)
        elif isinstance(result, Table):
            to.print("\n" + result.title, markup=False)
            to.print(_table(result.columns, [tuple(map(cell, row)) for row in result.rows], to.width))
        elif isinstance(result, Note):
            to.print("\n" + result.text, markup=False)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> ScreenTable:
    table = ScreenTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for column, fixed in zip(columns, _widths(columns, rows, width), strict=True):
        table.add_column(column.replace("[", r"\["), overflow="fold", width=fixed)
    for row in rows:
        table.add_row(*(text.replace("[", r"\[") for text in row), style="bold red" if "FAILS" in row else "")
    return table


def _widths(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[int | None]:
    """Return the widths of the columns of numbers, so that none is broken, and None for those that take the rest.

    All are None where the rest would be too little.
    """
    widths: list[int | None] = []
    for name, *cells in zip(columns, *rows, strict=True):
        longest = max(map(len, (*name.split(), *cells)))
        widths.append(longest if longest <= NARROW else None)
    needed = sum(REST if fixed is None else fixed for fixed in widths) + 2 * len(widths)
    return widths if needed <= width else [None] * len(widths)


def progress() -> Progress:
    """Return a progress bar of scenes on stderr, which shows nothing where that is no terminal."""
    to = Console(stderr=True)
    rest = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    columns = (
        *(BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn()),
        TextColumn("{task.description}", table_column=rest),
    )
    return Progress(*columns, console=to, transient=True, expand=True, disable=not to.is_terminal)
