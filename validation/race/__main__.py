"""python -m validation.race: print the table "which method for which task" of README, as measured here and now."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from ..command import Parser
from ..fmu import DEFAULT_PATH, NATIVE_NAME, Fmu, UnusableFmuError
from . import show
from .machine import provenance

PURPOSE = 'Print the table "which method for which task" of README, as measured here and now.'
PATHS = (DEFAULT_PATH, DEFAULT_PATH.with_name(NATIVE_NAME))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = Parser(prog="python -m validation.race", description=PURPOSE)
    parser.parse_args(arguments)
    with parser.interruptible():
        values = dict(provenance())
        print(
            f"Measured on {values['date'][:10]}: {values['CPU']}, Python {values['Python']}, SciPy {values['scipy']}."
        )
        for path in PATHS:
            try:
                with Fmu(path) as fmu:
                    table = show.choice(fmu)
            except UnusableFmuError as error:
                parser.error(str(error))
            print(f"\n`{path.name}`:\n")
            print("\n".join(markdown([table.columns, ["---"] * len(table.columns), *table.rows])))
    return 0


def markdown(rows: Sequence[Sequence[object]]) -> Iterator[str]:
    """Yield the rows of a table in Markdown."""
    return ("| " + " | ".join(map(str, row)) + " |" for row in rows)


if __name__ == "__main__":
    sys.exit(main())
