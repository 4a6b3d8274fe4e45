"""How results are written: the one place where numbers become text."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from ..checks import About, Check

KINDS = {About.FMU: "FMU", About.FORMULAS: "formulas", About.TIMES: "times"}
CHECK_COLUMNS = (
    "check",
    "about",
    "measured",
    "relation",
    "bound",
    "unit",
    "margin",
    "verdict",
    "reason of the bound",
)
# Of the page and, without reasons, of the screen.
PAGE_COLUMNS = ("check", "about", "measured", "bound", "margin", "verdict", "reason of the bound")
EXPONENT = re.compile(r"[\d.]+e[+-]\d+")
SHORT, LONG = 14, 40  # characters of a cell that stays on a line, and of one that gets a column of some width


def number(value: float) -> str:
    """Return a number of a check, three digits."""
    return f"{value:.3g}"


def cell(value: object) -> str:
    """Return a cell of a table; numbers get six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def is_number(value: object) -> bool:
    """Return whether a cell is a number, which must not break at the minus of its exponent."""
    try:
        float(str(value))
    except ValueError:
        return False
    return True


def unbroken(text: str) -> Markup:
    """Return a text for a page in which no number breaks at the minus of its exponent."""
    return Markup(EXPONENT.sub(r'<span class="unbroken">\g<0></span>', str(escape(text))))


def style(value: object) -> str:
    """Return the class of a cell of a page: a number, a text that stays on a line, a long one, or none."""
    if is_number(value):
        return "number"
    length = len(str(value))
    return "short" if length <= SHORT else "long" if length > LONG else ""


def check_values(check: Check) -> tuple[str | float, ...]:
    """Return a check as values of `CHECK_COLUMNS`; numbers keep all their digits."""
    return (
        check.name,
        KINDS[check.about],
        check.measured,
        ">=" if check.at_least else "<=",
        check.bound,
        check.unit,
        check.margin,
        "holds" if check.holds else "FAILS",
        check.reason,
    )


def page_cells(check: Check) -> tuple[str, ...]:
    """Return a check as the cells of `PAGE_COLUMNS`."""
    cells = (value if isinstance(value, str) else number(value) for value in check_values(check))
    name, about, measured, relation, bound, unit, margin, verdict, reason = cells
    return name, about, f"{measured} {unit}".strip(), f"{relation} {bound}", margin, verdict, reason
