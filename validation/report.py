"""The report: tables on the screen, one HTML file with its pictures inside, CSV files beside it."""

from __future__ import annotations

import base64
import csv
import hashlib
import html
import io
import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeGuard

from .results import Check, Note, Plot, Result, Table

PACKAGES = ("pythonfmu", "fmpy", "numpy", "scipy")
CHECK_COLUMNS = ("check", "measured", "", "bound", "unit", "margin", "verdict", "reason of the bound")
COLOURS = ("#000000", "#1f5fa8", "#b8451b", "#5a8f2f", "#7a4ea3", "#8a8a8a", "#c49a00", "#2a9a9a")


@dataclass(frozen=True)
class Section:
    """A study that was run."""

    name: str
    title: str
    formula: str
    results: Sequence[Result]

    @property
    def checks(self) -> list[Check]:
        """The checks among the results."""
        return [result for result in self.results if isinstance(result, Check)]


def check_row(check: Check) -> tuple[str, ...]:
    """Return a check as cells."""
    return (
        check.name,
        f"{check.measured:.3g}",
        ">=" if check.at_least else "<=",
        f"{check.bound:.3g}",
        check.unit,
        f"{check.margin:.3g}",
        "holds" if check.holds else "FAILS",
        check.reason,
    )


def cell(value: object) -> str:
    """Return a table cell as text; numbers get six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def summary(sections: Iterable[Section]) -> str:
    """Return how many checks hold."""
    checks = [check for section in sections for check in section.checks]
    holding = sum(check.holds for check in checks)
    return f"{holding} of {len(checks)} checks hold"


def screen(section: Section) -> str:
    """Return a section as text: the tables, without reasons and pictures."""
    lines = ["", section.title, section.formula, ""]
    rows = [CHECK_COLUMNS[:-1], *(check_row(check)[:-1] for check in section.checks)]
    lines += aligned(rows) if len(rows) > 1 else []
    for result in section.results:
        if isinstance(result, Table):
            cells = [tuple(cell(value) for value in row) for row in result.rows]
            lines += ["", result.title, *aligned([tuple(result.columns), *cells])]
        elif isinstance(result, Note):
            lines += ["", result.text]
    return "\n".join(lines)


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with columns of equal width."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def write(sections: Sequence[Section], folder: Path, fmu: Path, pictures: bool) -> Path:
    """Write index.html and the CSV files into `folder` and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    everything = [row for section in sections for row in map(check_row, section.checks)]
    write_csv(folder / "checks.csv", CHECK_COLUMNS, everything)
    for section in sections:
        for i, table in enumerate(r for r in section.results if isinstance(r, Table)):
            write_csv(folder / f"{section.name}_{i + 1}.csv", table.columns, table.rows)
    drawn = {id(p): draw(p) for s in sections for p in s.results if isinstance(p, Plot)} if pictures else {}
    page = folder / "index.html"
    partial = page.with_suffix(".partial")
    partial.write_text(_page(sections, fmu, drawn), "utf-8")
    partial.replace(page)
    return page


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file with a header; numbers keep all their digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)


def _page(sections: Sequence[Section], fmu: Path, drawn: dict[int, bytes]) -> str:
    results = [result for section in sections for result in section.results]
    top = [r for r in results if is_headline(r)]
    failing = [check_row(c) for s in sections for c in s.checks if not c.holds]
    parts = [
        "<!DOCTYPE html>\n<html lang='en'>\n<head>\n<meta charset='utf-8'>\n",
        f"<title>Validation of the damped pendulum FMU</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n",
        "<h1>Validation of the damped pendulum FMU</h1>\n",
        f"<p class='summary'>{summary(sections)}</p>\n",
        f"<p>{html.escape(provenance(fmu))}</p>\n",
    ]
    if failing:
        parts.append("<h2>Failing checks</h2>\n" + _html_table(CHECK_COLUMNS, failing))
    parts += [_html(result, drawn) for result in top]
    links = (f"<li><a href='#{s.name}'>{html.escape(s.title)}</a>: {summary([s])}</li>\n" for s in sections)
    parts.append(f"<h2>Studies</h2>\n<ul>\n{''.join(links)}</ul>\n")
    for section in sections:
        parts.append(f"<h2 id='{section.name}'>{html.escape(section.title)}</h2>\n")
        parts.append(f"<p><code>{html.escape(section.formula)}</code></p>\n")
        if section.checks:
            parts.append(_html_table(CHECK_COLUMNS, [check_row(check) for check in section.checks]))
        parts += [_html(r, drawn) for r in section.results if not isinstance(r, Check) and not is_headline(r)]
    return "".join(parts) + "</body>\n</html>\n"


def is_headline(result: Result) -> TypeGuard[Plot | Note]:
    """Return whether a result is shown at the top of the report."""
    return isinstance(result, Plot | Note) and result.headline


def provenance(fmu: Path) -> str:
    """Return what was measured where: FMU digest, machine, versions."""
    digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"{fmu.name}, SHA-256 {digest}; {platform.system()} {platform.machine()}, {os.cpu_count()} cores; "
        f"Python {platform.python_version()}, {versions}"
    )


def _html(result: Table | Plot | Note, drawn: dict[int, bytes]) -> str:
    if isinstance(result, Note):
        return f"<p>{html.escape(result.text)}</p>\n"
    title, note = html.escape(result.title), f"<p>{html.escape(result.note)}</p>\n" if result.note else ""
    if isinstance(result, Table):
        return f"<h3>{title}</h3>\n{note}{_html_table(result.columns, result.rows)}"
    if id(result) not in drawn:
        return ""
    data = base64.b64encode(drawn[id(result)]).decode()
    return f"<figure><img alt='{title}' src='data:image/png;base64,{data}'></figure>\n{note}"


def _html_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    def line(tag: str, cells: Iterable[object]) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell(c))}</{tag}>" for c in cells) + "</tr>\n"

    body = "".join(line("td", row) for row in rows)
    return f"<table>\n{line('th', columns)}{body}</table>\n"


def draw(plot: Plot) -> bytes:
    """Return a picture as a PNG file; needs the extra `report`."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9.0, 4.8), dpi=110, layout="constrained")
    if plot.shade is not None:
        x, y, values = plot.shade
        axes.pcolormesh(x, y, values, cmap="Greys", vmin=0.0, vmax=2.0, shading="nearest", rasterized=True)
    for i, curve in enumerate(plot.curves):
        axes.plot(
            curve.x,
            curve.y,
            color=COLOURS[i % len(COLOURS)],
            linestyle=curve.line or "none",
            marker=curve.marker,
            markersize=4,
            linewidth=1.3,
            label=curve.label,
        )
    _finish(axes, plot)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    pyplot.close(figure)
    return buffer.getvalue()


def _finish(axes: Any, plot: Plot) -> None:
    axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    if "x" in plot.logarithmic:
        axes.set_xscale("log")
    if "y" in plot.logarithmic:
        axes.set_yscale("log")
    if plot.y_range is not None:
        axes.set_ylim(*plot.y_range)
    if any(curve.label for curve in plot.curves):
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    axes.grid(True, linewidth=0.3)


_STYLE = """
body { font-family: sans-serif; max-width: 72em; margin: 2em auto; padding: 0 1em; line-height: 1.4 }
.summary { font-size: 1.4em; font-weight: bold }
table { border-collapse: collapse; font-size: 0.85em; display: block; overflow-x: auto }
td, th { border: 1px solid #999; padding: 0.15em 0.5em; text-align: left }
figure { margin: 1em 0 } img { max-width: 100% } code { background: #eee; padding: 0.1em 0.3em }
"""
