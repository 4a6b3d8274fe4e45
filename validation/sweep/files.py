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
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import IO, Any, Protocol

import numpy as np

from ..command import reason
from .errors import WrongUseError
from .row import Row, Trajectory

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

Kinds = Mapping[str, type]  # of columns: str, float or int
Table = Mapping[str, Sequence[Any]]  # values by column
TRAJECTORIES = ".trajectories"  # behind the stem of an output: the file of its trajectories
ROWS, SAMPLES, SECONDS = 5_000, 200_000, 10.0  # a part is written when it holds so much, or is so old
CHUNK = 65_536  # rows that are in memory when files are joined
DAMAGED = (ValueError, csv.Error)  # what reading a damaged file raises; pyarrow's errors are ValueErrors


class Format(Protocol):
    """A kind of file with named columns."""

    def write(self, path: Path, kinds: Kinds, table: Table) -> None:
        """Write a file."""

    def names(self, path: Path, kinds: Kinds) -> list[str]:
        """Return the names of the columns; raise ValueError if it is not whole, or its values are of other kinds."""

    def runs(self, path: Path) -> Iterator[str]:
        """Yield the column `run`; raise ValueError at a row that is not whole."""

    def join(self, paths: Sequence[Path], kinds: Kinds, into: Path) -> None:
        """Write the rows of files of the same columns into one."""


class _Csv:
    """Numbers with all of their digits, nothing where there is none."""

    def write(self, path: Path, kinds: Kinds, table: Table) -> None:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(kinds)
            writer.writerows(zip(*(table[name] for name in kinds), strict=True))

    def names(self, path: Path, kinds: Kinds) -> list[str]:
        del kinds  # all is text
        with path.open("rb") as file:
            if file.seek(0, os.SEEK_END):
                file.seek(-1, os.SEEK_END)
                if file.read() != b"\n":
                    raise ValueError("its last line has no end")
        with path.open(newline="", encoding="utf-8") as file:
            return next(csv.reader(file), [])

    def runs(self, path: Path) -> Iterator[str]:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            names = next(reader)
            for row in filter(None, reader):
                if len(row) != len(names):
                    raise ValueError(
                        f"line {reader.line_num} has another number of values than {len(names)} names"
                    )
                yield row[names.index("run")]

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

    def names(self, path: Path, kinds: Kinds) -> list[str]:
        schema = self._pq.read_schema(path)
        for name, kind in kinds.items():
            if name in schema.names and (found := schema.field(name).type) != self._types[kind]:
                raise ValueError(f"the values of {name} are {found} (allowed: {self._types[kind]})")
        return list(schema.names)

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
    """Keep other sweeps off an output; the system takes the lock from a process that is killed.

    Raises
    ------
    WrongUseError : another sweep is at it
    OSError : nothing can be written beside it
    """
    path = output.with_name(f"{output.name}.lock")
    with path.open("ab") as file:
        if not _taken(file, path):
            raise WrongUseError(f"{output} is in use by another sweep")
        try:
            yield
        finally:
            if sys.platform == "win32":
                file.close()  # what is open cannot be removed
            with suppress(OSError):  # Windows: another sweep has opened it
                path.unlink()  # POSIX: before the lock is given back, because then it may be another's


def _taken(file: IO[bytes], path: Path) -> bool:
    """Lock an open file; return False if another process has locked it, or it is no longer the one at `path`."""
    try:
        if sys.platform == "win32":
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except (BlockingIOError, PermissionError, FileNotFoundError):  # POSIX, Windows, and removed in between
        return False


class Store:
    """The output of a sweep: `output` for the rows and, if outputs are recorded, a file of trajectories beside it.

    Attributes
    ----------
    done : identities of the runs that are there already

    Raises
    ------
    WrongUseError : the output is there and shall not be resumed, is damaged, or was written by another kind of sweep
    OSError : something else is in its place
    """

    def __init__(self, output: Path, kinds: Kinds, record: Sequence[str], resume: bool) -> None:
        self._format: Format = FORMATS[output.suffix]()
        trajectories = output.with_name(f"{output.stem}{TRAJECTORIES}{output.suffix}")
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
        if not self._written("rows"):
            if self._written("trajectories"):
                raise WrongUseError(f"{trajectories} is there without {output}")
        elif bool(self._written("trajectories")) != bool(record):
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
                    if (names := self._format.names(path, kinds)) != list(kinds):
                        raise WrongUseError(f"{path} has other columns: {', '.join(names) or 'none'}")
                    if kind == "rows":
                        done.update(self._format.runs(path))
                except (OSError, *DAMAGED) as error:
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
        """Join the parts with what was there.

        Raises
        ------
        OSError : the disk is full, or trajectories that were there are damaged; the parts are kept
        """
        self._flush()
        if not self._parts.exists():
            return
        for kind, kinds in self._kinds.items():
            try:
                self._format.join(self._written(kind), kinds, self._parts / f"{kind}.partial")
            except (OSError, *DAMAGED) as error:
                if getattr(error, "errno", None) is not None:  # of the disk
                    raise
                raise OSError(f"{self._files[kind]} cannot be read: {reason(error)}") from error
        self._parts.rename(self._joined)
        self._publish()

    def _publish(self) -> None:
        for kind, output in self._files.items():
            partial = self._joined / f"{kind}.partial"
            if partial.exists():
                partial.replace(output)
        shutil.rmtree(self._joined)
