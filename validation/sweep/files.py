"""The file of rows, and that of trajectories beside it, in CSV or Parquet, whole at every time.

Who dies while he appends to a file leaves a torn one, and a Parquet file without its end cannot be read at all. So rows
are written as parts, whole files in a folder beside the output, which are joined with it when the sweep ends or is
interrupted. A sweep that is killed leaves the output as it was, and parts that the next one takes up. Joined files are
committed by renaming the folder.
"""

from __future__ import annotations

import csv
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import Any, Protocol

import numpy as np

from .errors import WrongUseError, reason
from .row import Row, Trajectory

Kinds = Mapping[str, type]  # of columns: str, float or int
Table = Mapping[str, Sequence[Any]]  # values by column
ROWS, SAMPLES, SECONDS = 5_000, 200_000, 10.0  # a part is written when it holds so much, or is so old
CHUNK = 65_536  # rows that are in memory when files are joined


class Format(Protocol):
    """A kind of file with named columns."""

    def write(self, path: Path, kinds: Kinds, table: Table) -> None:
        """Write a file."""

    def names(self, path: Path) -> list[str]:
        """Return the names of the columns."""

    def runs(self, path: Path) -> Iterator[str]:
        """Yield the column `run`."""

    def join(self, paths: Sequence[Path], kinds: Kinds, into: Path) -> None:
        """Write the rows of files of the same columns into one."""


class _Csv:
    """Numbers with all of their digits, nothing where there is none."""

    def write(self, path: Path, kinds: Kinds, table: Table) -> None:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(kinds)
            writer.writerows(zip(*(table[name] for name in kinds), strict=True))

    def names(self, path: Path) -> list[str]:
        with path.open(newline="", encoding="utf-8") as file:
            return next(csv.reader(file), [])

    def runs(self, path: Path) -> Iterator[str]:
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                yield row["run"]

    def join(self, paths: Sequence[Path], kinds: Kinds, into: Path) -> None:
        with into.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(kinds)
            for path in paths:
                with path.open(newline="", encoding="utf-8") as part:
                    writer.writerows(islice(csv.reader(part), 1, None))


class _Parquet:
    """Apache Parquet; what there is none of is null."""

    def __init__(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._pa, self._pq = pa, pq
        self._types = {str: pa.string(), float: pa.float64(), int: pa.int64()}

    def _schema(self, kinds: Kinds) -> Any:
        return self._pa.schema([(name, self._types[kind]) for name, kind in kinds.items()])

    def write(self, path: Path, kinds: Kinds, table: Table) -> None:
        self._pq.write_table(self._pa.table(dict(table), self._schema(kinds)), path)

    def names(self, path: Path) -> list[str]:
        return list(self._pq.read_schema(path).names)

    def runs(self, path: Path) -> Iterator[str]:
        with self._pq.ParquetFile(path) as file:
            for batch in file.iter_batches(CHUNK, columns=["run"]):
                yield from batch.column(0).to_pylist()

    def join(self, paths: Sequence[Path], kinds: Kinds, into: Path) -> None:
        with self._pq.ParquetWriter(into, self._schema(kinds)) as writer:
            for path in paths:
                with self._pq.ParquetFile(path) as file:
                    for batch in file.iter_batches(CHUNK):
                        writer.write_batch(batch)


FORMATS: dict[str, Callable[[], Format]] = {".csv": _Csv, ".parquet": _Parquet}


@contextmanager
def locked(output: Path) -> Iterator[None]:
    """Keep other sweeps off an output.

    SQLite locks files on POSIX and Windows alike, and the system takes the lock from a process that is killed.

    Raises
    ------
    WrongUseError : another sweep is at it, or nothing can be written beside it
    """
    path = output.with_name(f"{output.name}.lock")
    connection = None
    try:
        connection = sqlite3.connect(path, timeout=0)
        connection.execute("BEGIN EXCLUSIVE")
        if not path.exists():  # the sweep before ended between both
            raise sqlite3.OperationalError("database is locked")
    except sqlite3.OperationalError as error:
        if connection is not None:
            connection.close()
        if str(error) == "database is locked":
            raise WrongUseError(f"{output} is in use by another sweep") from None
        raise WrongUseError(f"{output.parent} cannot be written: {error}") from None
    try:
        yield
    finally:
        if os.name == "posix":
            path.unlink(missing_ok=True)  # before the lock is given back: afterwards it may be another's
        connection.close()
        if os.name != "posix":
            with suppress(OSError):  # another's, which is open
                path.unlink()


class Store:
    """The output of a sweep: `output` for the rows and, if outputs are recorded, a file of trajectories beside it.

    Attributes
    ----------
    done : identities of the runs that are there already

    Raises
    ------
    WrongUseError : the output is there and shall not be resumed, or was written by another kind of sweep
    """

    def __init__(self, output: Path, kinds: Kinds, record: Sequence[str], resume: bool) -> None:
        self._format: Format = FORMATS[output.suffix]()
        trajectories = output.with_name(f"{output.stem}.trajectories{output.suffix}")
        self._files = {"rows": output, "trajectories": trajectories}
        self._kinds: dict[str, Kinds] = {"rows": kinds}
        if record:
            self._kinds["trajectories"] = {"run": str, "time": float} | dict.fromkeys(record, float)
        self._parts = output.with_name(f"{output.name}.parts")
        self._joined = output.with_name(f"{output.name}.joined")
        there = [path for path in (output, trajectories, self._parts, self._joined) if path.exists()]
        if there and not resume:
            raise WrongUseError(f"{there[0]} is there already (--resume goes on with it)")
        self._recover()
        if self._written("rows") and bool(self._written("trajectories")) != bool(record):
            raise WrongUseError(f"{output} was written {'without' if record else 'with'} --record")
        self.done = self._read()
        self._number = max((int(path.name[-6:]) for path in self._parts.glob("rows-*")), default=0)
        self._clear()

    def _recover(self) -> None:
        """End what the sweep before was killed in."""
        if self._joined.exists():
            self._publish()
        for kind in self._files:
            (self._parts / f"{kind}.partial").unlink(missing_ok=True)
        for path in self._parts.glob("trajectories-*"):  # written before their rows
            if not path.with_name(path.name.replace("trajectories", "rows")).exists():
                path.unlink()

    def _read(self) -> set[str]:
        done: set[str] = set()
        for kind, kinds in self._kinds.items():
            for path in self._written(kind):
                try:
                    if (names := self._format.names(path)) != list(kinds):
                        raise WrongUseError(f"{path} has other columns: {', '.join(names)}")
                    if kind == "rows":
                        done.update(self._format.runs(path))
                except (OSError, ValueError, csv.Error) as error:  # pyarrow's are ValueErrors
                    raise WrongUseError(f"{path} cannot be read: {reason(error)}") from None
        return done

    def _written(self, kind: str) -> list[Path]:
        """Return the whole files of a kind, the output first."""
        output = self._files[kind]
        return [*[output] * output.exists(), *sorted(self._parts.glob(f"{kind}-*"))]

    def _clear(self) -> None:
        self._rows: list[Row] = []
        self._trajectories: list[tuple[str, Trajectory]] = []
        self._samples = 0
        self._since = monotonic()

    def add(self, row: Row, trajectory: Trajectory | None) -> None:
        """Take a row, and write a part when it is time."""
        self._rows.append(row)
        if trajectory is not None:
            self._trajectories.append((str(row["run"]), trajectory))
            self._samples += len(trajectory["time"])
        if len(self._rows) >= ROWS or self._samples >= SAMPLES or monotonic() - self._since >= SECONDS:
            self._flush()

    def _flush(self) -> None:
        if not self._rows:
            return
        tables: dict[str, Table] = {
            "rows": {name: [row[name] for row in self._rows] for name in self._kinds["rows"]}
        }
        if "trajectories" in self._kinds:
            lengths = [len(trajectory["time"]) for _, trajectory in self._trajectories]
            runs = [run for run, _ in self._trajectories]
            tables["trajectories"] = {"run": np.repeat(np.array(runs, dtype=object), lengths).tolist()} | {
                name: np.concatenate([trajectory[name] for _, trajectory in self._trajectories]).tolist()
                for name in list(self._kinds["trajectories"])[1:]
            }
        self._parts.mkdir(exist_ok=True)
        for kind in reversed(self._kinds):  # the rows last: they say that the part is whole
            partial = self._parts / f"{kind}.partial"
            self._format.write(partial, self._kinds[kind], tables[kind])
            partial.replace(self._parts / f"{kind}-{self._number + 1:06d}")
        self._number += 1
        self._clear()

    def close(self) -> None:
        """Join the parts with what was there."""
        self._flush()
        if not self._parts.exists():
            return
        for kind, kinds in self._kinds.items():
            self._format.join(self._written(kind), kinds, self._parts / f"{kind}.partial")
        self._parts.rename(self._joined)
        self._publish()

    def _publish(self) -> None:
        for kind, output in self._files.items():
            partial = self._joined / f"{kind}.partial"
            if partial.exists():
                partial.replace(output)
        shutil.rmtree(self._joined)
